// What is known of the servos of a bench.

import { refuse } from "./check.js";

export class Facts {
  /** @param {any} world @param {any} scene */
  constructor(world, scene) {
    this.world = world;
    this.servos = scene.servos.map((/** @type {any} */ one) => {
      if (!one.id) refuse("only_with_server");
      if (!(one.id in world.servos)) refuse("unknown_servo", one.id);
      return { ...one, ...world.servos[one.id], model: one.model || world.servos[one.id].model };
    });
    this.models = this.servos.map((/** @type {any} */ one) => one.of[one.model] ?? refuse("no_such_model", one.model));
  }

  /** @param {number} k @returns {boolean} */
  isDigital(k) { return this.models[k].columns.includes("duty"); }

  /** @returns {any[]} each servo as the page's panels know it */
  all() {
    const { world } = this;
    return this.servos.map((/** @type {any} */ servo, /** @type {number} */ k) => {
      const model = this.models[k];
      const reads = new Set(world.reads[servo.model]);
      return { servo: k, id: servo.id, title: servo.title, kind: servo.kind, model: servo.model, models: servo.models,
        horn: servo.horn, registers: servo.registers, columns: model.columns, travel_deg: model.travel_deg,
        pulse_us: model.pulse_us, voltage: model.voltage, loop: model.loop,
        signals: Object.fromEntries(model.columns.slice(1).map((/** @type {string} */ name) => [name, world.signals[name]])),
        parameters: world.parameters.map((/** @type {any[]} */ own, /** @type {number} */ n) => ({
          ...joined(world.of_all, own), ...joined(world.of_each, servo.values[n]), read: reads.has(own[0]) })) };
    });
  }

  /** @param {any} live @param {any} action @returns {(() => void)[]} */
  set(live, action) { return refuse("only_with_server", action.value); }
}

/** @param {string[]} names @param {any[]} values */
function joined(names, values) { return Object.fromEntries(names.map((name, k) => [name, values[k]])); }
