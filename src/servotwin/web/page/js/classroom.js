// A class: the code on the teacher's screen, and the door for those who watch.

import { el, unique } from "./dom.js";

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const place = el("section", { class: "panel class-panel", hidden: true });
  root.append(place);
  bench.on("hello", (hello) => {
    document.body.classList.toggle("watches", hello.role === "watcher");
    place.hidden = hello.role === "own";
    if (hello.role === "teacher") place.replaceChildren(el("p", {}, "Others watch at ", el("code", { text: `${location.origin}/` }),
      " with the code ", el("strong", { class: "code", text: hello.code })));
    else if (hello.role === "watcher") place.replaceChildren(el("p", { text: "You watch: the teacher steers this bench." }));
  });
  bench.on("locked", (reason) => {
    place.hidden = false;
    document.body.classList.add("locked");
    const said = new URLSearchParams(location.search).has("code");
    const id = unique();
    const code = el("input", { type: "text", id, autocomplete: "off", autocapitalize: "none" });
    place.replaceChildren(el("form", { onsubmit: (/** @type {Event} */ event) => {
      event.preventDefault();
      location.search = `?code=${encodeURIComponent(code.value.trim().toLowerCase())}`;
    } }, el("p", { text: said && reason ? reason : "This bench belongs to a class: its teacher steers, and you watch." }), el("label", { for: id, text: "Code on the teacher's screen" }),
    code, el("button", { class: "primary", text: "Watch" })));
    code.focus();
  });
}
