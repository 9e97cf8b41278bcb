// What the servos are told: a slider, a gamepad, and commands with a shape.

import { READABLE, choice, el, paced, panel, unique } from "./dom.js";
import { slider } from "./slider.js";

/** Fields of each shape: [name, label, unit or "command", usual value]. */
const SHAPES = /** @type {Record<string, [string, string, string, (low: number, high: number) => number][]>} */ ({
  step: [["low", "from", "command", (a, b) => a + 0.35 * (b - a)], ["high", "to", "command", (a, b) => a + 0.65 * (b - a)],
    ["period", "period (0: once)", "s", () => 2]],
  sine: [["mean", "mean", "command", (a, b) => (a + b) / 2], ["amplitude", "amplitude", "command", (a, b) => 0.15 * (b - a)],
    ["frequency", "frequency", "Hz", () => 0.5]],
  sweep: [["mean", "mean", "command", (a, b) => (a + b) / 2], ["amplitude", "amplitude", "command", (a, b) => 0.08 * (b - a)],
    ["start_frequency", "from", "Hz", () => 0.2], ["end_frequency", "to", "Hz", () => 5], ["duration", "in", "s", () => 10]],
  staircase: [["low", "from", "command", (a, b) => a + 0.3 * (b - a)], ["high", "to", "command", (a, b) => a + 0.7 * (b - a)],
    ["steps", "steps", "", () => 8], ["dwell", "each for", "s", () => 0.5]] });
const RECORD = "recorded";
const NAMES = { us: "pulse", deg: "angle", V: "input voltage" };
const SHOWN = { us: "µs", deg: "°", V: "V" };
const SIGNAL = { us: "pulse_width", deg: "command_angle", V: "command_voltage" };
const FACTOR = { us: 1e6, deg: 180 / Math.PI, V: 1 };
const STEP = { us: 1, deg: 0.5, V: 0.005 };
const PULSES = [500, 2500]; // µs: ends of the slider, if the servo takes more
const [AXIS_REST, AXIS_SPEED] = [0.12, 0.6]; // of a gamepad's stick: less is none; ranges a second when it is all the way over
const QUIET = 1500; // ms after a hand has let go until the slider follows what a shape does

/** @typedef {"us"|"deg"|"V"} Unit */

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const body = panel(root, "Command", true);
  /** @type {Unit} */
  let unit = "us";
  /** @type {[number, number]} */
  let ends = [PULSES[0], PULSES[1]];
  let value = 1500;
  let touched = -Infinity;
  let shape = "step";
  const told = bench.onceAFrame(() => bench.tell({ do: "command", value: { shape: "hold", value, unit } }));
  const send = () => { touched = performance.now(); told(); }; // from now on nothing but a hand moves the slider
  const units = choice("Told in", [], (chosen) => { unit = /** @type {Unit} */ (chosen); bench.look({ "command.unit": unit }); begin(); });
  const shapes = choice("Shape", [...Object.keys(SHAPES), RECORD].map((name) => [name, name]), (chosen) => { shape = chosen; form(); });
  const main = el("div", { class: "command" });
  const fields = el("div", { class: "shape" });
  const said = el("p", { class: "soft", hidden: true });
  /** @type {ReturnType<typeof slider>} */
  let hand;

  /** @param {Unit} of @returns {[number, number]|null} ends that all servos take */
  const range = (of) => {
    const found = bench.facts.map((one) => (of === "us" ? one.pulse_us : of === "deg" ? one.travel_deg : one.voltage));
    if (!found.length || found.some((one) => !one)) return null;
    const both = /** @type {[number, number]} */ ([Math.max(...found.map((one) => one[0])), Math.min(...found.map((one) => one[1]))]);
    return both[0] < both[1] ? both : null;
  };
  const usual = () => {
    const [low, high] = range(unit) ?? [0, 1];
    return /** @type {[number, number]} */ (unit === "us" ? [Math.max(low, PULSES[0]), Math.min(high, PULSES[1])] : [low, high]);
  };
  const now = () => FACTOR[unit] * (bench.history[0]?.latest(SIGNAL[unit]) ?? NaN);

  const begin = () => {
    ends = usual();
    value = Number.isFinite(now()) ? Math.min(ends[1], Math.max(ends[0], now())) : (ends[0] + ends[1]) / 2;
    hand = slider({ label: NAMES[unit], unit: SHOWN[unit], low: ends[0], high: ends[1], value, step: STEP[unit],
      title: "Drag, use the arrow keys, type, or turn the wheel while it has the focus",
      changed: (to) => { value = to; send(); } });
    hand.row.classList.add("main");
    main.replaceChildren(hand.row);
    form();
  };

  const form = () => fields.replaceChildren(...(shape === RECORD ? recorded() : shaped(shape)));

  /** @param {number} command @returns {number} rounded to what a person would type */
  const tidy = (command) => Number((Math.round(command / (10 * STEP[unit])) * 10 * STEP[unit]).toPrecision(6));

  /** @param {string} name @returns {HTMLElement[]} */
  const shaped = (name) => {
    const made = SHAPES[name].map(([key, label, of, first]) => {
      const id = unique();
      const input = el("input", { type: "number", id, step: "any", value: String(of === "command" ? tidy(first(ends[0], ends[1])) : first(0, 0)) });
      return { key, input, row: el("div", { class: "field" }, el("label", { for: id, text: label }), input,
        el("span", { class: "unit", text: of === "command" ? SHOWN[unit] : of })) };
    });
    return [...made.map((field) => field.row), el("button", { text: `Begin the ${name}`, onclick: () => tell({ shape: name, unit,
      ...Object.fromEntries(made.map((field) => [field.key, Number(field.input.value)])) }) })];
  };

  /** @returns {HTMLElement[]} */
  const recorded = () => {
    const area = el("textarea", { rows: 4, spellcheck: "false", placeholder: "0, 1500\n0.5, 1700\n1.0, 1500" });
    const hold = choice("Between samples", [["previous", "hold"], ["linear", "straight line"]], () => {});
    return [el("label", {}, `Lines of time [s] and command [${SHOWN[unit]}]`, area), hold.row,
      el("button", { text: "Begin the record", onclick: () => {
        const rows = area.value.split(/\n/).map((line) => line.trim()).filter(Boolean)
          .map((line) => line.split(/[\s,;]+/).map(Number)).filter((row) => row.every(Number.isFinite));
        tell({ shape: RECORD, unit, time: rows.map((row) => row[0]), value: rows.map((row) => row[1]), hold: hold.select.value });
      } })];
  };

  /** @param {Record<string, any>} command */
  const tell = (command) => { touched = -Infinity; bench.tell({ do: "command", value: command }); };

  body.append(units.row, main, said, shapes.row, fields);
  bench.on("scene", (state) => {
    const able = /** @type {Unit[]} */ (state.control ? ["V"] : ["us", "deg", "V"]).filter((one) => range(one));
    units.select.replaceChildren(...able.map((one) => el("option", { value: one, text: `${NAMES[one]} [${SHOWN[one]}]` })));
    const kept = /** @type {Unit} */ (bench.view["command.unit"]);
    if (able.includes(kept)) unit = kept;
    if (!able.includes(unit)) unit = able[0] ?? "deg";
    units.select.value = unit;
    fresh = true;
    begin();
  });
  let fresh = true;
  const follow = paced(() => { // what a shape, or a lesson, makes of the command
    const at = now();
    if (performance.now() - touched < QUIET || !Number.isFinite(at) || at < ends[0] || at > ends[1] || hand.busy()) return;
    value = at;
    hand.set(value);
  }, READABLE);
  bench.on("push", (header) => {
    if (fresh && bench.history[0]?.length) { fresh = false; begin(); }
    follow();
    pad(header.running);
  });

  let padded = performance.now();
  /** @param {boolean} running */
  const pad = (running) => {
    const since = Math.min(performance.now() - padded, 100) / 1000;
    padded = performance.now();
    if (!navigator.getGamepads || !running || bench.role === "watcher") return;
    for (const one of navigator.getGamepads()) {
      const tilt = one?.axes[0] ?? 0;
      if (!one || Math.abs(tilt) < AXIS_REST) continue;
      said.hidden = false;
      said.textContent = `gamepad: ${one.id.slice(0, 40)}`;
      value = Math.min(ends[1], Math.max(ends[0], value + tilt * AXIS_SPEED * since * (ends[1] - ends[0])));
      hand.set(value);
      send();
    }
  };
}
