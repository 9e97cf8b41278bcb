// A servo whose numbers are hidden: measure, fit or guess, and compare.

import { breakable, el, panel, unique } from "./dom.js";
import { plain, printed } from "./units.js";

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const body = panel(root, "Mystery servo");
  const id = unique();
  const seed = el("input", { type: "number", id, min: 0, step: 1, value: 7 });
  const place = el("div");
  body.append(el("p", { text: "Some of its numbers are hidden behind a seed. Measure it, and find out." }),
    el("div", { class: "row" }, el("label", { for: id, text: "Seed" }), seed, el("button", { text: "Begin", onclick: () => {
      history.replaceState(null, "", `${location.pathname}${location.search}#mystery=${seed.value}`);
      bench.tell({ mystery: Number(seed.value) });
    } })), place);

  /** @type {any[]} */
  let fields = [];
  bench.on("guess", (guess) => {
    for (const { one, input } of fields) if (one.name in guess) input.value = plain(guess[one.name] / one.shown.factor, 6);
    fields[0]?.input.focus();
  });
  bench.on("scene", (state) => {
    const unknowns = state.unknowns ?? [];
    place.replaceChildren();
    fields = [];
    if (!unknowns.length) { body.append(place); return; }
    beside(place);
    const said = el("div", { "aria-live": "polite" });
    fields = unknowns.map((/** @type {any} */ one) => {
      const field = unique();
      const input = el("input", { type: "number", id: field, step: "any" });
      return { one, input, row: el("div", { class: "card" }, el("label", { for: field }, breakable(one.name)),
        el("span", { class: "typed" }, input, el("span", { class: "unit", text: printed(one.shown.unit) })),
        el("p", { class: "soft", text: `${one.meaning}, between ${inUnit(one, one.low)} and ${inUnit(one, one.high)} ${printed(one.shown.unit)}` })) };
    });
    place.append(...fields.map((/** @type {any} */ field) => field.row), el("button", { class: "primary", text: "Compare with the truth",
      onclick: async () => {
        const guess = Object.fromEntries(fields.filter((/** @type {any} */ field) => field.input.value !== "")
          .map((/** @type {any} */ field) => [field.one.name, Number(field.input.value) * field.one.shown.factor]));
        const found = await bench.tell({ guess });
        if (found) {
          said.replaceChildren(el("table", {}, el("caption", { text: "Your guess and the truth" }), el("tbody", {},
            ...found.compared.map((/** @type {any} */ row, /** @type {number} */ k) => el("tr", {}, el("th", { scope: "row", text: row.name }),
              el("td", { text: row.guess === null ? "–" : inUnit(unknowns[k], row.guess, 4) }), el("td", { text: row.truth === null ? "?" : inUnit(unknowns[k], row.truth, 4) }),
              el("td", { text: printed(unknowns[k].shown.unit) }), el("td", { text: row.error === null ? "" : `${(100 * row.error).toFixed(1)} %` }), el("td", { text: row.said }))))));
        }
      } }), said);
  });
}

/**
 * Put what is to be found out where a lesson stands, beside the horn.
 * @param {HTMLElement} place
 */
function beside(place) {
  const panel = /** @type {HTMLElement} */ (document.querySelector(".lesson-panel"));
  panel.hidden = false;
  document.body.classList.add("teaches");
  panel.firstElementChild?.replaceChildren(el("h2", { text: "Mystery servo" }),
    el("p", { text: "Measure what it does, and find out these numbers." }), place);
}

/** @param {any} one what is hidden @param {number} value in SI @param {number} [digits] @returns {string} in the unit that is shown */
function inUnit(one, value, digits = 3) { return plain(value / one.shown.factor, digits); }
