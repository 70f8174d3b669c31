// A panel of curves as SVG: axes, a cursor at the pose, gaps hatched, dead centres named.

import { path, range, ticks } from "./curve.js";
import { signed } from "./quantity.js";
import { element, put } from "./dom.js";

/** @typedef {{quantity: string, unit: string, shown: [number, number], curves: [string, (number | null)[]][], without: [string, (number | null)[]][]}} Panel */
/** @typedef {{words: string, values: number[], events: [number, string][]}} Along what curves are drawn over */

const [LEFT, RIGHT, TOP, BOTTOM, HEIGHT] = [64, 12, 8, 34, 170];
const DASHES = ["", "6 3", "2 3", "8 3 2 3"];

/**
 * A panel; the answer puts its cursor to a sample.
 * @param {HTMLElement} parent @param {Panel} panel @param {Along} along
 * @param {[number, number][]} gaps samples without an answer, from the first to the last
 * @param {(k: number) => void} pick what a tap on a sample does
 * @returns {(k: number | null) => void}
 */
export function drawPanel(parent, panel, along, gaps, pick) {
  const figure = element(parent, "figure");
  const legend = element(figure, "figcaption");
  const width = Math.max(parent.clientWidth, 260);
  const svg = put(figure, "svg", { width: "100%", viewBox: `0 0 ${width} ${HEIGHT}`, role: "img" });
  svg.setAttribute("aria-label", `${panel.quantity} over ${along.words}`);
  const x = along.values;
  const finite = x.filter(Number.isFinite);
  const ends = [Math.min(...finite), Math.max(...finite)];
  const values = panel.curves.flatMap(([, row]) => row).filter((v) => v !== null);
  const floor = 1e-12 * Math.max(1, ...values.map(Math.abs)) + (panel.unit === "-" ? 1e-9 : 0);
  const [low, high] = range(panel.shown[0], panel.shown[1], floor);
  const across = (/** @type {number} */ v) => LEFT + ((v - ends[0]) / (ends[1] - ends[0] || 1)) * (width - LEFT - RIGHT);
  const down = (/** @type {number} */ v) => TOP + ((high - v) / (high - low)) * (HEIGHT - TOP - BOTTOM);
  for (const [a, b] of gaps) {
    const [from, to] = [across(x[Math.max(a - 1, 0)]), across(x[Math.min(b + 1, x.length - 1)])];
    put(svg, "rect", { x: Math.min(from, to), y: TOP, width: Math.abs(to - from), height: HEIGHT - TOP - BOTTOM, class: "gap" });
  }
  for (const v of ticks(low, high)) {
    put(svg, "line", { x1: LEFT, x2: width - RIGHT, y1: down(v), y2: down(v), class: v === 0 ? "axis zero" : "axis" });
    put(svg, "text", { x: LEFT - 5, y: down(v) + 4, "text-anchor": "end" }, signed(v, 6));
  }
  for (const v of ticks(ends[0], ends[1], 7)) {
    put(svg, "line", { x1: across(v), x2: across(v), y1: TOP, y2: HEIGHT - BOTTOM, class: "axis" });
    put(svg, "text", { x: across(v), y: HEIGHT - BOTTOM + 14, "text-anchor": "middle" }, signed(v, 6));
  }
  put(svg, "text", { x: (LEFT + width - RIGHT) / 2, y: HEIGHT - 5, "text-anchor": "middle" }, along.words);
  const word = put(svg, "text", { transform: `translate(12 ${(TOP + HEIGHT - BOTTOM) / 2}) rotate(-90)`, "text-anchor": "middle" }, `${panel.quantity} [${panel.unit}]`);
  word.classList.add("quantity");
  const clip = `clip${Math.random().toString(36).slice(2)}`;
  const area = put(put(svg, "clipPath", { id: clip }), "rect", { x: LEFT, y: TOP - 2, width: width - LEFT - RIGHT, height: HEIGHT - TOP - BOTTOM + 4 });
  area.setAttribute("class", "clip");
  const lines = put(svg, "g", { "clip-path": `url(#${clip})` });
  for (const [k, [at, name]] of along.events.entries()) {
    put(lines, "line", { x1: across(at), x2: across(at), y1: TOP, y2: HEIGHT - BOTTOM, class: "event" });
    put(lines, "text", { x: across(at) + 3, y: TOP + 11 + 12 * (k % 3), class: "event" }, name);
  }
  panel.without.forEach(([, row]) => put(lines, "path", { d: path(x, row, across, down), class: "without" }));
  panel.curves.forEach(([name, row], k) => {
    const look = { d: path(x, row, across, down), class: `curve c${k % 6}`, "stroke-dasharray": DASHES[Math.floor(k / 6) % 4] };
    put(lines, "path", look);
    const item = element(legend, "span", `key c${k % 6}`, name);
    item.title = name;
  });
  if (panel.without.length) element(legend, "span", "key without", "without friction");
  const cursor = put(svg, "line", { y1: TOP, y2: HEIGHT - BOTTOM, class: "cursor" });
  svg.addEventListener("pointerdown", (event) => {
    const at = ((event.clientX - svg.getBoundingClientRect().x) / svg.getBoundingClientRect().width) * width;
    let [best, least] = [0, Infinity];
    x.forEach((v, k) => { const off = Math.abs(across(v) - at); if (off < least) [best, least] = [k, off]; });
    pick(best);
  });
  return (k) => {
    const place = k === null || !Number.isFinite(x[k]) ? -10 : across(x[k]);
    cursor.setAttribute("x1", String(place));
    cursor.setAttribute("x2", String(place));
  };
}
