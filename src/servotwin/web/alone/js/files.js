// What leaves the page as files: a table, a script, the text of the bench.

import { wrong } from "./check.js";
import { Kernel } from "./kernel.js";
import { Live } from "./live.js";
import { written } from "./scene.js";
import { servoFile } from "./servo_file.js";

/**
 * @param {{module: WebAssembly.Module, world: any}} parts
 * @param {Live} live
 * @param {string} kind
 * @param {number} servo
 * @returns {Promise<{name: string, type: string, text: string}>}
 */
export async function file({ module, world }, live, kind, servo) {
  const scene = live.now();
  if (!world.files.kinds.includes(kind)) wrong("export", kind, world.files.kinds.join(", "));
  if (!(Number.isInteger(servo) && servo in scene.servos)) wrong("servo of an export", servo, `a whole number from 0 to ${scene.servos.length - 1}`);
  const text = written(world, scene);
  if (kind === "scene") return { name: "bench.toml", type: "application/toml", text };
  if (kind === "script") return { name: "bench.py", type: "text/x-python", text: script(world, scene, text) };
  if (kind === "servo") return servoFile(world, live.servos[servo]);
  return { name: "bench.csv", type: "text/csv", text: await table(new Kernel(module, world.layout), world, scene, servo) };
}

/** @param {any} world @param {any} scene @param {string} text @returns {string} */
function script(world, scene, text) {
  if (text.includes("'''")) wrong("script of this bench", "three quotes in a name", "texts without them");
  const title = (scene.name || "A bench").replaceAll("\\", "/").replaceAll('"', "'");
  return world.files.script.replaceAll("{{", "{").replaceAll("}}", "}").replace("{title}", () => title).replace("{name}", "bench.py")
    .replace("{text}", () => text);
}

/**
 * Repeat what was done, and return what a servo did as a table.
 * @param {Kernel} kernel
 * @param {any} world
 * @param {any} scene
 * @param {number} k
 * @returns {Promise<string>}
 */
async function table(kernel, world, scene, k) {
  const live = new Live(kernel, world, { ...scene, end: 0 });
  const { rate, apart, columns: shown, digits } = world.files;
  const { columns } = live.servos[k];
  const rows = [live.going.now(k)];
  /** @type {number[][]} */
  const sent = [];
  while (!live.going.reached(scene.end)) {
    const { parts } = live.advance(Math.min(scene.end, live.time + 1), rate, false);
    const { points, pulses } = parts[k];
    for (let n = 0; n < points.length; n += columns.length) rows.push(points.subarray(n, n + columns.length));
    for (let n = 0; n < pulses.length; n += 2) if (pulses[n + 1] > 0) sent.push([pulses[n], pulses[n + 1]]);
    await new Promise((done) => setTimeout(done)); // others have their turn
  }
  const kept = rows.filter((row, n) => n + 1 === rows.length || rows[n + 1][0] - row[0] > apart);
  const at = columns.indexOf("pulse_width");
  let next = 0;
  const lines = kept.map((row) => {
    while (next < sent.length && sent[next][0] <= row[0] + apart) next += 1;
    return columns.map((/** @type {string} */ name, /** @type {number} */ n) => {
      const value = n === at && next ? sent[next - 1][1] : row[n];
      const [, gain, offset] = shown[name];
      return printed(gain * value + offset + 0, digits);
    }).join(",");
  });
  return `${[columns.map((/** @type {string} */ name) => shown[name][0]).join(","), ...lines].join("\n")}\n`;
}

/** @param {number} value @param {number} digits @returns {string} */
function printed(value, digits) { return Number.isNaN(value) ? "nan" : String(Number(value.toPrecision(digits))); }
