// How a servo is drawn from above: body, ears, scale, horn, and what hangs on it. Lengths are in metres.

import { svg } from "./dom.js";

/** @typedef {{whole: SVGElement, turn: SVGElement, wish: SVGElement, disc: SVGElement, arm: SVGElement, mass: SVGElement,
 *             hand: SVGElement}} Drawn */

const [STEEL, DISC, LEAD] = [7850, 0.005, 11340]; // kg/m³, m, kg/m³: of which loads are drawn; assumed
export const RING = 1.62; // horns: radius of the scale
const ROOM = 1.3; // rings to the edge of the drawing: the numbers of the scale stand there
const FIRST = 30; // degrees between two numbers of the scale, at least
const LAST = 360;

/**
 * @param {any} facts of a servo
 * @param {Record<string, any>} attributes of the drawing
 * @returns {Drawn}
 */
export function drawServo(facts, attributes) {
  const { length_m: long, width_m: wide, horn_m: horn } = facts.horn;
  const turn = svg("g", { class: "turn" });
  const wish = svg("path", { class: "wish", d: `M${0.9 * RING * horn} 0l${-0.2 * horn} ${-0.09 * horn}v${0.18 * horn}z` });
  const disc = svg("circle", { class: "disc", r: 0 });
  const arm = svg("line", { class: "arm", x1: 0, y1: 0, x2: 0, y2: 0, "stroke-width": 0.1 * horn });
  const mass = svg("circle", { class: "mass", r: 0 });
  const hand = svg("path", { class: "hand", d: "" });
  turn.append(disc, arm, mass, svg("path", { class: "horn", d: hornPath(horn), "stroke-width": 0.045 * horn }),
    ...[0.42, 0.62, 0.82].map((at) => svg("circle", { class: "hole", cx: at * horn, r: 0.05 * horn })),
    svg("circle", { class: "screw", r: 0.13 * horn }), svg("path", { class: "slot", d: `M${-0.08 * horn} 0H${0.08 * horn}M0 ${-0.08 * horn}V${0.08 * horn}`,
      "stroke-width": 0.03 * horn }), hand);
  const whole = svg("svg", attributes, ...body(long, wide), scale(facts.travel_deg, horn), wish, turn);
  return { whole, turn, wish, disc, arm, mass, hand };
}

/** @param {number} long @param {number} wide @returns {SVGElement[]} body and ears, with the shaft at 0, 0 */
function body(long, wide) {
  const round = 0.05 * long;
  const ear = (/** @type {number} */ x) => svg("g", { class: "ear" },
    svg("rect", { x, y: -0.45 * wide, width: 0.16 * long, height: 0.9 * wide, rx: 0.4 * round }),
    ...[-0.25, 0.25].map((y) => svg("circle", { cx: x + (x < 0 ? 0.065 : 0.095) * long, cy: y * wide, r: 0.035 * long })));
  return [ear(-0.44 * long), ear(0.68 * long),
    svg("rect", { class: "case", x: -0.3 * long, y: -0.5 * wide, width: long, height: wide, rx: round }),
    svg("rect", { class: "lid", x: -0.27 * long, y: -0.44 * wide, width: 0.94 * long, height: 0.88 * wide, rx: 0.7 * round }),
    svg("circle", { class: "boss", r: 0.21 * long })];
}

/** @param {[number, number]} travel ends [deg] @param {number} horn @returns {SVGElement} a scale of degrees over the travel */
function scale([low, high], horn) {
  const radius = RING * horn;
  const at = (/** @type {number} */ degrees, /** @type {number} */ r) => {
    const angle = (-degrees * Math.PI) / 180;
    return `${(r * Math.cos(angle)).toFixed(5)} ${(r * Math.sin(angle)).toFixed(5)}`;
  };
  const span = Math.min(high - low, LAST);
  const apart = span > 240 ? 90 : FIRST;
  const ends = [Math.ceil(low / 10) * 10, Math.floor(Math.min(high, low + LAST - 1) / 10) * 10];
  const marks = [];
  for (let degrees = ends[0]; degrees <= ends[1]; degrees += 10) {
    const big = degrees % apart === 0;
    marks.push(svg("path", { class: big ? "mark big" : "mark", d: `M${at(degrees, radius)}L${at(degrees, radius * (big ? 0.91 : 0.95))}`,
      "stroke-width": 0.02 * horn }));
    if (!big || (span > 350 && degrees === -180)) continue;
    const [x, y] = at(degrees, radius * 1.17).split(" ").map(Number);
    marks.push(svg("text", { x, y: y + 0.06 * horn, "text-anchor": "middle", "font-size": 0.17 * horn, text: `${degrees}` }));
  }
  const large = span > 180 ? 1 : 0;
  const arc = span > 359 ? `M${at(0, radius)}A${radius} ${radius} 0 1 0 ${at(180, radius)}A${radius} ${radius} 0 1 0 ${at(0, radius)}`
    : `M${at(low, radius)}A${radius} ${radius} 0 ${large} 0 ${at(low + span, radius)}`;
  return svg("g", { class: "scale", "aria-hidden": "true" }, svg("path", { class: "arc", d: arc, "stroke-width": 0.02 * horn }), ...marks);
}

/**
 * Hang a load on: a disc of steel that has the inertia, an arm with a ball of lead.
 * @param {Drawn} drawn
 * @param {number} inertia [kg m²]
 * @param {number} weight [kg]
 * @param {number} length [m]
 * @param {number} most radius of the disc [m]
 * @returns {number} how far it reaches [m]
 */
export function hang({ disc, arm, mass }, inertia, weight, length, most) {
  const thin = inertia > 0 ? ((2 * inertia) / (Math.PI * STEEL * DISC)) ** 0.25 : 0; // J = pi rho d r^4 / 2
  const radius = Math.min(thin, most); // a disc that is thicker has it too, and hides no scale
  const long = weight > 0 ? length : 0;
  const ball = long ? (weight / ((4 / 3) * Math.PI * LEAD)) ** (1 / 3) : 0;
  disc.setAttribute("r", String(radius));
  arm.setAttribute("x2", String(long));
  mass.setAttribute("cx", String(long));
  mass.setAttribute("r", String(ball));
  return Math.max(radius, long + ball);
}

/**
 * @param {Drawn} drawn
 * @param {number} reach of the drawing to the left, to the right and above the shaft: of all servos, so that they are of one scale [m]
 * @param {number} below and below it [m]
 */
export function frame({ whole }, reach, below) {
  whole.setAttribute("viewBox", `${-reach} ${-reach} ${2 * reach} ${reach + below}`);
}

/** @param {SVGElement} whole @returns {{x: number, y: number}} where its shaft is in the window [pixels] */
export function centre(whole) {
  const box = whole.getBoundingClientRect();
  const [, top, , height] = (whole.getAttribute("viewBox") ?? "0 -1 2 2").split(" ").map(Number);
  return { x: box.left + box.width / 2, y: box.top - (top / height) * box.height };
}

/** @param {any} facts @returns {number} how far its horn, its scale and its body reach below the shaft [m] */
export function belowOf(facts) {
  const { horn, travel_deg: [low, high] } = facts;
  const least = low <= -90 || high >= 270 ? -1 : Math.min(Math.sin((low * Math.PI) / 180), Math.sin((high * Math.PI) / 180), 0);
  return Math.max(0.58 * horn.width_m, -least * ROOM * RING * horn.horn_m, 0.3 * horn.horn_m);
}

/** @param {any} facts @returns {number} how far a servo itself reaches [m] */
export function reachOf(facts) {
  return Math.max(ROOM * RING * facts.horn.horn_m, 0.86 * facts.horn.length_m);
}

/**
 * An arrow at the horn's tip, across it.
 * @param {Drawn} drawn
 * @param {number} horn its length [m]
 * @param {number} share of the greatest; positive turns it on
 */
export function push({ hand }, horn, share) {
  const long = Math.max(-1, Math.min(1, share)) * 1.1 * horn;
  const head = Math.sign(long) * 0.16 * horn;
  hand.setAttribute("d", Math.abs(long) < 0.02 * horn ? ""
    : `M${horn} 0v${-long}m${-0.1 * horn} ${head}l${0.1 * horn} ${-head}l${0.1 * horn} ${head}`);
  hand.setAttribute("stroke-width", String(0.06 * horn));
}

/** @param {number} length @returns {string} a horn's outline, along +x */
function hornPath(length) {
  const thick = 0.26 * length;
  const thin = 0.13 * length;
  return `M0 ${-thick}A${thick} ${thick} 0 1 0 0 ${thick}L${length} ${thin}A${thin} ${thin} 0 1 0 ${length} ${-thin}Z`;
}
