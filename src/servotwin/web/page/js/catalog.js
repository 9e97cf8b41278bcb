// Which servos are on the bench: one, two beside each other, or up to six.

import { choice, el, panel, svg, unique } from "./dom.js";
import { asked } from "./line.js";
import { engineering, plain } from "./units.js";

const MOST = 6;

/** @typedef {{id: string, title: string, models: string[], keep?: number}} Offered what may be chosen: of the catalog, or as it stands here */

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const body = panel(root, "Servos");
  /** @type {any[]} */
  let all = [];
  /** @type {Offered[]} servos of the bench that the catalog does not have: one's own, or a mystery */
  let own = [];
  /** @type {{id: string, model: string}[]} */
  let chosen = [];
  const rows = el("div");
  const picture = el("div", { class: "curves" });
  const shared = el("input", { type: "checkbox", onchange: () => { fields.hidden = !shared.checked; } });
  const [volts, ohms] = [number("Voltage without load", "V", 6), number("Resistance of its leads", "Ω", 0.5)];
  const fields = el("div", { hidden: true }, volts.row, ohms.row);
  body.append(rows, el("div", { class: "buttons" }, el("button", { text: "Add a servo", onclick: () => {
    if (chosen.length >= MOST) { bench.notice(`${MOST} servos are all that the bench has room for`); return; }
    chosen.push({ ...chosen[chosen.length - 1] });
    show();
  } })), el("label", { class: "tick" }, shared, " All on one battery"), fields, el("div", { class: "buttons" },
    el("button", { class: "primary", text: "Put on the bench", onclick: () => put() })), picture);

  const offered = () => /** @type {Offered[]} */ ([...own, ...all]);
  const show = () => rows.replaceChildren(...chosen.map((one, k) => {
    const facts = offered().find((servo) => servo.id === one.id);
    const servo = choice(`Servo ${k + 1}`, offered().map((found) => [found.id, found.title]), (id) => {
      one.id = id;
      const models = offered().find((found) => found.id === id)?.models ?? [];
      if (!models.includes(one.model)) one.model = models[models.length - 1];
      show();
      curves(id);
      rows.querySelectorAll("select")[2 * k]?.focus();
    });
    servo.select.value = one.id;
    const model = choice("Computed as", (facts?.models ?? []).map((name) => [name, name]), (name) => { one.model = name; });
    model.select.value = one.model;
    return el("div", { class: "pick" }, servo.row, model.row, chosen.length > 1 ? el("button", { text: "Remove",
      "aria-label": `Remove servo ${k + 1}`, onclick: () => { chosen.splice(k, 1); show(); } }) : null);
  }));

  const put = () => bench.tell({ servos: chosen.map(({ id, model }) => {
    const keep = offered().find((one) => one.id === id)?.keep;
    return keep === undefined ? { id, model } : { keep, model };
  }), supply: shared.checked ? { open_circuit_voltage: volts.value(), internal_resistance: ohms.value() } : null });

  /** @param {string} id */
  const curves = async (id) => {
    if (own.some((one) => one.id === id)) { picture.replaceChildren(); return; }
    /** @type {any} */
    let found;
    try {
      found = await asked("curves", id);
    } catch (error) {
      picture.replaceChildren(el("p", { class: "soft", text: error instanceof Error ? error.message : String(error) }));
      return;
    }
    const servo = all.find((one) => one.id === id);
    picture.replaceChildren(el("h3", { text: `${servo.title} at full drive, ${plain(found.voltage)} V` }),
      chart(found.speed, found.torque.map((/** @type {number} */ one) => 1000 * one), found.current),
      el("p", { class: "soft", text: `${(1000 * servo.mass_kg).toFixed(0)} g; stalls at ${
        plain(1000 * Math.max(...found.torque), 3)} mN m, turns 60° in ${engineering(Math.PI / 3 / Math.max(...found.speed), "s", 3)}` }));
  };

  bench.on("scene", async () => {
    if (!all.length) all = await asked("catalog");
    const state = bench.state; // of now: it may have changed meanwhile
    own = bench.facts.flatMap((facts, keep) => (state.of_catalog[keep] ? []
      : [{ id: `here ${keep}`, title: `${facts.title} (here)`, models: facts.models, keep }]));
    chosen = bench.facts.map((facts, k) => ({ id: state.of_catalog[k] || `here ${k}`, model: facts.model }));
    shared.checked = Boolean(state.supply);
    fields.hidden = !state.supply;
    if (state.supply?.open_circuit_voltage !== undefined) volts.set(state.supply.open_circuit_voltage);
    if (state.supply?.internal_resistance !== undefined) ohms.set(state.supply.internal_resistance);
    show();
    if (chosen.length) curves(chosen[0].id);
  });
}

/** @param {string} label @param {string} unit @param {number} first */
function number(label, unit, first) {
  const id = unique();
  const input = el("input", { type: "number", id, step: "any", min: 0, value: first });
  return { row: el("div", { class: "field" }, el("label", { for: id, text: label }), input, el("span", { class: "unit", text: unit })),
    value: () => Number(input.value), set: (/** @type {number} */ to) => { input.value = plain(to); } };
}

/**
 * Two curves over speed in one picture, each with an axis of its own.
 * @param {number[]} x [rad/s]
 * @param {number[]} torque [mN m]
 * @param {number[]} current [A]
 */
function chart(x, torque, current) {
  const [w, h, left, right, top, low] = [280, 170, 40, 36, 22, 34];
  const most = Math.max(...x);
  const [strong, ampere] = [round(Math.max(...torque)), round(Math.max(...current))];
  const px = (/** @type {number} */ value) => left + (value / most) * (w - left - right);
  const py = (/** @type {number} */ share) => h - low - share * (h - low - top);
  const path = (/** @type {number[]} */ y, /** @type {number} */ greatest) => x.map((value, k) =>
    `${k ? "L" : "M"}${px(value).toFixed(1)} ${py(y[k] / greatest).toFixed(1)}`).join("");
  const label = (/** @type {number} */ at, /** @type {number} */ y, /** @type {string} */ text, anchor = "middle") =>
    svg("text", { x: at, y, "text-anchor": anchor, text });
  const last = Math.floor(most / nice(most)) * nice(most);
  return svg("svg", { class: "curve", viewBox: `0 0 ${w} ${h}`, role: "img", "aria-label": `torque over speed: ${
    plain(torque[0], 3)} mN m at rest, none at ${plain(most, 3)} rad/s; current: ${plain(current[0], 3)} A at rest, ${
    plain(current[current.length - 1], 3)} A at ${plain(most, 3)} rad/s` },
  ...[0.25, 0.5, 0.75, 1].map((share) => svg("path", { class: "rule", d: `M${left} ${py(share)}H${w - right}` })),
  svg("path", { class: "axis", d: `M${left} ${top - 4}V${h - low}H${w - right}V${top - 4}` }),
  svg("path", { class: "line", d: path(torque, strong) }), svg("path", { class: "line second", d: path(current, ampere) }),
  ...[0, 0.5, 1].flatMap((share) => [label(left - 5, py(share) + 4, plain(share * strong, 2), "end"),
    label(w - right + 5, py(share) + 4, plain(share * ampere, 2), "start")]),
  label(2, 11, "torque [mN m]", "start"), label(w - 2, 11, "current [A], dashed", "end"),
  ...[0, last / 2, last].map((value) => label(px(value), h - low + 14, plain(value, 2))), label((left + w - right) / 2, h - 4, "speed [rad/s]"));
}

/** @param {number} most @returns {number} a round step, of which two to four fit */
function nice(most) {
  const power = 10 ** Math.floor(Math.log10(most / 2));
  return ([5, 2, 1].find((one) => one * power <= most / 2) ?? 1) * power;
}

/** @param {number} most @returns {number} the next round number that is not less */
function round(most) {
  const power = 10 ** Math.floor(Math.log10(most));
  return ([1, 1.2, 1.6, 2, 3, 4, 5, 6, 8, 10].find((one) => one * power >= most) ?? 10) * power;
}
