// Light or dark: as the system has it, or as one likes.

import { el } from "./dom.js";

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const own = document.documentElement;
  const button = el("button", { onclick: () => {
    own.dataset.theme = isDark() ? "light" : "dark";
    said();
  } });
  const isDark = () => (own.dataset.theme ? own.dataset.theme === "dark" : dark.matches);
  const said = () => {
    button.textContent = isDark() ? "Light" : "Dark";
    button.setAttribute("aria-label", `${button.textContent} colours`);
    bench.emit("theme");
  };
  let screen = own.dataset.theme;
  addEventListener("beforeprint", () => { // paper is white
    [screen, own.dataset.theme] = [own.dataset.theme, "light"];
    bench.emit("theme");
  });
  addEventListener("afterprint", () => {
    if (screen) own.dataset.theme = screen;
    else delete own.dataset.theme;
    bench.emit("theme");
  });
  dark.addEventListener("change", said);
  root.append(button);
  said();
}
