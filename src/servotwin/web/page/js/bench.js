// The bench as the page knows it: what it is, what it has shown, and how to do something at it.

import { History } from "./history.js";
import { before } from "./kept.js";
import { connect } from "./line.js";

const AGAIN = [500, 1000, 2000, 4000, 8000]; // ms until the next attempt
const LOOKS = 400; // ms of rest until what is looked at is kept

/** @typedef {import("./line.js").Part} Part */
/** @typedef {{t: number, pace: number, speed: number|string, running: boolean, behind: boolean, replaying: number|null,
 *             lcd: Record<string, number|null>[], events: [number, string, number][], servos: Part[]}} Header */

export class Bench extends EventTarget {
  constructor() {
    super();
    /** @type {any[]} what is known of each servo */
    this.facts = [];
    /** @type {any[]} */
    this.loads = [];
    /** @type {any} */
    this.hello = {};
    /** @type {any} */
    this.state = {};
    /** @type {History[]} */
    this.history = [];
    /** @type {Header|null} */
    this.header = null;
    this.time = 0;
    this.scene = "";
    /** @type {Map<number, {done: (found: any) => void, failed: (error: Error) => void}>} */
    this.waiting = new Map();
    /** @type {Set<() => void>} what is said with the next frame */
    this.soon = new Set();
    this.number = 0;
    this.attempt = 0;
    /** @type {Record<string, string|number|boolean>} how it is looked at: part of its text, and so of a link */
    this.view = {};
    this.looks = 0;
    this.full = "";
    this.kept = ""; // the text of the bench, to go on with after the line was cut
    /** @type {ReturnType<typeof connect>|null} */
    this.line = null;
  }

  get role() { return this.hello.role ?? "own"; }
  get running() { return this.header ? this.header.running : Boolean(this.state.running); }

  open() { this.line = connect(this); }

  /**
   * Do something now.
   * @param {string} kind
   * @param {any} value
   * @param {number|null} [servo]
   * @returns {Promise<any>}
   */
  do(kind, value, servo = null) { return this.ask({ do: kind, value, servo }); }

  /**
   * Say something, and wait for the answer.
   * @param {Record<string, any>} message
   * @returns {Promise<any>}
   */
  ask(message) {
    this.sayNow();
    this.number += 1;
    const id = this.number;
    const answer = new Promise((done, failed) => this.waiting.set(id, { done, failed }));
    if (this.line?.open) this.line.say({ ...message, id });
    else this.answered(id, null, "the bench is not connected");
    return answer;
  }

  /**
   * Say something; what is wrong with it is shown as a notice.
   * @param {Record<string, any>} message
   * @returns {Promise<any>}
   */
  async tell(message) {
    try {
      return await this.ask(message);
    } catch (error) {
      this.notice(error instanceof Error ? error.message : String(error));
      return null;
    }
  }

  /**
   * Say something at most once a frame, and before all that is said later, so that the order is that of the hand.
   * @param {() => void} say
   * @returns {() => void}
   */
  onceAFrame(say) {
    return () => {
      if (this.soon.has(say)) return;
      this.soon.add(say);
      requestAnimationFrame(() => { if (this.soon.has(say)) this.sayNow(); });
    };
  }

  sayNow() {
    const all = [...this.soon];
    this.soon.clear();
    all.forEach((say) => say());
  }

  /** @param {string} line */
  notice(line) { this.emit("said", line); }

  /** @param {string} name @param {any} [detail] */
  emit(name, detail = null) { this.dispatchEvent(new CustomEvent(name, { detail })); }

  /** @param {string} name @param {(detail: any) => void} listener */
  on(name, listener) { this.addEventListener(name, (event) => listener(/** @type {CustomEvent} */ (event).detail)); }

  /**
   * Keep how the bench is looked at.
   * @param {Record<string, string|number|boolean>} changes
   */
  look(changes) {
    Object.assign(this.view, changes);
    clearTimeout(this.looks);
    this.looks = window.setTimeout(() => {
      if (this.role !== "watcher" && this.line?.open) this.tell({ view: this.view });
    }, LOOKS);
  }

  /** @param {any} message */
  told(message) {
    if ("hello" in message) this.greeted(message.hello);
    else if ("scene" in message) this.began(message.scene);
    else if ("changed" in message) {
      for (const facts of message.changed) this.facts[facts.servo] = facts;
      this.loads = message.loads;
      this.emit("changed");
    } else if ("done" in message) this.answered(message.done, message, null);
    else if ("refused" in message) this.answered(message.refused, null, message.message);
    else if ("said" in message) this.notice(message.said);
    else if ("full" in message) this.full = message.full;
    for (const word of ["fit", "log", "own"]) if (word in message) this.emit(word, message[word]);
  }

  /** @param {any} hello */
  greeted(hello) {
    this.hello = hello;
    const again = this.attempt > 0;
    this.attempt = 0;
    this.emit("hello", hello);
    if (hello.role === "watcher") return;
    const kept = again ? this.kept && { text: this.kept, running: true } : this.role === "own" && before();
    if (kept) this.goOnWith(kept);
    else this.begin();
  }

  /**
   * Begin with a bench of before: what was done at it is done again, and time goes on if it went on.
   * @param {{text: string, running: boolean}} kept
   */
  async goOnWith({ text, running }) {
    if (!await this.tell({ scene: text }) || !running) return;
    const state = this.state;
    const goOn = () => {
      if (this.state === state && this.header && this.header.replaying !== null) return;
      this.removeEventListener("push", goOn);
      if (this.state === state && !this.running) this.tell({ run: true });
    };
    this.addEventListener("push", goOn);
  }

  /** @param {string} what is being set up, said until its scene is there */
  setUp(what) { this.emit("said", `The ${what} is being set up.`); }

  /** Begin with what the link of the page carries. */
  begin() {
    const packed = location.hash.slice(1);
    if (packed) this.setUp(packed.startsWith("lesson=") ? "lesson" : packed.startsWith("mystery=") ? "mystery servo" : "bench of this link");
    if (packed.startsWith("lesson=")) this.tell({ lesson: decodeURIComponent(packed.slice(7)) });
    else if (packed.startsWith("mystery=")) this.tell({ mystery: Number(packed.slice(8)) });
    else if (packed) this.tell({ fragment: packed });
  }

  /** @param {any} state */
  began(state) {
    this.state = state;
    this.scene = state.scene;
    this.facts = state.servos;
    this.loads = state.loads;
    this.history = state.servos.map((/** @type {any} */ one) => new History(one.columns));
    this.header = null;
    this.time = 0;
    if (Object.keys(state.view).length) this.view = { ...state.view };
    else if (Object.keys(this.view).length) this.look({});
    this.emit("scene", state);
  }

  /** @param {Header} header @param {import("./line.js").Numbers[]} parts */
  pushed(header, parts) {
    if (header.servos.length !== this.history.length) return;
    header.servos.forEach(({ columns }, k) => {
      if (this.history[k].width !== columns.length) this.history[k] = new History(columns);
      this.history[k].add(parts[k].points, parts[k].pulses);
    });
    this.header = header;
    this.time = header.t;
    this.emit("push", header);
  }

  /** @param {number|null} id @param {any} found @param {string|null} wrong */
  answered(id, found, wrong) {
    const waits = id === null ? undefined : this.waiting.get(id);
    if (!waits) { if (wrong) this.notice(wrong); return; }
    this.waiting.delete(/** @type {number} */ (id));
    if (wrong) waits.failed(new Error(wrong));
    else waits.done(found);
    if (found && "time" in found) this.emit("did");
  }

  /** @param {CloseEvent} event */
  closed(event) {
    for (const { failed } of this.waiting.values()) failed(new Error("the line to the bench was cut"));
    this.waiting.clear();
    this.emit("closed");
    if (event.code === 4003) { this.emit("locked", event.reason); return; }
    if (event.code === 4403) { this.notice(event.reason || "this address is not one of the server's"); return; }
    if (this.full) this.notice(this.full);
    const wait = AGAIN[Math.min(this.attempt, AGAIN.length - 1)];
    this.attempt += 1;
    if (!this.full) this.notice(`the line to the bench was cut; trying again in ${wait / 1000} s`);
    setTimeout(() => this.open(), this.full ? 8000 : wait);
    this.full = "";
  }

  /** Keep the text of the bench, for when the line is cut. */
  async keep() {
    if (this.role === "watcher" || !this.line?.open) return;
    const found = await this.tell({ text: true });
    if (!found) return;
    this.kept = found.text;
    this.emit("kept");
  }
}
