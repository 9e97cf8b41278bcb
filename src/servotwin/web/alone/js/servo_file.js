// Servo files: those of catalog servos with other numbers are read; every servo's is written, in SI.

import { Refused, refuse } from "./check.js";
import { line, parsed } from "./toml.js";

/** @typedef {import("./facts.js").Servo} Servo */

/**
 * @param {any} world
 * @param {string} text of a servo file
 * @returns {{id: string, title: string, values: Record<string, any>}} the catalog's servo, and what the file has otherwise (SI)
 */
export function readServo(world, text) {
  const content = parsed("servo file", text);
  const other = (/** @type {string} */ got) => refuse("no_servo_file", got);
  const id = content.name;
  const known = world.servos[id] ?? other(String(id));
  const { groups, units, no_play: none } = world.file;
  /** @type {Record<string, any>} */
  const values = {};
  const seen = new Set();
  const rows = new Map(world.parameters.map((/** @type {any[]} */ row, /** @type {number} */ n) => [row[0], { row, n }]));
  for (const [group, table] of Object.entries(content).filter(([key]) => groups.includes(key))) {
    for (const [key, entry] of Object.entries(/** @type {any} */ (table))) {
      const name = `${group}.${key}`;
      const { row, n } = rows.get(name) ?? other(name);
      const dimension = row[world.of_all.indexOf("dimension")];
      const factor = dimension === "word" ? 1 : units[dimension][entry?.unit] ?? other(`${name} in ${String(entry?.unit)}`);
      const given = entry.value ?? other(`${name} without a value`);
      const value = typeof given === "number" ? given * factor : Array.isArray(given) ? given.map((one) => one * factor) : given;
      const before = known.values[n][0];
      if (before === null || (Array.isArray(before) && String(before) !== String(value))) other(name);
      if (!Array.isArray(before) && before !== value) values[name] = value;
      seen.add(name);
    }
  }
  world.parameters.forEach((/** @type {any[]} */ [name], /** @type {number} */ n) => {
    const [value, , source] = known.values[n];
    if (value !== null && source !== none && !seen.has(name)) other(`no ${name}`);
  });
  return { id, title: content.title || known.title, values };
}

/** @param {any} world @param {Servo} servo @returns {{name: string, type: string, text: string}} its file, with its numbers of now */
export function servoFile(world, servo) {
  const { known } = servo;
  if (servo.mystery) throw new Refused(world.words.no_mystery_file);
  const lines = [line("name", known.id), line("title", known.title), ...(known.kind === world.file.usual ? [] : [line("kind", known.kind)]),
    ...(known.notes ? [line("notes", known.notes)] : [])];
  for (const group of world.file.groups) {
    const own = world.parameters.map((/** @type {any[]} */ row, /** @type {number} */ n) => ({ row, n, name: row[0] }))
      .filter((/** @type {any} */ one) => one.name.startsWith(`${group}.`) && (servo.value(one.name) ?? null) !== null);
    if (own.length) lines.push("", `[${group}]`);
    for (const { row, n, name } of own) {
      const [, origin, source] = servo.changed.has(name) ? ["", world.set.origin, world.set.source] : known.values[n];
      const unit = row[world.of_all.indexOf("unit")];
      const spread = servo.changed.has(name) ? [] : known.stated[name] ?? [];
      const parts = { value: servo.value(name), ...(unit ? { unit } : {}), origin, ...(source ? { source } : {}),
        ...Object.fromEntries(world.file.spread.map((/** @type {string} */ key, /** @type {number} */ k) => [key, spread[k] ?? null]).filter((/** @type {any[]} */ pair) => pair[1] !== null)) };
      lines.push(line(name.slice(group.length + 1), parts));
    }
  }
  for (const table of ["sheet", "fit"].filter((one) => Object.keys(known[one]).length)) {
    lines.push("", `[${table}]`, ...Object.entries(known[table]).map(([key, value]) => line(key, value)));
  }
  return { name: `${known.id}.toml`, type: "application/toml", text: `${lines.join("\n")}\n` };
}
