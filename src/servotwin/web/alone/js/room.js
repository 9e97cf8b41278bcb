// A room: a bench that goes on in real time, and the page that looks at it.

import { hidden } from "./facts.js";
import { file } from "./files.js";
import { Kernel } from "./kernel.js";
import { Live } from "./live.js";
import { Refused, filled as filledIn, refuse, unknown, wrong } from "./check.js";
import { Pace } from "./pace.js";
import { OwnLog } from "./own.js";
import { fragment, read, servo, unfragment, view, written } from "./scene.js";

const now = () => performance.now() / 1000; // s

export class Room {
  /**
   * @param {{module: WebAssembly.Module, world: any}} parts
   * @param {{told: (message: any) => void, pushed: (header: any, parts: any[]) => void}} page
   */
  constructor(parts, page) {
    const { world } = parts;
    this.parts = parts;
    /** @type {Live|undefined} */
    this.live = undefined;
    this.world = world;
    this.page = page;
    this.pace = new Pace(world.limits, now());
    /** @type {string|null} */
    this.broken = null;
    this.end = 0;
    this.step = world.limits.first_stretch;
    this.own = new OwnLog(parts, page);
    /** @type {any[]} */
    this.lcd = [];
    this.put(read(world, world.first));
  }

  /** @param {any} scene begin with this bench; what was done at it is done again, as fast as it goes */
  put(scene) {
    // in a kernel of its own: the bench before stays as it is where this one is refused
    this.live = new Live(new Kernel(this.parts.module, this.world.layout), this.world, { ...scene, end: 0 });
    this.end = scene.end;
    this.broken = null;
    this.step = this.world.limits.first_stretch;
    this.pace.running = scene.end === 0;
    this.pace.begin(now(), this.live.time);
    this.page.told({ scene: this.state() });
    this.glance();
  }

  state() {
    const live = /** @type {Live} */ (this.live);
    const scene = live.now();
    return { scene: written(this.world, scene), name: scene.name, servos: live.servos.map((one, k) => one.facts(k)), loads: this.loads(),
      view: scene.view, lesson: scene.lesson, supply: filled(scene.supply), control: filled(scene.control),
      of_catalog: scene.servos.map((/** @type {any} */ one) => one.id ?? null), frame_rate: live.going.rate, unknowns: live.servos[0].mystery ? this.world.mystery.hidden : [],
      running: this.pace.running, speed: this.speed, end: this.end };
  }

  /** @returns {any[]} the controls of what hangs on the shafts */
  loads() {
    const live = /** @type {Live} */ (this.live);
    return this.world.loads.map((/** @type {any} */ one) => ({ ...one,
      value: live.loads[one.name] ?? live.scene.load[this.world.load[one.name]] ?? one.value }));
  }

  get speed() { return Number.isFinite(this.pace.speed) ? this.pace.speed : this.world.limits.unpaced; }
  get replaying() {
    const live = /** @type {Live} */ (this.live);
    return this.broken === null && (live.due || !live.going.reached(this.end));
  }

  /** Go on for ever. */
  turn() {
    const live = /** @type {Live} */ (this.live);
    const { limits } = this.world;
    if (this.replaying) {
      this.push(this.until(this.end, limits.coarsest));
      this.pace.begin(now(), live.time);
      if (!this.replaying) this.end = 0;
    } else if (this.pace.running) {
      const target = Math.min(this.pace.target(now(), live.time), live.time + limits.far);
      const speed = Number.isFinite(this.pace.speed) ? this.pace.speed : 1;
      const push = this.until(target, Math.max(limits.coarsest, (limits.points * limits.rate) / speed));
      this.pace.note(now(), live.time);
      this.push(push);
    }
  }

  /** @param {number} target @param {number} rate @returns {any[]} pushes that follow each other, in no more time than a turn may take */
  until(target, rate) {
    const live = /** @type {Live} */ (this.live);
    const { limits } = this.world;
    const ends = now() + limits.budget;
    const found = [];
    while ((live.due || !live.going.reached(target)) && this.broken === null && now() < ends) {
      const [time, at] = [live.time, now()];
      try {
        found.push(live.advance(Math.max(Math.min(target, time + this.step), time), rate));
      } catch (error) {
        if (!(error instanceof Refused)) throw error;
        this.stand(error.message);
      }
      const spent = now() - at;
      if (spent < limits.budget * limits.short) this.step = Math.min(2 * this.step, limits.longest);
      else if (spent > limits.budget / 2) this.step = Math.max(this.step / 2, limits.first_stretch);
    }
    return found;
  }

  /** @param {string} why */
  stand(why) {
    this.broken = why;
    this.end = 0;
    this.pace.running = false;
    this.pace.begin(now(), /** @type {Live} */ (this.live).time);
    this.page.told({ said: `${this.world.words.stands}${why}` });
    this.glance();
  }

  /** @param {any[]} pushes */
  push(pushes) {
    const live = /** @type {Live} */ (this.live);
    const parts = live.servos.map((one, k) => ({ columns: one.columns,
      points: joined(pushes.map((one) => one.parts[k].points)), pulses: joined(pushes.map((one) => one.parts[k].pulses)) }));
    parts.forEach((one, k) => {
      if (one.points.length) this.lcd[k] = this.reading(one.columns, one.points.slice(-one.columns.length));
    });
    this.page.pushed({ t: live.time, pace: this.pace.measured, speed: this.speed, running: this.pace.running,
      behind: this.pace.behind, replaying: this.replaying && this.end ? live.time / this.end : null,
      lcd: this.lcd.map((one) => ({ ...one })), events: pushes.flatMap((one) => one.events),
      servos: parts.map((one) => ({ n: one.points.length / one.columns.length, m: one.pulses.length / 2, columns: one.columns })) },
    parts);
  }

  /** Show how all stands, without going on. */
  glance() {
    const live = /** @type {Live} */ (this.live);
    const parts = live.servos.map((one, k) => ({ columns: one.columns, points: live.going.now(k), pulses: new Float64Array(0) }));
    this.lcd = parts.map((one) => this.reading(one.columns, one.points));
    this.push([{ parts, events: [] }]);
  }

  /** @param {string[]} columns @param {Float64Array} row */
  reading(columns, row) {
    const live = /** @type {Live} */ (this.live);
    const value = (/** @type {string} */ name) => {
      const found = row[columns.indexOf(name)];
      return Number.isFinite(found) ? found : null;
    };
    const counts = Object.fromEntries(this.world.converters.map((/** @type {any} */ one) => [one.name,
      value(one.of) === null ? null : live.going.kernel.call("count", one.gain, one.offset, one.highest, value(one.of))]));
    return { command_voltage: value("command_voltage"), feedback_voltage: value("feedback_voltage"), ...counts,
      pulse_rate: columns.includes("pulse_width") ? live.going.rate : null, output_angle: value("output_angle"),
      pulse_width: value("pulse_width") };
  }

  /** Go on by one frame, or by a tick of a bus servo, and stand. */
  frame() {
    const live = /** @type {Live} */ (this.live);
    const { limits } = this.world;
    if (this.replaying || this.broken !== null) refuse("no_single_frame");
    this.pace.running = false;
    this.pace.begin(now(), live.time);
    let until = live.time + limits.tick;
    if (live.servos.some((one) => one.columns.includes("pulse_width"))) {
      const edge = live.going.nextEdge;
      until = edge > live.time * (1 + limits.rounding) ? edge : edge + 1 / live.going.rate;
    }
    this.push([live.advance(until, Math.max(limits.coarsest, limits.frame_points / (until - live.time)))]);
  }

  /** @param {boolean} running */
  run(running) {
    if (running && this.broken !== null) refuse("new_beginning", this.broken);
    this.pace.running = running;
    this.pace.begin(now(), /** @type {Live} */ (this.live).time);
    this.push([]);
  }

  /** @param {any} speed */
  ask(speed) {
    const [low, high] = this.world.limits.speeds;
    if (speed !== this.world.limits.unpaced && !(Number.isFinite(speed) && speed >= low && speed <= high)) refuse("speed", speed);
    this.pace.speed = speed === this.world.limits.unpaced ? Infinity : speed;
    this.pace.begin(now(), /** @type {Live} */ (this.live).time);
  }

  /** @param {any} message @returns {Promise<any>} what is answered */
  async answer(message) {
    const live = /** @type {Live} */ (this.live);
    const { world } = this;
    if ("do" in message) {
      if (this.replaying) refuse("repeating");
      const { time, kind, servo } = live.do(message.do, message.value, message.servo ?? null);
      if (kind === "set" || kind === "register") {
        this.step = world.limits.first_stretch;
        const those = live.servos.map((one, k) => one.facts(k)).filter((one) => servo === null || one.servo === servo);
        this.page.told({ changed: those, loads: this.loads() });
      }
      return { time };
    }
    if ("run" in message) this.run(message.run);
    else if ("speed" in message) this.ask(message.speed);
    else if ("step" in message) this.frame();
    else if ("view" in message) live.scene.view = view(world, message.view);
    else if ("reset" in message) {
      const scene = live.now();
      this.put({ ...scene, end: 0, actions: scene.actions.filter((/** @type {any} */ one) => one.time === 0) });
    } else if ("scene" in message) this.put(read(world, message.scene));
    else if ("fragment" in message) this.put(read(world, await unfragment(message.fragment)));
    else if ("lesson" in message) this.put(read(world, this.lesson(message.lesson)));
    else if ("servos" in message) this.put(this.chosen(live.now(), message.servos, message.supply));
    else if ("text" in message) {
      const text = written(world, live.now());
      return { text, fragment: await fragment(text) };
    } else if ("export" in message) return { file: await file(this.parts, live, message.export, message.servo ?? 0) };
    else if ("mystery" in message) this.put(read(world, this.hidden(message.mystery)));
    else if ("guess" in message) return { compared: this.compared(live.scene.servos[0].mystery, message.guess) };
    else if ("log" in message) return message.log.play ? this.answer({ do: "command", value: this.own.played() }) : this.own.answer(live, message.log);
    else refuse("only_with_server");
    return { time: /** @type {Live} */ (this.live).time };
  }

  /** @param {any} seed @returns {string} the text of a bench with a servo whose numbers are hidden */
  hidden(seed) {
    const most = this.world.mystery.seeds;
    if (!Number.isInteger(seed) || seed < 0 || seed > most) wrong("seed of a mystery servo", seed, `a whole number from 0 to ${most}`);
    return filledIn(this.world.words.mystery_scene, { seed });
  }

  /** @param {number|undefined} seed @param {any} guess @returns {any[]} guess and truth side by side */
  compared(seed, guess) {
    const { good, fair } = this.world.mystery;
    if (seed === undefined) wrong("guess", "a bench without a mystery", "a mystery servo");
    if (!guess || typeof guess !== "object" || !Object.keys(guess).length) wrong("guess", guess, "a table of numbers in SI");
    const truth = hidden(this.world, /** @type {Live} */ (this.live).going.kernel, /** @type {number} */ (seed));
    for (const [name, value] of Object.entries(guess)) {
      if (!(name in truth)) unknown("number of a mystery servo", name, Object.keys(truth));
      if (!Number.isFinite(value)) wrong(`guess of ${name}`, value, "a finite number in SI");
    }
    return Object.entries(truth).map(([name, value]) => {
      const error = name in guess ? guess[name] / value - 1 : null;
      const said = error === null ? "not guessed" : Math.abs(error) <= good ? "found" : Math.abs(error) <= fair ? "near" : "off";
      return { name, truth: error === null ? null : value, guess: guess[name] ?? null, error, said };
    });
  }

  /** @param {string} name @returns {string} */
  lesson(name) {
    const found = this.world.lessons.find((/** @type {any} */ one) => one.name === name);
    return found ? found.text : unknown("lesson", name, this.world.lessons.map((/** @type {any} */ one) => one.name));
  }

  /** @param {any} scene @param {any} asked @param {any} supply @returns {any} a bench with other servos */
  chosen(scene, asked, supply) {
    const { world } = this;
    const most = world.limits.servos;
    if (!Array.isArray(asked) || !asked.length || asked.length > most) wrong("servos", Array.isArray(asked) ? asked.length : asked, `a list of 1 to ${most}`);
    const servos = asked.map((one) => {
      if (!one || !("keep" in one)) return servo(world, one);
      if (!(one.keep in scene.servos)) wrong("servo to keep", one.keep, `a whole number from 0 to ${scene.servos.length - 1}`);
      return { ...scene.servos[one.keep], model: one.model ?? "" };
    });
    return { ...scene, servos, supply: supply ?? {}, name: "", end: 0, actions: [], control: {}, lesson: {} };
  }
}

/** @param {any} table @returns {any} */
function filled(table) { return Object.keys(table).length ? { ...table } : null; }

/** @param {Float64Array[]} parts @returns {Float64Array} */
function joined(parts) {
  const found = new Float64Array(parts.reduce((sum, one) => sum + one.length, 0));
  let at = 0;
  for (const one of parts) {
    found.set(one, at);
    at += one.length;
  }
  return found;
}
