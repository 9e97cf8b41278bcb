// The oscilloscope: two channels from edges and exact points, a trigger, cursors and measures.

import { choice, el, onceAFrame } from "./dom.js";
import { BASES, crossings, latest, level, measure, measurePulses } from "./scope_measure.js";
import { DIVISIONS, drawScreen } from "./scope_draw.js";
import { SHOWN, engineering } from "./units.js";

const LOGIC = 5; // V of the pulse; assumed: a five-volt transmitter
const SCALES = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10];
const SEEN = ["armature_voltage", "feedback_voltage", "armature_current", "supply_current", "bus_voltage"];
const PULSE = "pulse";
const COLOURS = ["--first", "--second"];

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const canvas = el("canvas", { role: "img", tabindex: 0, "aria-label": "screen of the oscilloscope" });
  const found = el("dl", { class: "measures" });
  const knobs = el("div", { class: "knobs" });
  root.append(el("h2", { text: "Oscilloscope" }), canvas, found, knobs);

  let base = 0.005;
  let held = false;
  let single = false;
  let trigger = { channel: 0, rising: true, mode: "auto", at: 0.1 };
  let start = -Infinity;
  const channels = [{ of: "0:pulse", scale: 2, position: 1 }, { of: "0:armature_voltage", scale: 2, position: -3 }];
  /** @type {{time: number[], level: number[]}|null} */
  let cursors = null;
  let gripped = "";

  const bases = choice("Time base", BASES.map((one) => [String(one), `${engineering(one, "s", 2)} a division`]), (value) => {
    base = Number(value);
    draw();
  });
  bases.select.value = String(base);
  const picks = channels.map((channel, k) => choice(`Channel ${k + 1}`, [], (value) => {
    channel.of = value;
    channel.scale = unitOf(value) === "A" ? 0.5 : 2;
    named(k);
    draw();
  }));
  const unitOf = (/** @type {string} */ of) => SHOWN[of.split(":")[1]]?.[0] ?? "V";
  const scales = channels.map((channel, k) => choice(`Scale ${k + 1}`, [], (value) => { channel.scale = Number(value); draw(); }));
  const named = (/** @type {number} */ k) => {
    scales[k].select.replaceChildren(...SCALES.map((one) => el("option", { value: one,
      text: `${engineering(one, unitOf(channels[k].of), 2)} a division` })));
    scales[k].select.value = String(channels[k].scale);
  };
  const places = channels.map((channel, k) => {
    const made = choice(`Position ${k + 1}`, [], () => {});
    const input = el("input", { type: "number", id: made.select.id, step: 0.5, min: -4, max: 4, value: channel.position,
      oninput: () => { channel.position = Number(input.value); draw(); } });
    made.select.replaceWith(input);
    return made;
  });
  const edges = choice("Trigger", [["0+", "1, rising"], ["0-", "1, falling"], ["1+", "2, rising"], ["1-", "2, falling"]],
    (value) => { trigger = { ...trigger, channel: Number(value[0]), rising: value[1] === "+" }; draw(); });
  const modes = choice("Mode", [["auto", "auto"], ["normal", "normal"], ["single", "single"]], (value) => {
    trigger.mode = value;
    single = false;
    draw();
  });
  let threshold = 0.5 * LOGIC;
  const levels = choice("Trigger level", [], () => {});
  const levelInput = el("input", { type: "number", id: levels.select.id, step: 0.1, value: threshold,
    oninput: () => { threshold = Number(levelInput.value); draw(); } });
  levels.select.replaceWith(levelInput);
  const hold = el("button", { text: "Hold", "aria-pressed": "false", onclick: () => {
    held = !held;
    single = false;
    hold.textContent = held ? "Run" : "Hold";
    hold.setAttribute("aria-pressed", String(held));
    draw();
  } });
  const cursor = el("button", { text: "Cursors", "aria-pressed": "false", onclick: () => {
    cursors = cursors ? null : { time: [0.3, 0.6], level: [0.3, 0.7] };
    cursor.setAttribute("aria-pressed", String(cursors !== null));
    marks.hidden = !cursors;
    draw();
  } });
  const marks = el("div", { class: "marks", hidden: true }, ...["time 1", "time 2", "level 1", "level 2"].map((name, k) => {
    const input = el("input", { type: "range", min: 0, max: 1, step: 0.001, value: k < 2 ? 0.3 + 0.3 * k : 0.3 + 0.4 * (k - 2),
      oninput: () => { if (cursors) { (k < 2 ? cursors.time : cursors.level)[k % 2] = Number(input.value); draw(); } } });
    return el("label", {}, `cursor ${name} `, input);
  }));
  knobs.append(bases.row, el("div", { class: "row" }, hold, cursor), marks, el("details", {},
    el("summary", { text: "Channels and trigger" }), el("div", { class: "knobs" },
      ...[0, 1].flatMap((k) => [picks[k].row, scales[k].row, places[k].row]), edges.row, levels.row, modes.row)));

  bench.on("scene", () => {
    const options = bench.facts.flatMap((facts, k) => [
      ...(facts.pulse_us ? [[`${k}:${PULSE}`, "pulse"]] : []),
      ...SEEN.filter((name) => facts.columns.includes(name)).map((name) => [`${k}:${name}`, SHOWN[name][2]])]
      .map(([value, text]) => [value, bench.facts.length > 1 ? `${text} of ${k + 1}: ${facts.model}` : text]));
    channels.forEach((channel, k) => {
      picks[k].select.replaceChildren(...options.map(([value, text]) => el("option", { value, text })));
      if (!options.some(([value]) => value === channel.of)) channel.of = options[Math.min(k, options.length - 1)]?.[0] ?? "";
      picks[k].select.value = channel.of;
      named(k);
    });
    [start, single] = [-Infinity, false];
    draw();
  });

  /** @param {string} of @param {number} from @param {number} to */
  const traceOf = (of, from, to) => {
    const [k, name] = of.split(":");
    const seen = bench.history[Number(k)];
    if (!seen || !seen.length) return { time: [], value: [] };
    if (name !== PULSE) return seen.slice(name, from, to);
    const made = level(seen.pulses(from, to));
    const time = [from, ...made.time, Math.max(to, from)];
    const first = made.time.length && made.time[0] < from ? made.value[1] : 0;
    const last = made.time.length && made.time[made.time.length - 1] > to ? 1 : 0;
    const keep = time.map((t, n) => [t, [first, ...made.value, last][n]]).filter(([t]) => t >= from && t <= to);
    return { time: keep.map(([t]) => t), value: keep.map(([, v]) => LOGIC * v) };
  };

  const find = () => {
    const span = DIVISIONS.x * base;
    const now = bench.time;
    const channel = channels[trigger.channel];
    const reach = Math.max(3 * span, span + 0.5);
    const [k, name] = channel.of.split(":");
    const times = name === PULSE
      ? (bench.history[Number(k)]?.pulses(now - reach, now) ?? []).filter(([, width]) => width > 0)
        .map(([edge, width]) => (trigger.rising ? edge : edge + width))
      : crossings(traceOf(channel.of, now - reach, now), threshold, trigger.rising);
    const at = latest(times, now, (1 - trigger.at) * span);
    if (at !== null) {
      start = at - trigger.at * span;
      if (trigger.mode === "single") single = true;
    } else if (trigger.mode === "auto") start = now - span;
  };

  const draw = onceAFrame(() => {
    if (!held && !single) find();
    const box = canvas.getBoundingClientRect();
    const sharp = window.devicePixelRatio || 1;
    const [width, height] = [Math.round(box.width * sharp), Math.round(box.height * sharp)];
    if (!width || !height) return;
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    const pen = canvas.getContext("2d");
    if (!pen) return;
    pen.setTransform(sharp, 0, 0, sharp, 0, 0);
    const style = getComputedStyle(canvas);
    const end = start + DIVISIONS.x * base;
    const traces = channels.map((channel) => traceOf(channel.of, start, Math.min(end, bench.time)));
    drawScreen(pen, { width: box.width, height: box.height, start, base, style, cursors,
      trigger: { x: trigger.at, y: 0, colour: style.getPropertyValue(COLOURS[trigger.channel]).trim() },
      channels: channels.map((channel, k) => ({ ...channel, trace: traces[k], name: channel.of, dash: [],
        colour: style.getPropertyValue(COLOURS[k]).trim() })) });
    tell(traces, end);
  });

  /** @param {import("./scope_measure.js").Trace[]} traces @param {number} end */
  const tell = (traces, end) => {
    const rows = channels.flatMap((channel, k) => {
      const [servo, name] = channel.of.split(":");
      if (name === PULSE) {
        const period = 3 / 10 + DIVISIONS.x * base;
        const m = measurePulses(bench.history[Number(servo)]?.pulses(end - period, Math.min(end, bench.time)) ?? []);
        return [[`${k + 1} pulse width`, engineering(m.width, "s", 7)], [`${k + 1} period`, engineering(m.period, "s", 5)],
          [`${k + 1} frequency`, engineering(m.frequency, "Hz", 5)], [`${k + 1} duty`, `${(100 * m.duty).toFixed(2)} %`]];
      }
      const unit = SHOWN[name]?.[0] ?? "";
      const m = measure(traces[k], start, end);
      return [[`${k + 1} lowest`, engineering(m.min, unit)], [`${k + 1} highest`, engineering(m.max, unit)],
        [`${k + 1} mean`, engineering(m.mean, unit)], [`${k + 1} rms`, engineering(m.rms, unit)]];
    });
    if (cursors) {
      const span = Math.abs(cursors.time[1] - cursors.time[0]) * DIVISIONS.x * base;
      rows.push(["Δt", engineering(span, "s")], ["1/Δt", engineering(1 / span, "Hz")], ...channels.map((channel, k) => [
        `Δ${k + 1}`, engineering(Math.abs(cursors ? cursors.level[1] - cursors.level[0] : 0) * DIVISIONS.y * channel.scale,
          SHOWN[channel.of.split(":")[1]]?.[0] ?? "V")]));
    }
    if (found.childElementCount !== rows.length) {
      found.replaceChildren(...rows.map(() => el("div", {}, el("dt"), el("dd"))));
    }
    rows.forEach(([name, value], n) => {
      const [term, data] = found.children[n].children;
      if (term.textContent !== name) term.textContent = name;
      if (data.textContent !== value) data.textContent = value;
    });
    canvas.setAttribute("aria-label", `screen of the oscilloscope, ${engineering(base, "s", 2)} a division; ${
      rows.slice(0, 8).map((row) => row.join(" ")).join(", ")}`);
  };

  // --- cursors by mouse ---------------------------------------------------------------------------------------------

  canvas.addEventListener("pointerdown", (event) => {
    if (!cursors) return;
    const [x, y] = part(event);
    const all = /** @type {[string, number][]} */ ([...cursors.time.map((c, k) => [`time${k}`, Math.abs(c - x)]),
      ...cursors.level.map((c, k) => [`level${k}`, Math.abs(c - y)])]);
    all.sort((a, b) => a[1] - b[1]);
    if (all[0][1] < 0.04) { [[gripped]] = all; canvas.setPointerCapture(event.pointerId); }
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!cursors || !gripped) return;
    const [x, y] = part(event);
    const way = gripped.startsWith("time") ? cursors.time : cursors.level;
    way[Number(gripped.slice(-1))] = gripped.startsWith("time") ? x : y;
    draw();
  });
  canvas.addEventListener("pointerup", () => { gripped = ""; });
  canvas.addEventListener("keydown", (event) => {
    const by = { "+": -1, "-": 1 }[event.key];
    if (!by) return;
    bases.select.selectedIndex = Math.min(BASES.length - 1, Math.max(0, bases.select.selectedIndex + by));
    base = Number(bases.select.value);
    draw();
  });
  /** @param {PointerEvent} event @returns {[number, number]} */
  const part = (event) => {
    const box = canvas.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  };
  bench.on("push", draw);
  bench.on("theme", draw);
  new ResizeObserver(draw).observe(canvas);
}
