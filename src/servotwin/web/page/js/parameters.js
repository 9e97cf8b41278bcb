// Any parameter, by search: its symbol, unit, range, meaning and where its value comes from.

import { anew, breakable, choice, el, panel, unique } from "./dom.js";
import { plain, printed } from "./units.js";

const MOST = 12;

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const body = panel(root, "Any parameter");
  const id = unique();
  const search = el("input", { type: "search", id, placeholder: "such as inertia, K, deadband", oninput: () => show() });
  const which = choice("Of", [], () => show());
  const found = el("div", { class: "found" });
  const count = el("p", { class: "soft", "aria-live": "polite" });
  body.append(which.row, el("div", { class: "row" }, el("label", { for: id, text: "Search" }), search), count, found);

  const show = () => {
    const facts = bench.facts[Number(which.select.value)] ?? bench.facts[0];
    if (!facts) return;
    const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
    const fits = facts.parameters.filter((/** @type {any} */ one) => words.every((word) =>
      `${one.name} ${one.symbol} ${one.meaning}`.toLowerCase().includes(word)));
    fits.sort((/** @type {any} */ a, /** @type {any} */ b) => Number(b.read) - Number(a.read)
      || Number(b.value !== null) - Number(a.value !== null));
    count.textContent = fits.length > MOST ? `${fits.length} fit; the first ${MOST} are shown` : `${fits.length} fit`;
    found.replaceChildren(...fits.slice(0, MOST).map((/** @type {any} */ one) => card(one)));
  };

  /** @param {any} one */
  const card = (one) => {
    const field = unique();
    const servo = Number(which.select.value) || 0;
    /** @param {any} value */
    const set = (value) => bench.tell({ do: "set", value: { [one.name]: value }, servo });
    const { unit, factor } = one.shown;
    const value = Array.isArray(one.value) ? "a table" : one.choices ? one.value ?? ""
      : one.value === null ? "" : plain(one.value / factor, 6);
    const input = one.choices
      ? el("select", { id: field, "data-key": one.name, onchange: () => set(input.value) },
        ...one.choices.map((/** @type {string} */ word) => el("option", { value: word, text: word, selected: word === one.value })))
      : el("input", { id: field, "data-key": one.name, type: one.rule === "table" ? "text" : "number", step: "any", value, disabled: !one.read || one.rule === "table",
        onchange: async () => {
          if (input.value !== "" && !await set(Number(input.value) * factor)) input.value = value; // refused
        } });
    const spread = one.spread ? `, ${one.spread}` : "";
    return el("div", { class: "card" },
      el("label", { for: field }, breakable(one.name)), el("span", { class: "symbol", text: one.symbol }),
      el("span", { class: "typed" }, input, el("span", { class: "unit", text: printed(unit) })),
      el("p", {}, `${one.meaning}; ${one.rule}. `, el("span", { class: "soft", text: one.value === null ? "Not given."
        : `${one.origin}${spread}${one.source ? `: ${one.source}` : ""}` }),
      one.read ? "" : el("strong", { text: " This model does not read it." })));
  };

  bench.on("scene", () => {
    which.select.replaceChildren(...bench.facts.map((facts, k) => el("option", { value: k,
      text: `${k + 1}: ${facts.title}, ${facts.model}` })));
    show();
  });
  bench.on("changed", () => anew(found, show));
}
