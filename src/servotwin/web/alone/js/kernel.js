// The kernel: a module of WebAssembly, its memory, and its entries by their names.

/** @typedef {{address: number, lengths: number[]}} Block an array, or records, in the kernel's memory */
/** @typedef {Record<string, any>} Places of the fields of a record, in bytes */

export class Kernel {
  /**
   * @param {WebAssembly.Module} module
   * @param {any} layout
   */
  constructor(module, layout) {
    const needed = WebAssembly.Module.imports(module).map((one) => one.name);
    const more = /** @type {Record<string, any>} */ ({ exp2: (/** @type {number} */ x) => 2 ** x,
      fmod: (/** @type {number} */ x, /** @type {number} */ y) => x % y });
    const env = Object.fromEntries(needed.map((name) => [name, more[name] ?? /** @type {any} */ (Math)[name]]));
    const made = new WebAssembly.Instance(module, { env });
    this.exports = /** @type {Record<string, any>} */ (made.exports);
    this.layout = layout;
    this.memory = /** @type {WebAssembly.Memory} */ (this.exports.memory);
    this.word = BigInt64Array.BYTES_PER_ELEMENT;
    this.first = this.rounded(Number(this.exports.__heap_base.value));
    this.free = this.first;
    this.words = this.take(layout.words);
  }

  /** @param {number} size @returns {number} */
  rounded(size) { return Math.ceil(size / this.word) * this.word; }

  /** Forget all that was taken. */
  clear() {
    this.free = this.first;
    this.words = this.take(this.layout.words);
  }

  /**
   * Take room for an array of numbers; it holds zeros.
   * @param {...number} lengths
   * @returns {Block}
   */
  take(...lengths) { return this.bytes(this.word * lengths.reduce((a, b) => a * b), lengths); }

  /**
   * Take room for records.
   * @param {string} kind
   * @param {number} count
   * @returns {Block}
   */
  records(kind, count) { return this.bytes(this.layout.records[kind].size * count, [count]); }

  /** @param {number} size @param {number[]} lengths @returns {Block} */
  bytes(size, lengths) {
    const address = this.free;
    this.free = this.rounded(address + size);
    const short = this.free - this.memory.buffer.byteLength;
    if (short > 0) this.memory.grow(Math.ceil(short / this.layout.page));
    new Uint8Array(this.memory.buffer, address, size).fill(0);
    return { address, lengths };
  }

  /** @param {Block} block @param {number} [at] @param {number} [count] @returns {Float64Array} its numbers, as long as nothing is taken */
  numbers(block, at = 0, count = block.lengths.reduce((a, b) => a * b) - at) {
    return new Float64Array(this.memory.buffer, block.address + this.word * at, count);
  }

  /** @param {Block} block @returns {BigInt64Array} */
  wholes(block) { return new BigInt64Array(this.memory.buffer, block.address, block.lengths[0]); }

  /** @param {string} kind @param {Block} block @param {number} k @param {Uint8Array} bytes */
  put(kind, block, k, bytes) {
    new Uint8Array(this.memory.buffer).set(bytes, block.address + k * this.layout.records[kind].size);
  }

  /** @param {string} kind @param {Block} block @param {number} k @param {string} name a dotted name @param {number} value */
  set(kind, block, k, name, value) {
    const { at, whole } = this.place(kind, name);
    const view = new DataView(this.memory.buffer, block.address + k * this.layout.records[kind].size + at);
    if (whole) view.setBigInt64(0, BigInt(value), true);
    else view.setFloat64(0, value, true);
  }

  /** @param {string} kind @param {Block} block @param {number} k @param {string} name @returns {number} */
  get(kind, block, k, name) {
    const { at, whole } = this.place(kind, name);
    const view = new DataView(this.memory.buffer, block.address + k * this.layout.records[kind].size + at);
    return whole ? Number(view.getBigInt64(0, true)) : view.getFloat64(0, true);
  }

  /** @param {string} kind @param {string} name @returns {{at: number, whole: boolean}} */
  place(kind, name) {
    let [at, more] = /** @type {[number, any]} */ ([0, this.layout.records[kind].at]);
    for (const part of name.split(".")) {
      const [own, inner] = more[part];
      at += own;
      more = inner;
    }
    return { at, whole: more === "whole" };
  }

  /**
   * Call an entry.
   * @param {string} name
   * @param {...any} given
   * @returns {number} what it returns
   */
  call(name, ...given) {
    const { kinds, result } = this.layout.entries[name];
    const floats = this.numbers(this.words);
    const words = this.wholes(this.words);
    let at = 0;
    /** @param {any} kind @param {any} value */
    const lay = (kind, value) => {
      if (Array.isArray(kind)) kind.forEach((one, k) => lay(one, value[k]));
      else if (kind === "float") { floats[at] = value; at += 1; }
      else if (kind === "whole") { words[at] = BigInt(value); at += 1; }
      else for (const one of [value.address, ...value.lengths]) { words[at] = BigInt(one); at += 1; }
    };
    kinds.forEach((/** @type {any} */ kind, /** @type {number} */ k) => lay(kind, given[k]));
    const found = this.exports[`servotwin_${name}`](this.words.address);
    return result === "d" ? this.numbers(this.words)[at] : Number(found);
  }
}
