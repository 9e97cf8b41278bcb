// A log as a plain table: read by names and units that need no guess, or refused.

import { filled, refuse, tidy, wrong } from "./check.js";

/** @typedef {{name: string, time: Float64Array, command: Float64Array, kind: string, angle: Float64Array}} Log one run (SI); NaN where no angle was measured */

/**
 * @param {any} world
 * @param {string} name of the file
 * @param {ArrayBuffer} bytes
 * @returns {{log: Log, facts: any}} the log, and what is told of it
 */
export function readLog(world, name, bytes) {
  const rules = world.csv;
  const { header, rows, remarks } = tableOf(world, name, bytes);
  const signals = header.map((column) => rules.columns[column] ?? refuse("no_plain_log", `column ${column}`, { name }));
  const named = signals.map(([signal]) => signal);
  const twice = named.find((one, k) => named.indexOf(one) < k);
  if (twice) refuse("no_plain_log", `${twice} in two columns`, { name });
  const command = Object.keys(rules.commands).find((one) => named.includes(one));
  for (const [part, there] of Object.entries({ time: named.includes(rules.time), command, angle: named.includes(rules.angle) })) {
    if (!there) refuse("no_plain_log", `no column of ${part}`, { name });
  }
  if (named.includes(rules.switch)) refuse("no_plain_log", rules.switch, { name });
  const number = new RegExp(`^(?:${rules.number})$`);
  const missing = new Set(rules.missing);
  const grouped = groupedIn(rules, rows);
  if (grouped) refuse("no_plain_log", grouped, { name });
  const columns = Object.fromEntries(named.map((signal, k) => {
    const [, , factor] = signals[k];
    const needed = signal === rules.time || signal === command;
    return [signal, Float64Array.from(rows, ({ line, cells }) => {
      if (number.test(cells[k])) return Number(cells[k]) * factor;
      if (!needed && missing.has(cells[k].toLowerCase())) return NaN;
      return wrong(`${name}: line ${line}, ${header[k]}`, cells[k] || "nothing", filled(world.words.a_number, {}));
    })];
  }));
  const kind = rules.commands[/** @type {string} */ (command)];
  const log = { name: name.replace(/\.\w+$/, ""), time: columns[rules.time], command: columns[/** @type {string} */ (command)], kind, angle: columns[rules.angle] };
  look(world, name, log, columns, rows);
  return { log, facts: factsOf(world, name, log, header, signals, remarks) };
}

/**
 * @param {any} rules
 * @param {{cells: string[]}[]} rows
 * @returns {string | undefined} a number whose point may separate thousands: whole ones stand in its column
 */
function groupedIn(rules, rows) {
  const [form, whole] = [rules.grouped, rules.whole].map((one) => new RegExp(`^(?:${one})$`));
  const pointed = rows.flatMap(({ cells }) => cells.filter((cell) => cell.includes(".")));
  if (!pointed.every((cell) => form.test(cell))) return undefined;
  const mixed = rows[0].cells.findIndex((_, k) => rows.some(({ cells }) => whole.test(cells[k]) && Number(cells[k])) && rows.some(({ cells }) => form.test(cells[k])));
  return mixed < 0 ? undefined : rows.map(({ cells }) => cells[mixed]).find((cell) => form.test(cell));
}

/** @param {any} world @param {string} name @param {ArrayBuffer} bytes */
function tableOf(world, name, bytes) {
  let text = "";
  try {
    text = new TextDecoder("utf-8", { fatal: true }).decode(bytes);
  } catch {
    refuse("no_plain_log", "no text in UTF-8", { name });
  }
  const lines = text.split(/\r?\n/);
  const remarks = lines.pop() ? [filled(world.words.cut_line, { line: lines.length + 1 })] : [];
  const all = lines.map((line, k) => ({ line: k + 1, cells: line.split(",").map((cell) => cell.trim()) })).filter(({ cells }) => cells.some(Boolean));
  if (text.includes('"') || text.includes("\0")) refuse("no_plain_log", "quotes, or no text", { name });
  const [head, ...rows] = all;
  if (!rows.length) wrong(name, text.trim() ? "a header without rows" : "an empty file", world.words.rows);
  const odd = rows.find(({ cells }) => cells.length !== head.cells.length);
  if (odd) refuse("no_plain_log", `${odd.cells.length} cells in line ${odd.line}`, { name });
  return { header: head.cells, rows, remarks };
}

/**
 * Refuse what no log of a servo can be.
 * @param {any} world
 * @param {string} name
 * @param {Log} log
 * @param {Record<string, Float64Array>} columns
 * @param {{line: number}[]} rows
 */
function look(world, name, log, columns, rows) {
  const { fewest, limits, commands, positive, time } = world.csv;
  if (rows.length < fewest) wrong(name, `${rows.length} rows`, `at least ${fewest}`);
  const back = log.time.findIndex((one, k) => k > 0 && !(one > log.time[k - 1]));
  if (back > 0) refuse("no_plain_log", `line ${rows[back].line}, where time does not increase`, { name });
  if (log.kind === positive) {
    const [least, most] = world.csv.pulses;
    const odd = log.command.findIndex((one) => one === 0 || (one > 0 && one < least) || (one > most && one <= limits[positive][0]));
    if (odd >= 0) refuse("no_plain_log", `a pulse of ${tidy(log.command[odd])} s`, { name });
    const none = log.command.findIndex((one) => !(one > 0));
    if (none >= 0) wrong(`${name}: pulse width of sample ${none}`, `${tidy(log.command[none])} s`, world.words.a_width);
  }
  for (const [signal, values] of Object.entries(columns)) {
    const own = signal in commands && values === log.command ? log.kind : signal;
    const [limit, unit, meant] = limits[own] ?? [Infinity, "", ""];
    const far = values.findIndex((one) => Math.abs(one) > limit);
    if (signal !== time && far >= 0) wrong(`${name}: ${own}`, `${tidy(values[far])} ${unit}`, `at most ${tidy(limit)} ${unit} in magnitude: ${meant}`);
  }
  if (!log.angle.some(Number.isFinite)) wrong(`${name}: ${world.csv.angle}`, "no value", "at least one value");
}

/** @param {Log} log @returns {number[]} samples at which the command is another one than before */
function changes(log) { return [...log.command.keys()].filter((k) => k > 0 && log.command[k] !== log.command[k - 1]); }

/** @param {any} world @param {string} name @param {Log} log @param {string[]} header @param {any[][]} signals @param {string[]} remarks @returns {any} */
function factsOf(world, name, log, header, signals, remarks) {
  const { known, commands, hold, units } = world.csv;
  const [unit, factor] = units[log.kind];
  let [low, high] = [Infinity, -Infinity];
  for (const one of log.command) [low, high] = [Math.min(low, one), Math.max(high, one)];
  const measured = signals.map(([signal]) => signal).filter((signal) => signal !== world.csv.time && !(signal in commands));
  return { name, columns: header.map((column, k) => ({ column, signal: signals[k][0], unit: signals[k][1], known })),
    unread: [], remarks, runs: [{ name: log.name, motion: "", rows: log.time.length, duration: duration(log),
      command: { kind: log.kind, unit, low: factor * low, high: factor * high, hold, changes: changes(log).length },
      measured, played: some(log).length <= world.csv.played }] };
}

/** @param {Log} log @returns {number} from the first sample to the last [s] */
export function duration(log) { return log.time[log.time.length - 1] - log.time[0]; }

/** @param {Log} log @returns {number[]} the samples that say all of its command */
function some(log) { return [...new Set([0, ...changes(log), log.time.length - 1])]; }

/** @param {any} world @param {Log} log @returns {any} its command as a bench takes it */
export function played(world, log) {
  const { units, hold, digits, played: most } = world.csv;
  const [unit, factor] = units[log.kind];
  const those = some(log);
  if (those.length > most) wrong("command of the log", "too many changes", "a shorter log");
  const told = (/** @type {number} */ value) => Number(value.toPrecision(digits));
  return { shape: "recorded", unit, hold, time: those.map((k) => told(log.time[k] - log.time[0])), value: those.map((k) => told(factor * log.command[k])) };
}
