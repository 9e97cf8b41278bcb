// A log of one's own: handed in, how its columns were read, laid over a servo of the bench, its command played.

import { choice, el, panel, unique } from "./dom.js";
import { handedIn } from "./line.js";
import { fullName } from "./names.js";
import { plain, printed } from "./units.js";

const MOST = 20_000_000; // bytes
const FIRST = "The first time, the simulation is compiled, which can take a minute.";

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const body = panel(root, "Your own log");
  /** @type {File|null} what was handed in last, to hand it in again when the line was cut */
  let file = null;
  /** @type {any} what is known of it */
  let facts = null;
  /** @type {any} what was laid over a servo last */
  let overlay = null;
  let drawn = false; // over the traces

  const input = el("input", { type: "file", accept: ".csv,.tsv,.txt,.json", class: "quiet", "aria-label": "open a log",
    onchange: () => { if (input.files?.[0]) bring(input.files[0]); input.value = ""; } });
  const said = el("p", { class: "said", role: "status" });
  const place = el("div", { hidden: true });
  const words = el("div", { hidden: true });
  const of = choice("Over servo", [], () => {});
  const run = choice("Run", [], () => { tell(); compare(); });
  const rig = tick("Fit delay, pulses' phase and zero of the angle first", true);
  const [id, mendId] = [unique(), unique()];
  const columns = el("input", { type: "text", id, placeholder: "time=t:ms angle=pos:deg-90", autocomplete: "off",
    spellcheck: "false", onkeydown: (/** @type {KeyboardEvent} */ event) => { if (event.key === "Enter") again(); } });
  const mend = el("input", { type: "text", id: mendId, placeholder: "torn,reset", autocomplete: "off", spellcheck: "false",
    onkeydown: (/** @type {KeyboardEvent} */ event) => { if (event.key === "Enter") again(); } });
  const table = el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "how the columns were read" });
  const hint = el("p", { class: "soft", text: "Drop a table (CSV, TSV) or a JSON log of a known format anywhere on the page, 20 MB at most." });
  body.append(hint,
    el("label", {}, "Open a log ", input), said, place, words);
  words.append(el("label", { for: id, text: "What its columns mean (as --columns of servotwin fit; time=50Hz is --rate, command=30deg@0s --commanded)" }), columns,
    el("label", { for: mendId, text: "What to mend (as --mend)" }), mend,
    el("div", { class: "buttons" }, el("button", { text: "Read again", onclick: () => again() })));
  place.append(table, run.row, of.row, rig.row, el("div", { class: "buttons" },
    el("button", { class: "primary", text: "Compare", onclick: () => compare() }),
    el("button", { text: "Play its command on the bench", onclick: () => play() }),
    el("button", { text: "Let it go", onclick: () => { bench.tell({ log: { forget: true } }); forget(); } })));

  /** @param {string} line */
  const say = (line) => { said.textContent = line; };
  const alone = () => Boolean(bench.hello.alone); // words for columns, and fits of the rig, need the server
  const number = () => Number(run.select.value) || 0;
  const tell = () => bench.emit("brought", facts && { ...facts, run: number() });

  const forget = () => {
    [file, facts, overlay] = [null, null, null];
    place.hidden = words.hidden = true;
    say("");
    clear();
    tell();
  };
  const clear = () => {
    if (drawn) bench.emit("log", null);
    drawn = false;
  };

  /** @param {File} given */
  const bring = async (given) => {
    /** @type {HTMLDetailsElement} */ (body.parentElement).open = true;
    forget();
    if (given.size > MOST) { say(`${given.name}: got ${(given.size / 1e6).toFixed(1)} MB, allowed: at most ${MOST / 1e6} MB`); return; }
    file = given;
    say(`Reading ${given.name} …`);
    try {
      const found = await handedIn(given, bench.hello.visitor ?? "");
      if (file !== given) return;
      columns.value = mend.value = "";
      if (found.log) took(found.log); else wrong(found.wrong ?? found.error ?? "", Boolean(found.wrong));
    } catch {
      wrong(`${given.name}: the line to the bench was cut, or the file cannot be read`, false);
    }
  };

  /** @param {string} line @param {boolean} kept whether it can be read again with other words */
  const wrong = (line, kept) => {
    facts = null;
    place.hidden = true;
    words.hidden = !kept || alone();
    say(line);
    tell();
  };

  const again = async () => {
    say("Reading …");
    try {
      await bench.ask({ log: { columns: columns.value, mend: mend.value } });
    } catch (error) { say(error instanceof Error ? error.message : String(error)); }
  };

  /** @param {any} found */
  const took = (found) => {
    facts = found;
    place.hidden = false;
    words.hidden = alone();
    run.select.replaceChildren(...found.runs.map((/** @type {any} */ one, /** @type {number} */ k) => el("option", { value: k, text: one.name })));
    run.row.hidden = found.runs.length < 2;
    table.hidden = !found.columns.length;
    table.replaceChildren(columnTable(found));
    say(described(found));
    tell();
    compare();
  };

  const compare = async () => {
    if (!facts) return;
    say(`${described(facts, number())} Comparing …${alone() ? "" : ` ${FIRST}`}`);
    try {
      await bench.ask({ log: { show: true, servo: Number(of.select.value) || 0, run: number(), rig: rig.input.checked } });
    } catch (error) { say(error instanceof Error ? error.message : String(error)); }
  };

  const play = async () => {
    const found = await bench.tell({ log: { play: true, run: number() } });
    if (!found) return;
    if (overlay?.unit === "°" && overlay.log === facts?.runs[number()]?.name) {
      drawn = true;
      bench.emit("log", { name: `log: ${overlay.log}`, value: Float64Array.from(overlay.measured),
        time: Float64Array.from(overlay.time, (/** @type {number} */ t) => t + found.time) });
    }
    bench.notice("the bench plays the command of the log");
  };

  bench.on("dropped", bring);
  bench.on("own", (found) => {
    if (found.reading) took(found.reading);
    else if (found.wrong) {
      if (facts && !words.hidden && said.textContent === "Reading …") wrong(found.wrong, true);
      else say(found.wrong);
    } else if (found.overlay) {
      overlay = found.overlay;
      say(facts ? described(facts, number()) : "");
    }
  });
  bench.on("scene", () => {
    clear();
    const before = of.select.value;
    of.select.replaceChildren(...bench.facts.map((one, k) => el("option", { value: k, text: `${k + 1}: ${fullName(one)}` })));
    if (Number(before) < bench.facts.length && before) of.select.value = before;
    of.row.hidden = bench.facts.length < 2;
  });
  bench.on("hello", (hello) => {
    rig.row.hidden = alone();
    if (hello.log_hint) hint.textContent = hello.log_hint;
    if (file) bring(file);
  });
}

/** @param {string} label @param {boolean} checked @returns {{row: HTMLElement, input: HTMLInputElement}} */
function tick(label, checked) {
  const input = el("input", { type: "checkbox", checked });
  return { input, row: el("label", { class: "tick" }, input, ` ${label}`) };
}

/** @param {any} found @param {number} [run] @returns {string} what a log is, in a sentence */
function described(found, run = 0) {
  const one = found.runs[run] ?? found.runs[0];
  const { kind, unit, low, high } = one.command;
  const what = /** @type {Record<string, string>} */ ({ pulse_width: "pulses", angle: "angles", voltage: "voltages" })[kind];
  return `${one.name}: ${plain(one.duration, 4)} s, ${one.rows} rows, commanded by ${what} from ${plain(low, 5)} to ${plain(high, 5)} ${printed(unit)}.`;
}

/** @param {any} found @returns {HTMLElement} which column is what, and how this is known */
function columnTable(found) {
  const heads = ["column", "is", "known"];
  return el("div", {}, el("table", {}, el("caption", { text: "How the columns were read" }),
    el("thead", {}, el("tr", {}, ...heads.map((text) => el("th", { scope: "col", text })))),
    el("tbody", {}, ...found.columns.map((/** @type {any} */ one) => el("tr", { class: one.known.startsWith("guessed") ? "guessed" : null },
      el("th", { scope: "row", text: one.column }), el("td", { text: `${one.signal.replaceAll("_", " ")}${printed(one.unit) ? ` [${printed(one.unit)}]` : ""}` }),
      el("td", { text: one.known }))))),
  ...(found.unread.length ? [el("p", { class: "soft", text: `Not read: ${found.unread.join(", ")}` })] : []),
  ...found.remarks.map((/** @type {string} */ text) => el("p", { class: "soft", text })));
}
