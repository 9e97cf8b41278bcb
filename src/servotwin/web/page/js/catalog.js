// Which servos are on the bench: one, two beside each other, or up to six.

import { choice, el, panel, svg } from "./dom.js";
import { engineering, plain } from "./units.js";

const MOST = 6;

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const body = panel(root, "Servos");
  /** @type {any[]} */
  let all = [];
  /** @type {{id: string, model: string}[]} */
  let chosen = [];
  const rows = el("div");
  const picture = el("div", { class: "curves" });
  body.append(rows, el("div", { class: "row" },
    el("button", { text: "Add a servo", onclick: () => {
      if (chosen.length < MOST) chosen.push({ ...chosen[chosen.length - 1] });
      show();
    } }), el("button", { class: "primary", text: "Put on the bench", onclick: () => put() })), picture);

  const show = () => rows.replaceChildren(...chosen.map((one, k) => {
    const facts = all.find((servo) => servo.id === one.id);
    const servo = choice(`Servo ${k + 1}`, all.map((found) => [found.id, found.title]), (id) => {
      one.id = id;
      const models = all.find((found) => found.id === id)?.models ?? [];
      if (!models.includes(one.model)) one.model = models[models.length - 1];
      show();
      curves(id);
    });
    servo.select.value = one.id;
    const model = choice("computed as", (facts?.models ?? []).map((/** @type {string} */ name) => [name, name]),
      (name) => { one.model = name; });
    model.select.value = one.model;
    return el("div", { class: "pick" }, servo.row, model.row, chosen.length > 1 ? el("button", { text: "Remove",
      "aria-label": `Remove servo ${k + 1}`, onclick: () => { chosen.splice(k, 1); show(); } }) : null);
  }));

  const put = () => {
    const lines = ["format = 1"];
    for (const one of chosen) lines.push("[[servo]]", `id = "${one.id}"`, `model = "${one.model}"`);
    lines.push("[load]", "inertia = 1e-4");
    bench.tell({ scene: `${lines.join("\n")}\n` });
  };

  /** @param {string} id */
  const curves = async (id) => {
    const answer = await fetch(`/api/curves/${encodeURIComponent(id)}`);
    const found = await answer.json();
    if (!answer.ok) { picture.replaceChildren(el("p", { class: "soft", text: found.error })); return; }
    const servo = all.find((one) => one.id === id);
    picture.replaceChildren(el("h3", { text: `${servo.title} at full drive, ${plain(found.voltage)} V` }),
      chart(found.speed, found.torque, "torque", "N m"), chart(found.speed, found.current, "current", "A"),
      el("p", { class: "soft", text: `${(1000 * servo.mass_kg).toFixed(0)} g; stalls at ${
        engineering(Math.max(...found.torque), "N m", 3)}, turns 60° in ${engineering(Math.PI / 3 / Math.max(...found.speed), "s", 3)}` }));
  };

  bench.on("scene", async () => {
    if (!all.length) all = await (await fetch("/api/catalog")).json();
    chosen = bench.facts.map((facts) => ({ id: all.some((one) => one.id === facts.id) ? facts.id : all[0].id, model: facts.model }));
    show();
    if (chosen.length) curves(chosen[0].id);
  });
}

/** @param {number[]} x @param {number[]} y @param {string} name @param {string} unit */
function chart(x, y, name, unit) {
  const [w, h, left, low] = [250, 96, 40, 22];
  const [most, top] = [Math.max(...x), Math.max(...y)];
  const path = x.map((value, k) => `${k ? "L" : "M"}${(left + (value / most) * (w - left - 8)).toFixed(1)} ${
    (h - low - (y[k] / top) * (h - low - 8)).toFixed(1)}`).join("");
  const label = (/** @type {number} */ px, /** @type {number} */ py, /** @type {string} */ text, anchor = "middle") =>
    svg("text", { x: px, y: py, "text-anchor": anchor, text });
  return svg("svg", { class: "curve", viewBox: `0 0 ${w} ${h}`, role: "img",
    "aria-label": `${name} over speed: ${plain(y[0], 3)} ${unit} at rest, ${plain(y[y.length - 1], 3)} ${unit} at ${plain(most, 3)} rad/s` },
  svg("path", { class: "axis", d: `M${left} 6V${h - low}H${w - 6}` }), svg("path", { class: "line", d: path }),
  label(left - 4, 14, plain(top, 2), "end"), label(left - 4, h - low, "0", "end"), label(w - 8, h - 8, `${plain(most, 2)} rad/s`, "end"),
  label(left + 4, 14, `${name} [${unit}]`, "start"));
}
