// Small helpers to build the page.

/**
 * Make an element.
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {Record<string, any>} [attributes] listeners begin with "on"; "text" is its text
 * @param {...(Node|string|null)} children
 * @returns {HTMLElementTagNameMap[K]}
 */
export function el(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  dress(made, attributes);
  made.append(...children.filter((child) => child !== null));
  return made;
}

/**
 * Make an element of a drawing.
 * @param {string} tag
 * @param {Record<string, any>} [attributes]
 * @param {...Node} children
 * @returns {SVGElement}
 */
export function svg(tag, attributes = {}, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  dress(made, attributes);
  made.append(...children);
  return made;
}

/**
 * @param {Element} made
 * @param {Record<string, any>} attributes
 */
function dress(made, attributes) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (name === "text") made.textContent = String(value);
    else if (name === "value" && "value" in made) {
      if (made instanceof HTMLInputElement) made.defaultValue = String(value); // so that one sees what was typed since
      made.value = value;
    }
    else made.setAttribute(name, value === true ? "" : String(value));
  }
}

/** @param {string} name @returns {HTMLElement} a name that may be broken after its dots and underlines */
export function breakable(name) {
  return el("code", {}, ...name.split(/(?<=[._])/).flatMap((part, k) => (k ? [el("wbr"), part] : [part])));
}

let count = 0;

/** @returns {string} an id that nothing else has */
export function unique() {
  count += 1;
  return `e${count}`;
}

/**
 * Make a panel of the side: a heading that opens it.
 * @param {HTMLElement} root
 * @param {string} title
 * @param {boolean} [open]
 * @returns {HTMLElement} what it holds
 */
export function panel(root, title, open = false) {
  const body = el("div", { class: "body" });
  root.append(el("details", { open }, el("summary", {}, el("h2", { text: title })), body));
  return body;
}

/**
 * Make a labelled choice.
 * @param {string} label
 * @param {[string, string][]} options value and text
 * @param {(value: string) => void} chosen
 * @returns {{row: HTMLElement, select: HTMLSelectElement}}
 */
export function choice(label, options, chosen) {
  const id = unique();
  const select = el("select", { id, onchange: () => chosen(select.value) },
    ...options.map(([value, text]) => el("option", { value, text })));
  return { row: el("div", { class: "row" }, el("label", { for: id, text: label }), select), select };
}

/**
 * Build something anew; the control that had the focus has it again, with what was being typed.
 * @param {HTMLElement} body
 * @param {() => void} build controls are known by their attribute data-key
 */
export function anew(body, build) {
  const held = document.activeElement;
  const key = held instanceof HTMLElement && body.contains(held) ? held.dataset.key : undefined;
  const typed = held instanceof HTMLInputElement && held.value !== held.defaultValue ? held.value : null;
  build();
  if (!key) return;
  const next = body.querySelector(`[data-key="${key}"]`);
  if (!(next instanceof HTMLElement)) return;
  next.focus();
  if (typed !== null && next instanceof HTMLInputElement) next.value = typed;
}

/** Whether the system asks for little motion. */
export const calm = window.matchMedia("(prefers-reduced-motion: reduce)");
const CALM = 3; // drawings a second, then
export const READABLE = 8; // times a second that a number may change and still be read

/**
 * Call something at most once a frame.
 * @param {() => void} act
 * @returns {() => void}
 */
export function onceAFrame(act) {
  let waits = false;
  return () => {
    if (waits) return;
    waits = true;
    requestAnimationFrame(() => { waits = false; act(); });
  };
}

/**
 * Draw at most so often; a few times a second where the system asks for little motion.
 * @param {() => void} draw
 * @param {number} [rate] times a second; with every frame unless given
 * @returns {(() => void) & {now: () => void}} `now` draws at once: what is printed waits for no frame
 */
export function paced(draw, rate = Infinity) {
  let last = -Infinity;
  let waits = false;
  const frame = onceAFrame(() => { last = performance.now(); waits = false; draw(); });
  return Object.assign(() => {
    if (waits) return;
    waits = true;
    const left = last + 1000 / (calm.matches ? Math.min(rate, CALM) : rate) - performance.now();
    if (left > 4) setTimeout(frame, left);
    else frame();
  }, { now: draw });
}
