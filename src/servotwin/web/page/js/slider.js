// A number with a slider, a field to type it in, its unit and what it means.

import { el, unique } from "./dom.js";
import { plain, printed } from "./units.js";

const STEPS = 1000; // of a slider whose number has none of its own
const DIGITS = 6;

/**
 * @param {{label: string, unit: string, low: number, high: number, value: number|null, step?: number,
 *          title?: string, changed: (value: number) => void}} of as shown
 * @returns {{row: HTMLElement, set: (value: number|null) => void, busy: () => boolean, typed: HTMLInputElement,
 *            slide: HTMLInputElement}}
 */
export function slider(of) {
  const id = unique();
  const { low, high } = of;
  const steps = of.step ? Math.max(1, Math.round((high - low) / of.step)) : STEPS;
  const unit = printed(of.unit);
  const slide = el("input", { type: "range", min: 0, max: steps, step: 1, "aria-label": `${of.label}, slider`,
    title: of.title });
  const typed = el("input", { type: "number", id, step: "any", inputmode: "decimal", title: of.title });
  const row = el("div", { class: "slider" },
    el("label", { for: id, text: of.label, title: of.title }), slide,
    el("span", { class: "typed" }, typed, el("span", { class: "unit", text: unit })));

  /** @param {number} value */
  const place = (value) => {
    slide.value = String(Math.round(((value - low) / (high - low)) * steps));
    slide.setAttribute("aria-valuetext", `${plain(value)} ${unit}`);
  };
  /** @param {number|null} value */
  const set = (value) => {
    if (value === null || !Number.isFinite(value)) { typed.value = ""; slide.value = "0"; return; }
    if (document.activeElement !== typed) typed.value = plain(value, DIGITS);
    if (!slide.matches(":active")) place(value);
  };
  /** @param {number} value */
  const take = (value) => {
    typed.value = plain(value, DIGITS);
    place(value);
    of.changed(Number(typed.value));
  };
  slide.addEventListener("input", () => {
    const value = low + (Number(slide.value) / steps) * (high - low);
    take(of.step ? Math.round(value / of.step) * of.step : value);
  });
  typed.addEventListener("change", () => {
    const value = Number(typed.value);
    if (typed.value === "" || !Number.isFinite(value)) return;
    place(value);
    of.changed(value);
  });
  row.addEventListener("wheel", (event) => {
    if (!row.contains(document.activeElement)) return; // a page that scrolls changes nothing
    event.preventDefault();
    const by = of.step ?? (high - low) / 100;
    take(Math.min(high, Math.max(low, Number(typed.value) - Math.sign(event.deltaY) * by)));
  }, { passive: false });
  set(of.value);
  return { row, set, typed, slide, busy: () => document.activeElement === typed || slide.matches(":active") };
}
