// Logs at the page as one file, without the page: what is told of each, and its twin; or what is refused.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const folder = process.argv[2];
const of = (name) => import(pathToFileURL(`${folder}/${name}`));
const [{ Kernel }, { Live }, { Refused, speak }, { read }, { readLog }, { compared }] = await Promise.all(
  ["kernel.js", "live.js", "check.js", "scene.js", "csv.js", "twin.js"].map(of));
const { world, jobs } = JSON.parse(readFileSync(0, "utf8"));
speak(world.words);
const module = new WebAssembly.Module(readFileSync(`${folder}/bench.wasm`));
const found = [];
for (const { scene, csv, name } of jobs) {
  try {
    const { log, facts } = readLog(world, name, new TextEncoder().encode(csv));
    const live = new Live(new Kernel(module, world.layout), world, { ...read(world, scene), end: 0 });
    found.push({ facts, overlay: await compared({ module, world }, live, 0, log, () => false) });
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    found.push({ refused: error.message });
  }
}
process.stdout.write(JSON.stringify(found));
