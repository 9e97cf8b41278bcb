// The lessons: what to look at, one question, and its answer.

import { el, panel } from "./dom.js";

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const body = panel(root, "Lessons");
  const list = el("ol", { class: "list" });
  const now = el("div", { class: "lesson", hidden: true });
  body.append(list, now);
  bench.on("hello", (hello) => {
    list.replaceChildren(...hello.lessons.map((/** @type {any} */ one) => el("li", {}, el("a", {
      href: `#lesson=${one.name}`, text: one.title, onclick: (/** @type {Event} */ event) => {
        event.preventDefault();
        history.replaceState(null, "", `${location.pathname}${location.search}#lesson=${one.name}`);
        bench.tell({ lesson: one.name });
      } }))));
  });
  bench.on("scene", (state) => {
    const lesson = state.lesson;
    now.hidden = !lesson?.title;
    if (!lesson?.title) return;
    /** @type {HTMLDetailsElement} */ (body.parentElement).open = true;
    const answer = el("p", { class: "answer", hidden: true, text: lesson.answer });
    now.replaceChildren(el("h3", { text: lesson.title }), ...lesson.look.map((/** @type {string} */ line) => el("p", { text: line })),
      el("p", { class: "question" }, el("strong", { text: lesson.question })),
      el("button", { text: "Answer", onclick: () => { answer.hidden = false; } }), answer);
  });
}
