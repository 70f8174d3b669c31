// A mechanism that moves in the page: poses of links from the coordinates of drivers.
//
// `poses(p, u, out)` of a module gives places and angles of the blocks' links, `numbers(x, c, p)`
// the numbers p that follow from the places x of pins in the drawing. Links of a document are
// seats on those of blocks.

import { posed } from "../../../exchange/page/web/geometry.js";

/** @typedef {import("../../../exchange/page/web/geometry.js").Point} Point */
/** @typedef {Record<string, number[]>} Poses link -> [x, y, cos, sin] */
/**
 * @typedef {{hash: string, p: number[], c: number[], links: Record<string, number>, places: number,
 *   pins: Record<string, number>, inputs: string[], drivers: string[], numbers: number, spots: Record<string, string>}} LiveData
 */
/**
 * @typedef {{poses: (p: Float64Array, u: Float64Array, out: Float64Array) => number,
 *   numbers?: (x: Float64Array, c: number[], p: Float64Array) => void}} Kernel
 */

export class Live {
  /** @param {Kernel} kernel @param {LiveData} data */
  constructor(kernel, data) {
    this.kernel = kernel;
    this.data = data;
    this.p = Float64Array.from(data.p);
    this.out = new Float64Array(data.places);
    this.u = new Float64Array(data.inputs.length);
    this.drivers = data.inputs.map((input) => data.drivers[Number(input.slice(2))]);
    this.links = Object.entries(data.links);
    this.holds = Object.entries(data.spots); // of blocks: handles, whose places are beside the numbers
  }

  /** Whether a pin is dragged here, without asking. @param {string} pin */
  drags(pin) {
    return this.data.pins[pin] !== undefined && this.kernel.numbers !== undefined;
  }

  /**
   * The numbers when pins are elsewhere in the drawing.
   * @param {Record<string, Point>} places of all pins
   */
  move(places) {
    const count = Math.max(-1, ...Object.values(this.data.pins)) + 1;
    const x = new Float64Array(2 * count);
    for (const [pin, i] of Object.entries(this.data.pins)) if (places[pin]) [x[2 * i], x[2 * i + 1]] = places[pin];
    this.kernel.numbers?.(x, this.data.c, this.p);
  }

  /**
   * How a joint of blocks is held: coordinates, places of handles on their links, and whether no dyad
   * has turned over, for then the server has another branch.
   */
  held() {
    const tail = [...this.p.subarray(this.data.numbers)];
    const [drivers, at] = [this.data.drivers, tail.length - 2 * this.holds.length];
    /** @type {Record<string, [string, number, number]>} */
    const spots = Object.fromEntries(this.holds.map(([name, link], k) => [name, [link, tail[at + 2 * k], tail[at + 2 * k + 1]]]));
    const q = Object.fromEntries(drivers.map((driver, i) => [driver, tail[i]]));
    return { q, spots, upright: tail.slice(drivers.length, at).every((side) => side > 0) };
  }

  /** Take back what was moved. */
  reset() {
    this.p.set(this.data.p);
  }

  /** All links at coordinates of the drivers. @param {Record<string, number>} q @returns {Poses} */
  poses(q) {
    this.drivers.forEach((driver, i) => (this.u[i] = q[driver] ?? 0));
    this.kernel.poses(this.p, this.u, this.out);
    /** @type {Poses} */
    const made = {};
    let seat = this.data.numbers;
    for (const [name, at] of this.links) {
      if (at < 0) {
        made[name] = [0, 0, 1, 0];
        continue;
      }
      const [x, y, c, s] = posed([this.out[at], this.out[at + 1], this.out[at + 2]]);
      if (seat === this.p.length || this.holds.length) made[name] = [x, y, c, s];
      else {
        const [a, b, turn] = [this.p[seat], this.p[seat + 1], this.p[seat + 2]];
        const [tc, ts] = [Math.cos(turn), Math.sin(turn)];
        made[name] = [x + c * a - s * b, y + s * a + c * b, c * tc - s * ts, s * tc + c * ts];
        seat += 3;
      }
    }
    return made;
  }
}

/** Poses that came as rows: of the sample nearest to a place among them. */
export class Rows {
  /** @param {Record<string, (number | null)[][]>} rows */
  constructor(rows) {
    this.rows = rows;
  }

  drags() {
    return false;
  }

  reset() {}

  /** @param {number} k @returns {Poses} */
  at(k) {
    return Object.fromEntries(Object.entries(this.rows).map(([name, row]) =>
      [name, posed(row.map((values) => values[k] ?? NaN))]));
  }
}
