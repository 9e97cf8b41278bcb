// The display: the three readings that matter first, and the paper's seven.

import { READABLE, el, paced } from "./dom.js";
import { meanCurrent } from "./moves.js";
import { fullName } from "./names.js";
import { engineering } from "./units.js";

/** @typedef {[string, string, string, (value: number) => string]} Line name of a reading, symbol, meaning, and its text */
const degrees = (/** @type {number} */ x) => `${((x * 180) / Math.PI).toFixed(2)}°`;
const micro = (/** @type {number} */ x) => `${(x * 1e6).toFixed(1)} µs`;
const PULSE = /** @type {Line} */ (["pulse_width", "pulse", "width of the pulses", micro]);
const COMMAND = /** @type {Line} */ (["command_angle", "command", "angle that is commanded", degrees]);
const FIRST = /** @type {Line[]} */ ([["output_angle", "angle", "angle", degrees],
  ["mean_current", "current", "mean current from the supply in the last second", (x) => engineering(x, "A", 3)]]);
const SEVEN = /** @type {Line[]} */ ([
  ["command_voltage", "Vi", "input voltage", (x) => `${x.toFixed(3)} V`],
  ["command_count", "ADCi", "count at the input", (x) => x.toFixed(0)],
  ["feedback_voltage", "Vo", "feedback voltage", (x) => `${x.toFixed(3)} V`],
  ["feedback_count", "ADCo", "count at the feedback", (x) => x.toFixed(0)],
  ["pulse_rate", "f", "frequency of the pulses", (x) => `${x.toFixed(2)} Hz`],
  ["output_angle", "q", "angle", degrees], ["pulse_width", "ta", "width of the pulses", micro]]);

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const three = el("div", { class: "lcds" });
  const seven = el("div", { class: "lcds" });
  root.append(el("h2", { text: "Display" }), three, el("details", { class: "more" }, el("summary", { text: "The paper's seven readings" }), seven));
  /** @type {{line: Line, cell: HTMLElement, k: number}[]} */
  let cells = [];
  /** @type {Record<string, number|null>[]} */
  let readings = [];

  /** @param {any} facts @param {number} k @param {Line[]} lines @param {string} named */
  const face = (facts, k, lines, named) => el("div", { class: `lcd servo${k}`, role: "group", "aria-label": `${named} of ${fullName(facts)}` },
    el("dl", {}, ...lines.map((line) => {
      const cell = el("dd", { title: line[2], text: "–" });
      cells.push({ line, cell, k });
      return el("div", {}, el("dt", { title: line[2] }, el("span", { "aria-hidden": "true", text: line[1] }), el("span", { class: "hidden", text: line[2] })), cell);
    })));

  bench.on("scene", () => {
    cells = [];
    three.replaceChildren(...bench.facts.map((facts, k) => face(facts, k, [facts.columns.includes("pulse_width") ? PULSE : COMMAND, ...FIRST], "readings")));
    seven.replaceChildren(...bench.facts.map((facts, k) => face(facts, k, SEVEN, "seven readings")));
  });
  const value = (/** @type {string} */ name, /** @type {number} */ k) => {
    if (name === "mean_current") return meanCurrent(bench, k);
    return name === "command_angle" ? bench.history[k]?.latest(name) : readings[k]?.[name];
  };
  const draw = paced(() => cells.forEach(({ line: [name, , , text], cell, k }) => {
    const found = value(name, k);
    const now = found === null || found === undefined || !Number.isFinite(found) ? "–" : text(found);
    if (cell.textContent !== now) cell.textContent = now;
  }), READABLE);
  bench.on("push", (header) => { readings = header.lcd; draw(); });
}
