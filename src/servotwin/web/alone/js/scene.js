// The text of a bench: read, written, and packed into a link.

import { parse } from "./toml_parse.js";

/** @param {any} world @param {string} text @returns {any} */
export function read(world, text) {
  const content = /** @type {any} */ (parse(text));
  return {
    name: content.name ?? "", seed: content.seed ?? 0, frame_rate: content.frame_rate ?? world.limits.frame_rate, end: content.end ?? 0,
    servos: content.servo, load: content.load ?? {}, supply: content.supply ?? {}, control: content.control ?? {},
    view: content.view ?? {}, lesson: content.lesson ?? {},
    actions: (content.actions ?? []).map((/** @type {any[]} */ [time, kind, value, servo = null]) => ({ time, kind, value, servo })),
  };
}

/** @param {any} world @param {any} scene @returns {string} */
export function written(world, scene) {
  const float = (/** @type {number} */ x) => (Number.isInteger(x) ? `${x}.0` : String(x));
  const lines = [line("format", world.limits.format), ...(scene.name ? [line("name", scene.name)] : []),
    line("seed", scene.seed), `frame_rate = ${float(scene.frame_rate)}`, `end = ${float(scene.end)}`];
  if (scene.actions.length) {
    lines.push("actions = [", ...scene.actions.map((/** @type {any} */ one) => `  ${value([one.time, one.kind, one.value,
      ...(one.servo === null ? [] : [one.servo])])},`), "]");
  }
  for (const servo of scene.servos) {
    lines.push("", "[[servo]]", ...world.scene.servo.filter((/** @type {string} */ name) => filled(servo[name]))
      .map((/** @type {string} */ name) => line(name, servo[name])));
  }
  for (const key of world.scene.tables) {
    if (filled(scene[key])) lines.push("", `[${key}]`, ...Object.entries(scene[key]).map(([name, one]) => line(name, one)));
  }
  return `${lines.join("\n")}\n`;
}

/** @param {any} one @returns {boolean} */
function filled(one) {
  return !(one === undefined || one === null || one === "" || (typeof one === "object" && !Object.keys(one).length));
}

/** @param {string} key @param {any} one @returns {string} */
function line(key, one) {
  if (typeof one === "string" && one.includes("\n")) {
    return `${name(key)} = """\n${one.split("\n").map((part) => quoted(part).slice(1, -1)).join("\n")}"""`;
  }
  return `${name(key)} = ${value(one)}`;
}

/** @param {any} one @returns {string} */
function value(one) {
  if (typeof one === "string") return quoted(one);
  if (Array.isArray(one)) return `[${one.map(value).join(", ")}]`;
  if (one !== null && typeof one === "object") {
    return `{${Object.entries(one).map(([key, inner]) => `${name(key)} = ${value(inner)}`).join(", ")}}`;
  }
  return String(one);
}

/** @param {string} key @returns {string} */
function name(key) { return /^[\w-]+$/.test(key) ? key : quoted(key); }

/** @param {string} text @returns {string} */
function quoted(text) { return JSON.stringify(text.toWellFormed?.() ?? text).replaceAll("\x7f", "\\u007f"); }

/** @param {string} text @returns {Promise<string>} the text packed for the part of a link after its # */
export async function fragment(text) {
  const packed = new Uint8Array(await through(new TextEncoder().encode(text), new CompressionStream("deflate")));
  let plain = "";
  for (const byte of packed) plain += String.fromCharCode(byte);
  return btoa(plain).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "");
}

/** @param {string} packed @returns {Promise<string>} */
export async function unfragment(packed) {
  const plain = atob(packed.replaceAll("-", "+").replaceAll("_", "/"));
  const bytes = Uint8Array.from(plain, (one) => one.charCodeAt(0));
  return new TextDecoder().decode(await through(bytes, new DecompressionStream("deflate")));
}

/** @param {Uint8Array} bytes @param {any} change @returns {Promise<ArrayBuffer>} */
function through(bytes, change) { return new Response(new Blob([/** @type {any} */ (bytes)]).stream().pipeThrough(change)).arrayBuffer(); }
