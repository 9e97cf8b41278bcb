// Time: run and pause, how fast it shall go, how fast it really goes, and single frames.

import { el, unique } from "./dom.js";
import { engineering } from "./units.js";

const SPEEDS = /** @type {[string, string][]} */ ([
  ["unpaced", "as fast as it can"], ["10", "10 times"], ["2", "2 times"], ["1", "real time"], ["0.5", "1/2"], ["0.1", "1/10"],
  ["0.01", "1/100"], ["0.001", "1/1000"], ["0.0001", "1/10 000"], ["0.000001", "a millionth"]]);

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const run = el("button", { class: "primary", text: "Pause", "aria-keyshortcuts": "Space",
    onclick: () => bench.tell({ run: !bench.running }) });
  const step = el("button", { text: "One frame", title: "Go on by one frame of the transmitter, and stand",
    onclick: () => bench.tell({ step: true }) });
  const anew = el("button", { text: "Start anew", onclick: () => bench.tell({ reset: true }) });
  const id = unique();
  const speed = el("select", { id, onchange: () => bench.tell({
    speed: speed.value === "unpaced" ? "unpaced" : Number(speed.value) }) },
  ...SPEEDS.map(([value, text]) => el("option", { value, text })));
  speed.value = "1";
  const time = el("output", { class: "time", "aria-label": "bench time" });
  const pace = el("span", { class: "pace" });
  root.append(run, step, anew, el("label", { for: id, text: "Speed" }), speed, time, pace);

  bench.on("push", (header) => {
    run.textContent = header.running ? "Pause" : "Run";
    time.textContent = `${header.t.toFixed(header.speed < 0.01 ? 6 : 3)} s`;
    const asked = header.speed === "unpaced" ? Infinity : header.speed;
    if (header.replaying !== null) pace.textContent = `repeating ${Math.round(100 * header.replaying)} %`;
    else if (!header.running) pace.textContent = "stands";
    else if (header.behind || (asked !== Infinity && header.pace < 0.97 * asked && header.t > 2 * asked)) {
      pace.textContent = `cannot keep up: ${engineering(header.pace, "s", 2)} in a second`;
    } else pace.textContent = asked === 1 ? "real time" : `${engineering(header.pace, "s", 2)} in a second`;
    pace.classList.toggle("late", header.behind);
    const value = String(header.speed);
    if (document.activeElement !== speed && [...speed.options].some((one) => Number(one.value) === Number(value))) {
      speed.value = [...speed.options].find((one) => Number(one.value) === Number(value))?.value ?? "1";
    } else if (value === "unpaced") speed.value = value;
  });
  document.addEventListener("keydown", (event) => {
    const into = /** @type {HTMLElement} */ (event.target);
    if (event.key !== " " || into.closest("input,select,textarea,button,summary,[role=slider],a")) return;
    event.preventDefault();
    bench.tell({ run: !bench.running });
  });
}
