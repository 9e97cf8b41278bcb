// The registers of a bus servo by the maker's names, and what they mean at the shaft.

import { anew, breakable, el, panel, unique } from "./dom.js";
import { plain, printed } from "./units.js";

const FIRST = ["P_Coefficient", "D_Coefficient", "I_Coefficient", "Torque_Limit", "Max_Torque_Limit", "Goal_Velocity",
  "Acceleration", "Position_P_Gain", "Position_D_Gain", "Position_I_Gain", "Goal_PWM", "Profile_Velocity",
  "Profile_Acceleration", "P_Gain", "D_Gain", "I_Gain", "CW_Compliance_Slope", "CCW_Compliance_Slope"];

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const body = panel(root, "Registers");
  const loose = /** @type {Set<number>} */ (new Set()); // servos whose torque is off

  const show = () => {
    const those = bench.facts.map((facts, k) => ({ facts, k })).filter(({ facts }) => facts.registers || facts.loop);
    root.hidden = !those.length;
    body.replaceChildren(...those.map(({ facts, k }) => servo(facts, k)));
  };

  /** @param {any} facts @param {number} k */
  const servo = (facts, k) => {
    const loop = facts.loop;
    const rows = [...(facts.registers ?? [])].sort((a, b) => rank(a.name) - rank(b.name));
    return el("div", {}, bench.facts.length > 1 ? el("h3", { text: `${k + 1}: ${facts.title}` }) : null,
      loop ? el("p", { class: "stiffness" }, "The loop is a spring of ", el("strong", {
        text: `${plain(loop.stiffness_nm_per_rad, 3)} N m/rad` }), `${loop.cap_torque_nm === undefined ? "" : ` up to ${
        plain(1000 * loop.cap_torque_nm, 3)} mN m at an error of ${plain((loop.cap_error_rad * 180) / Math.PI, 3)}°`}.`) : null,
      el("label", { class: "tick" }, torque(k), " torque is on"),
      ...rows.map((one) => register(facts, one, k)));
  };

  /** @param {number} k @returns {HTMLInputElement} */
  const torque = (k) => {
    const input = el("input", { type: "checkbox", checked: !loose.has(k), "data-key": `${k} torque`, onchange: () => {
      if (input.checked) loose.delete(k); else loose.add(k);
      bench.tell({ do: "torque", value: input.checked, servo: k });
    } });
    return input;
  };

  /** @param {any} facts @param {any} one @param {number} k */
  const register = (facts, one, k) => {
    const id = unique();
    const numbers = one.numbers.map((/** @type {string} */ name) => facts.parameters.find((/** @type {any} */ p) => p.name === name))
      .filter((/** @type {any} */ p) => p && typeof p.value === "number")
      .map((/** @type {any} */ p) => `${p.symbol || p.meaning} = ${plain(p.value / p.shown.factor)} ${printed(p.shown.unit)}`);
    const input = el("input", { type: "number", id, min: one.low, max: one.high, step: 1, value: one.value, "data-key": `${k} ${one.name}`,
      onchange: async () => {
        const done = await bench.tell({ do: "register", value: { [one.name]: Number(input.value) }, servo: k });
        if (!done) input.value = one.value; // refused: it holds what it held
      } });
    return el("div", { class: "card" }, el("label", { for: id }, breakable(one.name), ` (${one.address})`), input,
      el("p", { class: "soft", text: `${one.low} to ${one.high}${numbers.length ? `; ${numbers.join(", ")}` : ""}` }));
  };

  bench.on("scene", (state) => {
    loose.clear();
    for (const [, on, servo] of state.scene.matchAll(/^ *\[[^,]+, "torque", (true|false)(?:, (\d+))?\]/gm)) {
      for (const k of servo === undefined ? bench.facts.keys() : [Number(servo)]) if (on === "true") loose.delete(k); else loose.add(k);
    }
    show();
  });
  bench.on("changed", () => anew(body, show));
}

/** @param {string} name @returns {number} */
function rank(name) {
  const at = FIRST.indexOf(name);
  return at < 0 ? FIRST.length : at;
}
