// Room for words: where no other word stands, and few links do.

import { below, guideway } from "./geometry.js";

/** @typedef {[number, number, number, number]} Area left, top, width, height */

export class Room {
  constructor() {
    /** @type {Area[]} */
    this.taken = [];
    /** @type {{x: number, y: number}[]} */
    this.lined = [];
  }

  /** A line between pixels, on which no word should lie. @param {{x: number, y: number}} a @param {{x: number, y: number}} b */
  line(a, b) {
    const n = Math.min(Math.ceil(Math.hypot(b.x - a.x, b.y - a.y) / 9), 400);
    for (let k = 0; k < n; k++) this.lined.push({ x: a.x + ((b.x - a.x) * k) / n, y: a.y + ((b.y - a.y) * k) / n });
  }

  /** The path of a guide, on which no word should lie. @param {{x: number, y: number}} a @param {{x: number, y: number}} b */
  guide(a, b) {
    const size = Math.hypot(b.x - a.x, b.y - a.y);
    this.line(below(a, b, -18, 13), below(a, b, size + 18, 13));
    return guideway(a, b);
  }

  /** Where a word beside a point begins; null where there is no room. @param {number} x @param {number} y @param {string} words */
  word(x, y, words) {
    const width = 6.8 * words.length;
    const tried = [0, 13, 26].flatMap((more) => [[10, -10 - more], [10, 18 + more], [-10 - width, -10 - more],
      [-10 - width, 18 + more], [-width / 2, -18 - more], [-width / 2, 28 + more]]);
    return this.take(tried, ([ax, ay]) => [x + ax, y + ay - 11, width, 13]);
  }

  /**
   * The best of some places that is free; it is taken then. Null where none is.
   * @template T @param {T[]} places @param {(one: T) => Area} area @returns {T | null}
   */
  take(places, area) {
    let [best, least] = [/** @type {T | null} */ (null), Infinity];
    places.forEach((one, k) => {
      const [x, y, w, h] = area(one);
      const free = this.taken.every(([x2, y2, w2, h2]) => x + w <= x2 || x2 + w2 <= x || y + h <= y2 || y2 + h2 <= y);
      if (!free) return;
      const under = this.lined.filter((z) => Math.abs(z.x - x - w / 2) < w / 2 + 5 && Math.abs(z.y - y - h / 2) < h / 2 + 5).length;
      if (under + k / 6 < least) [best, least] = [one, under + k / 6];
    });
    if (best) this.taken.push(area(best));
    return best;
  }
}
