// What was done at the bench stays when the page is loaded once more: in the tab, and nowhere else.

const KEY = `servotwin ${location.pathname}${location.search}`;
const SOON = 400; // ms after something was done

/** @param {import("./bench.js").Bench} bench */
export function mount(bench) {
  let waits = 0;
  let link = location.hash; // with which the bench began: another one begins its own
  /** @type {{link: string, text: string}|null} */
  let record = null;
  const write = () => { if (record && bench.role === "own") put(JSON.stringify({ ...record, running: bench.running })); };
  bench.on("kept", () => {
    record = { link, text: bench.kept };
    write();
  });
  for (const name of ["scene", "linked"]) bench.on(name, () => { link = location.hash; });
  bench.on("did", () => {
    clearTimeout(waits);
    waits = window.setTimeout(() => bench.keep(), SOON);
  });
  addEventListener("pagehide", write);
}

/** @returns {{text: string, running: boolean}|null} the bench of before, where this page was loaded once more */
export function before() {
  const [entry] = /** @type {PerformanceNavigationTiming[]} */ (performance.getEntriesByType("navigation"));
  if (!entry || entry.type === "navigate") return null;
  try {
    const found = JSON.parse(sessionStorage.getItem(KEY) ?? "null");
    return found && found.link === location.hash ? found : null;
  } catch {
    return null; // storage is refused: it begins anew
  }
}

/** @param {string} text */
function put(text) {
  try {
    sessionStorage.setItem(KEY, text);
  } catch { /* refused, or too much: the bench works without */ }
}
