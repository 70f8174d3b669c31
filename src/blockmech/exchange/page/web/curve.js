// Curves: scales of axes, ticks, and paths with gaps, corners kept.

import { nice } from "./geometry.js";

/** Round numbers in a range. @param {number} low @param {number} high @param {number} most */
export function ticks(low, high, most = 5) {
  const step = nice((high - low) / most || 1);
  const first = Math.ceil(low / step - 1e-9);
  const last = Math.floor(high / step + 1e-9);
  return Array.from({ length: Math.max(last - first + 1, 0) }, (_, k) => Number(((first + k) * step).toPrecision(12)));
}

/**
 * The range of an axis: what is shown, with room, and never only the rounding of larger numbers.
 * @param {number} low @param {number} high @param {number} floor
 */
export function range(low, high, floor = 0) {
  if (!(high - low > floor)) {
    const middle = Math.abs(low) <= floor ? 0 : low;
    const half = middle ? Math.max(Math.abs(low) * 0.1, floor) : 1;
    return [middle - half, middle + half];
  }
  const room = 0.06 * (high - low);
  return [low - room, high + room];
}

/**
 * A path through points that are there; a gap begins a new piece.
 * @param {number[]} x @param {(number | null)[]} y @param {(x: number) => number} across @param {(y: number) => number} down
 */
export function path(x, y, across, down) {
  let [made, open] = ["", false];
  y.forEach((value, k) => {
    if (value === null || !Number.isFinite(x[k])) open = false;
    else {
      made += `${open ? "L" : "M"}${across(x[k]).toFixed(1)} ${down(value).toFixed(1)}`;
      open = true;
    }
  });
  return made;
}

/** Which of n poses is shown after a share of a whole motion: round, or to and fro. @param {number} share @param {number} n @param {boolean} forward */
export function frameAt(share, n, forward) {
  const k = Math.floor(share * n);
  return forward ? k % n : n - 1 - Math.abs(n - 1 - (k % Math.max(2 * n - 2, 1)));
}
