// A picture of the instruments: screen and charts with their keys, as one sheet.

const [EDGE, LINE, GAP] = [16, 20, 10]; // pixels of the page
const [SAMPLE, BETWEEN] = [32, 18]; // pixels of a piece of line, and from word to word
const FONT = "13px system-ui, sans-serif";

/**
 * @param {string} title
 * @param {HTMLElement} root where screen and charts are
 * @returns {HTMLCanvasElement}
 */
export function sheet(title, root) {
  const sharp = window.devicePixelRatio || 1;
  const parts = [...root.querySelectorAll("canvas")].filter((one) => one.width && one.height)
    .map((canvas) => ({ canvas, words: wordsOf(canvas), width: canvas.width / sharp, height: canvas.height / sharp }));
  const width = Math.max(320, ...parts.map((one) => one.width)) + 2 * EDGE;
  const made = document.createElement("canvas");
  const pen = made.getContext("2d");
  if (!pen) return made;
  for (const one of parts) one.words = one.words.flatMap((line) => wrapped(pen, line, width - 2 * EDGE));
  const height = EDGE + LINE + parts.reduce((sum, one) => sum + one.words.length * LINE + one.height + GAP, 0) + EDGE;
  [made.width, made.height] = [Math.round(width * sharp), Math.round(height * sharp)];
  const style = getComputedStyle(document.body);
  const ink = style.color;
  pen.scale(sharp, sharp);
  pen.fillStyle = style.getPropertyValue("--panel");
  pen.fillRect(0, 0, width, height);
  pen.textBaseline = "middle";
  let y = EDGE + LINE / 2;
  text(pen, EDGE, y, [{ text: title, colour: ink, bold: true }]);
  y += LINE / 2;
  for (const { canvas, words, width: wide, height: tall } of parts) {
    for (const line of words) {
      y += LINE / 2;
      text(pen, EDGE, y, line.map((one) => ({ ...one, colour: one.colour || ink })));
      y += LINE / 2;
    }
    pen.drawImage(canvas, EDGE, y, wide, tall);
    y += tall + GAP;
  }
  return made;
}

/** @typedef {{text: string, colour: string, bold?: boolean, line?: string}} Word */

/**
 * @param {HTMLCanvasElement} canvas
 * @returns {Word[][]} lines of what stands beside it on the page
 */
function wordsOf(canvas) {
  const chart = canvas.closest(".chart");
  if (!chart) {
    return [...document.querySelectorAll(".measures section")].map((one) => [
      { text: one.querySelector("h3")?.textContent ?? "", colour: getComputedStyle(/** @type {Element} */ (one.firstElementChild)).color, bold: true },
      ...[...one.querySelectorAll("dl div")].map((row) => ({ text: [...row.children].map((cell) => cell.textContent).join(" "), colour: "" }))]);
  }
  return [[{ text: chart.querySelector("h3")?.textContent ?? "", colour: "", bold: true },
    ...[...chart.querySelectorAll(".sample")].map((one) => ({ text: one.textContent ?? "", colour: one.querySelector("line")?.getAttribute("stroke") ?? "",
      line: one.querySelector("line")?.getAttribute("stroke-dasharray") ?? undefined }))]];
}

/** @param {CanvasRenderingContext2D} pen @param {Word[]} words @param {number} room @returns {Word[][]} lines that fit */
function wrapped(pen, words, room) {
  const lines = /** @type {Word[][]} */ ([[]]);
  let x = 0;
  for (const word of words) {
    pen.font = word.bold ? `600 ${FONT}` : FONT;
    const wide = pen.measureText(word.text).width + (word.line === undefined ? 0 : SAMPLE);
    if (x > 0 && x + wide > room) { lines.push([]); x = 0; }
    lines[lines.length - 1].push(word);
    x += wide + BETWEEN;
  }
  return lines;
}

/** @param {CanvasRenderingContext2D} pen @param {number} x @param {number} y @param {Word[]} words */
function text(pen, x, y, words) {
  for (const word of words) {
    pen.font = word.bold ? `600 ${FONT}` : FONT;
    pen.fillStyle = word.colour;
    if (word.line !== undefined) {
      pen.strokeStyle = word.colour;
      pen.lineWidth = 2.4;
      pen.setLineDash(word.line === "none" ? [] : word.line.split(" ").map(Number));
      pen.beginPath();
      pen.moveTo(x, y);
      pen.lineTo(x + 26, y);
      pen.stroke();
      pen.setLineDash([]);
      x += SAMPLE;
    }
    pen.fillText(word.text, x, y);
    x += pen.measureText(word.text).width + BETWEEN;
  }
}
