// The screen of the oscilloscope.

export const DIVISIONS = { x: 10, y: 8 };

/** @typedef {{trace: import("./scope_measure.js").Trace, colour: string, scale: number, position: number, dash: number[],
 *             name: string}} Channel scale: units a division; position: divisions above the middle */

/**
 * @param {CanvasRenderingContext2D} pen
 * @param {{width: number, height: number, start: number, base: number, channels: Channel[],
 *          cursors: {time: number[], level: number[]}|null, trigger: {x: number, y: number, colour: string}|null,
 *          style: CSSStyleDeclaration}} of
 */
export function drawScreen(pen, of) {
  const { width, height } = of;
  const colour = (/** @type {string} */ name) => of.style.getPropertyValue(name).trim();
  pen.clearRect(0, 0, width, height);
  pen.fillStyle = colour("--screen");
  pen.fillRect(0, 0, width, height);
  graticule(pen, width, height, colour("--grid"), colour("--grid-strong"));
  pen.lineJoin = "round";
  for (const channel of of.channels) {
    const x = (/** @type {number} */ t) => ((t - of.start) / of.base / DIVISIONS.x) * width;
    const y = (/** @type {number} */ v) => height / 2 - ((v / channel.scale + channel.position) / DIVISIONS.y) * height;
    pen.strokeStyle = channel.colour;
    pen.lineWidth = 2;
    pen.setLineDash(channel.dash);
    line(pen, channel.trace, x, y, width);
    pen.setLineDash([]);
    pen.fillStyle = channel.colour;
    const zero = Math.min(height - 6, Math.max(6, y(0)));
    pen.beginPath();
    pen.moveTo(0, zero - 5);
    pen.lineTo(9, zero);
    pen.lineTo(0, zero + 5);
    pen.fill();
  }
  if (of.trigger) {
    pen.fillStyle = of.trigger.colour;
    pen.beginPath();
    pen.moveTo(of.trigger.x * width - 5, 0);
    pen.lineTo(of.trigger.x * width + 5, 0);
    pen.lineTo(of.trigger.x * width, 9);
    pen.fill();
  }
  if (of.cursors) {
    pen.strokeStyle = colour("--cursor");
    pen.lineWidth = 1.5;
    pen.setLineDash([5, 4]);
    for (const part of of.cursors.time) stroke(pen, part * width, 0, part * width, height);
    for (const part of of.cursors.level) stroke(pen, 0, part * height, width, part * height);
    pen.setLineDash([]);
  }
}

/**
 * A trace; where many points share a column of pixels, their extremes.
 * @param {CanvasRenderingContext2D} pen
 * @param {import("./scope_measure.js").Trace} trace
 * @param {(t: number) => number} x
 * @param {(v: number) => number} y
 * @param {number} width
 */
function line(pen, trace, x, y, width) {
  const { time, value } = trace;
  pen.beginPath();
  let column = NaN;
  let [low, high, last] = [0, 0, 0];
  const whole = () => { if (high - low > 0.5) { pen.lineTo(column, low); pen.lineTo(column, high); pen.lineTo(column, last); } };
  for (let k = 0; k < time.length; k += 1) {
    const at = x(time[k]);
    const to = y(value[k]);
    if (!Number.isFinite(to)) continue;
    if (Number.isNaN(column)) pen.moveTo(at, to);
    else if (Math.abs(at - column) < 0.5) {
      [low, high, last] = [Math.min(low, to), Math.max(high, to), to];
      continue;
    } else {
      whole();
      pen.lineTo(at, to);
    }
    column = at;
    [low, high, last] = [to, to, to];
  }
  whole();
  pen.stroke();
}

/** @param {CanvasRenderingContext2D} pen @param {number} w @param {number} h @param {string} thin @param {string} strong */
function graticule(pen, w, h, thin, strong) {
  pen.lineWidth = 1;
  for (let k = 0; k <= DIVISIONS.x; k += 1) {
    pen.strokeStyle = k === DIVISIONS.x / 2 ? strong : thin;
    stroke(pen, Math.round((k / DIVISIONS.x) * (w - 1)) + 0.5, 0, Math.round((k / DIVISIONS.x) * (w - 1)) + 0.5, h);
  }
  for (let k = 0; k <= DIVISIONS.y; k += 1) {
    pen.strokeStyle = k === DIVISIONS.y / 2 ? strong : thin;
    stroke(pen, 0, Math.round((k / DIVISIONS.y) * (h - 1)) + 0.5, w, Math.round((k / DIVISIONS.y) * (h - 1)) + 0.5);
  }
}

/** @param {CanvasRenderingContext2D} pen @param {number} a @param {number} b @param {number} c @param {number} d */
function stroke(pen, a, b, c, d) {
  pen.beginPath();
  pen.moveTo(a, b);
  pen.lineTo(c, d);
  pen.stroke();
}
