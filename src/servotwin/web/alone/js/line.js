// The way to the bench: here it stands in the page itself.

import { Refused, speak } from "./check.js";
import { Room } from "./room.js";

/** @type {Room} */
let room;
const { world, module } = /** @type {any} */ (globalThis).servotwin;

/** @typedef {{n: number, m: number, columns: string[]}} Part how many rows, of what, and how many pulses */
/** @typedef {{points: Float64Array, pulses: Float64Array}} Numbers rows, and edges and widths [s], one after the other */

/**
 * @param {{told: (message: any) => void, pushed: (header: any, parts: any[]) => void}} page
 * @returns {{open: boolean, say: (message: any) => void}}
 */
export function connect(page) {
  speak(world.words);
  const live = () => { room.turn(); setTimeout(live, world.limits.pause); };
  const begun = Promise.resolve().then(() => {
    page.told({ hello: { role: "own", alone: world.words.alone, log_hint: world.words.log_hint, lessons: world.lessons } });
    room = new Room({ module, world }, page);
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

/**
 * @param {File} file a log
 * @param {string} _visitor whose it is
 * @returns {Promise<{log?: any, wrong?: string, error?: string}>} what is known of it, or what is wrong with it
 */
export async function handedIn(file, _visitor) {
  const bytes = await file.arrayBuffer();
  try {
    return { log: room.own.take(file.name, bytes) };
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    return { wrong: error.message };
  }
}
