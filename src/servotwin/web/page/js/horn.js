// The horn that turns, drawn from the servo's size, with what hangs on it; it can be pushed by hand.

import { READABLE, el, paced } from "./dom.js";
import { RING, belowOf, centre, drawServo, frame, hang, push, reachOf } from "./horn_draw.js";
import { moves } from "./moves.js";
import { fullName } from "./names.js";
import { plain } from "./units.js";

const STIFFNESS = 2.0; // N m per rad that the hand is away from the horn; assumed: a finger
const KEYS = /** @type {Record<string, number>} */ ({ ArrowLeft: 1, ArrowRight: -1, ArrowUp: 1, ArrowDown: -1 });
const SPOKEN = 1; // times a second that the angle is said anew to a screen reader
const TOLD = 3; // times a second that what it does is told anew
const HINT = window.matchMedia("(pointer: coarse)").matches ? "Turn it with the slider, or push the horn with the finger."
  : "Turn it with the slider, or push the horn: with the mouse, or with an arrow key.";
const BESIDE = /** @type {Record<string, [string, string]>} */ ({ // the model that is put beside each, and what it is for
  PulseServo: ["BoundedServo", "PulseServo follows every pulse. BoundedServo is the same servo in the mean of its pulses: for long runs, and to see what the pulses themselves do."],
  BoundedServo: ["PulseServo", "BoundedServo is a servo in the mean of its pulses. PulseServo follows every pulse: deadband, droop and buzz come from there."] });
const [SHARE, USUAL] = [0.25, 0.3]; // of what a loop gives at most, and N m where nothing is known: with what a key pushes

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const drawings = el("div", { class: "horns" });
  const force = el("p", { class: "soft force", text: HINT });
  const second = el("p", { class: "soft model-beside", hidden: true });
  root.append(el("h2", { text: "Horn" }), drawings, force, second);
  /** @type {(import("./horn_draw.js").Drawn & {angle: HTMLElement, does: HTMLElement})[]} */
  let drawn = [];
  let most = USUAL; // N m that a key pushes with
  let [sent, torque] = [0, 0]; // N m of the hand
  /** @type {(() => void)[]} what a hand that holds a horn does, again and again */
  let holds = [];

  bench.on("scene", () => {
    [drawn, holds] = [[], []];
    drawings.classList.toggle("many", bench.facts.length > 2);
    drawings.replaceChildren(...bench.facts.map((facts, k) => picture(facts, k)));
    const sheet = bench.facts[0]?.loop;
    most = sheet?.cap_torque_nm ? SHARE * sheet.cap_torque_nm : USUAL;
    [sent, torque] = [0, 0];
    force.textContent = HINT;
    offer();
    dress();
    draw();
    say();
  });
  bench.on("changed", () => dress());

  /** Say what a second model is for, where one servo stands alone. */
  const offer = () => {
    const [facts] = bench.facts;
    const [model, why] = BESIDE[facts?.model] ?? ["", ""];
    second.hidden = bench.facts.length > 1 || !facts?.models.includes(model) || Boolean(bench.state.lesson?.title) || bench.role === "watcher";
    second.replaceChildren(`${why} `, el("button", { text: "Put it beside", onclick: () => bench.tell({ servos: [{ keep: 0, model: facts.model }, { keep: 0, model }] }) }));
  };

  /** @param {any} facts @param {number} k */
  const picture = (facts, k) => {
    const made = drawServo(facts, { class: `servo${k}`, role: "slider", tabindex: bench.role === "watcher" ? null : 0,
      "aria-label": `Horn of ${fullName(facts)}; arrow keys push it`, "aria-valuenow": 0, "aria-valuemin": -360, "aria-valuemax": 360 });
    const angle = el("span", { class: "angle" });
    const does = el("span", { class: "does" });
    handle(made.whole, k);
    drawn.push({ ...made, angle, does });
    return el("figure", {}, /** @type {any} */ (made.whole), el("figcaption", {}, angle, does, el("span", { class: "who" },
      el("span", { class: `key servo${k}` }), facts.title, el("span", { class: "model", text: facts.model }))));
  };

  const dress = () => {
    /** @param {string} name */
    const of = (name) => Number(bench.loads.find((one) => one.name === name)?.value ?? 0);
    const loads = drawn.map((one, k) => 1.06 * hang(one, of("load.inertia"), of("load.pendulum.mass"), of("load.pendulum.length"),
      0.74 * RING * bench.facts[k].horn.horn_m));
    const arm = of("load.pendulum.mass") > 0 ? Infinity : 0; // it swings below, too
    const reach = Math.max(...loads, ...bench.facts.map((facts) => reachOf(facts)));
    const below = Math.min(reach, Math.max(arm, ...loads, ...bench.facts.map((facts) => belowOf(facts))));
    for (const one of drawn) frame(one, reach, below);
  };

  const draw = paced(() => {
    drawn.forEach((one, k) => {
      const seen = bench.history[k];
      const angle = (seen?.latest("output_angle") * 180) / Math.PI;
      if (Number.isFinite(angle)) one.turn.setAttribute("transform", `rotate(${-angle})`);
      const told = (seen?.latest("command_angle") * 180) / Math.PI;
      one.wish.setAttribute("visibility", Number.isFinite(told) ? "visible" : "hidden");
      if (Number.isFinite(told)) one.wish.setAttribute("transform", `rotate(${-told})`);
    });
  });
  const read = paced(() => drawn.forEach(({ angle }, k) => {
    const text = `${((bench.history[k]?.latest("output_angle") * 180) / Math.PI).toFixed(1)}°`;
    if (angle.textContent !== text) angle.textContent = text;
  }), READABLE);
  const tellMoves = paced(() => drawn.forEach(({ does }, k) => {
    const text = moves(bench, k);
    if (does.textContent !== text) does.textContent = text;
  }), TOLD);
  const say = paced(() => drawn.forEach(({ whole }, k) => {
    const angle = (bench.history[k]?.latest("output_angle") * 180) / Math.PI;
    if (!Number.isFinite(angle) || whole.getAttribute("aria-valuenow") === angle.toFixed(0)) return;
    whole.setAttribute("aria-valuenow", angle.toFixed(0));
    whole.setAttribute("aria-valuetext", `${angle.toFixed(0)} degrees`);
  }), SPOKEN);
  bench.on("push", () => { draw(); read(); say(); tellMoves(); });

  // --- the hand -----------------------------------------------------------------------------------------------------

  bench.on("push", () => holds.forEach((one) => one())); // a horn goes on under a hand that rests
  const send = bench.onceAFrame(() => {
    if (torque === sent) return;
    sent = torque;
    force.textContent = torque ? `Your hand pushes with ${plain(1000 * Math.abs(torque), 3)} mN m towards ${
      torque < 0 ? "larger" : "smaller"} angles.` : HINT;
    drawn.forEach((one, k) => push(one, bench.facts[k].horn.horn_m, -torque / (4 * most)));
    bench.tell({ do: "push", value: torque });
  });

  /** @param {SVGElement} whole @param {number} k */
  const handle = (whole, k) => {
    let grip = 0; // rad that the hand first was ahead of the horn
    let held = false;
    /** @param {PointerEvent} event */
    const at = (event) => {
      const { x, y } = centre(whole);
      return Math.atan2(y - event.clientY, event.clientX - x);
    };
    const now = () => bench.history[k]?.latest("output_angle") ?? 0;
    let last = 0; // rad, where the hand is
    const pull = () => {
      const ahead = last - now() - grip;
      torque = -STIFFNESS * Math.atan2(Math.sin(ahead), Math.cos(ahead)); // positive pushes towards smaller angles
      send();
    };
    whole.addEventListener("pointerdown", (event) => {
      if (bench.role === "watcher") return;
      held = true;
      whole.setPointerCapture(event.pointerId);
      last = at(event);
      grip = last - now();
    });
    whole.addEventListener("pointermove", (event) => {
      if (!held) return;
      last = at(event);
      pull();
    });
    holds.push(() => { if (held) pull(); });
    for (const name of /** @type {const} */ (["pointerup", "pointercancel"])) {
      whole.addEventListener(name, () => { if (held) { held = false; torque = 0; send(); } });
    }
    whole.addEventListener("keydown", (event) => {
      if (!(event.key in KEYS) || event.ctrlKey || event.altKey || event.metaKey || bench.role === "watcher") return;
      event.preventDefault();
      torque = -KEYS[event.key] * most;
      send();
    });
    for (const name of /** @type {const} */ (["keyup", "blur"])) {
      whole.addEventListener(name, () => { if (torque && !held) { torque = 0; send(); } });
    }
  };
}
