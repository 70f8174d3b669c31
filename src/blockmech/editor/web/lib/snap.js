// Where a pointer means: a pin, then a crossing of the grid, then in line with pins, then a direction.

/** @typedef {import("../../../exchange/page/web/geometry.js").Point} Point */
/** @typedef {{name: string, at: Point}} Named */
/** @typedef {{at: Point, pin?: string, lines: ("x" | "y" | "turn")[]}} Aim */

export const TAKES = 13; // px within which a pointer takes hold of a pin
const CROSSES = 0.36; // of the grid's step, within which its crossing is meant
const LINED = 6; // px from the line of another pin
const TURN = Math.PI / 12; // directions of a drag
const LEAN = 6; // px from one of them

/** A number with no more digits than a grid has. @param {number} x */
const clean = (x) => Number(x.toPrecision(9)) || 0;

/**
 * What a pointer at a place means.
 * @param {Point} z @param {{scale: number, step: number, pins: Named[], start?: Point | null, free?: boolean}} given
 * `scale` px/m, `step` of the grid [m], `start` of a drag, `free` for no help at all
 * @returns {Aim}
 */
export function aim(z, { scale, step, pins, start = null, free = false }) {
  let [best, least] = [/** @type {Named | null} */ (null), TAKES / scale];
  for (const one of pins) {
    const off = Math.hypot(one.at[0] - z[0], one.at[1] - z[1]);
    if (off < least) [best, least] = [one, off];
  }
  if (best) return { at: best.at, pin: best.name, lines: [] };
  if (free) return { at: z, lines: [] };
  const grid = z.map((x) => clean(Math.round(x / step) * step));
  const off = z.map((x, k) => Math.abs(x - grid[k]));
  if (Math.hypot(off[0], off[1]) < CROSSES * step) return { at: [grid[0], grid[1]], lines: [] };
  const near = LINED / scale;
  const lined = [0, 1].map((k) => nearest(pins.map((one) => one.at[k]), z[k], near));
  if (lined[0] !== null || lined[1] !== null) {
    /** @type {("x" | "y")[]} */
    const lines = [];
    if (lined[0] !== null) lines.push("x");
    if (lined[1] !== null) lines.push("y");
    return { at: [lined[0] ?? grid[0], lined[1] ?? grid[1]], lines };
  }
  if (start) {
    const [dx, dy] = [z[0] - start[0], z[1] - start[1]];
    const angle = Math.round(Math.atan2(dy, dx) / TURN) * TURN;
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    const along = dx * c + dy * s;
    if (along > 0 && Math.abs(dy * c - dx * s) < LEAN / scale) {
      const length = Math.max(Math.round(along / step), 1) * step;
      return { at: [clean(start[0] + length * c), clean(start[1] + length * s)], lines: ["turn"] };
    }
  }
  return { at: [grid[0], grid[1]], lines: [] };
}

/** @param {number[]} values @param {number} x @param {number} reach */
function nearest(values, x, reach) {
  let [best, least] = [/** @type {number | null} */ (null), reach];
  for (const value of values) if (Math.abs(value - x) < least) [best, least] = [value, Math.abs(value - x)];
  return best;
}
