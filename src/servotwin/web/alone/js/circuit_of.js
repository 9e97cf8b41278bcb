// The control circuit at a bench: a program that reads its command off the supply of a servo, and makes its pulses.

import { refuse, wrong } from "./check.js";

/** @typedef {import("./live.js").Live} Live */

export class Circuit {
  /**
   * @param {any} world
   * @param {Live} live
   * @param {Record<string, number>} numbers what a scene says of it
   */
  constructor(world, live, numbers) {
    this.world = world;
    this.live = live;
    this.numbers = { ...world.control.usual, ...numbers };
    const { kernel } = live.going;
    this.records = kernel.records("circuit", 1);
    for (const [name, value] of Object.entries(world.control.fields)) kernel.set("circuit", this.records, 0, name, value);
    live.servos.forEach((one, k) => { if (!live.going.hears(k)) wrong("model at a control circuit", one.model, world.words.of_pulses); });
    /** @type {{edge: number, width: number, at: number}[]} when its program looks next, of each servo: behind which edge, and when [s] */
    this.looks = [];
  }

  /** @returns {number} from the edge of the longest pulse to when the program looks [s] */
  get longest() { return this.longestWith({}); }

  /** @param {Record<string, number>} numbers @returns {number} */
  longestWith(numbers) {
    const { longest, delay } = this.world.control;
    return longest + { ...this.numbers, ...numbers }[delay];
  }

  /** Read the command of a servo while its supply has lost a part of its voltage. @param {number} k @param {number} sag */
  heed(k, sag) {
    const { going } = this.live;
    const { shares, delay } = this.world.control;
    if (!(1 - this.numbers[shares[1]] * sag > 0)) refuse("no_reference");
    for (const name of shares) going.kernel.set("circuit", this.records, 0, name, this.numbers[name]);
    const width = going.kernel.call("heed", going.posts, k, going.told, this.records, going.time, sag);
    const edge = going.nextEdge;
    this.looks[k] = { edge, width, at: edge + width + this.numbers[delay] };
  }

  /** @returns {number} when a program looks next [s] */
  get next() { return Math.min(...this.looks.map(({ at }) => this.live.going.snapped(at))); }

  /** Let those programs look whose time it is. @param {{columns: string[], points: Float64Array}[]} parts what has shown */
  look(parts) {
    const { going, servos } = this.live;
    const { bus, full } = this.world.control;
    this.looks.forEach(({ at }, k) => {
      if (going.snapped(at) > going.time) return;
      const { columns, points } = parts[k];
      const volts = points[points.length - columns.length + columns.indexOf(bus)];
      this.heed(k, 1 - volts / servos[k].value(full));
    });
  }

  /** @param {Record<string, number>} numbers */
  change(numbers) {
    Object.assign(this.numbers, numbers);
    const { nextEdge } = this.live.going;
    for (const one of this.looks) if (one.edge >= nextEdge) one.at = one.edge + one.width + this.numbers[this.world.control.delay];
  }
}
