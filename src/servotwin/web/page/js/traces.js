// Traces over time: angle against command, speed, torque, current, supply, temperature, of all servos.

import uPlot from "../vendor/uPlot.js";
import { choice, el, onceAFrame } from "./dom.js";
import { SHOWN, shown } from "./units.js";

const CHARTS = /** @type {[string, string[], boolean][]} */ ([ // title, signals, whether it is shown first
  ["Angle", ["output_angle", "command_angle"], true], ["Speed", ["output_speed"], true],
  ["Torque", ["load_torque"], false], ["Current", ["armature_current"], true], ["Supply", ["bus_voltage"], false],
  ["Temperature", ["winding_temperature", "housing_temperature"], false], ["Duty", ["duty"], false]]);
const WINDOWS = [0.05, 0.2, 1, 2, 5, 10, 30, 60];
const DASHES = [[], [6, 4], [2, 3], [10, 3, 2, 3], [1, 4], [12, 6]];
const FINE = 2; // points of a pixel column: what comes closer shows as its extremes

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const bar = el("div", { class: "knobs" });
  const place = el("div", { class: "charts" });
  root.append(el("h2", { text: "Traces" }), bar, place);
  let span = 5;
  let follows = true;
  let end = 0;
  /** @type {{plot: uPlot, series: [number, string][], title: string, box: HTMLElement}[]} */
  let charts = [];
  /** @type {{time: Float64Array, value: Float64Array, name: string}|null} */
  let log = null;
  const wanted = new Set(CHARTS.filter(([, , first]) => first).map(([title]) => title));

  const windows = choice("Window", WINDOWS.map((one) => [String(one), `${one} s`]), (value) => { span = Number(value); draw(); });
  windows.select.value = String(span);
  const follow = el("button", { text: "Follow", "aria-pressed": "true", onclick: () => { follows = !follows; press(); draw(); } });
  const press = () => follow.setAttribute("aria-pressed", String(follows));
  const boxes = CHARTS.map(([title]) => {
    const input = el("input", { type: "checkbox", checked: wanted.has(title), onchange: () => {
      if (input.checked) wanted.add(title); else wanted.delete(title);
      begin();
    } });
    return el("label", { class: "tick" }, input, ` ${title}`);
  });
  bar.append(windows.row, el("div", { class: "row" }, follow,
    el("button", { text: "◀", "aria-label": "earlier", onclick: () => pan(-0.25) }),
    el("button", { text: "▶", "aria-label": "later", onclick: () => pan(0.25) }),
    el("button", { text: "+", "aria-label": "zoom in", onclick: () => zoom(0.5) }),
    el("button", { text: "−", "aria-label": "zoom out", onclick: () => zoom(2) })),
  el("fieldset", { class: "ticks" }, el("legend", { text: "Shown" }), ...boxes));

  /** @param {number} share */
  const pan = (share) => { follows = false; end += share * span; press(); draw(); };
  /** @param {number} by @param {number} [about] time that stays where it is */
  const zoom = (by, about = end) => {
    end = about + (end - about) * by;
    span = Math.min(120, Math.max(1e-6, span * by));
    draw();
  };

  const begin = () => {
    for (const { plot } of charts) plot.destroy();
    charts = [];
    place.replaceChildren();
    const style = getComputedStyle(document.documentElement);
    const colour = (/** @type {string} */ name) => style.getPropertyValue(name).trim();
    for (const [title, names] of CHARTS) {
      if (!wanted.has(title)) continue;
      const series = /** @type {[number, string][]} */ (bench.facts.flatMap((facts, k) => names
        .filter((name) => facts.columns.includes(name) && !(name === "command_angle" && k > 0)).map((name) => [k, name])));
      if (!series.length) continue;
      const unit = SHOWN[names[0]][0];
      const box = el("div", { class: "chart", role: "img", tabindex: 0, "aria-label": `${title} over time` });
      place.append(box);
      const axis = { stroke: colour("--ink-soft"), grid: { stroke: colour("--grid"), width: 1 },
        ticks: { stroke: colour("--grid"), width: 1 }, font: "12px system-ui" };
      const plot = new uPlot({
        width: Math.max(box.clientWidth, 200), height: title === "Angle" ? 210 : 150, legend: { live: true }, pxAlign: 0,
        cursor: { sync: { key: "traces" }, drag: { x: false, y: false }, points: { size: 6 } },
        scales: { x: { time: false, auto: false }, y: { auto: true, range: around } },
        axes: [{ ...axis, label: "time [s]", labelSize: 18, size: 34 },
          { ...axis, label: `${title.toLowerCase()} [${unit}]`, labelSize: 18, size: 56 }],
        series: [{ label: "t", value: (_, v) => (v === null ? "–" : `${v.toFixed(4)} s`) }, ...series.map(([k, name]) => ({
          label: series.length > 1 ? `${SHOWN[name][2]}${bench.facts.length > 1 ? ` ${k + 1}` : ""}` : SHOWN[name][2],
          stroke: name === "command_angle" ? colour("--command") : colour(k === 0 ? "--first" : k === 1 ? "--second" : `--more${k}`),
          width: 1.6, dash: name === "command_angle" ? [3, 3] : DASHES[name.startsWith("housing") ? 2 : k], points: { show: false },
          value: (/** @type {any} */ _, /** @type {number|null} */ v) => (v === null ? "–" : `${v.toPrecision(4)} ${unit}`) })),
        ...(title === "Angle" && log ? [{ label: log.name, stroke: colour("--log"), width: 1, points: { show: true, size: 3 } }] : [])] },
      [new Float64Array(0), ...series.map(() => new Float64Array(0)), ...(title === "Angle" && log ? [new Float64Array(0)] : [])], box);
      hands(plot);
      charts.push({ plot, series, title, box });
    }
    draw();
  };

  /** @param {uPlot} plot */
  const hands = (plot) => {
    const over = plot.over;
    over.addEventListener("wheel", (/** @type {WheelEvent} */ event) => {
      if (!event.ctrlKey && !event.shiftKey && document.activeElement !== over.closest(".chart")) return;
      event.preventDefault();
      follows = false;
      press();
      zoom(event.deltaY > 0 ? 1.25 : 0.8, plot.posToVal(event.offsetX, "x"));
    }, { passive: false });
    let from = NaN;
    over.addEventListener("pointerdown", (/** @type {PointerEvent} */ event) => { from = event.clientX; });
    window.addEventListener("pointerup", () => { from = NaN; });
    over.addEventListener("pointermove", (/** @type {PointerEvent} */ event) => {
      if (Number.isNaN(from) || !(event.buttons & 1)) return;
      pan((from - event.clientX) / over.clientWidth);
      from = event.clientX;
    });
    over.closest(".chart")?.addEventListener("keydown", (/** @type {any} */ event) => {
      const way = { ArrowLeft: () => pan(-0.1), ArrowRight: () => pan(0.1), "+": () => zoom(0.5), "-": () => zoom(2) };
      const act = way[/** @type {keyof typeof way} */ (event.key)];
      if (act) { event.preventDefault(); act(); }
    });
  };

  const draw = onceAFrame(() => {
    if (follows) end = Math.max(bench.time, span);
    const start = end - span;
    for (const { plot, series, title } of charts) {
      const width = plot.over.clientWidth || 600;
      const times = /** @type {number[]} */ ([]);
      const parts = series.map(([k, name]) => thinned(bench.history[k].slice(name, start, end), start, span, width, name));
      if (title === "Angle" && log) parts.push({ time: Array.from(log.time), value: Array.from(log.value) });
      plot.setData(joined(parts, times), false);
      plot.setScale("x", { min: start, max: end });
    }
  });

  bench.on("scene", () => { end = 0; begin(); });
  bench.on("push", draw);
  bench.on("theme", begin);
  bench.on("log", (found) => { log = found; begin(); });
  new ResizeObserver(onceAFrame(() => charts.forEach(({ plot, box }) => {
    if (box.clientWidth > 50 && plot.width !== box.clientWidth) plot.setSize({ width: box.clientWidth, height: plot.height });
  }))).observe(place);
}

/**
 * A trace of which at most the extremes of each pixel column are left, if there are more.
 * @param {{time: Float64Array, value: Float64Array}} trace
 * @param {number} start
 * @param {number} span
 * @param {number} width
 * @param {string} name
 * @returns {{time: number[], value: number[]}}
 */
function thinned(trace, start, span, width, name) {
  const time = [];
  const value = [];
  const dense = trace.time.length > FINE * width;
  let column = NaN;
  let [low, high, at, last, kept] = [0, 0, 0, 0, 0];
  const close = () => {
    if (kept > 1) { time.push(at, at, at); value.push(low, high, last); }
  };
  for (let k = 0; k < trace.time.length; k += 1) {
    const v = shown(name, trace.value[k]);
    const here = dense ? Math.floor(((trace.time[k] - start) / span) * width) : k;
    if (here !== column) {
      close();
      time.push(trace.time[k]);
      value.push(v);
      [column, low, high, kept] = [here, v, v, 0];
    }
    [low, high, at, last, kept] = [Math.min(low, v), Math.max(high, v), trace.time[k], v, kept + 1];
  }
  close();
  return { time, value };
}

/**
 * Traces with times of their own as columns over all times; what a trace lacks is left out of its line.
 * @param {{time: number[], value: number[]}[]} parts
 * @param {number[]} times
 * @returns {any}
 */
function joined(parts, times) {
  if (parts.every((part) => part.time.length === parts[0].time.length && part.time.every((t, k) => t === parts[0].time[k]))) {
    return [parts[0].time, ...parts.map((part) => part.value)];
  }
  const at = parts.map(() => 0);
  const columns = parts.map(() => /** @type {(number|null|undefined)[]} */ ([]));
  for (;;) {
    let next = Infinity;
    parts.forEach((part, k) => { if (at[k] < part.time.length) next = Math.min(next, part.time[at[k]]); });
    if (next === Infinity) break;
    times.push(next);
    parts.forEach((part, k) => {
      const here = at[k] < part.time.length && part.time[at[k]] === next;
      columns[k].push(here ? part.value[at[k]] : undefined);
      if (here) at[k] += 1;
    });
  }
  return [times, ...columns];
}

/** @param {any} _ @param {number|null} low @param {number|null} high @returns {[number, number]} with some room */
function around(_, low, high) {
  if (low === null || high === null || !Number.isFinite(low)) return [-1, 1];
  const room = Math.max(0.08 * (high - low), 1e-9 + 0.02 * Math.max(Math.abs(low), Math.abs(high)));
  return [low - room, high + room];
}
