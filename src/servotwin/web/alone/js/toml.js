// TOML of plain values on one line each: read and written.

import { Refused } from "./check.js";
import { parse } from "./toml_parse.js";

/** @param {string} what @param {string} text @returns {any} */
export function parsed(what, text) {
  try {
    return parse(text.replace(/^\ufeff/, ""));
  } catch (error) {
    throw new Refused(`${what}: not valid TOML: ${(error instanceof Error ? error.message : String(error)).split("\n")[0]}`);
  }
}

/** @param {string} key @param {any} one @returns {string} */
export function line(key, one) {
  if (typeof one === "string" && one.includes("\n")) {
    return `${name(key)} = """\n${one.split("\n").map((part) => quoted(part).slice(1, -1)).join("\n")}"""`;
  }
  return `${name(key)} = ${value(one)}`;
}

/** @param {any} one @returns {string} */
export function value(one) {
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
function quoted(text) { return JSON.stringify(/** @type {any} */ (text).toWellFormed?.() ?? text).replaceAll("\x7f", "\\u007f"); }
