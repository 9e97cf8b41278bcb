// The bench of the page as one file: what was done at it, and its servos that go on.

import { Facts } from "./facts.js";
import { Going } from "./going.js";
import { Refused, bounded, refuse } from "./check.js";

/** @typedef {{time: number, kind: string, value: any, servo: number|null}} Action */

export class Live {
  /**
   * @param {import("./kernel.js").Kernel} kernel
   * @param {any} world
   * @param {Uint8Array} records
   * @param {any} scene as `read` returns it
   */
  constructor(kernel, world, records, scene) {
    this.world = world;
    this.scene = { ...scene };
    this.facts = new Facts(world, scene);
    this.going = new Going(kernel, world, records, this.facts.models, scene);
    /** @type {Action[]} */
    this.todo = [...this.firstOnes(), ...scene.actions];
    /** @type {Action[]} */
    this.done = [];
    this.begun = this.begins();
    this.facts.models.forEach((_, k) => {
      const first = this.todo.find((one) => one.kind === "command" && (one.servo === null || one.servo === k));
      this.going.follow(k, this.takes(k, /** @type {Action} */ (first).value, 0));
      this.going.begin(k);
    });
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
    const found = this.facts.models.map((model, k) => ({ k, value: model.middle })).filter(({ k }) => !told.has(k));
    const hold = (/** @type {number} */ value, /** @type {number|null} */ servo) => ({ time: 0, kind: "command", servo,
      value: { shape: this.world.hold, unit: this.world.degrees, value } });
    if (!told.size && new Set(found.map((one) => one.value)).size === 1) return [hold(found[0].value, null)];
    return found.map(({ k, value }) => hold(value, k));
  }

  /** @returns {number} how many actions at the front say where all servos begin */
  begins() {
    const left = new Set(this.facts.models.keys());
    for (const [n, one] of this.todo.entries()) {
      if (!left.size) return n;
      if (one.kind === "command" && one.servo === null) left.clear();
      else if (one.kind === "command") left.delete(/** @type {number} */ (one.servo));
    }
    return this.todo.length;
  }

  /** @param {number} k @param {any} command @param {number} time */
  takes(k, command, time) {
    const taken = this.going.taken(k, command, time);
    bounded(this.facts.models[k].bounds[command.unit], taken.ends, this.facts.servos[k]);
    return taken;
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
    const action = { time: this.time, kind, value, servo };
    this.act(action);
    return action;
  }

  /** @param {Action} action @returns {number[]} */
  those(action) { return action.servo === null ? [...this.facts.models.keys()] : [action.servo]; }

  /**
   * Go on to a time, or to what is to be done before.
   * @param {number} until
   * @param {number} rate
   * @param {boolean} [switches]
   */
  advance(until, rate, switches = true) {
    this.catchUp();
    const end = this.todo.length ? Math.min(until, this.todo[0].time) : until;
    const push = this.going.advance(end, rate, switches);
    if (push.wrong) throw new Refused(push.wrong.replace("{time}", String(this.time)));
    this.catchUp();
    return push;
  }
}

/** @type {Record<string, (live: Live, action: Action) => (() => void)[]>} */
const WAYS = {
  command: (live, action) => live.those(action).map((k) => ({ k, taken: live.takes(k, action.value, action.time) }))
    .map(({ k, taken }) => () => live.going.follow(k, taken)),
  push: (live, action) => live.those(action).map((k) => () => live.going.push(k, action.value)),
  torque: (live, action) => {
    const those = live.those(action).filter((k) => action.servo !== null || live.facts.isDigital(k));
    if (!those.length || !those.every((k) => live.facts.isDigital(k))) refuse("no_torque_switch", action.value);
    return those.map((k) => () => live.going.torque(k, action.value));
  },
  frames: (live, action) => [() => {
    if ("rate" in action.value) live.going.tune(action.value.rate);
    if ("lost" in action.value) live.going.lose(action.value.lost);
  }],
  set: (live, action) => live.facts.set(live, action),
  register: () => refuse("only_with_server"),
  control: () => refuse("only_with_server"),
};
