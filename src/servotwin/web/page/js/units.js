// Numbers as people read them.

const PREFIXES = /** @type {[number, string][]} */ ([
  [1e9, "G"], [1e6, "M"], [1e3, "k"], [1, ""], [1e-3, "m"], [1e-6, "µ"], [1e-9, "n"]]);

/**
 * @param {number} value
 * @param {number} [digits] that count
 * @returns {string}
 */
export function plain(value, digits = 4) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) return value.toExponential(digits - 1).replace(/\.?0+e/, "e").replace("e+", "e");
  const text = value.toPrecision(digits);
  if (text.includes("e")) return value.toFixed(0);
  return text.includes(".") ? text.replace(/\.?0+$/, "") : text;
}

/** @param {string} unit in letters @returns {string} as it is printed */
export function printed(unit) {
  return unit === "1" ? "" : unit.replace(/\bohm\b/, "Ω").replace(/\bus\b/, "µs").replace(/\bdeg\b/, "°").replace(/(\bm|cm|s)2\b/g, "$1²");
}

const NOTHING = 1e-15; // of a volt, an ampere, a second: what rounding leaves

/**
 * A value with a prefix before its unit, such as 1.5 ms.
 * @param {number} value in SI
 * @param {string} unit
 * @param {number} [digits]
 * @returns {string}
 */
export function engineering(value, unit, digits = 4) {
  if (!Number.isFinite(value)) return "–";
  if (Math.abs(value) < NOTHING) return `0 ${unit}`;
  const size = Math.abs(Number(value.toPrecision(digits))); // 999.9 µs to two digits is a millisecond
  const [scale, prefix] = PREFIXES.find(([least]) => size >= least * 0.9999999) ?? [1, ""];
  return `${plain(value / (size ? scale : 1), digits)} ${size ? prefix : ""}${unit}`;
}

/** Signals as they are shown: [unit, factor from SI, label]. */
export const SHOWN = /** @type {Record<string, [string, number, string]>} */ ({
  output_angle: ["°", 180 / Math.PI, "angle"], command_angle: ["°", 180 / Math.PI, "command"],
  goal_angle: ["°", 180 / Math.PI, "goal"], reference_angle: ["°", 180 / Math.PI, "reference"],
  load_angle: ["°", 180 / Math.PI, "load angle"], output_speed: ["°/s", 180 / Math.PI, "speed"],
  motor_angle: ["rad", 1, "motor angle"], motor_speed: ["rad/s", 1, "motor speed"],
  load_torque: ["mN m", 1e3, "torque at the horn"], motor_torque: ["mN m", 1e3, "motor torque"],
  armature_current: ["A", 1, "motor current"], armature_voltage: ["V", 1, "motor voltage"],
  supply_current: ["A", 1, "supply current"], bus_voltage: ["V", 1, "supply voltage"],
  feedback_voltage: ["V", 1, "feedback voltage"], command_voltage: ["V", 1, "input voltage"],
  pulse_width: ["µs", 1e6, "pulse width"], error_time: ["µs", 1e6, "error"],
  winding_temperature: ["°C", 1, "winding"], housing_temperature: ["°C", 1, "housing"],
  duty: ["1", 1, "duty"], drive: ["1", 1, "drive"], trip: ["1", 1, "protection"] });

/**
 * @param {string} name of a signal
 * @param {number} value in SI
 * @returns {number} as it is shown
 */
export function shown(name, value) {
  const [unit, factor] = SHOWN[name] ?? ["", 1, name];
  return unit === "°C" ? value - 273.15 : factor * value;
}
