// What a fit found: verdict, numbers with intervals, what the log does not say, and taking it over to the bench.

import { breakable, el } from "./dom.js";
import { download } from "./exports.js";
import { plain } from "./units.js";

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  root.hidden = true;
  const place = el("div");
  root.append(el("h2", { text: "What the fit found" }), place);
  bench.on("fit", (found) => {
    if (found.state !== "done") return;
    root.hidden = false;
    place.replaceChildren(...shown(found, bench));
    bench.emit("fitted", found.overlay);
  });
  bench.on("brought", (found) => { if (!found) root.hidden = true; });
}

/**
 * What a fit found.
 * @param {any} found
 * @param {import("./bench.js").Bench} bench
 * @returns {HTMLElement[]}
 */
function shown(found, bench) {
  const heads = ["number", "value", `${100 * found.level} % interval`, "before"];
  const list = (/** @type {string[]} */ lines, cls = "soft") => lines.map((text) => el("p", { class: cls, text }));
  const off = `Off by ${plain(found.rms, 3)} ${found.unit} rms${found.held_out === null ? "" : `, and by ${plain(found.held_out, 3)} ${found.unit} on runs that it had not seen`}.`;
  return [
    el("p", { class: `verdict ${found.verdict?.holds ? "holds" : "lacks"}`, text: found.verdict ? `${capital(found.verdict.sentence)}.` : "No verdict: the fit was stopped." }),
    el("p", { text: off }),
    ...(found.causes.length ? [el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "what may be the matter" }, causeTable(found))] : []),
    el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "numbers that were found" }, el("table", {},
      el("caption", { text: "What was found" }), el("thead", {}, el("tr", {}, ...heads.map((text) => el("th", { scope: "col", text })))),
      el("tbody", {}, ...found.estimates.map((/** @type {any} */ one) => el("tr", {}, el("th", { scope: "row" }, breakable(one.name)),
        el("td", { text: `${one.value} ${one.unit}` }), el("td", { text: one.interval }), el("td", { text: one.before })))))),
    ...list(found.open), ...list(found.at_bound.map((/** @type {string} */ name) => `${name} ended at a bound of the search`)),
    ...list(found.warnings), ...list(found.notes),
    el("div", { class: "buttons" },
      el("button", { class: "primary", text: "Take over beside", onclick: () => bench.tell({ fit: { take: "beside" } }) }),
      el("button", { text: "Take over instead", onclick: () => bench.tell({ fit: { take: "instead" } }) }),
      el("button", { text: "Fitted servo file", onclick: () => download(found.name, new Blob([found.file], { type: "application/toml" })) }),
      ...(bench.state.unknowns?.length ? [el("button", { text: "Use as my guess", onclick: () => bench.emit("guess", found.guess) })] : []))];
}

/** @param {any} found @returns {HTMLElement} causes that were tried, the best first */
function causeTable(found) {
  const heads = ["what may be the matter", `error [${found.unit}]`, "with it", "what to do"];
  return el("table", {}, el("caption", { text: "What may be the matter, the likeliest first" }),
    el("thead", {}, el("tr", {}, ...heads.map((text) => el("th", { scope: "col", text })))),
    el("tbody", {}, ...found.causes.map((/** @type {any} */ one) => el("tr", {}, el("th", { scope: "row", text: one.name }),
      el("td", { text: plain(one.before, 3) }), el("td", { text: plain(one.after, 3) }), el("td", { text: one.remedy })))));
}

/** @param {string} text @returns {string} */
export function capital(text) {
  return text.charAt(0).toUpperCase() + text.slice(1);
}
