// What an oscilloscope finds in a window: its trigger, and measures. Nothing here knows of the page.

/** @typedef {{time: number[]|Float64Array, value: number[]|Float64Array}} Trace points in order; two at one time are a step */

/** Time bases and sensitivities in steps of 1, 2, 5. */
export const BASES = /** @type {number[]} */ ([]);
for (let decade = -6; decade <= 0; decade += 1) {
  for (const step of [1, 2, 5]) if (decade < 0 || step === 1) BASES.push(Number(`${step}e${decade}`));
}

/**
 * @param {[number, number][]} pulses edges and widths
 * @returns {Trace} their level, 0 or 1
 */
export function level(pulses) {
  /** @type {number[]} */
  const time = [];
  /** @type {number[]} */
  const value = [];
  for (const [edge, width] of pulses) {
    if (width <= 0) continue;
    time.push(edge, edge, edge + width, edge + width);
    value.push(0, 1, 1, 0);
  }
  return { time, value };
}

/**
 * The level over a window: from its start to its end, whatever pulses begin or end outside.
 * @param {[number, number][]} pulses edges and widths
 * @param {number} from
 * @param {number} to
 * @returns {Trace} 0 or 1
 */
export function levelBetween(pulses, from, to) {
  const made = level(pulses);
  const high = (/** @type {number} */ t) => Number(pulses.some(([edge, width]) => edge <= t && t < edge + width));
  /** @type {[number, number][]} */
  const points = [[from, high(from)]];
  for (let k = 0; k < made.time.length; k += 1) {
    if (made.time[k] > from && made.time[k] < to) points.push([made.time[k], made.value[k]]);
  }
  points.push([Math.max(to, from), high(to)]);
  return { time: points.map(([t]) => t), value: points.map(([, v]) => v) };
}

/**
 * The times at which a trace crosses a level.
 * @param {Trace} trace
 * @param {number} at
 * @param {boolean} rising
 * @returns {number[]}
 */
export function crossings(trace, at, rising) {
  const { time, value } = trace;
  const found = [];
  const sign = rising ? 1 : -1;
  for (let k = 1; k < time.length; k += 1) {
    const before = sign * (value[k - 1] - at);
    const after = sign * (value[k] - at);
    if (before < 0 && after >= 0) {
      const share = after === before ? 0 : -before / (after - before);
      found.push(time[k - 1] + share * (time[k] - time[k - 1]));
    }
  }
  return found;
}

/**
 * The latest trigger whose window has been seen whole.
 * @param {number[]} times of triggers, in order
 * @param {number} now
 * @param {number} after how long the window goes on after its trigger
 * @returns {number|null}
 */
export function latest(times, now, after) {
  for (let k = times.length - 1; k >= 0; k -= 1) if (times[k] + after <= now) return times[k];
  return null;
}

/**
 * Width, period, frequency and duty of the pulses: those of the last whole one.
 * @param {[number, number][]} pulses
 * @returns {{width: number, period: number, frequency: number, duty: number}}
 */
export function measurePulses(pulses) {
  const sent = pulses.filter(([, width]) => width > 0);
  const none = { width: NaN, period: NaN, frequency: NaN, duty: NaN };
  if (!sent.length) return none;
  if (sent.length === 1) return { ...none, width: sent[0][1] };
  const [[edge, width], [next]] = sent.slice(-2);
  const period = next - edge;
  return { width, period, frequency: 1 / period, duty: width / period };
}

/**
 * Extremes, mean, and root of the mean square of a trace between two times, over time and not over points.
 * @param {Trace} trace
 * @param {number} start
 * @param {number} end
 * @returns {{min: number, max: number, mean: number, rms: number, swing: number}}
 */
export function measure(trace, start, end) {
  const { time, value } = trace;
  let [low, high, area, square, span] = [Infinity, -Infinity, 0, 0, 0];
  for (let k = 1; k < time.length; k += 1) {
    const [t0, t1] = [Math.max(time[k - 1], start), Math.min(time[k], end)];
    if (t1 < t0 || time[k] < start || time[k - 1] > end) continue;
    const length = time[k] - time[k - 1];
    const slope = length > 0 ? (value[k] - value[k - 1]) / length : 0;
    const a = value[k - 1] + slope * (t0 - time[k - 1]);
    const b = t1 < time[k] ? value[k - 1] + slope * (t1 - time[k - 1]) : value[k];
    low = Math.min(low, a, b);
    high = Math.max(high, a, b);
    area += 0.5 * (a + b) * (t1 - t0);
    square += ((a * a + a * b + b * b) / 3) * (t1 - t0);
    span += t1 - t0;
  }
  if (!Number.isFinite(low)) return { min: NaN, max: NaN, mean: NaN, rms: NaN, swing: NaN };
  return { min: low, max: high, swing: high - low, mean: span > 0 ? area / span : low,
    rms: span > 0 ? Math.sqrt(square / span) : Math.abs(low) };
}
