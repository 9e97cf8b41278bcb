// The lessons: a list of them.

import { el, panel } from "./dom.js";

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const body = panel(root, "Lessons");
  const list = el("ol", { class: "list" });
  body.append(list);
  bench.on("hello", (hello) => {
    list.replaceChildren(...hello.lessons.map((/** @type {any} */ one) => el("li", {}, el("a", {
      href: `#lesson=${one.name}`, text: one.title, onclick: (/** @type {Event} */ event) => {
        event.preventDefault();
        history.replaceState(null, "", `${location.pathname}${location.search}#lesson=${one.name}`);
        bench.setUp(`lesson ${one.title}`);
        bench.tell({ lesson: one.name });
      } }))));
  });
}
