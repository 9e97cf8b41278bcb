// A log of one's own: kept, laid over a servo of the bench, its command told.

import { played, readLog } from "./csv.js";
import { refuse, wrong } from "./check.js";
import { compared } from "./twin.js";

/** @typedef {import("./csv.js").Log} Log */

export class OwnLog {
  /**
   * @param {any} parts module and world
   * @param {{told: (message: any) => void}} page
   */
  constructor(parts, page) {
    this.parts = parts;
    this.page = page;
    /** @type {Log|null} */
    this.log = null;
    this.comparisons = 0;
  }

  /** @returns {Log} */
  get there() { return this.log ?? refuse("log"); }

  /** @param {string} name @param {ArrayBuffer} bytes @returns {any} what is told of a log that was handed in */
  take(name, bytes) {
    this.log = null;
    const { log, facts } = readLog(this.parts.world, name, bytes);
    this.log = log;
    return facts;
  }

  /** @returns {any} its command as a bench takes it */
  played() { return played(this.parts.world, this.there); }

  /** @param {import("./live.js").Live} live @param {any} asked @returns {any} */
  answer(live, asked) {
    this.comparisons += 1;
    if (asked.forget) { this.log = null; return {}; }
    if (!asked.show) refuse("only_with_server");
    if (!(asked.servo in live.servos)) wrong("servo", asked.servo, `a whole number from 0 to ${live.servos.length - 1}`);
    this.compare(live, asked.servo, this.there);
    return {};
  }

  /** @param {import("./live.js").Live} live @param {number} k @param {Log} log lay it over a servo as it is now; the page is told */
  async compare(live, k, log) {
    const own = this.comparisons;
    try {
      const overlay = await compared(this.parts, live, k, log, () => own !== this.comparisons);
      if (overlay) this.page.told({ own: { overlay } });
    } catch (error) {
      this.page.told({ own: { wrong: error instanceof Error ? error.message : String(error) } });
    }
  }
}
