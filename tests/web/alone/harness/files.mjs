// Servo files of the page as one file, without the page: those of benches, or what is refused.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const folder = process.argv[2];
const of = (name) => import(pathToFileURL(`${folder}/${name}`));
const [{ Kernel }, { Live }, { Refused, speak }, { read }, { servoFile }] = await Promise.all(
  ["kernel.js", "live.js", "check.js", "scene.js", "servo_file.js"].map(of));
const { world, scenes } = JSON.parse(readFileSync(0, "utf8"));
speak(world.words);
const kernel = new Kernel(new WebAssembly.Module(readFileSync(`${folder}/bench.wasm`)), world.layout);
const found = scenes.map((text) => {
  try {
    const live = new Live(kernel, world, { ...read(world, text), end: 0 });
    return { text: servoFile(world, live.servos[0]).text };
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    return { refused: error.message };
  }
});
process.stdout.write(JSON.stringify(found));
