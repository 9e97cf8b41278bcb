// The paper's control circuit: what it feels of the servo's supply, and when its program reads the command.

import { panel } from "./dom.js";
import { slider } from "./slider.js";

const FIELDS = /** @type {[string, string, string, number, number, number][]} */ ([ // name, label, unit, factor, highest, usual
  ["command_share", "share of the supply's sag in the command", "%", 100, 100, 1],
  ["reference_share", "share of the supply's sag in the reference", "%", 100, 100, 0],
  ["sampling_delay", "from the end of a pulse to the reading", "ms", 1000, 12, 2e-4]]);

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const body = panel(root, "Control circuit");
  bench.on("scene", (state) => {
    root.hidden = !state.control;
    if (!state.control) { body.replaceChildren(); return; }
    body.replaceChildren(...FIELDS.map(([name, label, unit, factor, high, usual]) => {
      let next = 0;
      const send = bench.onceAFrame(() => bench.tell({ do: "control", value: { [name]: next / factor } }));
      return slider({ label, unit, low: 0, high, value: factor * (state.control[name] ?? usual), title: name,
        changed: (value) => { next = value; send(); } }).row;
    }));
  });
}
