// The servos of a bench: what is given of them, what the panels show of them, and between what commands may be.

import { Refused, filled, refuse, tidy, unknown, within, wrong } from "./check.js";
import { readServo } from "./servo_file.js";

/** @typedef {{time: number, kind: string, value: any, servo: number|null}} Action */

export class Servo {
  /**
   * @param {any} world
   * @param {any} one a servo of a scene
   * @param {any} scene
   * @param {import("./kernel.js").Kernel} kernel
   */
  constructor(world, one, scene, kernel) {
    this.world = world;
    this.mystery = "mystery" in one;
    const file = "file" in one ? readServo(world, one.file) : null;
    const id = this.mystery ? world.mystery.base : file?.id ?? one.id;
    const known = file ? { ...world.servos[id], title: file.title } : world.servos[id];
    if (!known) unknown("servo", id, Object.keys(world.servos));
    this.known = this.mystery ? { ...known, id: "mystery", title: filled(world.words.mystery, { seed: one.mystery }) } : known;
    this.id = this.known.id;
    this.model = one.model || known.model;
    this.own = known.of[this.model] ?? refuse("no_such_model", this.model, known);
    const { reads, family } = world.models[this.model];
    this.family = family;
    this.reads = new Set(reads);
    /** @type {Map<string, any>} */
    this.values = new Map(world.parameters.map((/** @type {any[]} */ [name], /** @type {number} */ n) => [name, known.values[n][world.of_each.indexOf("value")]]));
    /** @type {Map<string, {value: any, source: string}>} values that are others than the catalog's */
    this.changed = new Map();
    this.load = { ...world.no_load, ...scene.load };
    if (this.mystery) for (const [name, value] of Object.entries(hidden(world, kernel, one.mystery))) this.hide(name, value);
    /** @type {Map<string, number>} what was written into registers */
    this.written = new Map();
    if (Object.keys(one.registers).length) this.write(one.registers);
    this.change({ ...file?.values, ...one.parameters });
  }

  /**
   * Take a supply that several servos share in the place of its own.
   * @param {Record<string, number>} supply
   * @param {number} number of the servo, from 1 on
   */
  hang(supply, number) {
    const { world } = this;
    const [volts] = world.of_bus;
    const given = Object.fromEntries(Object.entries(supply).map(([name, value]) => [`supply.${name}`, value]));
    for (const name of world.of_bus) this.values.set(name, null);
    this.change(given);
    if (!(volts in given)) refuse("no_supply");
    if (!world.switched.includes(this.model)) wrong(`model of servo ${number} on a shared supply`, this.model, world.words.bus_models);
    if (this.reads.has("gear.stiffness") && Number.isFinite(this.value("gear.stiffness"))) wrong(`servo ${number} on a shared supply`, "gear.stiffness", world.words.rigid);
  }

  get columns() { return this.own.columns; }

  /** @param {string} name @param {number} value */
  hide(name, value) {
    const { friction, both_ways: both } = this.world.mystery;
    for (const one of name === friction ? both : [name]) this.values.set(one, value);
  }

  /** @param {string} name @returns {boolean} whether a number is not shown */
  hides(name) {
    const { hidden: those, both_ways: both } = this.world.mystery;
    return this.mystery && (both.includes(name) || those.some((/** @type {any} */ one) => one.name === name));
  }

  /** @param {string} name @returns {any} a value, or the usual one */
  value(name) { return this.values.get(name); }

  /** @param {Record<string, any>} values by dotted names; nothing has changed where one is refused */
  change(values) {
    const next = new Map(this.values);
    for (const [name, value] of Object.entries(values)) {
      const place = this.world.parameters.findIndex((/** @type {any[]} */ own) => own[0] === name);
      if (place < 0) unknown("parameter", name, this.world.parameters.map((/** @type {any[]} */ own) => own[0]));
      this.looked(name, value, this.world.parameters[place]);
      next.set(name, value);
    }
    for (const [low, high] of this.world.less) {
      const [a, b] = [next.get(low), next.get(high)];
      if (Number.isFinite(a) && Number.isFinite(b) && !(a < b)) wrong(low, a, `less than ${high} = ${b}`);
    }
    this.values = next;
    for (const [name, value] of Object.entries(values)) this.changed.set(name, value);
  }

  /** @param {Record<string, number>} values by the maker's names; nothing has changed where one is refused */
  write(values) {
    const { registers } = this.known;
    if (!registers) wrong(`registers of ${this.id}`, Object.keys(values).join(", "), this.world.words.no_registers);
    const all = new Map([...this.written, ...Object.entries(values)]);
    /** @type {Map<string, any>} */
    const made = new Map();
    for (const [name, value] of Object.entries(values)) {
      const table = registers.find((/** @type {any} */ one) => one.name === name) ?? this.unwritten(name);
      const now = held(table, value) ?? wrong(table.what, value, table.allowed);
      if (table.shared.some((/** @type {string} */ other) => all.has(other))) refuse("only_with_server");
      const before = held(table, this.written.get(name) ?? table.value) ?? [];
      table.numbers.forEach((/** @type {string} */ number, /** @type {number} */ n) => { if (now[n] !== before[n]) made.set(number, now[n]); });
    }
    for (const [number, value] of made) { this.values.set(number, value); this.changed.set(number, value); }
    this.written = all;
  }

  /** Refuse to write a register that has no table. @param {string} name @returns {never} */
  unwritten(name) {
    const { label, names } = this.known.family;
    if (names.includes(name)) return refuse("only_with_server");
    return unknown(`register of ${label}`, name, names, filled(this.world.words.a_register, { such: names[0] }));
  }

  /** @returns {any} the spring that its loop is: of a servo whose registers were written its stiffness alone, of one with other numbers nothing is said */
  get loop() {
    const { loop } = this.own;
    if (!loop || !this.changed.size) return loop;
    const numbers = this.known.registers.flatMap((/** @type {any} */ one) => (this.written.has(one.name) ? one.numbers : []));
    if (![...this.changed.keys()].every((name) => numbers.includes(name))) return null;
    return { stiffness_nm_per_rad: loop.per_gain * this.values.get(loop.gain) };
  }

  /** @param {string} name @param {any} value @param {any[]} own what is alike of all servos */
  looked(name, value, own) {
    const { of_all: names, ranges } = this.world;
    const [rule, choices, unit] = ["rule", "choices", "unit"].map((one) => own[names.indexOf(one)]);
    if (choices) { if (!choices.includes(value)) wrong(name, value, choices.join(" or ")); }
    else if (!(rule in ranges)) refuse("only_with_server");
    else if (!Number.isFinite(value) || !within(ranges[rule], value)) wrong(name, value, `${rule} [${unit}]`);
  }

  /** @returns {[string, number][]} fields of what is given, as the kernel takes them */
  given() {
    const { given, parameters, of_all: names } = this.world;
    return parameters.map((/** @type {any[]} */ own) => {
      const value = this.reads.has(own[0]) ? this.values.get(own[0]) : null;
      const choices = own[names.indexOf("choices")];
      return [given[own[0]], value === null || value === undefined || Array.isArray(value) ? NaN : choices ? choices.indexOf(value) : value];
    });
  }

  /**
   * Refuse a command that goes beyond bounds.
   * @param {any} command
   * @param {number[][]} ends lowest and highest of the command, and of what the servo follows; their pieces, and when these start [s]
   */
  bound(command, ends) {
    const bounds = this.own.bounds[command.unit] ?? this.untold(command.unit);
    const end = (/** @type {any} */ one, /** @type {number} */ none) => {
      const [name, usual] = Array.isArray(one) ? one : [null, one];
      return (name && this.value(name)) ?? usual ?? none;
    };
    for (const one of bounds) {
      const [[lowest, highest], followed, pieces, starts] = ends;
      const [least, most] = one.of === "command" ? [lowest, highest] : followed;
      const [low, high] = [end(one.low, -Infinity), end(one.high, Infinity)];
      const slack = one.slack ?? 0;
      const below = one.open ? least <= low : least < low - slack;
      if (!below && !(one.open ? most >= high : most > high + slack)) continue;
      const [got, from, to] = [below ? least : most, low, high].map((x) => tidy(x * one.factor));
      throw new Refused(filled(one.words, { got, low: from, high: to, name: this.id, piece: pieces[below ? 0 : 1], start: tidy(starts[below ? 0 : 1]) }));
    }
  }

  /** Refuse a kind of command that it does not take. @param {string} unit @returns {never} */
  untold(unit) {
    const word = this.world.kinds[unit];
    const goals = this.values.get("firmware.command_kind") === "goal" && this.reads.has("firmware.command_kind");
    if (goals) return refuse("takes_goals", null, { name: this.id, word, kind: word.replaceAll("_", " ") });
    throw new Refused(this.own.refused[unit]);
  }

  /** @param {number} k @returns {any} what the panels know of it */
  facts(k) {
    const { world, known, own } = this;
    return { servo: k, id: known.id, title: known.title, kind: known.kind, model: this.model, models: known.models,
      horn: known.horn, registers: this.registers(), columns: own.columns, travel_deg: own.travel_deg, pulse_us: own.pulse_us,
      voltage: own.voltage, loop: this.loop,
      signals: Object.fromEntries(own.columns.slice(1).map((/** @type {string} */ name) => [name, world.signals[name]])),
      parameters: world.parameters.map((/** @type {any[]} */ alike, /** @type {number} */ n) => {
        const name = alike[0];
        const value = this.changed.get(name);
        const set = this.changed.has(name) ? { value, ...world.set, ...ends(world.slider, value, alike[world.of_all.indexOf("rule")]) } : {};
        return { ...joined(world.of_all, alike), ...joined(world.of_each, known.values[n]), ...set, read: this.reads.has(name) };
      }).filter((/** @type {any} */ one) => !this.hides(one.name)) };
  }

  /** @returns {any[]|null} its registers with what they hold */
  registers() {
    return this.known.registers && this.known.registers.map((/** @type {any} */ one) => ({ ...one, value: this.written.get(one.name) ?? one.value }));
  }

  /** @returns {Servo} the same, of which something may change */
  copy() {
    const copy = Object.assign(Object.create(Servo.prototype), this);
    copy.load = { ...this.load };
    copy.values = new Map(this.values);
    copy.changed = new Map(this.changed);
    copy.written = new Map(this.written);
    return copy;
  }
}

/** @param {any} world @param {import("./kernel.js").Kernel} kernel @param {number} seed @returns {Record<string, number>} what is hidden behind a seed (SI) */
export function hidden(world, kernel, seed) {
  return Object.fromEntries(world.mystery.hidden.map((/** @type {any} */ one, /** @type {number} */ k) => [one.name, kernel.call("draw", seed, k, one.low, one.high)]));
}

/** @param {string[]} names @param {any[]} values */
function joined(names, values) { return Object.fromEntries(names.map((name, k) => [name, values[k]])); }

/** @param {any} table of a register @param {any} value @returns {any[]|null} the numbers that follow; null of a value that is none of the register's */
function held({ low, high, only, pieces }, value) {
  if (!Number.isInteger(value) || value < low || value > high || (only.length && !only.includes(value))) return null;
  const [from, at, slopes] = pieces.filter((/** @type {any[]} */ piece) => piece[0] <= value).at(-1);
  return at ? at.map((/** @type {any} */ one, /** @type {number} */ n) => (typeof one === "number" ? one + slopes[n] * (value - from) : one)) : null;
}

/** @param {any} slider @param {any} value @param {string} rule @returns {{low?: number, high?: number}} where a slider ends of a number that was set */
function ends({ wide, of_none: none, floors, positive, least, share }, value, rule) {
  if (!Number.isFinite(value)) return {};
  const [from, to] = value ? [value / wide, value * wide].sort((a, b) => a - b) : none;
  const low = Math.max(from, rule === positive ? least * Math.abs(value) : floors[rule] ?? from);
  return rule === share ? { low: Math.max(low, 0), high: Math.min(to, 1) } : { low, high: to };
}
