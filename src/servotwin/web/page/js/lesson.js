// The lesson that the bench is set up for, beside the horn: what to look at, one question, and its answer.

import { el } from "./dom.js";

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  root.hidden = true;
  const place = el("div", { class: "lesson" });
  root.append(place);
  bench.on("scene", ({ lesson }) => {
    root.hidden = !lesson?.title;
    document.body.classList.toggle("teaches", !root.hidden);
    if (root.hidden) { place.replaceChildren(); return; }
    const answer = el("p", { class: "answer", hidden: true, text: lesson.answer });
    place.replaceChildren(el("h2", { text: lesson.title }), ...lesson.look.map((/** @type {string} */ line) => el("p", { text: line })),
      el("p", { class: "question" }, el("strong", { text: lesson.question })),
      el("button", { text: "Answer", onclick: () => { answer.hidden = false; } }), answer);
  });
}
