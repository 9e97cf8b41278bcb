// Benches of the page as one file, without the page: node bench.mjs FOLDER, jobs in JSON from stdin, what shows to stdout.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const folder = process.argv[2];
const of = (name) => import(pathToFileURL(`${folder}/${name}`));
const [{ Kernel }, { Live }, { Refused, speak }, { read, written }] = await Promise.all(
  ["kernel.js", "live.js", "check.js", "scene.js"].map(of));
const { world, jobs } = JSON.parse(readFileSync(0, "utf8"));
const kernel = new Kernel(new WebAssembly.Module(readFileSync(`${folder}/bench.wasm`)), world.layout);
speak(world.words);

const found = jobs.map(({ scene, steps, rate, switches }) => {
  const refused = [];
  let live;
  try {
    live = new Live(kernel, world, { ...read(world, scene), end: 0 });
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    return { refused: [error.message] };
  }
  const rows = live.servos.map(() => []);
  const pulses = live.servos.map(() => []);
  const events = [];
  const begun = process.cpuUsage().user;
  for (const { until, kind, value, servo } of steps) {
    try {
      while (live.due || !live.going.reached(until)) {
        const push = live.advance(until, rate, switches);
        push.parts.forEach(({ columns, points, pulses: heard }, k) => {
          for (let n = 0; n < points.length; n += columns.length) rows[k].push([...points.subarray(n, n + columns.length)]);
          for (let n = 0; n < heard.length; n += 2) pulses[k].push([heard[n], heard[n + 1]]);
        });
        events.push(...push.events);
      }
      if (kind) live.do(kind, value, servo ?? null);
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      refused.push(error.message);
      if (!kind || !live.going.reached(until)) break;
    }
  }
  return { rows, pulses, events, refused, text: written(world, live.now()), time: live.time,
    cpu: (process.cpuUsage().user - begun) * 1e-6 };
});
process.stdout.write(JSON.stringify(found, (_, x) => (typeof x === "number" && !Number.isFinite(x) ? String(x) : x)));
