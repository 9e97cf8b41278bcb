// What is refused, in the words of the table.

export class Refused extends Error {}

/** @type {any} */
let words = {};

/** @param {any} table of messages */
export function speak(table) { words = table; }

/** @param {any} value @returns {string} a value as the messages have it */
export function shown(value) {
  return typeof value === "string" ? `'${value}'` : typeof value === "boolean" ? (value ? "True" : "False")
    : value === null || value === undefined ? "None" : typeof value === "object" ? JSON.stringify(value) : String(value);
}

/**
 * Refuse with a message of the table.
 * @param {string} name
 * @param {any} [got]
 * @param {Record<string, any>} [more]
 * @returns {never}
 */
export function refuse(name, got = null, more = {}) {
  const text = words[name].replace(/\{(\w+)\}/g, (/** @type {string} */ _, /** @type {string} */ key) =>
    (key === "got" ? shown(got) : String(more[key])));
  throw new Refused(text);
}

/**
 * Refuse a command that goes beyond bounds.
 * @param {any[]|undefined} bounds each: of what, from where to where, whether these are possible themselves, a factor, a message
 * @param {number[]} ends lowest and highest of the command, and of what the servo follows
 * @param {any} servo
 */
export function bounded(bounds, ends, servo) {
  if (!bounds) refuse("no_such_command", null, servo);
  for (const one of bounds) {
    const [low, high] = one.of === "command" ? ends : ends.slice(2);
    const below = one.open ? low <= one.low : low < one.low;
    if (!below && !(one.open ? high >= one.high : high > one.high)) continue;
    throw new Refused(one.words.replace("{got}", tidy((below ? low : high) * one.factor)));
  }
}

/** @param {number} value @returns {string} to six digits */
export function tidy(value) { return String(Number(value.toPrecision(6))); }
