// What servos are called where several are shown: by what they differ in.

/**
 * @param {any[]} facts of all servos
 * @returns {string[]} short names; empty of a servo that stands alone
 */
export function shortNames(facts) {
  if (facts.length < 2) return facts.map(() => "");
  const differ = (/** @type {string} */ key) => new Set(facts.map((one) => one[key])).size === facts.length;
  if (differ("title")) return facts.map((one) => one.title);
  if (differ("model") && new Set(facts.map((one) => one.title)).size === 1) return facts.map((one) => one.model);
  return facts.map((_, k) => `servo ${k + 1}`);
}

/** @param {any} facts @returns {string} title and model */
export function fullName(facts) {
  return `${facts.title}, ${facts.model}`;
}
