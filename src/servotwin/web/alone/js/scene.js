// The text of a bench: read, written, and packed into a link.

import { checked, unknown, wrong } from "./check.js";
import { said } from "./live.js";
import { line, parsed, value } from "./toml.js";

/** @param {any} world @param {string} text @returns {any} the scene that a text describes */
export function read(world, text) {
  const { rules, limits, scene: keys } = world;
  if (text.length > limits.text) wrong("scene", `${text.length} characters`, `at most ${limits.text}`);
  const content = parsed("scene", text);
  for (const key of Object.keys(content)) if (!keys.top.includes(key)) unknown("key of a scene", key, keys.top);
  if (content.format !== limits.format) wrong("format of a scene", content.format, String(limits.format));
  const servos = content.servo;
  if (!Array.isArray(servos) || !servos.length || servos.length > limits.servos) {
    wrong("servos of a scene", Array.isArray(servos) ? servos.length : servos, `1 to ${limits.servos} tables [[servo]]`);
  }
  const rows = content.actions ?? [];
  if (!Array.isArray(rows) || rows.length > limits.actions) wrong("actions of a scene", Array.isArray(rows) ? rows.length : rows, `a list of at most ${limits.actions}`);
  const actions = rows.map((row) => action(world, servos.length, row));
  if (actions.some((one, k) => k > 0 && one.time < actions[k - 1].time)) wrong("actions of a scene", "times that go back", "the order of their times");
  const own = Object.fromEntries(Object.entries(rules.scene).map(([key, rule]) => [key, key in content ? checked(rule, content[key]) : rule.usual ?? {}]));
  return { ...own, servos: servos.map((one) => servo(world, one)), actions, view: view(world, content.view ?? {}), lesson: lesson(content.lesson ?? {}) };
}

/** @param {any} world @param {any} table @returns {any} */
export function servo(world, table) {
  const { sources } = world.scene;
  const found = checked(world.rules.servo, table);
  const given = sources.filter((/** @type {string} */ key) => key in found);
  if (given.length !== 1) wrong("servo of a scene", given.join(", ") || "none of them", "one of id, file, mystery");
  const models = Object.keys(world.models);
  if (!["", ...models].includes(found.model)) unknown("model", found.model, models);
  return found;
}

/** @param {any} world @param {any} table @returns {any} */
export function view(world, table) {
  const found = checked(world.rules.view, table);
  const size = Object.entries(found).reduce((sum, [name, one]) => sum + name.length + String(one).length, 0);
  if (size > world.limits.view) wrong("view", "more than that", `${world.limits.view} characters in all`);
  return found;
}

/** @param {any} table @returns {any} */
function lesson(table) {
  if (!Object.values(table).flat().every((one) => typeof one === "string")) wrong("lesson of a scene", "other values", "texts and lists of texts");
  return table;
}

/** @param {any} world @param {number} servos @param {any} row @returns {import("./live.js").Action} */
function action(world, servos, row) {
  if (!Array.isArray(row) || row.length < world.scene.row[0] || row.length > world.scene.row[1]) {
    wrong("action", row, "[time in s, kind, value] or [time in s, kind, value, servo]");
  }
  if (!(Number.isFinite(row[0]) && row[0] >= 0)) wrong("time of an action", row[0], "a number of seconds of at least 0");
  return said(world, servos, row);
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

/** @param {string} text @returns {Promise<string>} the text packed for the part of a link after its # */
export async function fragment(text) {
  const packed = new Uint8Array(await through(new TextEncoder().encode(text), new CompressionStream("deflate")));
  let plain = "";
  for (const byte of packed) plain += String.fromCharCode(byte);
  return btoa(plain).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "");
}

/** @param {string} packed @returns {Promise<string>} the text that a link carries */
export async function unfragment(packed) {
  try {
    const plain = atob(packed.replaceAll("-", "+").replaceAll("_", "/"));
    const bytes = Uint8Array.from(plain, (one) => one.charCodeAt(0));
    return new TextDecoder().decode(await through(bytes, new DecompressionStream("deflate")));
  } catch {
    return wrong("link", "something that does not unpack", "a whole link of a bench");
  }
}

/** @param {Uint8Array} bytes @param {any} change @returns {Promise<ArrayBuffer>} */
function through(bytes, change) { return new Response(new Blob([/** @type {any} */ (bytes)]).stream().pipeThrough(change)).arrayBuffer(); }
