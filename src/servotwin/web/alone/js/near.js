// Names that are near another one, as the package finds them.

/** @param {string} name @returns {string} its letters and digits */
function letters(name) { return name.toLowerCase().replace(/[^\p{L}\p{N}]/gu, ""); }

/**
 * Return how many letters two names have in common: of the longest common part, and to its left and right.
 * @param {string} one
 * @param {string} other
 * @returns {number}
 */
function common(one, other) {
  let [longest, i, j] = [0, 0, 0];
  /** @type {Map<number, number>} */
  let ends = new Map();
  for (let at = 0; at < one.length; at += 1) {
    const next = new Map();
    for (let to = other.indexOf(one[at]); to >= 0; to = other.indexOf(one[at], to + 1)) {
      const length = (ends.get(to - 1) ?? 0) + 1;
      next.set(to, length);
      if (length > longest) [longest, i, j] = [length, at + 1 - length, to + 1 - length];
    }
    ends = next;
  }
  return longest && longest + common(one.slice(0, i), other.slice(0, j)) + common(one.slice(i + longest), other.slice(j + longest));
}

/**
 * Return what is near a name, the nearest first: what begins so, what holds it, what is spelled alike.
 * @param {any} rules
 * @param {string} name
 * @param {string[]} known
 * @returns {string[]}
 */
export function nearest(rules, name, known) {
  const asked = letters(name);
  if (!asked.length || asked.length >= rules.longest) return [];
  const scores = [...new Set(known)].map((one) => {
    const whole = letters(one);
    if (asked.length >= rules.letters && whole.includes(asked)) return { one, score: (whole.startsWith(asked) ? rules.begins : rules.holds) + asked.length / whole.length };
    const parts = [whole, ...one.replaceAll("-", ".").split(".").map(letters)];
    return { one, score: Math.max(...parts.map((part) => (2 * common(part, asked)) / (part.length + asked.length))) };
  });
  return scores.filter(({ score }) => score >= rules.least).sort((a, b) => b.score - a.score).map(({ one }) => one);
}
