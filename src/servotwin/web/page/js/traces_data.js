// From what was seen to lines: extremes of each column of pixels, columns over common times, ranges that stand still.

/** @typedef {import("./history.js").History} History */
/** @typedef {{time: number[], value: number[]}} Line */
/** @typedef {(number|null|undefined)[]} Column */

const FINE = 3; // points of a pixel column: what comes closer shows as its extremes
const PLACES = [0, 0.33, 0.66, 0.99]; // within a column: where its first, least, greatest and last value are drawn

/**
 * The lines of signals between two times, ready to be drawn.
 * @param {{history: History, name: string}[]} signals
 * @param {number} start
 * @param {number} end
 * @param {number} width in pixels
 * @param {(name: string, value: number) => number} shown from SI
 * @param {Line[]} [others] lines that are drawn beside, as they are
 * @returns {[number[], ...Column[]]} common times, then values
 */
export function lines(signals, start, end, width, shown, others = []) {
  const most = FINE * width;
  const dense = signals.some(({ history }) => history.at(end) - history.at(start) > most);
  if (!dense) {
    return joined([...signals.map(({ history, name }) => {
      const { time, value } = history.slice(name, start, end);
      return { time: Array.from(time), value: Array.from(value, (one) => shown(name, one)) };
    }), ...others.map((one) => thinned(one, most))]);
  }
  const step = (end - start) / width;
  const first = Math.floor(start / step);
  const count = Math.floor(end / step) - first + 1;
  const time = /** @type {number[]} */ ([]);
  for (let k = 0; k < count; k += 1) for (const place of PLACES) time.push((first + k + place) * step);
  const columns = signals.map((one) => extremes(one.history, one.name, first, count, step, shown));
  if (!others.length) return [time, ...columns];
  return joined([...columns.map((column) => seen(time, column)), ...others.map((one) => thinned(one, most))]);
}

/** @param {number[]} time @param {Column} column @returns {Line} what is there */
function seen(time, column) {
  const keep = time.map((_, k) => k).filter((k) => typeof column[k] === "number");
  return { time: keep.map((k) => time[k]), value: keep.map((k) => /** @type {number} */ (column[k])) };
}

/**
 * First, least, greatest and last value of each column; columns stand at whole multiples of their width, so that a
 * line which moves does not flicker.
 * @param {History} history
 * @param {string} name
 * @param {number} first column
 * @param {number} count of columns
 * @param {number} step width of a column [s]
 * @param {(name: string, value: number) => number} shown
 * @returns {Column}
 */
function extremes(history, name, first, count, step, shown) {
  const found = /** @type {Column} */ (new Array(4 * count).fill(undefined));
  const to = history.at((first + count) * step);
  let column = -1;
  let at = 0;
  for (let k = history.at(first * step); k < to; k += 1) {
    const v = shown(name, history.value(name, k));
    const here = Math.min(Math.floor(history.time(k) / step) - first, count - 1);
    if (here < 0) continue;
    if (here !== column) {
      [column, at] = [here, 4 * here];
      found[at] = found[at + 1] = found[at + 2] = found[at + 3] = v;
    } else {
      if (v < /** @type {number} */ (found[at + 1])) found[at + 1] = v;
      if (v > /** @type {number} */ (found[at + 2])) found[at + 2] = v;
      found[at + 3] = v;
    }
  }
  for (let k = 0; k < found.length; k += 4) { // what changes nothing is not drawn
    if (found[k + 1] === found[k] || found[k + 1] === found[k + 3]) found[k + 1] = undefined;
    if (found[k + 2] === found[k] || found[k + 2] === found[k + 3]) found[k + 2] = undefined;
    if (found[k + 3] === found[k] && found[k + 1] === undefined && found[k + 2] === undefined) found[k + 3] = undefined;
  }
  return found;
}

/**
 * @param {Line} line
 * @param {number} most points
 * @returns {Line} it, or so many of its points
 */
function thinned(line, most) {
  const every = Math.ceil(line.time.length / Math.max(most, 1));
  if (every < 2) return line;
  const keep = (/** @type {number} */ _, /** @type {number} */ k) => k % every === 0;
  return { time: line.time.filter(keep), value: line.value.filter(keep) };
}

/**
 * Lines with times of their own as columns over all times; what a line lacks is left out of it.
 * @param {Line[]} parts
 * @returns {[number[], ...Column[]]}
 */
export function joined(parts) {
  const one = parts[0];
  if (parts.every((part) => part.time.length === one.time.length && part.time.every((t, k) => t === one.time[k]))) {
    return [one?.time ?? [], ...parts.map((part) => part.value)];
  }
  const times = [];
  const at = parts.map(() => 0);
  const columns = parts.map(() => /** @type {Column} */ ([]));
  for (;;) {
    let next = Infinity;
    parts.forEach((part, k) => { if (at[k] < part.time.length) next = Math.min(next, part.time[at[k]]); });
    if (next === Infinity) break;
    times.push(next);
    parts.forEach((part, k) => {
      const here = at[k] < part.time.length && part.time[at[k]] === next;
      columns[k].push(here ? part.value[at[k]] : undefined);
      if (here) at[k] += 1;
    });
  }
  return [times, ...columns];
}

/**
 * A range with round ends that holds what is drawn, and that has not to change with every point.
 * @param {number|null} low
 * @param {number|null} high
 * @param {number} least how far its ends are apart at least
 * @returns {[number, number]}
 */
export function around(low, high, least) {
  if (low === null || high === null || !Number.isFinite(low) || !Number.isFinite(high)) return [0, least];
  const span = Math.max(high - low, least, 1e-9 * Math.max(Math.abs(low), Math.abs(high)));
  const middle = (low + high) / 2;
  const room = 0.56 * span;
  const raw = span / 8;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = /** @type {number} */ ([1, 2, 5, 10].find((one) => one * power >= raw)) * power;
  return [Math.floor((middle - room) / step) * step, Math.ceil((middle + room) / step) * step];
}
