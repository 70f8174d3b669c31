// Numbers with units as people type them, read exactly: the double is the nearest to what was typed.
//
// The same cases as Python's (`tests/data/typed_quantities.json`). A number is a fraction of whole
// numbers until the end, so that 80 mm is 0.08 m and 45 deg is the nearest double to pi / 4.

/** @typedef {{n: bigint, d: bigint}} Fraction */

/** @type {Fraction} the double, as Python has it */
const PI = { n: 884279719003555n, d: 281474976710656n };
const TURN = over(PI, { n: 180n, d: 1n });

/** @type {Record<string, Record<string, Fraction>>} */
const UNITS = {
  m: units({ m: "1", mm: "0.001", cm: "0.01", um: "0.000001", in: "0.0254", inch: "0.0254", ft: "0.3048" }),
  rad: { ...units({ rad: "1" }), deg: TURN, "\u00b0": TURN, turn: times(PI, { n: 2n, d: 1n }), turns: times(PI, { n: 2n, d: 1n }) },
};

/** @param {Record<string, string>} texts */
function units(texts) {
  return Object.fromEntries(Object.entries(texts).map(([unit, text]) => [unit, fraction(text)]));
}

/** @param {string} text @returns {Fraction} */
function fraction(text) {
  const [, sign, whole, part = "", power = "0"] = /** @type {RegExpMatchArray} */ (
    text.match(/^([-+]?)(\d*)\.?(\d*)(?:[eE]([-+]?\d+))?$/)
  );
  const digits = BigInt(`${sign === "-" ? "-" : ""}${whole}${part}` || "0");
  const places = Number(power) - part.length;
  return places < 0 ? { n: digits, d: 10n ** BigInt(-places) } : { n: digits * 10n ** BigInt(places), d: 1n };
}

/** @param {Fraction} a @param {Fraction} b @returns {Fraction} */
function times(a, b) {
  return { n: a.n * b.n, d: a.d * b.d };
}

/** @param {Fraction} a @param {Fraction} b @returns {Fraction} */
function over(a, b) {
  return b.n < 0n ? { n: -a.n * b.d, d: -a.d * b.n } : { n: a.n * b.d, d: a.d * b.n };
}

/** The nearest double. @param {Fraction} x */
function double({ n, d }) {
  if (n === 0n) return 0;
  const size = `${n < 0n ? -n : n}`.length - `${d}`.length;
  const more = BigInt(Math.max(40 - size, 0));
  return Number(`${(n * 10n ** more) / d}e-${more}`);
}

const NUMBER = /^[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?$/;

/** A number, a product or quotient of two, pi among them. @param {string} text @returns {Fraction | null} */
function value(text) {
  for (const mark of ["*", "/"]) {
    const k = text.indexOf(mark);
    if (k < 0) continue;
    const [a, b] = [value(text.slice(0, k)), value(text.slice(k + 1))];
    if (!a || !b || (mark === "/" && b.n === 0n)) return null;
    return mark === "*" ? times(a, b) : over(a, b);
  }
  let word = text.trim();
  if (["pi", "\u03c0", "-pi", "-\u03c0"].includes(word)) return word[0] === "-" ? { n: -PI.n, d: PI.d } : PI;
  if (/^[-+]?\d+,\d+$/.test(word)) word = word.replace(",", ".");
  return NUMBER.test(word) && Number.isFinite(Number(word)) ? fraction(word) : null;
}

/**
 * A number in SI from text in a shown unit or the one behind it; null for what is none.
 * @param {string} text @param {string} si @param {string} shown
 */
export function quantity(text, si, shown) {
  const known = UNITS[si] ?? {};
  const word = text.trim().replace("\u2212", "-");
  const behind = Object.keys(known).filter((unit) => word.endsWith(unit)).sort((a, b) => b.length - a.length);
  for (const unit of [...behind, ""]) {
    const x = value(word.slice(0, word.length - unit.length));
    if (x) return double(times(x, known[unit || shown] ?? { n: 1n, d: 1n }));
  }
  return null;
}

/** How many of a unit make one of SI. @param {string} si @param {string} shown */
export function factor(si, shown) {
  const unit = UNITS[si]?.[shown];
  return unit ? double(over({ n: 1n, d: 1n }, unit)) : 1;
}

/** The units that a length or an angle may have. @param {string} si */
export const unitsOf = (si) => Object.keys(UNITS[si] ?? {});

/**
 * A typed length and direction: "80 mm", "0.3 @ 30", "@ 30"; null for what is none yet.
 * @param {string} text @param {string} length @param {string} angle
 * @returns {{length: number | null, angle: number | null} | null}
 */
export function vector(text, length, angle) {
  const parts = text.split("@");
  if (!text.trim() || parts.length > 2) return null;
  const [r, turn] = [parts[0].trim(), parts[1]?.trim() ?? ""];
  if (!r && !turn) return null;
  const made = { length: r ? quantity(r, "m", length) : null, angle: turn ? quantity(turn, "rad", angle) : null };
  if ((r && !(/** @type {number} */ (made.length) > 0)) || (turn && made.angle === null)) return null;
  return made;
}

/**
 * A typed place "0,1; 0,2", "120mm, 50mm", "0.3 @ 45"; null for what is none.
 * @param {string} text @param {string} length @param {string} angle @returns {[number, number] | null}
 */
export function place(text, length, angle) {
  for (const mark of text.includes("@") ? ["@"] : [";", ",", " "]) {
    const parts = text.split(mark).filter((part) => part.trim());
    if (parts.length !== 2) continue;
    const x = quantity(parts[0], "m", length);
    const y = quantity(parts[1], mark === "@" ? "rad" : "m", mark === "@" ? angle : length);
    if (x === null || y === null) continue;
    return mark === "@" ? [x * Math.cos(y), x * Math.sin(y)] : [x, y];
  }
  return null;
}

/** A number of few digits. @param {number} x */
export const rounded = (x, digits = 4) => String(Number(x.toPrecision(digits)));

/** The same with a minus sign. @param {number} x */
export const signed = (x, digits = 4) => rounded(x, digits).replace("-", "\u2212");
