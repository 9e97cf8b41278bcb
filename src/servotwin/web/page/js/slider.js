// A number with a slider, a field to type it in, its unit and what it means.

import { el, unique } from "./dom.js";
import { plain, printed } from "./units.js";

const STEPS = 1000;

/**
 * @param {{label: string, unit: string, low: number, high: number, value: number|null, step?: number,
 *          title?: string, changed: (value: number) => void}} of as shown
 * @returns {{row: HTMLElement, set: (value: number|null) => void, range: (low: number, high: number) => void,
 *            typed: HTMLInputElement, slide: HTMLInputElement}}
 */
export function slider(of) {
  const id = unique();
  let low = of.low;
  let high = of.high;
  const unit = printed(of.unit);
  const slide = el("input", { type: "range", min: 0, max: STEPS, step: 1, "aria-label": `${of.label}, slider`,
    title: of.title });
  const typed = el("input", { type: "number", id, step: "any", inputmode: "decimal", title: of.title });
  const row = el("div", { class: "slider" },
    el("label", { for: id, text: of.label, title: of.title }), slide,
    el("span", { class: "typed" }, typed, el("span", { class: "unit", text: unit })));

  /** @param {number} value */
  const place = (value) => {
    slide.value = String(Math.round(((value - low) / (high - low)) * STEPS));
    slide.setAttribute("aria-valuetext", `${plain(value)} ${unit}`);
  };
  /** @param {number|null} value */
  const set = (value) => {
    if (value === null || !Number.isFinite(value)) { typed.value = ""; slide.value = "0"; return; }
    if (document.activeElement !== typed) typed.value = plain(value, 6);
    if (document.activeElement !== slide || !slide.matches(":active")) place(value);
  };
  slide.addEventListener("input", () => {
    let value = low + (Number(slide.value) / STEPS) * (high - low);
    if (of.step) value = Math.round(value / of.step) * of.step;
    typed.value = plain(value, 6);
    slide.setAttribute("aria-valuetext", `${plain(value)} ${unit}`);
    of.changed(value);
  });
  const take = () => {
    const value = Number(typed.value);
    if (typed.value === "" || !Number.isFinite(value)) return;
    place(value);
    of.changed(value);
  };
  typed.addEventListener("change", take);
  row.addEventListener("wheel", (event) => {
    if (!row.contains(document.activeElement)) return; // a page that scrolls changes nothing
    event.preventDefault();
    const by = of.step ?? (high - low) / 100;
    const value = Math.min(high, Math.max(low, Number(typed.value) - Math.sign(event.deltaY) * by));
    typed.value = plain(value, 6);
    place(value);
    of.changed(value);
  }, { passive: false });
  set(of.value);
  return { row, set, typed, slide,
    range: (newLow, newHigh) => { low = newLow; high = newHigh; } };
}
