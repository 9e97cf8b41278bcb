// What the servos are told: a slider, a gamepad, and commands with a shape.

import { choice, el, onceAFrame, panel } from "./dom.js";
import { slider } from "./slider.js";

/** Fields of each shape: [name, label, unit or "command", usual value]. */
const SHAPES = /** @type {Record<string, [string, string, string, (low: number, high: number) => number][]>} */ ({
  step: [["low", "from", "command", (a, b) => a + 0.4 * (b - a)], ["high", "to", "command", (a, b) => a + 0.6 * (b - a)],
    ["period", "period (0: once)", "s", () => 2]],
  sine: [["mean", "mean", "command", (a, b) => (a + b) / 2], ["amplitude", "amplitude", "command", (a, b) => 0.15 * (b - a)],
    ["frequency", "frequency", "Hz", () => 0.5]],
  sweep: [["mean", "mean", "command", (a, b) => (a + b) / 2], ["amplitude", "amplitude", "command", (a, b) => 0.08 * (b - a)],
    ["start_frequency", "from", "Hz", () => 0.2], ["end_frequency", "to", "Hz", () => 5], ["duration", "in", "s", () => 10]],
  staircase: [["low", "from", "command", (a, b) => a + 0.3 * (b - a)], ["high", "to", "command", (a, b) => a + 0.7 * (b - a)],
    ["steps", "steps", "", () => 8], ["dwell", "each for", "s", () => 0.5]] });
const NAMES = { us: "pulse", deg: "angle", V: "input voltage" };
const SHOWN = { us: "µs", deg: "°", V: "V" };
const AXIS_REST = 0.12; // of a gamepad's stick: less is none

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const body = panel(root, "Command", true);
  /** @type {"us"|"deg"|"V"} */
  let unit = "us";
  /** @type {[number, number]} */
  let ends = [500, 2500];
  let value = 1500;
  const send = onceAFrame(() => bench.tell({ do: "command", value: { shape: "hold", value, unit } }));
  const units = choice("Told in", [], (chosen) => { unit = /** @type {any} */ (chosen); begin(); });
  const main = el("div", { class: "command" });
  const shapes = el("div");
  const said = el("p", { class: "soft" });
  /** @type {ReturnType<typeof slider>} */
  let hand;

  /** @param {"us"|"deg"|"V"} of @returns {[number, number]|null} ends that all servos take */
  const range = (of) => {
    const found = bench.facts.map((one) => (of === "us" ? one.pulse_us : of === "deg" ? one.travel_deg : one.voltage));
    if (!found.length || found.some((one) => !one)) return null;
    return [Math.max(...found.map((one) => one[0])), Math.min(...found.map((one) => one[1]))];
  };
  const usual = () => {
    const [low, high] = /** @type {[number, number]} */ (range(unit) ?? [0, 1]);
    if (unit !== "us") return /** @type {[number, number]} */ ([low, high]);
    return /** @type {[number, number]} */ ([Math.max(low, 500), Math.min(high, 2500)]);
  };

  const begin = () => {
    ends = usual();
    const seen = bench.history[0];
    const name = unit === "us" ? "pulse_width" : unit === "deg" ? "command_angle" : "command_voltage";
    const factor = unit === "us" ? 1e6 : unit === "deg" ? 180 / Math.PI : 1;
    const now = seen && seen.has(name) && seen.length ? factor * seen.latest(name) : (ends[0] + ends[1]) / 2;
    value = Number.isFinite(now) ? now : (ends[0] + ends[1]) / 2;
    hand = slider({ label: NAMES[unit], unit: SHOWN[unit], low: ends[0], high: ends[1], value,
      step: unit === "us" ? 1 : unit === "deg" ? 0.5 : 0.005,
      title: "Drag, use the arrow keys, type, or turn the wheel while it has the focus",
      changed: (to) => { value = to; send(); } });
    hand.row.classList.add("main");
    main.replaceChildren(hand.row);
    shapes.replaceChildren(...Object.keys(SHAPES).map(shaped), recorded());
  };

  /** @param {string} shape */
  const shaped = (shape) => {
    const fields = SHAPES[shape].map(([name, label, of, first]) => {
      const found = first(ends[0], ends[1]);
      const input = el("input", { type: "number", step: "any", value: String(Number(found.toPrecision(4))) });
      const shown = of === "command" ? SHOWN[unit] : of;
      return { name, input, row: el("label", {}, `${label} `, input, shown ? ` ${shown}` : "") };
    });
    return el("details", { class: "shape" }, el("summary", { text: shape[0].toUpperCase() + shape.slice(1) }),
      el("div", { class: "fields" }, ...fields.map((field) => field.row)),
      el("button", { text: `Begin the ${shape}`, onclick: () => bench.tell({ do: "command", value: { shape, unit,
        ...Object.fromEntries(fields.map((field) => [field.name, Number(field.input.value)])) } }) }));
  };

  const recorded = () => {
    const area = el("textarea", { rows: 4, spellcheck: "false", placeholder: "0, 1500\n0.5, 1700\n1.0, 1500" });
    const hold = choice("Between samples", [["previous", "hold"], ["linear", "straight line"]], () => {});
    return el("details", { class: "shape" }, el("summary", { text: "Recorded" }),
      el("label", {}, `Lines of time [s] and command [${SHOWN[unit]}]`, area), hold.row,
      el("button", { text: "Begin the record", onclick: () => {
        const rows = area.value.split(/\n/).map((line) => line.trim()).filter(Boolean)
          .map((line) => line.split(/[\s,;]+/).map(Number)).filter((row) => row.every(Number.isFinite));
        bench.tell({ do: "command", value: { shape: "recorded", unit, time: rows.map((row) => row[0]),
          value: rows.map((row) => row[1]), hold: hold.select.value } });
      } }));
  };

  body.append(units.row, main, said, shapes);
  bench.on("scene", () => {
    const able = /** @type {("us"|"deg"|"V")[]} */ (["us", "deg", "V"]).filter((one) => range(one));
    units.select.replaceChildren(...able.map((one) => el("option", { value: one,
      text: `${NAMES[one]} [${SHOWN[one]}]` })));
    if (!able.includes(unit)) unit = able[0] ?? "deg";
    units.select.value = unit;
    fresh = true;
    begin();
  });
  let fresh = true;
  bench.on("push", (header) => {
    if (fresh && bench.history[0]?.length) { fresh = false; begin(); }
    pad(header.running);
  });

  /** @param {boolean} running */
  const pad = (running) => {
    if (!navigator.getGamepads || !running) return;
    for (const one of navigator.getGamepads()) {
      const tilt = one?.axes[0] ?? 0;
      if (!one || Math.abs(tilt) < AXIS_REST) continue;
      said.textContent = `gamepad: ${one.id.slice(0, 40)}`;
      value = Math.min(ends[1], Math.max(ends[0], value + tilt * 0.01 * (ends[1] - ends[0])));
      hand.set(value);
      send();
    }
  };
}
