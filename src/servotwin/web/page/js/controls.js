// What the servo hangs on and what hangs on it, and the numbers of its chip that matter most.

import { choice, el, panel } from "./dom.js";
import { slider } from "./slider.js";

const MOST = [ // parameters that stand here; all others are found in the search
  "supply.open_circuit_voltage", "supply.internal_resistance", "electronics.deadband", "electronics.stretcher_gain",
  "friction.coulomb_torque_forward", "gear.backlash", "electronics.off_state", "potentiometer.noise"];
const USUAL = /** @type {Record<string, [number, number, number]>} */ ({ // low, high and off of what a file may lack
  "supply.internal_resistance": [0, 2, 0], "gear.backlash": [0, 0.035, 0], "potentiometer.noise": [0, 0.01, 0] });
const BOTH_WAYS = "friction.coulomb_torque_backward";

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const load = panel(root, "Load", true);
  const sender = panel(root, "Transmitter");
  const chip = panel(root, "Supply, chip and gear");
  /** @type {Map<string, (value: number|null) => void>} */
  let setters = new Map();

  /** @param {string} name @param {any} value */
  const set = (name, value) => bench.tell({ do: "set", value: name.startsWith("friction.coulomb_torque")
    ? { [name]: value, [BOTH_WAYS]: value } : { [name]: value } });

  /** @param {any} of a record of a parameter @param {number} [low] @param {number} [high] @param {string} [label] */
  const control = (of, low = of.low, high = of.high, label = of.meaning) => {
    const { unit, factor } = of.shown;
    let next = 0;
    const send = bench.onceAFrame(() => set(of.name, next));
    const made = slider({ label, unit, low: low / factor, high: high / factor,
      value: of.value === null ? 0 : of.value / factor,
      title: [of.name, of.symbol, of.source].filter(Boolean).join(" · "),
      changed: (value) => { next = value * factor; send(); } });
    setters.set(of.name, (value) => made.set(value === null ? null : value / factor));
    return made.row;
  };

  const frames = () => {
    let rate = bench.state.frame_rate ?? 50;
    let lost = Number([...bench.scene.matchAll(/^ *\[[^,]+, "frames", \{[^}]*lost = ([\d.e+-]+)/gm)].at(-1)?.[1] ?? 0);
    const send = bench.onceAFrame(() => bench.tell({ do: "frames", value: { rate, lost } }));
    return [
      slider({ label: "frame rate", unit: "Hz", low: 10, high: 400, value: rate, step: 1,
        changed: (value) => { rate = value; send(); } }).row,
      slider({ label: "frames that are lost", unit: "%", low: 0, high: 100, value: 100 * lost, step: 1,
        changed: (value) => { lost = value / 100; send(); } }).row,
      el("p", { class: "soft", text: "At 100 % the transmitter is off." })];
  };

  const begin = () => {
    setters = new Map();
    const numbers = bench.loads.filter((one) => one.name.startsWith("load."));
    load.replaceChildren(...numbers.map((one) => control(one)));
    const pulsed = bench.facts.some((one) => one.pulse_us);
    sender.replaceChildren(...(pulsed ? frames() : [el("p", { class: "soft", text: "A bus servo hears no pulses." })]));
    chip.replaceChildren(...MOST.map(one).filter((row) => row !== null));
  };

  /** @param {string} name */
  const one = (name) => {
    const found = bench.facts.map((facts) => facts.parameters.find((/** @type {any} */ p) => p.name === name && p.read))
      .find(Boolean);
    if (!found) return null;
    if (found.choices) {
      const picked = choice(found.meaning, found.choices.map((/** @type {string} */ word) => [word, word]),
        (word) => set(name, word));
      picked.select.value = found.value ?? "";
      return picked.row;
    }
    const [low, high] = USUAL[name] ?? [found.low, found.high];
    if (low === null || high === null) return null;
    const label = name.startsWith("friction") ? "Coulomb friction at the motor" : found.meaning;
    return control(found, low, Math.max(high, found.high ?? 0), label);
  };

  bench.on("scene", begin);
  bench.on("changed", () => {
    for (const of of [...bench.loads, ...bench.facts.flatMap((facts) => facts.parameters)].reverse()) {
      setters.get(of.name)?.(of.value);
    }
  });
}
