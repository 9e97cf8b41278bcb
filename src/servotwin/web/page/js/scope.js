// The oscilloscope: two channels from edges and exact points, a trigger, cursors and measures.

import { READABLE, choice, el, paced, unique } from "./dom.js";
import { shortNames } from "./names.js";
import { DIVISIONS, drawScreen, onScreen } from "./scope_draw.js";
import { BASES, crossings, latest, levelBetween, measure, measurePulses } from "./scope_measure.js";
import { SHOWN, engineering } from "./units.js";

const LOGIC = 5; // V of the pulse; assumed: a five-volt transmitter
const SCALES = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10];
const SEEN = ["armature_voltage", "feedback_voltage", "armature_current", "supply_current", "bus_voltage"];
const USUAL = /** @type {Record<string, number>} */ ({ pulse: 2, armature_voltage: 5, feedback_voltage: 1, armature_current: 1,
  supply_current: 1, bus_voltage: 2 }); // units a division
const PULSE = "pulse";
const COLOURS = ["--first", "--second"];
const NEAR = 0.04; // of the screen: so near a cursor is gripped
const [REST, FRAMES] = [0.35, 2.5]; // s, or frames where they are longer: so long after the last pulse there is none
const SPOKEN = 1; // times a second that the screen's description changes

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const canvas = el("canvas", { role: "img", tabindex: 0, "aria-label": "screen of the oscilloscope" });
  const found = el("div", { class: "measures" });
  let base = 0.005;
  let held = false;
  let single = false;
  let trigger = { channel: 0, rising: true, mode: "auto", at: 0.1, level: 0.5 * LOGIC };
  let start = -Infinity;
  const channels = [{ of: "0:pulse", wish: "0:pulse", scale: 2, position: 1 },
    { of: "0:armature_voltage", wish: "0:armature_voltage", scale: 5, position: -2 }]; // wish: what it shows where a bench has it
  /** @type {import("./scope_draw.js").Cursors|null} */
  let cursors = null;
  let gripped = "";
  /** @type {{width: number, height: number, style: CSSStyleDeclaration|null}} */
  const size = { width: 0, height: 0, style: null };

  const unitOf = (/** @type {string} */ of) => SHOWN[of.split(":")[1]]?.[0] ?? "V";
  const nameOf = (/** @type {string} */ of) => {
    const [servo, name] = of.split(":");
    return [name === PULSE ? "pulse" : SHOWN[name]?.[2] ?? name, shortNames(bench.facts)[Number(servo)] ?? ""].filter(Boolean).join(", ");
  };

  // --- knobs --------------------------------------------------------------------------------------------------------

  /** A field for a number @param {string} label @param {number} value @param {Record<string, any>} more @param {(value: number) => void} changed */
  const field = (label, value, more, changed) => {
    const id = unique();
    const input = el("input", { type: "number", id, value, ...more, oninput: () => {
      if (input.value !== "" && Number.isFinite(Number(input.value))) { changed(Number(input.value)); looked(); draw(); }
    } });
    return { input, row: el("div", { class: "row" }, el("label", { for: id, text: label }), input) };
  };
  const bases = choice("Time base", BASES.map((one) => [String(one), `${engineering(one, "s", 2)}/div`]), (value) => {
    base = Number(value);
    looked();
    draw();
  });
  bases.select.value = String(base);
  const picks = channels.map((channel, k) => choice(`Channel ${k + 1}`, [], (value) => {
    channel.of = channel.wish = value;
    usual(k);
    named(k);
    looked();
    draw();
  }));
  const usual = (/** @type {number} */ k) => {
    const { of } = channels[k];
    channels[k].scale = USUAL[of.split(":")[1]] ?? 2;
    if (k !== trigger.channel) return;
    trigger.level = of.endsWith(PULSE) ? 0.5 * LOGIC : 0.5 * channels[k].scale;
    levels.input.value = String(trigger.level);
  };
  const scales = channels.map((channel, k) => choice(`Scale ${k + 1}`, [], (value) => {
    channel.scale = Number(value);
    looked();
    draw();
  }));
  const named = (/** @type {number} */ k) => {
    scales[k].select.replaceChildren(...SCALES.map((one) => el("option", { value: one,
      text: `${engineering(one, unitOf(channels[k].of), 2)}/div` })));
    scales[k].select.value = String(channels[k].scale);
  };
  const places = channels.map((channel, k) => field(`Position ${k + 1}`, channel.position, { step: 0.5, min: -4, max: 4 },
    (value) => { channel.position = value; }));
  const edges = choice("Trigger", [["0+", "1, rising"], ["0-", "1, falling"], ["1+", "2, rising"], ["1-", "2, falling"]],
    (value) => { trigger = { ...trigger, channel: Number(value[0]), rising: value[1] === "+" }; looked(); draw(); });
  const modes = choice("Mode", [["auto", "auto"], ["normal", "normal"], ["single", "single"]], (value) => {
    trigger.mode = value;
    single = false;
    looked();
    draw();
  });
  const levels = field("Trigger level", trigger.level, { step: 0.1 }, (value) => { trigger.level = value; });
  const hold = el("button", { text: "Hold", "aria-pressed": "false", onclick: () => {
    held = !held;
    single = false;
    press();
    draw();
  } });
  const press = () => hold.setAttribute("aria-pressed", String(held));
  const cursor = el("button", { text: "Cursors", "aria-pressed": "false", onclick: () => {
    cursors = cursors ? null : { time: marks.slice(0, 2).map(({ input }) => Number(input.value)),
      level: marks.slice(2).map(({ input }) => 1 - Number(input.value)) };
    cursor.setAttribute("aria-pressed", String(cursors !== null));
    sliders.hidden = !cursors;
    draw();
  } });
  const marks = [["time", 0.1], ["time", 0.3], ["level", 0.3], ["level", 0.7]].map(([way, first], k) => {
    const input = el("input", { type: "range", min: 0, max: 1, step: 0.001, value: first, oninput: () => {
      if (cursors) { if (k < 2) cursors.time[k] = Number(input.value); else cursors.level[k - 2] = 1 - Number(input.value); }
      draw();
    } });
    return { input, row: el("label", {}, `cursor ${way} ${(k % 2) + 1} `, input) };
  });
  const sliders = el("div", { class: "marks", hidden: true }, ...marks.map(({ row }) => row));
  root.append(el("div", { class: "head" }, el("h2", { text: "Oscilloscope" }), bases.row, el("div", { class: "row tight" }, hold, cursor)),
    canvas, found, sliders, el("details", { class: "more" }, el("summary", { text: "Channels and trigger" }), el("div", { class: "knobs" },
      ...[0, 1].flatMap((k) => [picks[k].row, scales[k].row, places[k].row]), edges.row, levels.row, modes.row)));

  // --- how it is looked at, in the text of the bench ----------------------------------------------------------------

  const looked = () => bench.look({ "scope.base": base, "scope.trigger": `${trigger.channel}${trigger.rising ? "+" : "-"}${trigger.mode}`,
    "scope.level": trigger.level, ...Object.fromEntries(channels.flatMap(({ of, wish, scale, position }, k) => [
      [`scope.of${k + 1}`, wish], ...(of === wish ? [[`scope.scale${k + 1}`, scale]] : []), [`scope.position${k + 1}`, position]])) });
  const restore = () => {
    const { "scope.base": one, "scope.trigger": edge, "scope.level": height } = bench.view;
    if (BASES.includes(Number(one))) base = Number(one);
    const known = /^([01])([+-])(auto|normal|single)$/.exec(String(edge));
    if (known) trigger = { ...trigger, channel: Number(known[1]), rising: known[2] === "+", mode: known[3] };
    if (typeof height === "number") trigger.level = height;
    channels.forEach((channel, k) => {
      const [of, scale, position] = ["of", "scale", "position"].map((key) => bench.view[`scope.${key}${k + 1}`]);
      if (typeof of === "string") channel.wish = of;
      if (SCALES.includes(Number(scale))) channel.scale = Number(scale);
      if (typeof position === "number") channel.position = position;
      places[k].input.value = String(channel.position);
    });
    bases.select.value = String(base);
    edges.select.value = `${trigger.channel}${trigger.rising ? "+" : "-"}`;
    modes.select.value = trigger.mode;
    levels.input.value = String(trigger.level);
  };

  bench.on("scene", () => {
    restore();
    const options = bench.facts.flatMap((facts, k) => [...(facts.pulse_us ? [`${k}:${PULSE}`] : []),
      ...SEEN.filter((name) => facts.columns.includes(name)).map((name) => `${k}:${name}`)]);
    channels.forEach((channel, k) => {
      picks[k].select.replaceChildren(...options.map((value) => el("option", { value, text: nameOf(value) })));
      const before = channel.of;
      channel.of = options.includes(channel.wish) ? channel.wish
        : options.find((one) => !channels.some(({ wish }) => wish === one)) ?? options[0] ?? "";
      const kept = channel.of === channel.wish && bench.view[`scope.scale${k + 1}`] !== undefined;
      if (!kept && channel.of.split(":")[1] !== before.split(":")[1]) usual(k);
      picks[k].select.value = channel.of;
      named(k);
    });
    [start, single] = [-Infinity, false];
    draw();
  });

  // --- the screen ---------------------------------------------------------------------------------------------------

  /** @param {string} of @param {number} from @param {number} to @returns {import("./scope_measure.js").Trace} */
  const traceOf = (of, from, to) => {
    const [k, name] = of.split(":");
    const seen = bench.history[Number(k)];
    if (!seen || !seen.length) return { time: [], value: [] };
    if (name !== PULSE) return seen.slice(name, from, to);
    const { time, value } = levelBetween(seen.pulses(from, to), from, to);
    return { time, value: Array.from(value, (one) => LOGIC * one) };
  };

  const find = () => {
    const span = DIVISIONS.x * base;
    const now = bench.time;
    const { of } = channels[trigger.channel];
    const reach = Math.max(3 * span, span + 0.5);
    const [k, name] = of.split(":");
    const times = name === PULSE
      ? (bench.history[Number(k)]?.pulses(now - reach, now) ?? []).filter(([, width]) => width > 0)
        .map(([edge, width]) => (trigger.rising ? edge : edge + width))
      : crossings(traceOf(of, now - reach, now), trigger.level, trigger.rising);
    const at = latest(times, now, (1 - trigger.at) * span);
    if (at !== null) {
      start = at - trigger.at * span;
      if (trigger.mode === "single") single = true;
    } else if (trigger.mode === "auto") start = now - span;
  };

  const draw = paced(() => {
    if (!held && !single) find();
    const sharp = window.devicePixelRatio || 1;
    const [width, height] = [Math.round(size.width * sharp), Math.round(size.height * sharp)];
    const pen = canvas.getContext("2d");
    if (!width || !height || !pen) return;
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    pen.setTransform(sharp, 0, 0, sharp, 0, 0);
    const style = size.style ?? (size.style = getComputedStyle(canvas));
    const end = start + DIVISIONS.x * base;
    drawScreen(pen, { width: size.width, height: size.height, start, base, style, cursors,
      trigger: { x: trigger.at, channel: trigger.channel, level: trigger.level },
      says: [`${engineering(base, "s", 2)}/div`, `trigger ${trigger.channel + 1} ${trigger.rising ? "↑" : "↓"}`],
      channels: channels.map((channel, k) => ({ ...channel, trace: traceOf(channel.of, start, Math.min(end, bench.time)), dash: [],
        colour: style.getPropertyValue(COLOURS[k]).trim(), says: `${engineering(channel.scale, unitOf(channel.of), 2)}/div` })) });
    tell();
  });

  // --- what it measures ---------------------------------------------------------------------------------------------

  /** @param {number} k @returns {[string, string][]} */
  const measured = (k) => {
    const end = start + DIVISIONS.x * base;
    const [servo, name] = channels[k].of.split(":");
    if (name === PULSE) {
      const to = held || single ? end : Math.max(end, bench.time);
      const rate = bench.header?.lcd[Number(servo)]?.pulse_rate ?? 50;
      const from = to - Math.max(REST, FRAMES / rate) - (held || single ? DIVISIONS.x * base : 0);
      const m = measurePulses(bench.history[Number(servo)]?.pulses(from, Math.min(to, bench.time)) ?? []);
      return [["pulse width", Number.isFinite(m.width) ? engineering(m.width, "s", 7) : "no pulse"], ["period", engineering(m.period, "s", 5)],
        ["frequency", engineering(m.frequency, "Hz", 5)], ["duty", Number.isFinite(m.duty) ? `${(100 * m.duty).toFixed(2)} %` : "–"]];
    }
    const unit = SHOWN[name]?.[0] ?? "";
    const m = measure(traceOf(channels[k].of, start, Math.min(end, bench.time)), start, end);
    return [["lowest", engineering(m.min, unit)], ["highest", engineering(m.max, unit)], ["mean", engineering(m.mean, unit)],
      ["rms", engineering(m.rms, unit)]];
  };
  /** @param {import("./scope_draw.js").Cursors} marked @returns {[string, string][]} */
  const between = (marked) => {
    const span = Math.abs(marked.time[1] - marked.time[0]) * DIVISIONS.x * base;
    const share = Math.abs(marked.level[1] - marked.level[0]) * DIVISIONS.y;
    return [["Δt", engineering(span, "s")], ["1/Δt", engineering(1 / span, "Hz")], ...channels.map((channel, k) => /** @type {[string, string]} */ (
      [`Δ${k + 1}`, engineering(share * channel.scale, unitOf(channel.of))]))];
  };

  const tell = paced(() => {
    const groups = channels.map((channel, k) => ({ title: `${k + 1} ${nameOf(channel.of)}`, kind: `channel${k + 1}`, rows: measured(k) }));
    if (cursors) groups.push({ title: "cursors", kind: "cursors", rows: between(cursors) });
    if (found.childElementCount !== groups.length) {
      found.replaceChildren(...groups.map(({ kind, rows }) => el("section", { class: kind }, el("h3"), el("dl", {},
        ...rows.map(() => el("div", {}, el("dt"), el("dd")))))));
    }
    groups.forEach(({ title, rows }, n) => {
      const [head, list] = found.children[n].children;
      if (head.textContent !== title) head.textContent = title;
      rows.forEach((row, at) => row.forEach((text, part) => {
        const cell = list.children[at].children[part];
        if (cell.textContent !== text) cell.textContent = text;
      }));
    });
    describe();
  }, READABLE);
  const describe = paced(() => canvas.setAttribute("aria-label", `screen of the oscilloscope, ${engineering(base, "s", 2)} a division; ${
    channels.map((channel, k) => `channel ${k + 1}, ${nameOf(channel.of)}: ${measured(k).map((row) => row.join(" ")).join(", ")}`).join("; ")}`), SPOKEN);

  // --- cursors by mouse ---------------------------------------------------------------------------------------------

  canvas.addEventListener("pointerdown", (event) => {
    if (!cursors) return;
    const [x, y] = part(event);
    const all = /** @type {[string, number][]} */ ([...cursors.time.map((c, k) => [`time${k}`, Math.abs(c - x)]),
      ...cursors.level.map((c, k) => [`level${k}`, Math.abs(c - y)])]);
    all.sort((a, b) => a[1] - b[1]);
    if (all[0][1] < NEAR) { [[gripped]] = all; canvas.setPointerCapture(event.pointerId); }
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!cursors || !gripped) return;
    const [x, y] = part(event).map((one) => Math.min(1, Math.max(0, one)));
    const [way, k] = [gripped.slice(0, -1), Number(gripped.slice(-1))];
    if (way === "time") cursors.time[k] = x; else cursors.level[k] = y;
    marks[way === "time" ? k : 2 + k].input.value = String(way === "time" ? x : 1 - y);
    draw();
  });
  for (const name of /** @type {const} */ (["pointerup", "pointercancel"])) canvas.addEventListener(name, () => { gripped = ""; });
  canvas.addEventListener("keydown", (event) => {
    const by = { "+": -1, "-": 1 }[event.key];
    if (!by) return;
    bases.select.selectedIndex = Math.min(BASES.length - 1, Math.max(0, bases.select.selectedIndex + by));
    base = Number(bases.select.value);
    looked();
    draw();
  });
  /** @param {PointerEvent} event @returns {[number, number]} */
  const part = (event) => {
    const box = canvas.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, onScreen((event.clientY - box.top) / box.height, box.height)];
  };
  bench.on("push", draw);
  bench.on("theme", () => { size.style = null; draw.now(); });
  new ResizeObserver((entries) => {
    for (const { contentRect } of entries) [size.width, size.height] = [contentRect.width, contentRect.height];
    draw();
  }).observe(canvas);
}
