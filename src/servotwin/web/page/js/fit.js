// A fit of a servo to the log that was brought: what is searched, and how far it is.

import { choice, el, panel } from "./dom.js";
import { capital } from "./fit_found.js";
import { fullName } from "./names.js";
import { engineering, plain, printed } from "./units.js";

const PREFIXED = ["s", "V", "A"]; // units that people write prefixes before

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const body = panel(root, "Fit a servo to the log");
  /** @type {any} the log that was brought */
  let log = null;
  let asked = 0; // plans: an answer to an earlier one comes too late
  const hint = el("p", { class: "soft", text: "Drop a log on the page first. A fit finds the numbers with which a servo does what the log shows." });
  const place = el("div", { hidden: true });
  const of = choice("Start from servo", [], () => plan());
  const model = choice("Computed as", [], () => plan(model.select.value));
  const free = el("fieldset", { class: "ticks" });
  const all = el("input", { type: "checkbox" });
  const causes = el("input", { type: "checkbox", checked: true });
  const allRow = el("label", { class: "tick" }, all, " Fit all runs of the log");
  const begin = el("button", { class: "primary", text: "Fit", onclick: () => fit() });
  const stop = el("button", { text: "Cancel the fit", disabled: true, onclick: () => bench.tell({ fit: { cancel: true } }) });
  const bar = el("progress", { max: 1, value: 0, "aria-label": "progress of the fit", hidden: true });
  const said = el("p", { class: "said", role: "status" });
  place.append(of.row, model.row, free, allRow, el("label", { class: "tick" }, causes, " Look for causes where what is left is no noise (takes longer)"),
    el("div", { class: "buttons" }, begin, stop), bar, said);
  body.append(hint, place);

  /** @param {string} [name] of a model */
  const plan = async (name) => {
    if (!log) return;
    asked += 1;
    const own = asked;
    try {
      const { plan: found } = await bench.ask({ fit: { plan: true, servo: Number(of.select.value) || 0, ...(name ? { model: name } : {}) } });
      if (own !== asked) return;
      model.select.replaceChildren(...found.models.map((/** @type {string} */ one) => el("option", { value: one, text: one })));
      model.select.value = found.model;
      free.replaceChildren(el("legend", { text: "What is searched" }), ...found.free.map((/** @type {any} */ one) => el("label", { class: "tick", title: one.name },
        el("input", { type: "checkbox", checked: true, value: one.name }),
        ` ${one.meaning}${one.value === null ? "" : ` (now ${now(one)})`}`)));
      begin.disabled = false;
    } catch (error) {
      if (own !== asked) return;
      say(error);
      begin.disabled = true;
    }
  };

  const fit = async () => {
    const names = [...free.querySelectorAll("input")].filter((one) => one.checked).map((one) => one.value);
    try {
      await bench.ask({ fit: { servo: Number(of.select.value) || 0, model: model.select.value, free: names, run: log.run,
        all: all.checked, diagnose: causes.checked } });
      runs(true);
      said.textContent = "The fit begins.";
    } catch (error) { say(error); }
  };

  /** @param {unknown} error */
  const say = (error) => { said.textContent = error instanceof Error ? error.message : String(error); };

  /** @param {boolean} running */
  const runs = (running) => {
    begin.disabled = running;
    stop.disabled = !running;
    bar.hidden = !running;
    if (running) bar.value = 0;
  };

  let spoken = ""; // a screen reader hears each stage once, not each second of it
  bench.on("fit", (found) => {
    if (found.state === "running") {
      runs(true);
      bar.value = found.share;
      bar.title = `${found.text}, ${(100 * found.share).toFixed(0)} %, ${found.seconds.toFixed(0)} s`;
      if (found.text !== spoken) said.textContent = `${found.text} …`;
      spoken = found.text;
      return;
    }
    runs(false);
    spoken = "";
    if (found.state === "done") {
      said.textContent = `Fitted in ${found.seconds.toFixed(0)} s${found.interrupted ? "; its time was over: this is the best so far, without intervals" : ""}.${found.verdict ? ` ${capital(found.verdict.sentence)}.` : ""}`;
    } else said.textContent = found.state === "failed" ? found.message : "The fit was cancelled.";
  });
  bench.on("brought", (found) => {
    const fresh = found && found.name !== log?.name;
    log = found;
    place.hidden = !found;
    hint.hidden = Boolean(found);
    if (!found) { said.textContent = ""; return; }
    allRow.hidden = found.runs.length < 2;
    if (fresh) { plan(); }
  });
  bench.on("scene", () => {
    of.select.replaceChildren(...bench.facts.map((one, k) => el("option", { value: k, text: `${k + 1}: ${fullName(one)}` })));
    of.row.hidden = bench.facts.length < 2;
    plan();
  });
  bench.on("closed", () => runs(false));
}

/** @param {any} one what may be searched @returns {string} its value of now */
function now(one) {
  return PREFIXED.includes(one.unit) ? engineering(one.value, one.unit, 3) : `${plain(one.value, 3)} ${printed(one.unit)}`.trim();
}
