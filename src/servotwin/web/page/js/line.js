// The way to the bench: a socket of the server. Of the page as one file another module stands in its place.

/** @typedef {{n: number, m: number, columns: string[]}} Part how many rows, of what, and how many pulses */
/** @typedef {{points: Float64Array, pulses: Float64Array}} Numbers rows, and edges and widths [s], one after the other */
/** @typedef {{told: (message: any) => void, pushed: (header: any, parts: Numbers[]) => void, closed?: (event: CloseEvent) => void}} Page */

/**
 * Let a page hear what the bench tells, and return how it says something.
 * @param {Page} page
 * @returns {{open: boolean, say: (message: any) => void, cut?: () => void}}
 */
export function connect(page) {
  const link = new URL("/live", location.href);
  link.protocol = location.protocol === "https:" ? "wss:" : "ws:";
  link.search = location.search;
  const socket = new WebSocket(link);
  socket.binaryType = "arraybuffer";
  socket.onmessage = (event) => {
    if (typeof event.data === "string") page.told(JSON.parse(event.data));
    else unpack(event.data, page);
  };
  socket.onclose = (event) => page.closed?.(event);
  return { get open() { return socket.readyState === WebSocket.OPEN; }, say: (message) => socket.send(JSON.stringify(message)),
    cut: () => socket.close() };
}

/** @param {ArrayBuffer} data @param {Page} page */
function unpack(data, page) {
  const length = new DataView(data).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  let at = Math.ceil((4 + length) / 8) * 8;
  page.pushed(header, header.servos.map((/** @type {Part} */ part) => {
    const points = new Float64Array(data, at, part.n * part.columns.length);
    const pulses = new Float64Array(data, at + points.byteLength, 2 * part.m);
    at += points.byteLength + pulses.byteLength;
    return { points, pulses };
  }));
}

/**
 * Ask for what does not change.
 * @param {string} what "catalog", or "curves" of a servo
 * @param {string} [name]
 * @returns {Promise<any>}
 */
export async function asked(what, name) {
  const answer = await fetch(name === undefined ? `/api/${what}` : `/api/${what}/${encodeURIComponent(name)}`);
  const found = await answer.json();
  if (!answer.ok) throw new Error(found.error);
  return found;
}

/**
 * Hand in a log.
 * @param {File} file
 * @param {string} visitor whose it is
 * @returns {Promise<{log?: any, wrong?: string, error?: string}>} what is known of it, or what is wrong
 */
export async function handedIn(file, visitor) {
  const answer = await fetch(`/api/log?name=${encodeURIComponent(file.name)}`, { method: "POST", headers: { "x-visitor": visitor }, body: file });
  return answer.json();
}
