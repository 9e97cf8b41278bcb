// A clock that never lies: bench time by the time on the wall, and how slow it really runs.

export class Pace {
  /** @param {any} limits @param {number} now time on the wall [s] */
  constructor(limits, now) {
    this.limits = limits;
    this.speed = 1;
    this.running = true;
    this.from = [now, 0];
    this.went = [[now, 0]];
    this.lateUntil = -Infinity;
  }

  /** @param {number} now @param {number} bench */
  begin(now, bench) {
    this.from = [now, bench];
    this.lateUntil = -Infinity;
    this.went = [[now, bench]];
  }

  /** @param {number} now @param {number} bench @returns {number} how far bench time should be [s] */
  target(now, bench) {
    if (!this.running) return bench;
    return Number.isFinite(this.speed) ? this.from[1] + this.speed * (now - this.from[0]) : Infinity;
  }

  /** Take note of how far bench time has come; a debt that is too large is dropped. @param {number} now @param {number} bench */
  note(now, bench) {
    if (Number.isFinite(this.speed) && this.target(now, bench) - bench > this.limits.late * this.speed) {
      this.from = [now, bench];
      this.lateUntil = now + this.limits.over;
    }
    this.went.push([now, bench]);
    while (this.went.length > 2 && this.went[1][0] <= now - this.limits.over) this.went.shift();
  }

  get last() { return this.went[this.went.length - 1]; }
  get behind() { return this.last[0] < this.lateUntil; }
  get measured() {
    const [first, start] = this.went[0];
    const [last, end] = this.last;
    return this.running && last > first ? (end - start) / (last - first) : 0;
  }
}
