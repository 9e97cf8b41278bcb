// Numbers that nobody may say, put past the rules: the kernel says that it cannot go on, and does not trap.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const folder = process.argv[2];
const of = (name) => import(pathToFileURL(`${folder}/${name}`));
const [{ Kernel }, { Live }, { Refused, speak }, { read }] = await Promise.all(["kernel.js", "live.js", "check.js", "scene.js"].map(of));
const { world, scenes } = JSON.parse(readFileSync(0, "utf8"));
speak(world.words);
const kernel = new Kernel(new WebAssembly.Module(readFileSync(`${folder}/bench.wasm`)), world.layout);
let count = 0;

function change(live) {
  try {
    live.going.make(0, live.servos[0]);
    live.going.change(0);
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
  }
}

for (const text of scenes) {
  for (const value of [NaN, Infinity, -Infinity, 1e308, -1e308, 1e19]) {
    for (const wild of ["push", "command", "load", "given", "count", "none"]) {
      const live = new Live(kernel, world, { ...read(world, text), end: 0 });
      if (wild === "push") live.going.push(0, value);
      if (wild === "command") live.going.follow(0, live.going.taken(0, { shape: "hold", unit: "deg", value }, 0));
      if (wild === "load") live.servos[0].load.inertia = value;
      if (wild === "given") live.servos[0].values.set("motor.armature_resistance", value);
      if (wild === "load" || wild === "given") change(live);
      live.going.advance(0.1, 100, true);
      if (wild === "count") kernel.call("count", 400, 0, 1023, value);
      live.going.now(0);
      count += 1;
    }
  }
}
process.stdout.write(JSON.stringify(count));
