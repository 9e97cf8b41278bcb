// The horn that turns, drawn from the servo's size, with what hangs on it; it can be pushed by hand.

import { el, onceAFrame, svg } from "./dom.js";
import { engineering } from "./units.js";

const ROOM = 1.12; // of what is drawn, to the edge of the drawing
const [WOOD, DISC, LEAD] = [700, 0.005, 11340]; // kg/m³, m, kg/m³: of which loads are drawn; assumed
const STIFFNESS = 2.0; // N m per rad that the hand is away from the horn; assumed: a finger
const KEYS = /** @type {Record<string, number>} */ ({ ArrowLeft: 1, ArrowRight: -1, ArrowUp: 1, ArrowDown: -1 });

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const drawings = el("div", { class: "horns" });
  const force = el("p", { class: "soft", "aria-live": "off" });
  root.append(el("h2", { text: "Horn" }), drawings, force);
  /** @type {{turn: SVGElement, wish: SVGElement, disc: SVGElement, arm: SVGElement, mass: SVGElement, whole: SVGElement}[]} */
  let drawn = [];
  let most = 0.3; // N m that a key pushes with

  bench.on("scene", () => {
    drawn = [];
    drawings.replaceChildren(...bench.facts.map((facts, k) => picture(facts, k)));
    const sheet = bench.facts[0]?.loop;
    most = sheet ? 0.25 * sheet.cap_torque_nm : 0.3;
    dress();
    draw();
  });
  bench.on("changed", () => dress());

  /** @param {any} facts @param {number} k */
  const picture = (facts, k) => {
    const size = facts.horn;
    const turn = svg("g", { class: "turn" });
    const wish = svg("line", { class: "wish", x1: 0, y1: 0, x2: 1.35 * size.horn_m, y2: 0 });
    const disc = svg("circle", { class: "disc", r: 0 });
    const arm = svg("line", { class: "arm", x1: 0, y1: 0, x2: 0, y2: 0 });
    const mass = svg("circle", { class: "mass", r: 0 });
    turn.append(disc, arm, mass, svg("path", { class: "horn", d: hornPath(size.horn_m) }),
      svg("circle", { class: "screw", r: 0.1 * size.horn_m }));
    const title = `${facts.title}, ${facts.model}: the horn`;
    const whole = svg("svg", { class: `servo${k}`, role: "slider",
      tabindex: bench.role === "watcher" ? -1 : 0, "aria-label": `${title}; arrow keys push it`, "aria-valuenow": 0,
      "aria-valuemin": -360, "aria-valuemax": 360 },
    svg("rect", { class: "body", x: -0.3 * size.length_m, y: -0.5 * size.width_m, width: size.length_m,
      height: size.width_m, rx: 0.002 }),
    svg("rect", { class: "ear", x: -0.45 * size.length_m, y: -0.5 * size.width_m, width: 0.15 * size.length_m,
      height: size.width_m, rx: 0.001 }),
    svg("rect", { class: "ear", x: 0.7 * size.length_m, y: -0.5 * size.width_m, width: 0.15 * size.length_m,
      height: size.width_m, rx: 0.001 }), wish, turn);
    handle(whole, k);
    drawn.push({ turn, wish, disc, arm, mass, whole });
    return el("figure", {}, whole, el("figcaption", {}, el("span", { class: `key servo${k}` }),
      `${facts.title}, ${facts.model}`));
  };

  const dress = () => {
    /** @param {string} name */
    const of = (name) => Number(bench.loads.find((one) => one.name === name)?.value ?? 0);
    drawn.forEach(({ disc, arm, mass, whole }, k) => {
      const size = bench.facts[k].horn;
      const inertia = of("load.inertia"); // a disc of wood, 5 mm thick, has it: r = (2 J / (pi rho d))^(1/4)
      const radius = inertia > 0 ? (2 * inertia / (Math.PI * WOOD * DISC)) ** 0.25 : 0;
      disc.setAttribute("r", String(radius));
      const weight = of("load.pendulum.mass");
      const length = weight > 0 ? of("load.pendulum.length") : 0;
      const ball = length ? (weight / (4 / 3 * Math.PI * LEAD)) ** (1 / 3) : 0;
      const view = ROOM * Math.max(0.9 * size.length_m, radius, length + ball, 1.35 * size.horn_m);
      whole.setAttribute("viewBox", `${-view} ${-view} ${2 * view} ${2 * view}`);
      arm.setAttribute("x2", String(length));
      mass.setAttribute("cx", String(length));
      mass.setAttribute("r", String(ball));
    });
  };

  const draw = onceAFrame(() => {
    drawn.forEach(({ turn, wish, whole }, k) => {
      const seen = bench.history[k];
      const angle = (seen?.latest("output_angle") * 180) / Math.PI;
      if (Number.isFinite(angle)) {
        turn.setAttribute("transform", `rotate(${-angle})`);
        whole.setAttribute("aria-valuenow", angle.toFixed(1));
        whole.setAttribute("aria-valuetext", `${angle.toFixed(1)} degrees`);
      }
      const told = (seen?.latest("command_angle") * 180) / Math.PI;
      wish.setAttribute("visibility", Number.isFinite(told) ? "visible" : "hidden");
      if (Number.isFinite(told)) wish.setAttribute("transform", `rotate(${-told})`);
    });
  });
  bench.on("push", draw);

  // --- the hand -----------------------------------------------------------------------------------------------------

  let sent = 0;
  let torque = 0;
  const send = onceAFrame(() => {
    if (torque === sent) return;
    sent = torque;
    force.textContent = torque ? `your hand pushes with ${engineering(-torque, "N m", 3)}` : "";
    bench.tell({ do: "push", value: torque });
  });

  /** @param {SVGElement} whole @param {number} k */
  const handle = (whole, k) => {
    let grip = 0; // rad that the hand first was ahead of the horn
    let held = false;
    /** @param {PointerEvent} event */
    const at = (event) => {
      const box = whole.getBoundingClientRect();
      return Math.atan2(box.top + box.height / 2 - event.clientY, event.clientX - box.left - box.width / 2);
    };
    const now = () => bench.history[k]?.latest("output_angle") ?? 0;
    whole.addEventListener("pointerdown", (event) => {
      if (bench.role === "watcher") return;
      held = true;
      whole.setPointerCapture(event.pointerId);
      grip = at(event) - now();
    });
    whole.addEventListener("pointermove", (event) => {
      if (!held) return;
      const ahead = at(event) - now() - grip;
      torque = -STIFFNESS * Math.atan2(Math.sin(ahead), Math.cos(ahead)); // positive pushes towards smaller angles
      send();
    });
    for (const name of /** @type {const} */ (["pointerup", "pointercancel"])) {
      whole.addEventListener(name, () => { if (held) { held = false; torque = 0; send(); } });
    }
    whole.addEventListener("keydown", (event) => {
      if (!(event.key in KEYS)) return;
      event.preventDefault();
      torque = -KEYS[event.key] * most;
      send();
    });
    for (const name of /** @type {const} */ (["keyup", "blur"])) {
      whole.addEventListener(name, () => { if (torque && !held) { torque = 0; send(); } });
    }
  };
}

/** @param {number} length @returns {string} a horn with holes' shape, along +x */
function hornPath(length) {
  const thick = 0.26 * length;
  const thin = 0.15 * length;
  return `M0 ${-thick}A${thick} ${thick} 0 1 0 0 ${thick}L${length} ${thin}A${thin} ${thin} 0 1 0 ${length} ${-thin}Z`;
}
