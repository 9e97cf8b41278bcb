// What leaves the bench: table, picture, servo file, script, the bench itself as a file and as a link.

import { choice, el, panel } from "./dom.js";
import { fullName } from "./names.js";
import { sheet } from "./picture.js";

const LONGEST_LINK = 30000;

/** @param {HTMLElement} root @param {import("./bench.js").Bench} bench */
export function mount(root, bench) {
  const body = panel(root, "Save and share");
  const which = choice("Of", [], () => {});
  const link = el("input", { type: "text", readonly: true, "aria-label": "link to this bench" });
  const file = el("input", { type: "file", accept: ".toml,text/plain", class: "quiet", "aria-label": "open a bench or a servo file",
    onchange: async () => { if (file.files?.[0]) open(await file.files[0].text(), file.files[0].name); file.value = ""; } });
  /** @param {string} kind */
  const save = async (kind) => {
    const answer = await bench.tell({ export: kind, servo: Number(which.select.value) || 0 });
    if (answer) download(answer.file.name, new Blob([answer.file.text], { type: answer.file.type }));
  };
  body.append(which.row, el("div", { class: "buttons" },
    el("button", { text: "Table (CSV)", onclick: () => save("csv") }),
    el("button", { text: "Picture (PNG)", onclick: () => picture() }),
    el("button", { text: "Servo file", onclick: () => save("servo") }),
    el("button", { text: "Python script", onclick: () => save("script") }),
    el("button", { text: "Bench (TOML)", onclick: () => save("scene") }),
    el("button", { class: "primary", text: "Link", onclick: () => share() })), link,
  el("label", {}, "Open a bench or a servo file ", file));

  const share = async () => {
    const found = await bench.tell({ text: true });
    if (!found) return;
    if (found.fragment.length > LONGEST_LINK) { bench.notice("too much was done for a link: save the bench as a file"); return; }
    history.replaceState(null, "", `${location.pathname}${location.search}#${found.fragment}`);
    bench.emit("linked");
    link.value = location.href;
    link.select();
    navigator.clipboard?.writeText(location.href).catch(() => {});
    bench.notice("the link is in the address bar, and copied");
  };

  /** @param {string} text @param {string} name */
  const open = (text, name) => {
    if (/^\s*format\s*=/m.test(text)) { bench.tell({ scene: text }); return; }
    bench.tell({ scene: `format = 1\nname = ${JSON.stringify(name)}\n[[servo]]\nfile = ${JSON.stringify(text)}\n[load]\ninertia = 1e-4\n` });
  };
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", async (event) => {
    const given = event.dataTransfer?.files[0];
    event.preventDefault();
    if (given?.name.endsWith(".toml")) open(await given.text(), given.name);
    else if (given) bench.emit("dropped", given);
  });

  const picture = () => sheet(`${bench.state.name || bench.facts.map(fullName).join("; ")}, after ${bench.time.toFixed(3)} s`,
    /** @type {HTMLElement} */ (document.getElementById("instruments"))).toBlob((blob) => { if (blob) download("bench.png", blob); });

  bench.on("scene", () => which.select.replaceChildren(...bench.facts.map((facts, k) => el("option", {
    value: k, text: `${k + 1}: ${fullName(facts)}` }))));
}

/** @param {string} name @param {Blob} blob */
export function download(name, blob) {
  const link = el("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
