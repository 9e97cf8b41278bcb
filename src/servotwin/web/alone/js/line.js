// The way to the bench: here it stands in the page itself.

import { Refused, speak } from "./check.js";
import { Kernel } from "./kernel.js";
import { Room } from "./room.js";

const { world, module } = /** @type {any} */ (globalThis).servotwin;

/** @typedef {{n: number, m: number, columns: string[]}} Part how many rows, of what, and how many pulses */
/** @typedef {{points: Float64Array, pulses: Float64Array}} Numbers rows, and edges and widths [s], one after the other */

/**
 * @param {{told: (message: any) => void, pushed: (header: any, parts: any[]) => void}} page
 * @returns {{open: boolean, say: (message: any) => void}}
 */
export function connect(page) {
  speak(world.words);
  /** @type {Room} */
  let room;
  const live = () => { room.turn(); setTimeout(live, world.limits.pause); };
  const begun = Promise.resolve().then(() => {
    page.told({ hello: { role: "own", alone: world.words.alone, lessons: world.lessons } });
    room = new Room({ kernel: new Kernel(module, world.layout), module, world }, page);
    live();
  });
  return { open: true, say: async (message) => {
    await begun;
    try {
      page.told({ done: message.id, ...await room.answer(message) });
    } catch (error) {
      if (!(error instanceof Refused)) console.error(error);
      page.told({ refused: message.id, message: error instanceof Error ? error.message : String(error) });
    }
  } };
}

/** @param {string} what @param {string} [name] @returns {Promise<any>} what a page asks for once */
export async function asked(what, name = "") {
  const found = what === "catalog" ? world.catalog : world.curves[name];
  return found.error ? Promise.reject(new Error(found.error)) : found;
}
