// Servos that go on at a bench: what the kernel keeps of them, and what shows.

import { refuse } from "./check.js";

/** @typedef {import("./kernel.js").Kernel} Kernel */
/** @typedef {import("./facts.js").Servo} Servo */
/** @typedef {{shape: string, unit: string, [field: string]: any}} Command */

const PAUSED = -1;

export class Going {
  /**
   * @param {Kernel} kernel
   * @param {any} world
   * @param {Servo[]} servos
   * @param {{seed: number, frame_rate: number, supply: any}} scene
   */
  constructor(kernel, world, servos, scene) {
    kernel.clear();
    const n = servos.length;
    const { rows, events, pulses, train } = world.limits;
    const width = world.columns.length;
    this.kernel = kernel;
    this.world = world;
    this.columns = servos.map((one) => one.columns);
    this.posts = kernel.records("post", n);
    this.programs = kernel.records("program", n);
    this.memories = [kernel.records("memory", n), kernel.records("firm", n)];
    this.sender = kernel.records("sender", 1);
    this.rows = kernel.take(n, rows, width);
    this.events = kernel.take(n, events, 2);
    this.pulses = kernel.take(n, pulses, 2);
    this.used = kernel.take(n * world.limits.used);
    this.ends = kernel.take(world.limits.ends, 2);
    this.given = kernel.take(world.limits.given);
    this.none = { address: this.ends.address, lengths: [0] };
    this.trains = n * train; // rows of the table of commands that trains of pulses have
    this.room = this.trains + 2 * n * world.limits.most_pieces; // rows of it in all
    this.commands = kernel.take(this.room, world.limits.piece);
    this.told = [this.commands, { ...this.none, lengths: [0, 2] }, kernel.take(this.trains)];
    /** @type {number[][]} rows of the table of commands that are about to be followed: the first, and how many */
    this.pending = [];
    this.givens = kernel.records("given", n);
    this.weights = kernel.records("weights", n);
    servos.forEach((servo, k) => {
      kernel.set("post", this.posts, k, "seed", scene.seed + k);
      kernel.set("post", this.posts, k, "accuracy", world.limits.accuracy);
      this.make(k, servo);
    });
    const room = kernel.layout.log;
    this.log = [kernel.records("row", room.motions), kernel.records("happened", room.events), { ...this.none, lengths: [0] }, kernel.take(room.counts)];
    this.bus = Object.keys(scene.supply).length ? this.onBus(n) : null;
    kernel.set("sender", this.sender, 0, "rate", scene.frame_rate);
    kernel.set("sender", this.sender, 0, "seed", scene.seed);
    this.picks = this.columns.map((names) => names.map((/** @type {string} */ name) => world.columns.indexOf(name)));
  }

  /**
   * Return what servos on one supply have together.
   * @param {number} n
   * @returns {any}
   */
  onBus(n) {
    const { kernel } = this;
    const { event, series } = kernel.layout;
    const whole = () => kernel.take(n);
    const room = this.world.limits.at_once * n;
    const lanes = { numbers: this.none, chips: kernel.records("chips", 1), start: { ...this.none, lengths: [0, 0] }, torque: whole(),
      seeds: whole(), piece_first: whole(), piece_count: whole(), edge_first: whole(), edge_count: whole(),
      accuracy: this.world.limits.accuracy, firmware: this.programs, edges: this.told[2] };
    const tables = { torques: { ...this.none, lengths: [0, 0] }, curves: this.told[1], torque_first: whole(), torque_count: whole(),
      curve_first: whole(), curve_count: whole() };
    const tape = [kernel.records("row", room), kernel.take(room, event), kernel.take(room * series), kernel.take(3)];
    return { lanes, rest: [kernel.layout.tables.map((/** @type {string} */ name) => /** @type {any} */ (tables)[name]),
      kernel.records("shared", 1), kernel.records("seat", n), kernel.records("mate", 2 * n), tape] };
  }

  get time() { return this.kernel.get("sender", this.sender, 0, "time"); }
  get rate() { return this.kernel.get("sender", this.sender, 0, "rate"); }
  get nextEdge() { return this.kernel.call("next_edge", this.sender); }

  /** @param {number} time @returns {number} */
  snapped(time) { return this.kernel.call("snapped", this.sender, time); }

  /** @param {number} time @returns {boolean} whether the bench has come to a time [s] */
  reached(time) { return this.snapped(time) <= this.time; }

  /**
   * Put a command into the table, and return what it asks for; it counts from when it is `followed`.
   * @param {number} k
   * @param {Command} command
   * @param {number} time
   */
  taken(k, command, time) {
    const { kernel, world } = this;
    const shape = Object.keys(world.shapes).indexOf(command.shape);
    const fields = world.shapes[command.shape];
    const lists = fields.filter((/** @type {string} */ name) => Array.isArray(command[name]));
    const rows = this.rowsOf(command);
    const first = this.place(rows);
    const free = kernel.free;
    const samples = lists.map((/** @type {string} */ name) => this.listed(command[name]));
    const numbers = kernel.numbers(this.given);
    const single = fields.filter((/** @type {string} */ name) => !lists.includes(name));
    single.forEach((/** @type {string} */ name, /** @type {number} */ at) => {
      numbers[at] = typeof command[name] === "string" ? Number(command[name] === world.lines) : command[name];
    });
    const table = { address: this.commands.address + first * world.limits.piece * kernel.word, lengths: [rows, world.limits.piece] };
    const count = kernel.call("take", this.posts, k, world.units.indexOf(command.unit), shape, this.given,
      samples[0] ?? this.none, samples[1] ?? this.none, time, table, this.ends);
    kernel.free = free; // the samples are in the table now
    this.pending.push([first, count]);
    return { first, count, ends: Array.from({ length: world.limits.ends }, (_, row) => row).map((row) => [...kernel.numbers(this.ends, 2 * row, 2)]) };
  }

  /** @param {number} k @param {{first: number, count: number}} taken */
  follow(k, taken) {
    this.kernel.set("post", this.posts, k, "command_first", taken.first);
    this.kernel.set("post", this.posts, k, "command_count", taken.count);
  }

  /** @param {Command} command @returns {number} rows of pieces that it may need */
  rowsOf(command) {
    const { limits } = this.world;
    const list = Object.values(command).find(Array.isArray);
    return list ? list.length : limits.most_pieces;
  }

  /** @param {number} rows @returns {number} where so many rows stand that no servo follows */
  place(rows) {
    const { kernel, world } = this;
    const followed = this.columns.map((_, k) => ["command_first", "command_count"].map((name) => kernel.get("post", this.posts, k, name)));
    const spans = [...followed, ...this.pending].filter(([, count]) => count).sort((a, b) => a[0] - b[0]);
    let at = this.trains;
    for (const [first, count] of spans) {
      if (at + rows <= first) break;
      at = Math.max(at, first + count);
    }
    if (at + rows > this.room) {
      const before = this.commands;
      this.room = 2 * (at + rows);
      const grown = kernel.take(this.room, world.limits.piece);
      kernel.numbers(grown).set(kernel.numbers(before));
      this.commands = grown;
      this.told[0] = grown;
    }
    return at;
  }

  /** @param {number[]} values */
  listed(values) {
    const block = this.kernel.take(values.length);
    this.kernel.numbers(block).set(values);
    return block;
  }

  /**
   * Make a servo of what is given of it.
   * @param {number} k
   * @param {Servo} servo
   */
  make(k, servo) {
    const { kernel } = this;
    for (const [field, value] of servo.given()) if (field) kernel.set("given", this.givens, k, field, value);
    for (const [field, value] of Object.entries(servo.load)) kernel.set("weights", this.weights, k, field, value);
    const how = kernel.call("make", this.posts, this.programs, k, servo.family, this.givens, this.weights);
    if (how) refuse(this.world.made[how], servo.value("gear.backlash"));
  }

  /** Go on with a servo that was made anew. @param {number} k */
  change(k) { this.kernel.call("change", this.posts, k, this.memories); }

  /** @param {number} k */
  begin(k) { this.kernel.call("begin", this.posts, k, this.told, this.memories); }

  /** @param {number} k @param {number} angle where it stands, whatever its command says [rad] */
  beginAt(k, angle) { this.kernel.call("begin_at", this.posts, k, this.told, this.memories, angle); }

  /** @param {number} k @returns {Float64Array} the row of a servo as it stands */
  now(k) {
    this.kernel.call("look", this.posts, k, this.told, this.programs, this.memories, this.rows, this.used);
    const width = this.world.columns.length;
    const all = this.kernel.numbers(this.rows, k * this.world.limits.rows * width, width);
    return Float64Array.from(this.picks[k], (from) => all[from]);
  }

  /** @param {number} k @param {number} torque [N m] */
  push(k, torque) { this.kernel.set("post", this.posts, k, "push", torque); }

  /** @param {number} k @returns {boolean} whether a servo hears pulses */
  hears(k) { return this.kernel.get("post", this.posts, k, "pulsed") === 1; }

  /** @param {number} rate [Hz] */
  tune(rate) { this.kernel.call("tune", this.sender, rate); }

  /** @param {number} share */
  lose(share) { this.kernel.set("sender", this.sender, 0, "lost", share); }

  /** @param {number} k @param {boolean} on */
  torque(k, on) { this.kernel.set("firm", this.memories[1], k, "torque", Number(on)); }

  /**
   * Go on to a time, or as far as there is room for what shows.
   * @param {number} until
   * @param {number} rate of looks [Hz]
   * @param {boolean} switches
   */
  advance(until, rate, switches) {
    const { kernel, world } = this;
    const together = this.bus ? [kernel.layout.lanes.map((/** @type {string} */ name) => (
      name === "pieces" ? this.commands : this.bus.lanes[name])), ...this.bus.rest] : [this.log];
    const left = kernel.wholes(this.used);
    for (let k = 0; k < this.columns.length; k += 1) left[k * world.limits.used + world.limits.left] = BigInt(world.limits.steps);
    const status = kernel.call(this.bus ? "advance_together" : "advance", this.posts, this.told, this.programs, this.memories,
      this.sender, ...together, until, rate, Number(switches), this.rows, this.events, this.pulses, this.used);
    const used = [...kernel.wholes(this.used)].map(Number);
    const { rows, events, pulses } = world.limits;
    const width = world.columns.length;
    /** @type {[number, string, number][]} */
    const said = [];
    const parts = this.columns.map((columns, k) => {
      const [seen, noted, heard] = used.slice(k * world.limits.used, (k + 1) * world.limits.used);
      const all = kernel.numbers(this.rows, k * rows * width, seen * width);
      const picks = this.picks[k];
      const points = new Float64Array(seen * picks.length);
      for (let n = 0; n < seen; n += 1) picks.forEach((/** @type {number} */ from, /** @type {number} */ to) => { points[n * picks.length + to] = all[n * width + from]; });
      const events_ = kernel.numbers(this.events, k * events * 2, noted * 2);
      for (let n = 0; n < noted; n += 1) {
        const word = world.events[events_[2 * n + 1]];
        if (word) said.push([events_[2 * n], word, k]);
      }
      return { columns, points, pulses: kernel.numbers(this.pulses, k * pulses * 2, heard * 2).slice() };
    });
    const wrong = status === 0 || status === PAUSED ? null : status === world.limits.too_long ? world.words.too_long : world.status[status];
    return { time: this.time, parts, events: said, wrong };
  }
}
