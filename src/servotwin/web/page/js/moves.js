// What a shaft does, in words: it stands, moves, hunts or buzzes.

const SECOND = 1; // s that is looked at
const [STILL, QUIET] = [0.02, 0.003]; // rad/s, rad within a second: what is slower, or less, stands
const FALLS = 0.01; // V: a supply that falls by less stands
const HUNTS = 5; // turns back within a second are more than a step's
const [BUZZ, SMALL] = [8, 0.05]; // Hz, rad: a swing that is faster and smaller is heard rather than seen

/**
 * @param {import("./bench.js").Bench} bench
 * @param {number} k
 * @returns {string} such as "stands", or "buzzes at 25 Hz by 0.2°"
 */
export function moves(bench, k) {
  const seen = bench.history[k];
  if (!seen?.length) return "";
  let turns = 0;
  let [low, high, before] = [Infinity, -Infinity, 0];
  for (let n = seen.at(bench.time - SECOND); n < seen.length; n += 1) {
    const speed = seen.value("output_speed", n);
    const angle = seen.value("output_angle", n);
    [low, high] = [Math.min(low, angle), Math.max(high, angle)];
    const way = Math.abs(speed) > STILL ? Math.sign(speed) : 0;
    if (way && before && way !== before) turns += 1;
    before = way || before;
  }
  if (turns > HUNTS && high > low) {
    const rate = turns / 2 / SECOND;
    return `${rate >= BUZZ && high - low < SMALL ? "buzzes" : "hunts"} at ${rate.toFixed(0)} Hz by ${(((high - low) * 180) / Math.PI).toPrecision(2)}°`;
  }
  return high - low <= QUIET ? "stands" : "moves";
}

/**
 * How far the supply of a servo fell within a time.
 * @param {import("./bench.js").Bench} bench
 * @param {number} k
 * @param {number} start
 * @param {number} end
 * @returns {string} such as "3.92 V at least at 1.23 s"; empty where it did not fall, or is not known
 */
export function lowestSupply(bench, k, start, end) {
  const seen = bench.history[k];
  if (!seen?.has("bus_voltage")) return "";
  const { value, time } = seen.lowest("bus_voltage", start, end);
  let most = -Infinity;
  for (let n = seen.at(start); n < seen.length && seen.time(n) <= end; n += 1) most = Math.max(most, seen.value("bus_voltage", n));
  return value < most - FALLS ? `${value.toFixed(2)} V at least at ${time.toFixed(2)} s` : "";
}

/**
 * The mean current of the last second: what the supply gives where that is known, else what flows through the motor.
 * @param {import("./bench.js").Bench} bench
 * @param {number} k
 * @returns {number} [A]
 */
export function meanCurrent(bench, k) {
  const seen = bench.history[k];
  const name = seen?.has("supply_current") ? "supply_current" : "armature_current";
  return seen?.has(name) ? seen.mean(name, Math.max(bench.time - SECOND, 0), bench.time) : NaN;
}
