// The rules of what may be said, and the words of what is refused.

import { nearest } from "./near.js";

export class Refused extends Error {}

/** @typedef {Record<string, any>} Rule see `rules.py` of the package, which goes by the same tables */

/** @type {any} */
let words = {};

/** @param {any} table of messages */
export function speak(table) { words = table; }

/** @param {any} value @returns {string} a value as the messages have it */
export function shown(value) {
  if (typeof value === "string") return value.includes("'") && !value.includes('"') ? `"${value}"` : `'${value.replaceAll("\\", "\\\\").replaceAll("'", "\\'")}'`;
  if (typeof value === "boolean") return value ? "True" : "False";
  if (value === null || value === undefined) return "None";
  if (Array.isArray(value)) return `[${value.map(shown).join(", ")}]`;
  if (typeof value === "object") return `{${Object.entries(value).map(([key, one]) => `${shown(key)}: ${shown(one)}`).join(", ")}}`;
  const small = value !== 0 && Math.abs(value) < 10 ** words.smallest;
  return (small ? value.toExponential() : String(value)).replace(/e([+-])(\d)$/, "e$10$2");
}

/** @param {any} value @returns {string} the beginning of what is long */
function brief(value) {
  const text = shown(value);
  return text.length > words.longest ? text.slice(0, words.longest - words.dots.length) + words.dots : text;
}

/**
 * Refuse in three parts: what was looked at, what was got, what is allowed.
 * @param {string} what
 * @param {any} got
 * @param {string} allowed
 * @returns {never}
 */
export function wrong(what, got, allowed) {
  throw new Refused(`${what}${got === null || got === undefined ? ":" : `: got ${brief(got)},`} allowed: ${allowed}`);
}

/**
 * Refuse a name that is not known.
 * @param {string} kind
 * @param {string} name
 * @param {string[]} known
 * @param {string} [said] of what is allowed, instead of all that is known
 * @returns {never}
 */
export function unknown(kind, name, known, said = words.known[kind]) {
  const group = name.split(".", 1)[0];
  const grouped = words.groups[kind]?.includes(group);
  const of = (words.places[kind] ?? known).filter((/** @type {string} */ one) => !grouped || one.startsWith(`${group}.`));
  const allowed = grouped ? undefined : said;
  const usual = words.usual[kind]?.[name.slice(group.length + 1) || group];
  const meant = usual && of.includes(usual) ? [usual] : [];
  const near = [...meant, ...nearest(words.near, name, of).filter((one) => !meant.includes(one))].slice(0, allowed ? words.near.suggestions : 1).map(shown);
  const last = near.pop();
  const hint = last ? `; did you mean ${near.length ? `${near.join(", ")} or ${last}` : last}?` : "";
  throw new Refused(`unknown ${kind} ${brief(name)}${hint}: allowed: ${allowed ?? (of.join(", ") || words.none)}`);
}

/**
 * Refuse with a message of the table.
 * @param {string} name
 * @param {any} [got]
 * @param {Record<string, any>} [more]
 * @returns {never}
 */
export function refuse(name, got = null, more = {}) {
  throw new Refused(filled(words[name], { ...more, got: shown(got) }));
}

/** @param {string} text @param {Record<string, any>} values @returns {string} */
export function filled(text, values) {
  return text.replace(/\{(\w+)\}/g, (/** @type {string} */ all, /** @type {string} */ key) => (key in values ? String(values[key]) : all));
}

/** @param {number} value @returns {string} to some digits, as the package prints it */
export function tidy(value) {
  if (!Number.isFinite(value)) return value > 0 ? "inf" : "-inf";
  const [digits, power] = value.toExponential(words.digits - 1).split("e");
  const short = Number(digits);
  if (Number(power) < words.digits && Number(power) >= words.smallest) return String(Number(value.toPrecision(words.digits)));
  return `${short}e${power}`.replace(/e([+-])(\d)$/, "e$10$2");
}

/** @param {Rule} rule @param {number} value @returns {boolean} */
export function within(rule, value) {
  const [low, high] = [rule.low ?? -Infinity, rule.high ?? Infinity];
  return rule.open ? low < value && value <= high : low <= value && value <= high;
}

/** @param {any} value @returns {string} */
function typeOf(value) {
  if (Array.isArray(value)) return words.types.array;
  return words.types[typeof value === "number" && Number.isInteger(value) ? "whole" : typeof value];
}

const isTable = (/** @type {any} */ value) => value !== null && typeof value === "object" && !Array.isArray(value);

/** @type {Record<string, (rule: Rule, value: any, name: string, table: any) => any>} */
const KINDS = {
  number: (rule, value) => (Number.isFinite(value) && within(rule, value) ? value : undefined),
  whole: (rule, value) => (Number.isInteger(value) && within(rule, value) ? value : undefined),
  "number or text": (_, value) => (typeof value === "string" || Number.isFinite(value) ? value : undefined),
  plain: (_, value) => (typeof value === "string" || typeof value === "boolean" || Number.isFinite(value) ? value : undefined),
  truth: (_, value) => (typeof value === "boolean" ? value : undefined),
  text: (rule, value) => {
    if (typeof value !== "string" || value.length > (rule.most ?? Infinity)) return undefined;
    return rule.without && new RegExp(rule.without, "u").test(value) ? undefined : value;
  },
  word: (rule, value) => {
    if (rule.of.includes(value)) return value;
    return rule.unknown && typeof value === "string" ? unknown(rule.unknown, value, rule.of) : undefined;
  },
  table: (rule, value) => {
    if (!isTable(value) || (rule.some && !Object.keys(value).length)) return undefined;
    if (!rule.fields) {
      const fits = new RegExp(`^(?:${rule.names ?? ".*"})$`, "us");
      if (!Object.keys(value).every((key) => fits.test(key))) return undefined;
      return Object.fromEntries(Object.entries(value).map(([key, one]) => [key, checked(rule.each, one, key, value)]));
    }
    for (const key of Object.keys(value)) {
      if (key in rule.fields) continue;
      return rule.unknown ? unknown(rule.unknown, key, rule.known ?? Object.keys(rule.fields)) : undefined;
    }
    /** @type {Record<string, any>} */
    const found = {};
    for (const [key, own] of /** @type {[string, Rule][]} */ (Object.entries(rule.fields))) {
      if (key in value || own.needed) found[key] = checked(own, value[key] ?? own.usual, key, value);
      else if ("usual" in own) found[key] = own.usual;
    }
    return found;
  },
  variant: (rule, value, name, table) => {
    if (!isTable(value)) return undefined;
    const which = checked({ ...rule.choice, is: "word", of: Object.keys(rule.tables) }, value[rule.by]);
    return KINDS.table(rule.tables[which], value, name, table);
  },
  list: (rule, value, name, table) => {
    if (!Array.isArray(value) || value.length < (rule.least ?? 0) || value.length > rule.most) return undefined;
    const other = table[rule.as_many_as ?? ""] ?? value;
    if (other.length !== value.length) wrong(filled(rule.what, { name }), `${value.length} numbers`, "as many as times");
    return value.map((one) => checked(rule.each, one, name, table));
  },
};

/**
 * Return a value as a rule has it, or refuse it.
 * @param {Rule} rule
 * @param {any} value
 * @param {string} [name] of the field that it is
 * @param {any} [table] in which it stands
 * @returns {any}
 */
export function checked(rule, value, name = "", table = {}) {
  const found = KINDS[rule.is](rule, value, name, table);
  if (found !== undefined) return found;
  const got = rule.told === "type" ? typeOf(value) : rule.told === "length" && Array.isArray(value) ? value.length : rule.got ?? value;
  return wrong(filled(rule.what, { name }), got, filled(rule.allowed, { name }));
}
