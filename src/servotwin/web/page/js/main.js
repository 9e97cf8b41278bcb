// The page: every panel is a file.

import { Bench } from "./bench.js";
import { el } from "./dom.js";
import * as catalog from "./catalog.js";
import * as circuit from "./circuit.js";
import * as classroom from "./classroom.js";
import * as clock from "./clock.js";
import * as command from "./command.js";
import * as controls from "./controls.js";
import * as exports from "./exports.js";
import * as fit from "./fit.js";
import * as fitFound from "./fit_found.js";
import * as horn from "./horn.js";
import * as kept from "./kept.js";
import * as lcd from "./lcd.js";
import * as lesson from "./lesson.js";
import * as lessons from "./lessons.js";
import * as log from "./log.js";
import * as logDraw from "./log_draw.js";
import * as mystery from "./mystery.js";
import * as parameters from "./parameters.js";
import * as registers from "./registers.js";
import * as scope from "./scope.js";
import * as summary from "./summary.js";
import * as theme from "./theme.js";
import * as traces from "./traces.js";

const SIDE = /** @type {[string, {mount: (root: HTMLElement, bench: Bench) => void}][]} */ ([
  ["command", command], ["load", controls], ["circuit", circuit], ["registers", registers], ["any", parameters], ["servos", catalog],
  ["lessons", lessons], ["mystery", mystery], ["own", log], ["fit", fit], ["files", exports]]);
const INSTRUMENTS = /** @type {[string, {mount: (root: HTMLElement, bench: Bench) => void}][]} */ ([
  ["lesson", lesson], ["horn", horn], ["lcd", lcd], ["scope", scope], ["traces", traces], ["log", logDraw], ["found", fitFound], ["words", summary]]);

/** @param {string} id @returns {HTMLElement} */
const place = (id) => /** @type {HTMLElement} */ (document.getElementById(id));

const bench = new Bench();
clock.mount(place("clock"), bench);
theme.mount(place("theme"), bench);
classroom.mount(place("instruments"), bench);
const left = el("div", { class: "left" });
for (const [name, one] of INSTRUMENTS) {
  const section = el("section", { class: `panel ${name}-panel` });
  if (name === "horn") place("instruments").append(left); // behind the lesson, which comes first on a phone
  (name === "horn" || name === "lcd" ? left : place("instruments")).append(section);
  one.mount(section, bench);
}
for (const [name, one] of SIDE) {
  const section = el("section", { class: `side ${name}` });
  place("controls").append(section);
  one.mount(section, bench);
}

// On a phone the slider stands right under the horn, in the order of the keys too.
const narrow = window.matchMedia("(max-width: 46rem)");
const settle = () => {
  const told = /** @type {HTMLElement} */ (document.querySelector(".side.command"));
  if (narrow.matches) {
    document.querySelector(".horn-panel")?.after(told);
    place("columns").append(place("controls"));
  } else {
    place("controls").prepend(told);
    place("columns").prepend(place("controls"));
  }
};
narrow.addEventListener("change", settle);
settle();

kept.mount(bench);
const why = el("p");
const alone = el("details", { class: "alone-says soft", hidden: true }, el("summary", { text: "Computes here" }), why);
place("theme").before(alone);
bench.on("hello", (hello) => { // the page as one file, which has no server
  document.body.classList.toggle("alone", Boolean(hello.alone));
  alone.hidden = !hello.alone;
  why.textContent = hello.alone ?? "";
});

const notice = place("notice");
let quiet = 0;
bench.on("said", (line) => {
  notice.hidden = false;
  notice.textContent = line;
  clearTimeout(quiet);
  quiet = window.setTimeout(() => { notice.hidden = true; }, 8000);
});
bench.on("scene", () => {
  if (notice.textContent?.endsWith(" is being set up.")) notice.hidden = true;
  document.body.classList.add("ready");
  document.body.classList.toggle("many", bench.facts.length > 2);
});
setInterval(() => { if (bench.header?.running) bench.keep(); }, 5000);
addEventListener("hashchange", () => { if (bench.role !== "watcher") bench.begin(); }); // a link that is pasted into the open page
bench.open();
Object.assign(window, { bench });
