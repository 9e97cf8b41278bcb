// Benches of the page as one file, without the page: node bench.mjs FOLDER, jobs in JSON from stdin, what shows to stdout.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

import { play } from "./play.mjs";

const folder = process.argv[2];
const parts = await Promise.all(["kernel.js", "live.js", "check.js", "scene.js"].map((name) => import(pathToFileURL(`${folder}/${name}`))));
const { world, jobs } = JSON.parse(readFileSync(0, "utf8"));
const module = new WebAssembly.Module(readFileSync(`${folder}/bench.wasm`));
const found = play(Object.assign({}, ...parts), module, world, jobs, () => 1e-6 * process.cpuUsage().user);
process.stdout.write(JSON.stringify(found, (_, x) => (typeof x === "number" && !Number.isFinite(x) ? String(x) : x)));
