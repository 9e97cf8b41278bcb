// The display: the paper's seven readings.

import { el } from "./dom.js";

const LINES = /** @type {[string, string, string, (value: number) => string][]} */ ([
  ["command_voltage", "Vi", "input voltage", (x) => `${x.toFixed(3)} V`],
  ["command_count", "ADCi", "count at the input", (x) => x.toFixed(0)],
  ["feedback_voltage", "Vo", "feedback voltage", (x) => `${x.toFixed(3)} V`],
  ["feedback_count", "ADCo", "count at the feedback", (x) => x.toFixed(0)],
  ["pulse_rate", "f", "frequency of the pulses", (x) => `${x.toFixed(2)} Hz`],
  ["output_angle", "q", "angle", (x) => `${((x * 180) / Math.PI).toFixed(2)}°`],
  ["pulse_width", "ta", "width of the pulses", (x) => `${(x * 1e6).toFixed(1)} µs`]]);

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const shown = el("div", { class: "lcds" });
  root.append(el("h2", { text: "Display" }), shown);
  /** @type {HTMLElement[][]} */
  let cells = [];

  bench.on("scene", () => {
    cells = [];
    shown.replaceChildren(...bench.facts.map((facts, k) => {
      const own = LINES.map(([, , meaning]) => el("dd", { title: meaning, text: "–" }));
      cells.push(own);
      const list = el("dl", { class: `lcd servo${k}`, "aria-label": `readings of ${facts.title}, ${facts.model}` });
      LINES.forEach(([, symbol, meaning], n) => list.append(
        el("div", {}, el("dt", { title: meaning, text: symbol }), own[n])));
      return list;
    }));
  });
  bench.on("push", (header) => {
    header.lcd.forEach((/** @type {Record<string, number|null>} */ reading, /** @type {number} */ k) => {
      LINES.forEach(([name, , , text], n) => {
        const value = reading[name];
        const now = value === null || value === undefined ? "–" : text(value);
        if (cells[k] && cells[k][n].textContent !== now) cells[k][n].textContent = now;
      });
    });
  });
}
