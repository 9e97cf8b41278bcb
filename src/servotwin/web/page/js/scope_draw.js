// The screen of the oscilloscope.

export const DIVISIONS = { x: 10, y: 8 };
const BAR = 22; // pixels of the line of settings above the screen
const FONT = "12px system-ui, sans-serif";

/** @typedef {{trace: import("./scope_measure.js").Trace, colour: string, scale: number, position: number, dash: number[],
 *             says: string}} Channel scale: units a division; position: divisions above the middle */
/** @typedef {{time: number[], level: number[]}} Cursors as shares of the screen */

/**
 * @param {CanvasRenderingContext2D} pen
 * @param {{width: number, height: number, start: number, base: number, channels: Channel[], cursors: Cursors|null,
 *          trigger: {x: number, channel: number, level: number}, says: string[], style: CSSStyleDeclaration}} of
 */
export function drawScreen(pen, of) {
  const { width } = of;
  const height = of.height - BAR;
  const colour = (/** @type {string} */ name) => of.style.getPropertyValue(name).trim();
  pen.clearRect(0, 0, width, of.height);
  settings(pen, of, colour);
  pen.save();
  pen.translate(0, BAR);
  pen.beginPath();
  pen.rect(0, 0, width, height);
  pen.clip();
  pen.fillStyle = colour("--screen");
  pen.fillRect(0, 0, width, height);
  graticule(pen, width, height, colour("--grid"), colour("--grid-strong"));
  pen.lineJoin = "round";
  const x = (/** @type {number} */ t) => ((t - of.start) / of.base / DIVISIONS.x) * width;
  of.channels.forEach((channel, k) => {
    const y = (/** @type {number} */ v) => height / 2 - ((v / channel.scale + channel.position) / DIVISIONS.y) * height;
    pen.strokeStyle = channel.colour;
    pen.lineWidth = 2;
    pen.setLineDash(channel.dash);
    line(pen, channel.trace, x, y);
    pen.setLineDash([]);
    tag(pen, `${k + 1}`, Math.min(height - 9, Math.max(9, y(0))), channel.colour, colour("--screen"));
    if (k === of.trigger.channel) level(pen, width, Math.min(height - 5, Math.max(5, y(of.trigger.level))), channel.colour);
  });
  pen.fillStyle = of.channels[of.trigger.channel].colour;
  triangle(pen, [of.trigger.x * width - 6, 0], [of.trigger.x * width + 6, 0], [of.trigger.x * width, 9]);
  if (of.cursors) cursorLines(pen, of.cursors, width, height, colour("--cursor"));
  pen.restore();
}

/** @param {CanvasRenderingContext2D} pen @param {any} of @param {(name: string) => string} colour */
function settings(pen, of, colour) {
  pen.fillStyle = colour("--field");
  pen.fillRect(0, 0, of.width, BAR);
  pen.font = FONT;
  pen.textBaseline = "middle";
  let x = 8;
  const texts = [...of.channels.map((/** @type {Channel} */ one, /** @type {number} */ k) => [`${k + 1}  ${one.says}`, one.colour]),
    ...of.says.map((/** @type {string} */ one) => [one, colour("--ink-soft")])];
  const room = of.width - 16 - texts.reduce((sum, [text]) => sum + pen.measureText(text).width, 0);
  const gap = Math.max(8, Math.min(24, room / Math.max(texts.length - 1, 1)));
  for (const [text, ink] of texts) {
    pen.fillStyle = ink;
    pen.fillText(text, x, BAR / 2 + 1);
    x += pen.measureText(text).width + gap;
  }
}

/** @param {CanvasRenderingContext2D} pen @param {string} text @param {number} y @param {string} ink @param {string} paper */
function tag(pen, text, y, ink, paper) {
  pen.fillStyle = ink;
  pen.beginPath();
  pen.moveTo(0, y - 8);
  pen.lineTo(12, y - 8);
  pen.lineTo(19, y);
  pen.lineTo(12, y + 8);
  pen.lineTo(0, y + 8);
  pen.fill();
  pen.fillStyle = paper;
  pen.font = `600 ${FONT}`;
  pen.textBaseline = "middle";
  pen.fillText(text, 4, y + 0.5);
}

/** @param {CanvasRenderingContext2D} pen @param {number} width @param {number} y @param {string} ink */
function level(pen, width, y, ink) {
  pen.fillStyle = ink;
  triangle(pen, [width, y - 5], [width, y + 5], [width - 9, y]);
}

/** @param {CanvasRenderingContext2D} pen @param {number[]} a @param {number[]} b @param {number[]} c */
function triangle(pen, a, b, c) {
  pen.beginPath();
  pen.moveTo(a[0], a[1]);
  pen.lineTo(b[0], b[1]);
  pen.lineTo(c[0], c[1]);
  pen.fill();
}

/** @param {CanvasRenderingContext2D} pen @param {Cursors} cursors @param {number} width @param {number} height @param {string} ink */
function cursorLines(pen, cursors, width, height, ink) {
  pen.strokeStyle = ink;
  pen.fillStyle = ink;
  pen.font = FONT;
  pen.textBaseline = "top";
  pen.lineWidth = 1.5;
  pen.setLineDash([5, 4]);
  for (const part of cursors.time) stroke(pen, part * width, 0, part * width, height);
  for (const part of cursors.level) stroke(pen, 0, part * height, width, part * height);
  pen.setLineDash([]);
  cursors.time.forEach((part, k) => pen.fillText(`t${k + 1}`, part * width + 3, height - 15));
  cursors.level.forEach((part, k) => pen.fillText(`y${k + 1}`, width - 26, part * height + 2));
}

/**
 * A trace; where many points share a column of pixels, their extremes.
 * @param {CanvasRenderingContext2D} pen
 * @param {import("./scope_measure.js").Trace} trace
 * @param {(t: number) => number} x
 * @param {(v: number) => number} y
 */
function line(pen, trace, x, y) {
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
  for (const [count, along] of /** @type {[number, boolean][]} */ ([[DIVISIONS.x, true], [DIVISIONS.y, false]])) {
    const size = along ? w : h;
    for (let k = 0; k <= count; k += 1) {
      const at = Math.round((k / count) * (size - 1)) + 0.5;
      pen.strokeStyle = k === count / 2 ? strong : thin;
      if (along) stroke(pen, at, 0, at, h); else stroke(pen, 0, at, w, at);
    }
    pen.strokeStyle = strong; // small marks on the middle lines: fifths of a division
    for (let k = 0; k <= 5 * count; k += 1) {
      const at = Math.round((k / (5 * count)) * (size - 1)) + 0.5;
      if (along) stroke(pen, at, h / 2 - 2.5, at, h / 2 + 2.5); else stroke(pen, w / 2 - 2.5, at, w / 2 + 2.5, at);
    }
  }
}

/** @param {CanvasRenderingContext2D} pen @param {number} a @param {number} b @param {number} c @param {number} d */
function stroke(pen, a, b, c, d) {
  pen.beginPath();
  pen.moveTo(a, b);
  pen.lineTo(c, d);
  pen.stroke();
}

/** @param {number} share of the canvas's height @param {number} height of the canvas @returns {number} share of the screen */
export function onScreen(share, height) {
  return (share * height - BAR) / (height - BAR);
}
