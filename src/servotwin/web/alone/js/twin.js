// A log over its twin: a servo of the bench under the log's own command, and what is left between them.

import { checked } from "./check.js";
import { duration, played } from "./csv.js";
import { Going } from "./going.js";
import { Kernel } from "./kernel.js";

/**
 * Let a servo go on as the log's was told, from rest where the log begins.
 * @param {{module: WebAssembly.Module, world: any}} parts
 * @param {import("./live.js").Live} live
 * @param {number} k the servo
 * @param {import("./csv.js").Log} log
 * @param {() => boolean} ended whether nobody waits for it any more
 * @returns {Promise<any>} what is drawn; null if it was ended
 */
export async function compared({ module, world }, live, k, log, ended) {
  const servo = live.servos[k].copy();
  const going = new Going(new Kernel(module, world.layout), world, [servo], { seed: live.scene.seed + k, frame_rate: live.going.rate, supply: {} });
  const taken = going.taken(0, checked(world.rules.actions.command, played(world, log)), 0);
  servo.bound({ unit: world.csv.units[log.kind][0] }, taken.ends);
  going.follow(0, taken);
  const counted = [...log.angle.keys()].filter((n) => Number.isFinite(log.angle[n]));
  going.beginAt(0, log.angle[counted[0]]);
  const place = servo.columns.indexOf(world.csv.angle);
  const rate = 1 / (2 * duration(log)); // no look but at the end of each stretch
  const angles = [];
  let [angle, pause] = [going.now(0)[place], performance.now() + world.limits.pause];
  for (const n of counted) {
    const until = log.time[n] - log.time[0];
    while (!going.reached(until)) {
      const { parts: [{ points }], wrong } = going.advance(until, rate, false);
      if (wrong) throw new Error(wrong.replace("{time}", String(going.time)));
      if (points.length) angle = points[points.length - servo.columns.length + place];
      if (performance.now() > pause) {
        await new Promise((done) => setTimeout(done)); // the bench has its turn
        pause = performance.now() + world.limits.pause;
      }
      if (ended()) return null;
    }
    angles.push(angle);
  }
  return overlay(world, servo, log, counted, angles);
}

/** @param {any} world @param {import("./facts.js").Servo} servo @param {import("./csv.js").Log} log @param {number[]} counted samples @param {number[]} angles of the servo there [rad] */
function overlay(world, servo, log, counted, angles) {
  const [factor, unit] = world.csv.shown;
  const time = counted.map((n) => log.time[n] - log.time[0]);
  const measured = counted.map((n) => factor * log.angle[n]);
  const simulated = angles.map((one) => factor * one);
  const residual = measured.map((one, n) => one - simulated[n]);
  const worst = residual.reduce((most, one, n) => (Math.abs(one) > Math.abs(residual[most]) ? n : most), 0);
  const those = shown(world.csv.stretches, [measured, simulated, residual]);
  const of = (/** @type {number[]} */ values) => those.map((n) => values[n]);
  return { log: log.name, signal: world.csv.angle, unit, time: of(time), measured: of(measured), simulated: of(simulated), residual: of(residual),
    rms: Math.sqrt(residual.reduce((sum, one) => sum + one * one, 0) / residual.length), worst: residual[worst], worst_at: time[worst],
    samples: residual.length, judged_from: time[0], duration: duration(log), servo: servo.known.title, model: servo.model,
    rig: [], rig_fitted: false, warnings: [world.words.twin] };
}

/** @param {number} stretches @param {number[][]} signals @returns {number[]} samples of which a picture is drawn: all, or the extremes in stretches */
function shown(stretches, signals) {
  const count = signals[0].length;
  if (count <= stretches * (2 * signals.length + 1)) return [...signals[0].keys()];
  const picked = new Set([0, count - 1]);
  for (let k = 0; k < stretches; k += 1) {
    const [from, to] = [k, k + 1].map((one) => Math.floor((one * count) / stretches));
    picked.add(from);
    for (const values of signals) {
      let [low, high] = [from, from];
      for (let n = from; n < to; n += 1) {
        if (values[n] < values[low]) low = n;
        if (values[n] > values[high]) high = n;
      }
      picked.add(low).add(high);
    }
  }
  return [...picked].sort((a, b) => a - b);
}
