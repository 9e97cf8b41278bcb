// Which servos are on the bench: one, two beside each other, or up to six.

import { choice, el, panel, svg, unique } from "./dom.js";
import { engineering, plain } from "./units.js";

const MOST = 6;

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const body = panel(root, "Servos");
  /** @type {any[]} */
  let all = [];
  /** @type {{id: string, keep: number|null, models: string[], model: string}[]} keep: its number, of one that is no servo of the catalog */
  let chosen = [];
  const rows = el("div");
  const picture = el("div", { class: "curves" });
  const id = unique();
  const together = el("input", { type: "checkbox", id, onchange: () => { weak.hidden = !together.checked; } });
  const number = (/** @type {string} */ label, /** @type {string} */ unit, /** @type {number} */ value) => {
    const field = unique();
    const input = el("input", { type: "number", id: field, step: "any", min: 0, value });
    return { input, row: el("div", { class: "row" }, el("label", { for: field, text: label }), input, el("span", { class: "unit", text: unit })) };
  };
  const volts = number("Voltage", "V", 6);
  const ohms = number("Internal resistance", "Ω", 0.5);
  const weak = el("div", { hidden: true }, volts.row, ohms.row);
  body.append(rows, el("label", { class: "tick", for: id }, together, " one battery for all of them"), weak,
    el("div", { class: "row" }, el("button", { text: "Add a servo", onclick: () => {
      if (chosen.length < MOST) chosen.push({ ...chosen[chosen.length - 1] });
      show();
    } }), el("button", { class: "primary", text: "Put on the bench", onclick: () => put() })), picture);

  const show = () => rows.replaceChildren(...chosen.map((one, k) => {
    const kept = bench.facts[one.keep ?? -1];
    const servo = choice(`Servo ${k + 1}`, [...(kept ? /** @type {[string, string][]} */ ([["", kept.title]]) : []),
      ...all.map((found) => /** @type {[string, string]} */ ([found.id, found.title]))], (id) => {
      const found = all.find((other) => other.id === id);
      [one.id, one.models] = [id, found ? found.models : kept.models];
      if (!one.models.includes(one.model)) one.model = one.models[one.models.length - 1];
      show();
      curves(id);
    });
    servo.select.value = one.id;
    const model = choice("computed as", one.models.map((name) => /** @type {[string, string]} */ ([name, name])), (name) => { one.model = name; });
    model.select.value = one.model;
    return el("div", { class: "pick" }, servo.row, model.row, chosen.length > 1 ? el("button", { text: "Remove",
      "aria-label": `Remove servo ${k + 1}`, onclick: () => { chosen.splice(k, 1); show(); } }) : null);
  }));

  const put = () => bench.tell({
    servos: chosen.map((one) => (one.id ? { id: one.id, model: one.model } : { keep: one.keep, model: one.model })),
    supply: together.checked ? { open_circuit_voltage: Number(volts.input.value), internal_resistance: Number(ohms.input.value) } : null });

  /** @param {string} id */
  const curves = async (id) => {
    if (!id) { picture.replaceChildren(); return; }
    const answer = await fetch(`/api/curves/${encodeURIComponent(id)}`);
    const found = await answer.json();
    if (!answer.ok) { picture.replaceChildren(el("p", { class: "soft", text: found.error })); return; }
    const servo = all.find((one) => one.id === id);
    picture.replaceChildren(el("h3", { text: `${servo.title} at full drive, ${plain(found.voltage)} V` }),
      chart(found.speed, found.torque, found.current),
      el("p", { class: "soft", text: `${(1000 * servo.mass_kg).toFixed(0)} g; stalls at ${
        engineering(Math.max(...found.torque), "N m", 3)}, turns 60° in ${engineering(Math.PI / 3 / Math.max(...found.speed), "s", 3)}` }));
  };

  bench.on("scene", async (state) => {
    if (!all.length) all = await (await fetch("/api/catalog")).json();
    chosen = bench.facts.map((facts, k) => (state.of_catalog[k] ? { id: state.of_catalog[k], keep: null, models: facts.models, model: facts.model }
      : { id: "", keep: k, models: facts.models, model: facts.model }));
    together.checked = Boolean(state.supply);
    weak.hidden = !together.checked;
    volts.input.value = String(state.supply?.open_circuit_voltage ?? 6);
    ohms.input.value = String(state.supply?.internal_resistance ?? 0.5);
    show();
    if (chosen.length) curves(chosen[0].id);
  });
}

/**
 * Two curves over speed in one picture, each with an axis of its own.
 * @param {number[]} x [rad/s]
 * @param {number[]} torque [N m]
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
    plain(torque[0], 3)} N m at rest, none at ${plain(most, 3)} rad/s; current: ${plain(current[0], 3)} A at rest, ${
    plain(current[current.length - 1], 3)} A at ${plain(most, 3)} rad/s` },
  ...[0.25, 0.5, 0.75, 1].map((share) => svg("path", { class: "rule", d: `M${left} ${py(share)}H${w - right}` })),
  svg("path", { class: "axis", d: `M${left} ${top - 4}V${h - low}H${w - right}V${top - 4}` }),
  svg("path", { class: "line", d: path(torque, strong) }), svg("path", { class: "line second", d: path(current, ampere) }),
  ...[0, 0.5, 1].flatMap((share) => [label(left - 5, py(share) + 4, plain(share * strong, 2), "end"),
    label(w - right + 5, py(share) + 4, plain(share * ampere, 2), "start")]),
  label(2, 11, "torque [N m]", "start"), label(w - 2, 11, "current [A], dashed", "end"),
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
