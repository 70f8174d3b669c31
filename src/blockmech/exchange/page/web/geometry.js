// Places and views: metres with y upwards, pixels with y downwards.

/** @typedef {[number, number]} Point */
/** @typedef {{x: number, y: number}} Pixel */
/** @typedef {{scale: number, x: number, y: number}} View */

const STEPS = [1, 2, 5, 10]; // of which each ten's round steps are made

/** The first round number that is not less. @param {number} least */
export function nice(least) {
  const ten = 10 ** Math.floor(Math.log10(least));
  return /** @type {number} */ (STEPS.map((k) => k * ten).find((step) => step >= least * 0.999));
}

/** Least and largest coordinates of some places. @param {Point[]} places @returns {[Point, Point]} */
export function corners(places) {
  const low = /** @type {Point} */ ([Infinity, Infinity]);
  const high = /** @type {Point} */ ([-Infinity, -Infinity]);
  for (const z of places)
    for (const k of [0, 1]) {
      if (z[k] < low[k]) low[k] = z[k];
      if (z[k] > high[k]) high[k] = z[k];
    }
  return [low, high];
}

/** Pixels of a place. @param {View} view @param {Point} z @returns {Pixel} */
export const pixel = (view, z) => ({ x: view.x + z[0] * view.scale, y: view.y - z[1] * view.scale });

/** The place of pixels. @param {View} view @param {Pixel} p @returns {Point} */
export const metres = (view, p) => [(p.x - view.x) / view.scale, (view.y - p.y) / view.scale];

/**
 * A view that shows some places in a window, with room around them.
 * @param {Point[]} places @param {number} width @param {number} height @param {number} room @returns {View}
 */
export function fitted(places, width, height, room = 70) {
  const [low, high] = corners(places.length ? places : [[0, 0], [1, 1]]);
  const size = [high[0] - low[0], high[1] - low[1]];
  const most = Math.max(...size) || Math.max(...low.map(Math.abs)) || 1;
  const free = [width - 2 * room, height - 2 * room];
  const scale = Math.min(...size.map((own, k) => Math.max(free[k], 50) / (own || most / 3)));
  return { scale, x: width / 2 - ((low[0] + high[0]) / 2) * scale, y: height / 2 + ((low[1] + high[1]) / 2) * scale };
}

/** The view scaled about a pixel. @param {View} view @param {number} by @param {Pixel} p @returns {View} */
export const zoomed = (view, by, p) => ({
  scale: view.scale * by, x: p.x + (view.x - p.x) * by, y: p.y + (view.y - p.y) * by,
});

/**
 * The nearest of some things within reach; `at` gives their pixels.
 * @template T @param {T[]} things @param {(one: T) => Pixel} at @param {Pixel} p @param {number} reach
 * @returns {T | null}
 */
export function closest(things, at, p, reach) {
  let [best, least] = [/** @type {T | null} */ (null), reach];
  for (const one of things) {
    const { x, y } = at(one);
    const off = Math.hypot(x - p.x, y - p.y);
    if (off < least) [best, least] = [one, off];
  }
  return best;
}

/** @param {Pixel} a @param {Pixel} b */
export const between = (a, b) => ({
  x: Math.min(a.x, b.x), y: Math.min(a.y, b.y), width: Math.abs(a.x - b.x), height: Math.abs(a.y - b.y),
});

/** How far a pixel is from the line between two others. @param {Pixel} p @param {Pixel} a @param {Pixel} b */
export function beside(p, a, b) {
  const [x, y] = [b.x - a.x, b.y - a.y];
  const share = Math.max(0, Math.min(1, ((p.x - a.x) * x + (p.y - a.y) * y) / (x * x + y * y || 1)));
  return Math.hypot(p.x - a.x - share * x, p.y - a.y - share * y);
}

/** A place on a link in a pose [x, y, cos, sin]. @param {number[]} pose @param {number} x @param {number} y @returns {Point} */
export const on = (pose, x, y) => [pose[0] + pose[2] * x - pose[3] * y, pose[1] + pose[3] * x + pose[2] * y];

/** A place in the frame of a link. @param {number[]} pose @param {Point} z @returns {Point} */
export const local = (pose, z) => {
  const [x, y] = [z[0] - pose[0], z[1] - pose[1]];
  return [pose[2] * x + pose[3] * y, pose[2] * y - pose[3] * x];
};

/** [x, y, cos, sin] of [x, y, angle]. @param {number[]} pose */
export const posed = (pose) => [pose[0], pose[1], Math.cos(pose[2]), Math.sin(pose[2])];

/** A place along a line, and so far below it. @param {Pixel} a @param {Pixel} b @param {number} along @param {number} off @returns {Pixel} */
export function below(a, b, along, off) {
  const size = Math.hypot(b.x - a.x, b.y - a.y) || 1;
  const [x, y] = [(b.x - a.x) / size, (b.y - a.y) / size];
  const side = x < -1e-9 ? -off : off;
  return { x: a.x + along * x - side * y, y: a.y + along * y + side * x };
}

/** A guide as a path beside the line on which its block moves: an edge, hatched on its other side. @param {Pixel} a @param {Pixel} b */
export function guideway(a, b) {
  const size = Math.hypot(b.x - a.x, b.y - a.y);
  const at = (/** @type {number} */ along, /** @type {number} */ off) => {
    const { x, y } = below(a, b, along, off);
    return `${x.toFixed(1)} ${y.toFixed(1)}`;
  };
  const hatch = Array.from({ length: Math.floor(size / 8) + 4 }, (_, k) => `M${at(8 * k - 14, 10)}L${at(8 * k - 19, 15)}`);
  return `M${at(-18, 10)}L${at(size + 18, 10)}${hatch.join("")}`;
}

/**
 * The line of a load between two pixels, as points of a polyline: of each corner the share of the way, and
 * points of the page along it and to its left, which short lines have smaller.
 * @param {number[][]} line @param {Pixel} a @param {Pixel} b
 */
export function strokes(line, a, b) {
  const [x, y] = [b.x - a.x, b.y - a.y];
  const size = Math.hypot(x, y) || 1;
  const [point, side] = [Math.min(2, size / 30) / size, 2 / size];
  return line.map(([share, along, left]) => `${a.x + x * (share + along * point) + y * left * side},${a.y + y * (share + along * point) - x * left * side}`).join(" ");
}
