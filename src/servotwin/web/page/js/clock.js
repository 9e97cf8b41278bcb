// Time: run and pause, how fast it shall go, how fast it really goes, and single frames.

import { READABLE, el, paced, unique } from "./dom.js";
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
  const time = el("span", { class: "time", role: "timer", "aria-label": "bench time" });
  const pace = el("span", { class: "pace" });
  /** @type {import("./bench.js").Header} */
  let header;
  root.append(run, step, anew, el("span", { class: "pair" }, el("label", { for: id, text: "Speed" }), speed), time, pace);

  const asked = () => (header.speed === "unpaced" ? Infinity : Number(header.speed));
  const says = () => {
    if (header.replaying !== null) return `repeating ${Math.round(100 * header.replaying)} %`;
    if (!header.running) return "stands";
    const second = `${engineering(header.pace, "s", 2)} in a second`;
    if (header.behind || (asked() !== Infinity && header.pace < 0.97 * asked() && header.t > 2 * asked())) return `only ${second}`; // cannot keep up
    return asked() === 1 ? "real time" : second;
  };
  const draw = paced(() => {
    run.textContent = header.running ? "Pause" : "Run";
    time.textContent = `${header.t.toFixed(asked() >= 0.01 ? 3 : 6)} s`;
    pace.textContent = pace.title = says();
    pace.classList.toggle("late", header.behind);
    const value = [...speed.options].find((one) => one.value === String(header.speed) || Number(one.value) === Number(header.speed))?.value;
    if (document.activeElement !== speed && value !== undefined) speed.value = value;
  }, READABLE);
  bench.on("push", (found) => { header = found; draw(); });
  document.addEventListener("keydown", (event) => {
    const into = event.target instanceof Element ? event.target : document.body;
    if (event.key !== " " || into.closest("input,select,textarea,button,summary,[role=slider],a")) return;
    event.preventDefault();
    bench.tell({ run: !bench.running });
  });
}
