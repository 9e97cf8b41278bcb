// A log over its twin: measured and simulated, what is left between them, and both in words and numbers.

import uPlot from "../vendor/uPlot.js";
import { el, onceAFrame, svg } from "./dom.js";
import { around } from "./traces_data.js";
import { plain } from "./units.js";

const [TALL, LOW] = [210, 150]; // pixels
const ROWS = 24; // of the table
const LINES = /** @type {[string, string, number[]][]} */ ([["measured", "--log", []], ["simulated", "--first", [7, 3]]]);

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  root.hidden = true;
  const said = el("p", { class: "said", "aria-live": "polite" });
  const more = el("div");
  const place = el("div", { class: "charts" });
  const table = el("table");
  /** @type {any} */
  let shown = null;
  /** @type {uPlot[]} */
  let plots = [];
  let [from, to] = [0, 1];
  const button = (/** @type {string} */ text, /** @type {string} */ label, /** @type {() => void} */ onclick) =>
    el("button", { text, title: label, "aria-label": label, onclick });
  root.append(el("div", { class: "head" }, el("h2", { text: "Your log over its twin" }), el("div", { class: "row tight" },
    button("All", "show all of the log", () => look(0, shown?.duration ?? 1)), button("◀", "earlier in the log", () => pan(-0.25)),
    button("▶", "later in the log", () => pan(0.25)), button("+", "zoom into the log", () => zoom(0.5)),
    button("−", "zoom out of the log", () => zoom(2)))), said, more, place,
  el("details", { class: "more" }, el("summary", { text: "Table of the log" }),
    el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "table of the log" }, table)));

  /** @param {number} start @param {number} end */
  const look = (start, end) => {
    const all = shown?.duration ?? 1;
    const width = Math.min(Math.max(end - start, 1e-4 * all), all);
    from = Math.min(Math.max(start, 0), all - width);
    to = from + width;
    for (const plot of plots) plot.setScale("x", { min: from, max: to });
  };
  /** @param {number} share */
  const pan = (share) => look(from + share * (to - from), to + share * (to - from));
  /** @param {number} by */
  const zoom = (by) => look(0.5 * (from + to) - 0.5 * by * (to - from), 0.5 * (from + to) + 0.5 * by * (to - from));

  const begin = () => {
    for (const plot of plots) plot.destroy();
    plots = [];
    place.replaceChildren();
    if (!shown) return;
    plots = [chart("Angle or voltage", LINES, [shown.measured, shown.simulated], TALL, false),
      chart("What is left", [["measured less simulated", "--second", []]], [shown.residual], LOW, true)];
    look(from, to);
  };

  /**
   * @param {string} title
   * @param {[string, string, number[]][]} lines name, colour, dash
   * @param {(number|null)[][]} data
   * @param {number} height
   * @param {boolean} last
   */
  const chart = (title, lines, data, height, last) => {
    const style = getComputedStyle(document.documentElement);
    const colour = (/** @type {string} */ name) => style.getPropertyValue(name).trim();
    const heading = title.startsWith("Angle") ? (shown.unit === "°" ? "Angle" : "Feedback voltage") : title;
    const values = lines.map(() => el("b"));
    const when = el("span", { class: "when" });
    const box = el("div", { class: "chart", role: "group", tabindex: 0, onkeydown: keys,
      "aria-label": `${heading} of the log over time; arrow keys move the window, plus and minus change how long it is` },
    el("div", { class: "keys" }, el("h3", { text: heading }), ...lines.map(([name, own, dash], k) => el("span", { class: "sample" },
      svg("svg", { width: 26, height: 8, "aria-hidden": "true" }, svg("path", { d: "M0 4H26", fill: "none", stroke: `var(${own})`,
        "stroke-width": 2.4, "stroke-dasharray": dash.join(" ") })), ` ${name} `, values[k])), when));
    place.append(box);
    const axis = { stroke: colour("--ink-soft"), grid: { stroke: colour("--grid"), width: 1 }, font: "12px system-ui",
      ticks: { stroke: colour("--grid"), width: 1, size: 5 }, labelFont: "12px system-ui", labelGap: 0 };
    const plot = new uPlot({
      width: Math.max(box.clientWidth, 200), height, legend: { show: false }, pxAlign: 0, padding: [6, 8, 4, 0],
      cursor: { sync: { key: "own" }, drag: { x: false, y: false }, points: { size: 6 } },
      hooks: { setCursor: [(own) => {
        const at = own.cursor.idx;
        values.forEach((value, k) => { value.textContent = at === null || at === undefined ? "" : `${plain(data[k][at] ?? NaN)} ${shown.unit}`; });
        when.textContent = at === null || at === undefined ? "" : `at ${plain(shown.time[at])} s`;
      }] },
      scales: { x: { time: false, auto: false }, y: { auto: true, range: (_, low, high) => around(low, high, 1e-3) } },
      axes: [{ ...axis, size: 24, ...(last ? { label: "time since the log's first row [s]", labelSize: 16 } : {}) },
        { ...axis, label: `${last ? "residual" : heading.toLowerCase()} [${shown.unit}]`, labelSize: 18, size: 50, space: 24 }],
      series: [{}, ...lines.map(([, own, dash]) => ({ stroke: colour(own), width: 1.6, dash, points: { show: false } }))] },
    /** @type {any} */ ([shown.time, ...data]), box);
    return plot;
  };

  /** @param {KeyboardEvent} event */
  const keys = (event) => {
    const way = { ArrowLeft: () => pan(-0.1), ArrowRight: () => pan(0.1), "+": () => zoom(0.5), "-": () => zoom(2) };
    const act = way[/** @type {keyof typeof way} */ (event.key)];
    if (act) { event.preventDefault(); act(); }
  };

  /** @param {any} found */
  const show = (found) => {
    shown = found;
    root.hidden = false;
    root.dataset.rms = String(found.rms);
    [from, to] = [0, found.duration];
    said.textContent = sentence(found);
    more.replaceChildren(...found.warnings.map((/** @type {string} */ text) => el("p", { class: "soft", text })));
    fill(table, found);
    begin();
  };

  bench.on("own", (found) => { if (found.overlay) show(found.overlay); });
  bench.on("fitted", show);
  bench.on("brought", (found) => { if (!found) { shown = null; root.hidden = true; begin(); } });
  bench.on("theme", begin);
  new ResizeObserver(onceAFrame(() => plots.forEach((plot) => {
    if (place.clientWidth > 50 && plot.width !== place.clientWidth) plot.setSize({ width: place.clientWidth, height: plot.height });
  }))).observe(place);
}

/** @param {any} found @returns {string} */
function sentence(found) {
  const sure = found.rig_fitted ? " (fitted to this log)" : "";
  const rig = found.rig.length ? ` The rig: ${found.rig.join(", ")}${sure}.` : "";
  const judged = found.judged_from > 0 ? ` in what comes after ${plain(found.judged_from, 3)} s, for what is before told when its pulses come` : "";
  return `${found.log} over ${found.servo}, ${found.model}: it is off by ${plain(found.rms, 3)}${space(found.unit)} rms${judged}, at worst by ${
    plain(found.worst, 3)}${space(found.unit)} at ${plain(found.worst_at, 4)} s, of ${found.samples} samples.${rig}`;
}

/** @param {string} unit @returns {string} */
function space(unit) {
  return unit === "°" ? unit : ` ${unit}`;
}

/** @param {HTMLTableElement} table @param {any} found */
function fill(table, found) {
  const step = Math.max(1, Math.floor(found.time.length / ROWS));
  const heads = ["time [s]", ...["measured", "simulated", "what is left"].map((text) => `${text} [${found.unit}]`)];
  const rows = [];
  for (let k = 0; k < found.time.length; k += step) {
    rows.push(el("tr", {}, el("th", { scope: "row", text: plain(found.time[k]) }),
      ...[found.measured, found.simulated, found.residual].map((values) => el("td", { text: plain(values[k] ?? NaN) }))));
  }
  table.replaceChildren(el("caption", { text: `${found.log} over ${found.servo}` }),
    el("thead", {}, el("tr", {}, ...heads.map((text) => el("th", { scope: "col", text })))), el("tbody", {}, ...rows));
}
