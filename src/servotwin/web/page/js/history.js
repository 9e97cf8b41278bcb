// What was seen of a servo: rows of numbers in a ring, and its pulses.

const ROOM = 120000; // rows

export class History {
  /** @param {string[]} columns */
  constructor(columns) {
    this.columns = columns;
    /** @type {Map<string, number>} */
    this.places = new Map(columns.map((name, k) => [name, k]));
    this.width = columns.length;
    this.data = new Float64Array(1024 * this.width);
    this.room = 1024;
    this.first = 0;
    this.length = 0;
    /** @type {[number, number][]} edges and widths [s], width 0 of a lost pulse */
    this.edges = [];
  }

  /** @param {string} name @returns {boolean} */
  has(name) { return this.places.has(name); }

  /**
   * @param {Float64Array} rows one after the other
   * @param {Float64Array} pulses edge and width, one after the other
   */
  add(rows, pulses) {
    const count = rows.length / this.width;
    if (this.length + count > this.room && this.room < ROOM) this.grow(this.length + count);
    for (let done = 0; done < count;) { // as many at once as fit before the end of the ring
      const at = (this.first + this.length) % this.room;
      const fit = Math.min(count - done, this.room - at);
      this.data.set(rows.subarray(done * this.width, (done + fit) * this.width), at * this.width);
      const over = Math.max(this.length + fit - this.room, 0);
      this.first = (this.first + over) % this.room;
      this.length += fit - over;
      done += fit;
    }
    for (let k = 0; k < pulses.length; k += 2) this.edges.push([pulses[k], pulses[k + 1]]);
    if (this.edges.length > 24000) this.edges.splice(0, 8000);
  }

  /** @param {number} needed */
  grow(needed) {
    const room = Math.min(ROOM, Math.max(needed, 2 * this.room));
    const data = new Float64Array(room * this.width);
    for (let k = 0; k < this.length; k += 1) {
      const at = ((this.first + k) % this.room) * this.width;
      data.set(this.data.subarray(at, at + this.width), k * this.width);
    }
    this.data = data;
    this.room = room;
    this.first = 0;
  }

  /** @param {string} name @param {number} k @returns {number} a value of the k-th row */
  value(name, k) {
    const place = this.places.get(name);
    return place === undefined ? NaN : this.data[((this.first + k) % this.room) * this.width + place];
  }

  /** @param {number} k @returns {number} time of the k-th row [s] */
  time(k) { return this.data[((this.first + k) % this.room) * this.width]; }

  /** @param {string} name @returns {number} the latest value */
  latest(name) { return this.length ? this.value(name, this.length - 1) : NaN; }

  /** @param {number} time @returns {number} the first row that is not before a time */
  at(time) {
    let low = 0;
    let high = this.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.time(middle) < time) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** @param {string} name @param {number} time @returns {number} the value at a time, on the line between two rows */
  between(name, time) {
    const k = this.at(time);
    if (k === 0 || k >= this.length) return NaN;
    const [before, after] = [this.time(k - 1), this.time(k)];
    const share = after > before ? (time - before) / (after - before) : 1;
    return (1 - share) * this.value(name, k - 1) + share * this.value(name, k);
  }

  /** @param {string} name @param {number} start @param {number} end @returns {number} the mean over a time, on lines between rows */
  mean(name, start, end) {
    const { time, value } = this.slice(name, start, end);
    let [sum, whole] = [0, 0];
    for (let k = 1; k < time.length; k += 1) {
      const lasts = Math.min(time[k], end) - Math.max(time[k - 1], start);
      if (!(lasts > 0)) continue;
      sum += (lasts * (value[k] + value[k - 1])) / 2;
      whole += lasts;
    }
    return sum / whole;
  }

  /** @param {string} name @param {number} start @param {number} end @returns {{value: number, time: number}} the least value, and when it came first */
  lowest(name, start, end) {
    const found = { value: NaN, time: NaN };
    for (let k = this.at(start); k < this.length && this.time(k) <= end; k += 1) {
      const value = this.value(name, k);
      if (!(value >= found.value)) Object.assign(found, { value, time: this.time(k) });
    }
    return found;
  }

  /**
   * @param {string} name
   * @param {number} start
   * @param {number} end
   * @returns {{time: Float64Array, value: Float64Array}} with the rows next to both ends
   */
  slice(name, start, end) {
    const from = Math.max(this.at(start) - 1, 0);
    const to = Math.min(this.at(end) + 1, this.length);
    const count = Math.max(to - from, 0);
    const time = new Float64Array(count);
    const value = new Float64Array(count);
    for (let k = 0; k < count; k += 1) {
      time[k] = this.time(from + k);
      value[k] = this.value(name, from + k);
    }
    return { time, value };
  }

  /** @param {number} start @param {number} end @returns {[number, number][]} pulses that are high between [s] */
  pulses(start, end) {
    let from = this.edges.length;
    while (from > 0 && this.edges[from - 1][0] + this.edges[from - 1][1] >= start) from -= 1;
    let to = from;
    while (to < this.edges.length && this.edges[to][0] <= end) to += 1;
    return this.edges.slice(from, to);
  }
}
