// Traces over time: angle against command, speed, torque, current, supply, temperature, of all servos.

import uPlot from "../vendor/uPlot.js";
import { READABLE, choice, el, paced, svg } from "./dom.js";
import { lowestSupply } from "./moves.js";
import { shortNames } from "./names.js";
import { around, lines } from "./traces_data.js";
import { SHOWN, plain, printed, shown } from "./units.js";

/** Title, signals, whether it is shown first, and how much the axis spans at least, in the unit that is shown. */
const CHARTS = /** @type {[string, string[], boolean, number][]} */ ([
  ["Angle", ["output_angle", "command_angle"], true, 1], ["Speed", ["output_speed"], false, 20],
  ["Torque", ["load_torque"], false, 20], ["Current", ["armature_current"], true, 0.2],
  ["Supply", ["bus_voltage"], false, 0.5], ["Temperature", ["winding_temperature", "housing_temperature"], false, 2],
  ["Duty", ["duty"], false, 0.2]]);
const WINDOWS = [0.02, 0.1, 0.5, 1, 2, 5, 10, 30, 60];
const DASHES = [[], [7, 3], [2, 3], [10, 3, 2, 3], [1, 4], [12, 6]];
const COMMAND = [3, 3];
const [TALL, LOW] = [178, 118]; // pixels, without what the time axis takes
const [AXIS, LABEL] = [24, 16]; // pixels of the numbers below, and of what they are
const LONGEST = 120; // s
/** @typedef {{name: string, signal: string, servo: number, dash: number[], colour: string, value: HTMLElement}} Key */
/** @typedef {{plot: uPlot, keys: Key[], title: string, box: HTMLElement, least: number, when: HTMLElement}} Chart */

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const place = el("div", { class: "charts" });
  let span = 5;
  let follows = true;
  let end = 0;
  let under = NaN; // s, time under the mouse
  /** @type {Chart[]} */
  let charts = [];
  /** @type {{time: Float64Array, value: Float64Array, name: string}|null} */
  let log = null;
  const wanted = new Set(CHARTS.filter(([, , first]) => first).map(([title]) => title));

  const windows = choice("Window", WINDOWS.map((one) => [String(one), `${plain(one)} s`]), (value) => {
    span = Number(value);
    looked();
    draw();
  });
  windows.select.value = String(span);
  windows.row.firstElementChild?.classList.add("hidden");
  const follow = el("button", { text: "Follow", onclick: () => { follows = !follows; press(); draw(); } });
  const press = () => follow.setAttribute("aria-pressed", String(follows));
  press();
  const looked = () => bench.look({ "traces.window": span, "traces.shown": [...wanted].join(" ") });
  const boxes = CHARTS.map(([title]) => {
    const input = el("input", { type: "checkbox", checked: wanted.has(title), onchange: () => {
      if (input.checked) wanted.add(title); else wanted.delete(title);
      looked();
      begin();
    } });
    return { title, input, row: el("label", { class: "tick" }, input, ` ${title}`) };
  });
  const button = (/** @type {string} */ text, /** @type {string} */ label, /** @type {() => void} */ onclick) =>
    el("button", { text, title: label, "aria-label": label, onclick });
  root.append(el("div", { class: "head" }, el("h2", { text: "Traces" }), windows.row, el("div", { class: "row tight" }, follow,
    button("◀", "earlier", () => pan(-0.25)), button("▶", "later", () => pan(0.25)), button("+", "zoom in", () => zoom(0.5)),
    button("−", "zoom out", () => zoom(2))),
  el("fieldset", { class: "ticks" }, el("legend", { class: "hidden", text: "Charts that are shown" }), ...boxes.map(({ row }) => row))), place);

  /** @param {number} share */
  const pan = (share) => { follows = false; end += share * span; press(); draw(); };
  /** @param {number} by @param {number} [about] time that stays where it is */
  const zoom = (by, about = end) => {
    const next = Math.min(LONGEST, Math.max(1e-6, span * by));
    if (about !== end) { follows = false; press(); }
    end = about + (end - about) * (next / span);
    span = next;
    const fits = WINDOWS.find((one) => Math.abs(one / span - 1) < 1e-6);
    let own = windows.select.querySelector("option.own");
    if (!own) { own = el("option", { class: "own" }); windows.select.append(own); }
    if (fits) own.remove();
    else Object.assign(own, { value: String(span), textContent: `${plain(span, 3)} s` });
    windows.select.value = String(fits ?? span);
    looked();
    draw();
  };

  const begin = () => {
    for (const { plot } of charts) plot.destroy();
    charts = [];
    place.replaceChildren();
    const able = CHARTS.filter(([, names]) => bench.facts.some((facts) => names.some((name) => facts.columns.includes(name))));
    for (const { title, row } of boxes) row.hidden = !able.some(([other]) => other === title);
    const those = able.filter(([title]) => wanted.has(title));
    those.forEach(([title, names, , least], n) => charts.push(chart(title, names, least, n === those.length - 1)));
    draw();
    read();
  };

  /** @param {string} title @param {string[]} names @param {number} least @param {boolean} last @returns {Chart} */
  const chart = (title, names, least, last) => {
    const style = getComputedStyle(document.documentElement);
    const colour = (/** @type {string} */ name) => style.getPropertyValue(name).trim();
    const keys = keysOf(bench.facts, names, colour);
    const beside = title === "Angle" && log ? [log] : [];
    const unit = SHOWN[names[0]][0];
    const when = el("span", { class: "when" });
    const box = el("div", { class: "chart", role: "group", tabindex: 0, "aria-label": `${title} over time; arrow keys move the window, plus and minus change how long it is`,
      "data-chart": title });
    box.append(el("div", { class: "keys" }, el("h3", { text: title }), ...keys.map((key) => el("span", { class: "sample" },
      sample(key), key.name, " ", key.value)), ...beside.map((one) => el("span", { class: "sample log", text: one.name })), when));
    place.append(box);
    const axis = { stroke: colour("--ink-soft"), grid: { stroke: colour("--grid"), width: 1 },
      ticks: { stroke: colour("--grid"), width: 1, size: 5 }, font: "12px system-ui", labelFont: "12px system-ui", labelGap: 0 };
    const plot = new uPlot({
      width: Math.max(box.clientWidth, 200), height: (title === "Angle" ? TALL : LOW) + (last ? AXIS + LABEL : 0), legend: { show: false },
      pxAlign: 0, padding: [6, 8, 4, 0],
      cursor: { sync: { key: "traces" }, drag: { x: false, y: false }, points: { size: 6 } },
      hooks: { setCursor: [(own) => {
        under = own.cursor.left !== undefined && own.cursor.left !== null && own.cursor.left >= 0 ? own.posToVal(own.cursor.left, "x") : NaN;
        read();
      }] },
      scales: { x: { time: false, auto: false }, y: { auto: true, range: (_, low, high) => around(low, high, least) } },
      axes: [{ ...axis, ...(last ? { label: "time [s]", labelSize: LABEL, size: AXIS } : { size: 0, values: () => [], ticks: { show: false } }) },
        { ...axis, label: `${title.toLowerCase()} [${printed(unit) || "1"}]`, labelSize: 18, size: 44, space: 24 }],
      series: [{}, ...keys.map((key) => ({ stroke: key.colour, width: 1.6, dash: key.dash, points: { show: false } })),
        ...beside.map(() => ({ stroke: colour("--log"), width: 1, points: { show: true, size: 3 } }))] },
    [[], ...keys.map(() => []), ...beside.map(() => [])], box);
    hands(plot, box);
    return { plot, keys, title, box, least, when };
  };

  /** @param {uPlot} plot @param {HTMLElement} box */
  const hands = (plot, box) => {
    const over = plot.over;
    over.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.shiftKey && document.activeElement !== box) return; // a page that scrolls changes nothing
      event.preventDefault();
      zoom(event.deltaY + event.deltaX > 0 ? 1.25 : 0.8, plot.posToVal(event.offsetX, "x"));
    }, { passive: false });
    let from = NaN;
    over.addEventListener("pointerdown", (event) => { from = event.clientX; over.setPointerCapture(event.pointerId); });
    for (const name of /** @type {const} */ (["pointerup", "pointercancel"])) over.addEventListener(name, () => { from = NaN; });
    over.addEventListener("pointermove", (event) => {
      if (Number.isNaN(from) || !(event.buttons & 1)) return;
      pan((from - event.clientX) / over.clientWidth);
      from = event.clientX;
    });
    const ways = /** @type {Record<string, () => void>} */ ({ ArrowLeft: () => pan(-0.1), ArrowRight: () => pan(0.1),
      "+": () => zoom(0.5), "-": () => zoom(2) });
    box.addEventListener("keydown", (event) => {
      if (event.target !== box || !ways[event.key]) return;
      event.preventDefault();
      ways[event.key]();
    });
  };

  const draw = paced(() => {
    if (follows) end = Math.max(bench.time, span);
    const start = end - span;
    for (const { plot, keys, title } of charts) {
      const signals = keys.map((key) => ({ history: bench.history[key.servo], name: key.signal }));
      const others = title === "Angle" && log ? [{ time: Array.from(log.time), value: Array.from(log.value) }] : [];
      const data = lines(signals, start, end, plot.over.clientWidth || 600, shown, others);
      plot.batch(() => {
        plot.setData(/** @type {any} */ (data), false);
        plot.setScale("x", { min: start, max: end });
      });
    }
    read();
  });

  /** Say the values under the mouse, or the latest. */
  const read = paced(() => {
    const at = Number.isFinite(under) ? under : bench.time;
    for (const { keys, when } of charts) {
      const supply = keys.find((key) => key.signal === "bus_voltage");
      when.textContent = Number.isFinite(under) ? `at ${under.toFixed(span < 0.5 ? 6 : 3)} s`
        : supply ? lowestSupply(bench, supply.servo, end - span, end) : "";
      for (const key of keys) {
        const history = bench.history[key.servo];
        const value = Number.isFinite(under) ? history.between(key.signal, at) : history.latest(key.signal);
        const unit = printed(SHOWN[key.signal][0]);
        const text = Number.isFinite(value) ? `${shown(key.signal, value).toFixed(2)}${unit === "°" ? "°" : ` ${unit}`}` : "–";
        if (key.value.textContent !== text) key.value.textContent = text;
      }
    }
  }, READABLE);

  bench.on("scene", () => {
    end = 0;
    const { "traces.window": window, "traces.shown": names } = bench.view;
    if (typeof window === "number" && window > 0 && window <= LONGEST) { span = window; zoom(1); }
    if (typeof names === "string") {
      wanted.clear();
      for (const [title] of CHARTS) if (names.split(" ").includes(title)) wanted.add(title);
      for (const { title, input } of boxes) input.checked = wanted.has(title);
    }
    begin();
  });
  bench.on("push", draw);
  bench.on("theme", () => { begin(); draw.now(); read.now(); });
  bench.on("log", (found) => { log = found; begin(); });
  new ResizeObserver(paced(() => charts.forEach(({ plot, box }) => {
    if (box.clientWidth > 50 && plot.width !== box.clientWidth) plot.setSize({ width: box.clientWidth, height: plot.height });
  }))).observe(place);
}

/**
 * @param {any[]} facts of all servos
 * @param {string[]} names of signals
 * @param {(name: string) => string} colour
 * @returns {Key[]} what a chart shows; the command once, for all hear the same
 */
function keysOf(facts, names, colour) {
  const called = shortNames(facts);
  return facts.flatMap((one, servo) => names
    .filter((name) => one.columns.includes(name) && !(name === "command_angle" && servo > 0))
    .map((signal) => ({ signal, servo, value: el("span", { class: "value" }),
      name: signal === "command_angle" ? "command" : signal === "housing_temperature" ? `${called[servo]} housing`.trim()
        : called[servo] || SHOWN[signal][2],
      dash: signal === "command_angle" ? COMMAND : signal === "housing_temperature" ? [2, 3] : DASHES[servo],
      colour: colour(signal === "command_angle" ? "--command" : servo === 0 ? "--first" : servo === 1 ? "--second" : `--more${servo}`) })));
}

/** @param {Key} key @returns {SVGElement} a piece of its line */
function sample(key) {
  return svg("svg", { class: "line-sample", viewBox: "0 0 26 8", "aria-hidden": "true" }, svg("line", { x1: 0, y1: 4, x2: 26, y2: 4,
    stroke: key.colour, "stroke-width": 2.4, "stroke-dasharray": key.dash.join(" ") || "none" }));
}
