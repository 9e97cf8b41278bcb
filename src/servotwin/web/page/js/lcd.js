// The display: the paper's seven readings.

import { READABLE, el, paced } from "./dom.js";
import { fullName } from "./names.js";

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
  /** @type {Record<string, number|null>[]} */
  let readings = [];

  bench.on("scene", () => {
    cells = [];
    shown.replaceChildren(...bench.facts.map((facts, k) => {
      const own = LINES.map(([, , meaning]) => el("dd", { title: meaning, text: "–" }));
      cells.push(own);
      return el("div", { class: `lcd servo${k}`, role: "group", "aria-label": `readings of ${fullName(facts)}` }, el("dl", {},
        ...LINES.map(([, symbol, meaning], n) => el("div", {}, el("dt", { title: meaning },
          el("span", { "aria-hidden": "true", text: symbol }), el("span", { class: "hidden", text: meaning })), own[n]))));
    }));
  });
  const draw = paced(() => readings.forEach((reading, k) => {
    LINES.forEach(([name, , , text], n) => {
      const value = reading[name];
      const now = value === null || value === undefined ? "–" : text(value);
      if (cells[k] && cells[k][n].textContent !== now) cells[k][n].textContent = now;
    });
  }), READABLE);
  bench.on("push", (header) => { readings = header.lcd; draw(); });
}
