// The bench of the page as one file: what was done at it, and its servos that go on.

import { Circuit } from "./circuit_of.js";
import { Refused, checked, refuse, tidy, unknown, wrong } from "./check.js";
import { Servo } from "./facts.js";
import { Going } from "./going.js";

/** @typedef {{time: number, kind: string, value: any, servo: number|null}} Action */

export class Live {
  /**
   * @param {import("./kernel.js").Kernel} kernel
   * @param {any} world
   * @param {any} scene as `read` returns it
   */
  constructor(kernel, world, scene) {
    this.world = world;
    this.scene = { ...scene };
    /** @type {Servo[]} */
    this.servos = scene.servos.map((/** @type {any} */ one) => new Servo(world, one, scene, kernel));
    this.shared = Object.keys(scene.supply).length > 0;
    if (this.shared) this.servos.forEach((/** @type {Servo} */ one, /** @type {number} */ k) => one.hang(scene.supply, k + 1));
    this.going = new Going(kernel, world, this.servos, scene);
    this.circuit = Object.keys(scene.control).length ? new Circuit(world, this, scene.control) : null;
    /** @type {{command: any, time: number}[]} what each servo is told now */
    this.told = [];
    /** @type {Record<string, number>} what was changed of loads since the start, by dotted names */
    this.loads = {};
    this.lost = 0;
    /** @type {Action[]} */
    this.todo = [...this.firstOnes(), ...scene.actions];
    /** @type {Action[]} */
    this.done = [];
    this.begun = this.begins();
    this.servos.forEach((/** @type {Servo} */ _, /** @type {number} */ k) => {
      const first = this.todo.find((one) => one.kind === "command" && (one.servo === null || one.servo === k));
      this.follow(k, this.takes(k, /** @type {Action} */ (first).value, 0));
      this.circuit?.heed(k, 0);
      this.going.begin(k);
    });
    this.fits(scene.frame_rate);
    this.catchUp();
  }

  get time() { return this.going.time; }
  get due() { return this.todo.length > 0 && this.going.reached(this.todo[0].time); }

  /** @returns {any} the scene as it is now */
  now() { return { ...this.scene, end: this.time, actions: [...this.done, ...this.todo] }; }

  /** @returns {Action[]} commands of servos that the scene tells nothing at t = 0: the middle of their travel */
  firstOnes() {
    const said = this.scene.actions.filter((/** @type {Action} */ one) => one.kind === "command" && one.time === 0);
    if (said.some((/** @type {Action} */ one) => one.servo === null)) return [];
    const told = new Set(said.map((/** @type {Action} */ one) => one.servo));
    const found = this.servos.map((/** @type {Servo} */ one, /** @type {number} */ k) => ({ k, value: one.own.middle })).filter((/** @type {any} */ one) => !told.has(one.k));
    const hold = (/** @type {number} */ value, /** @type {number|null} */ servo) => ({ time: 0, kind: "command", servo,
      value: { shape: this.world.hold, unit: this.world.degrees, value } });
    if (!told.size && new Set(found.map((/** @type {any} */ one) => one.value)).size === 1) return [hold(found[0].value, null)];
    return found.map((/** @type {any} */ one) => hold(one.value, one.k));
  }

  /** @returns {number} how many actions at the front say where all servos begin */
  begins() {
    const left = new Set(this.servos.keys());
    for (const [n, one] of this.todo.entries()) {
      if (!left.size) return n;
      if (one.kind === "command" && one.servo === null) left.clear();
      else if (one.kind === "command") left.delete(/** @type {number} */ (one.servo));
    }
    return this.todo.length;
  }

  /** @param {number} k @param {any} command @param {number} time @param {Servo} [servo] that is to follow it */
  takes(k, command, time, servo = this.servos[k]) {
    const { unit } = this.world.control;
    if (this.circuit && command.unit !== unit) wrong("unit of a command to a control circuit", command.unit, unit);
    const taken = this.going.taken(k, command, time);
    servo.bound(command, taken.ends);
    return { ...taken, command, time };
  }

  /** @param {number} k @param {{first: number, count: number, command: any, time: number, ends: number[][]}} taken */
  follow(k, taken) {
    this.told[k] = taken;
    this.going.follow(k, taken);
  }

  /** Refuse frames that some pulse does not fit into. @param {number} rate [Hz] */
  fits(rate) {
    if (this.circuit && this.circuit.longest * rate >= 1) refuse("frame_rate", `${tidy(rate)} Hz`);
    if (this.circuit) return;
    if (this.told.some((one, k) => this.going.hears(k) && /** @type {any} */ (one).ends[1][1] * rate >= 1)) refuse("frame_rate", `${tidy(rate)} Hz`);
  }

  /** Do what the scene says was done by now. */
  catchUp() { while (this.due) this.act(/** @type {Action} */ (this.todo.shift())); }

  /** @param {Action} action */
  act(action) {
    try {
      for (const put of WAYS[action.kind](this, action)) put();
    } finally {
      this.going.pending = [];
    }
    const last = this.done.length > this.begun ? this.done[this.done.length - 1] : null;
    if (last && this.world.whole.includes(action.kind) && last.time === action.time && last.kind === action.kind
      && last.servo === action.servo) this.done.pop();
    this.done.push(action);
  }

  /** @param {string} kind @param {any} value @param {number|null} servo @returns {Action} */
  do(kind, value, servo) {
    if (this.done.length + this.todo.length >= this.world.limits.actions) refuse("too_many_actions");
    const action = said(this.world, this.servos.length, [this.time, kind, value, servo]);
    this.act(action);
    return action;
  }

  /** @param {Action} action @returns {number[]} */
  those(action) { return action.servo === null ? [...this.servos.keys()] : [action.servo]; }

  /**
   * Go on to a time, or to what is to be done before.
   * @param {number} until
   * @param {number} rate
   * @param {boolean} [switches]
   */
  advance(until, rate, switches = true) {
    this.catchUp();
    const end = this.todo.length ? Math.min(until, this.todo[0].time) : until;
    const push = this.going.advance(this.circuit ? Math.min(end, this.circuit.next) : end, rate, switches);
    this.circuit?.look(push.parts);
    if (push.wrong) throw new Refused(push.wrong.replace("{time}", tidy(this.time)));
    this.catchUp();
    return push;
  }
}

/**
 * Return an action that has been looked at.
 * @param {any} world
 * @param {number} servos how many there are
 * @param {any[]} row time, kind, value and servo
 * @returns {Action}
 */
export function said(world, servos, [time, kind, value, servo = null]) {
  const { actions, for_all: all } = world.rules;
  if (!Object.hasOwn(actions, kind)) wrong("kind of action", kind, Object.keys(actions).join(", "));
  if (servo !== null && !(Number.isInteger(servo) && servo >= 0 && servo < servos)) wrong("servo of an action", servo, `a whole number from 0 to ${servos - 1}`);
  if (servo !== null && all.includes(kind)) wrong("servo of an action", servo, "none: all servos hear one transmitter");
  return { time, kind, value: checked(actions[kind], value), servo };
}

/** @param {Live} live @param {Action} action @returns {(() => void)[]} */
function set(live, action) {
  const { world } = live;
  const names = Object.keys(action.value);
  const isLoad = (/** @type {string} */ name) => name in world.load;
  for (const name of names) if (!isLoad(name) && !(name in world.given)) unknown("parameter", name, Object.keys(world.given));
  const all = live.shared && names.some((name) => world.of_bus.includes(name));
  const those = live.those(all ? { ...action, servo: null } : action).map((k) => ({ k, own: names.filter((name) => isLoad(name) || live.servos[k].reads.has(name)) }))
    .filter(({ own }) => own.length);
  if (!those.length) wrong(names.join(", "), "no servo here reads it", "what a model here reads");
  return [...remade(live, those.map(({ k }) => k), (servo, n) => {
    const { own } = those[n];
    for (const name of own.filter(isLoad)) servo.load[world.load[name]] = checked(world.rules.loads[name], action.value[name], name);
    servo.change(Object.fromEntries(own.filter((name) => !isLoad(name)).map((name) => [name, action.value[name]])));
  }), () => Object.assign(live.loads, Object.fromEntries(names.filter(isLoad).map((name) => [name, action.value[name]])))];
}

/** @param {Live} live @param {Action} action @returns {(() => void)[]} */
function register(live, action) {
  const those = live.those(action).filter((k) => action.servo === k || live.servos[k].known.registers);
  if (!those.length) wrong(Object.keys(action.value).join(", "), "no bus servo", live.world.words.bus_registers);
  return remade(live, those, (servo) => servo.write(action.value));
}

/**
 * Make servos anew that are changed; all stay as they were where one cannot be.
 * @param {Live} live
 * @param {number[]} those
 * @param {(servo: Servo, n: number) => void} change
 * @returns {(() => void)[]} what lets them go on
 */
function remade(live, those, change) {
  /** @type {{k: number, servo: Servo, taken?: any}[]} */
  const made = [];
  try {
    for (const [n, k] of those.entries()) {
      const servo = live.servos[k].copy();
      change(servo, n);
      made.push({ k, servo });
      live.going.make(k, servo);
      const { command, time } = live.told[k];
      made[made.length - 1].taken = live.takes(k, command, time, servo);
    }
  } catch (error) {
    for (const { k } of made) live.going.make(k, live.servos[k]); // as before
    throw error;
  }
  return made.map(({ k, servo, taken }) => () => {
    live.servos[k] = servo;
    live.follow(k, taken);
    live.going.change(k);
  });
}

/** @type {Record<string, (live: Live, action: Action) => (() => void)[]>} */
const WAYS = {
  command: (live, action) => live.those(action).map((k) => ({ k, taken: live.takes(k, action.value, action.time) }))
    .map(({ k, taken }) => () => live.follow(k, taken)),
  push: (live, action) => live.those(action).map((k) => () => live.going.push(k, action.value)),
  torque: (live, action) => {
    const digital = (/** @type {number} */ k) => live.servos[k].columns.includes("duty");
    const those = live.those(action).filter((k) => action.servo !== null || digital(k));
    if (!those.length) refuse("no_torque_switch", action.value);
    for (const k of those) if (!digital(k)) refuse("no_torque", action.value, { model: live.servos[k].model });
    return those.map((k) => () => live.going.torque(k, action.value));
  },
  frames: (live, action) => {
    if ("rate" in action.value) live.fits(action.value.rate);
    return [() => {
      if ("rate" in action.value) live.going.tune(action.value.rate);
      if ("lost" in action.value) live.going.lose(action.value.lost);
    }];
  },
  set,
  register,
  control: (live, { value }) => {
    const { circuit, world } = live;
    if (!circuit) return wrong("control circuit", Object.keys(value).join(", "), world.words.no_circuit);
    const { delay } = world.control;
    if (circuit.longestWith(value) * live.going.rate >= 1) wrong(`${delay} of the control circuit`, value[delay], world.words.late_circuit);
    return [() => circuit.change(value)];
  },
};
