// What the drawings show, as a sentence that is spoken and as a table.

import { el } from "./dom.js";
import { lowestSupply, meanCurrent, moves } from "./moves.js";
import { fullName, shortNames } from "./names.js";
import { SHOWN, engineering, shown } from "./units.js";

const ROWS = 20;
const LATEST = 2; // s of the table
const RECENT = 10; // s in which the supply is looked at
const NAMES = ["command_angle", "output_angle", "output_speed", "load_torque", "armature_current", "bus_voltage"];

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const said = el("p", { "aria-live": "polite", class: "said" });
  const table = el("table");
  const body = el("details", { class: "more", ontoggle: () => fill() }, el("summary", { text: "Table of the last two seconds" }),
    el("button", { text: "Bring it up to date", onclick: () => fill() }),
    el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "table of the last two seconds" }, table));
  root.append(el("div", { class: "head" }, el("h2", { text: "In words" }), el("button", { text: "Say what is shown", onclick: () => {
    said.textContent = bench.facts.map((_, k) => sentence(bench, k)).join(" ");
  } })), said, body);

  const fill = () => {
    if (!(/** @type {HTMLDetailsElement} */ (body)).open) return;
    const columns = bench.facts.flatMap((facts, k) => NAMES.filter((name) => facts.columns.includes(name))
      .map((name) => ({ k, name })));
    const seen = bench.history[0];
    const called = shortNames(bench.facts);
    const rows = [];
    const end = bench.time;
    for (let n = 0; n < ROWS && seen?.length; n += 1) {
      const time = Math.max(0, end - LATEST + ((n + 1) * LATEST) / ROWS);
      rows.push(el("tr", {}, el("th", { scope: "row", text: time.toFixed(3) }), ...columns.map(({ k, name }) => {
        const history = bench.history[k];
        const at = Math.min(history.at(time), history.length - 1);
        return el("td", { text: shown(name, history.value(name, at)).toPrecision(4) });
      })));
    }
    table.replaceChildren(
      el("caption", { text: "What the traces show" }),
      el("thead", {}, el("tr", {}, el("th", { scope: "col", text: "time [s]" }), ...columns.map(({ k, name }) => el("th", {
        scope: "col", text: `${SHOWN[name][2]}${called[k] && `, ${called[k]}`} [${SHOWN[name][0]}]` })))),
      el("tbody", {}, ...rows));
  };
}

/**
 * What a servo does, in a sentence.
 * @param {import("./bench.js").Bench} bench
 * @param {number} k
 * @returns {string}
 */
export function sentence(bench, k) {
  const seen = bench.history[k];
  if (!seen?.length) return "";
  const degrees = (/** @type {string} */ name) => (180 / Math.PI) * seen.latest(name);
  const angle = degrees("output_angle");
  const error = degrees("command_angle") - angle;
  const fell = lowestSupply(bench, k, Math.max(0, bench.time - RECENT), bench.time);
  const off = Number.isFinite(error) ? `, ${Math.abs(error).toFixed(2)} degrees ${error > 0 ? "below" : "above"} its command` : "";
  return `${fullName(bench.facts[k])}, ${moves(bench, k).replace("°", " degrees")} at ${angle.toFixed(1)} degrees${off}, with ${
    engineering(meanCurrent(bench, k), "A", 3)} on average.${fell && ` Its supply: ${fell}.`}`;
}
