// The drawing and the mechanism that moves: one picture, in which drags move and tools draw.
//
// Places are metres; `view` maps them to pixels. A gesture is drawn at once from the page's copy,
// and ends in one act; the sheet that comes back is the truth.

import { Live } from "../lib/live.js";
import { beside, closest, corners, between, fitted, local, metres, nice, on, pixel, posed, strokes, zoomed } from "../../../exchange/page/web/geometry.js";
import { ARROWS, writes } from "../lib/keys.js";
import { Room } from "../../../exchange/page/web/labels.js";
import { factor, place, quantity, rounded, signed, vector } from "../../../exchange/page/web/quantity.js";
import { TAKES, aim } from "../lib/snap.js";
import { path } from "../../../exchange/page/web/curve.js";
import { angle, asked, edit, enliven, follow, length, poses, say, set, showPose, store } from "../state.js";
import { Refused, ask, kernel } from "../api.js";
import { button, element, field, options, pixelIn, put, sayAt } from "../../../exchange/page/web/dom.js";
import { Tracing } from "./tracing.js";

/** @typedef {import("../../../exchange/page/web/geometry.js").Point} Point */
/** @typedef {import("../../../exchange/page/web/geometry.js").Pixel} Pixel */
/** @typedef {import("../state.js").Pin} Pin */
/** @typedef {import("../state.js").Spot} Spot */
/** @typedef {import("../state.js").Drawing} Drawing */

export const PAIRS = ["Link", "Cylinder", "Gears", "Rack", "Cam", "Belt", "Spring", "Dimension"]; // from pin to pin
export const AT_PINS = ["To the frame", "Slider", "Weld", "Driver", "Force"];
const GUIDE = [
  "Drag: a link is drawn. Type a length while you drag (80 mm, or 0.3 m @ 45), Enter takes it.",
  "Drag from one of its pins: the next link is joined to it.",
  "Click a pin and press To the frame, or Slider: what carries the mechanism.",
  "Click a pin on the frame and press Driver: what moves it.",
  "Press Play. Esc ends a tool; then a drag moves a pin, and curves follow at once.",
];
const SPAN = /** @type {Record<string, number>} */ ({ mm: 0.5, inch: 0.5, m: 2 }); // m that an empty sheet shows
const BAR = 6; // px of half a link that is drawn
const FEW = 12; // moving pins whose paths are all drawn

/** @param {HTMLElement} parent */
export function sheetView(parent) {
  const tools = element(parent, "div", "tools");
  tools.setAttribute("role", "toolbar");
  tools.setAttribute("aria-label", "drawing");
  const box = element(parent, "div", "canvas");
  const svg = put(box, "svg", { tabindex: 0, role: "application", "aria-label": "drawing of links and joints" });
  const typed = element(box, "div", "bubble typed");
  const bubble = element(box, "div", "bubble wrong");
  const menu = element(box, "div", "menu");
  const guide = element(box, "ol", "guide");
  const over = element(box, "div", "over");
  const show = field(over, "show", "select");
  const paths = button(over, "Paths", () => set({ paths: !store.paths }), "the paths of pins");
  menu.setAttribute("role", "menu");
  for (const words of GUIDE) element(guide, "li", "", words);
  for (const part of [typed, bubble, menu]) part.hidden = true;
  bubble.setAttribute("aria-hidden", "true"); // the status line says it to screen readers

  let view = { scale: 0, x: 0, y: 0 };
  /** @type {any} */
  let drag = null; // what the hand does now
  /** @type {{drawing: Drawing, live: Live | null} | null} */
  let ghost = null; // what the server says that a drag will make
  let pointer = { x: 60, y: 60 };
  let room = new Room();
  /** @type {Record<string, number[]>} */
  let at = {}; // poses of links as drawn now
  let known = ""; // the sheet that was drawn last
  let few = false; // whether it had no pin
  let pathless = false; // whether its paths are to come, which are to be seen too
  const tracing = new Tracing(over, () => ({ view, svg, step: grid() }), draw);

  const drawing = () => ghost?.drawing ?? store.sheet?.drawing ?? null;
  const pins = () => drawing()?.pins ?? [];
  const pin = (/** @type {string} */ name) => pins().find((one) => one.name === name);
  const ours = () => store.sheet?.kind === "joints";
  const spot = (/** @type {Spot} */ [link, x, y]) => on(at[link] ?? [0, 0, 1, 0], x, y);
  /** @param {Pin} one @returns {Point} */
  const where = (one) => (drag?.live && !ours() ? spot(drag.spots[one.name] ?? one.at) : drag?.moved?.[one.name] ?? spot(one.at));
  const shown = (/** @type {Pin} */ one) => pixel(view, where(one));
  const px = (/** @type {Point} */ z) => pixel(view, z);
  const unit = () => factor("m", length());
  const degree = () => factor("rad", angle());
  const stepOf = (/** @type {number} */ least) => nice((least / view.scale) * unit()) / unit();
  const grid = () => stepOf(12);
  const named = (but = "") => pins().filter((one) => one.name !== but).map((one) => ({ name: one.name, at: where(one) }));

  // -- tools ---------------------------------------------------------------------------------

  /** @type {Record<string, HTMLButtonElement>} */
  const buttons = {};
  const pick = button(tools, "Move", () => set({ tool: "" }), "choose and drag (Esc)");
  for (const name of [...PAIRS, ...AT_PINS]) buttons[name] = button(tools, name, () => press(name));
  for (const name of ["Masses", "Copy", "Delete"]) buttons[name] = button(tools, name, () => press(name));
  const along = field(tools, `along [${angle()}]`, "input");
  const slot = field(tools, "slides on", "select");
  const spotted = field(tools, "new pin at", "input");
  spotted.input.placeholder = "x, y";
  const redraw = button(tools, "Draw these blocks on as links and joints", () => edit({ act: "redraw" }).then((e) => e || set({ view: "drawing" })));
  const begin = button(tools, "Begin a drawing of links and joints", () => edit({ act: "begin" }).then((e) => e || set({ view: "drawing", tool: "Link" })));
  options(show.input, ["", "velocities", "reactions", "friction circles"].map((x) => [x, x || "nothing more"]), "");
  show.input.addEventListener("change", arrowed);
  /** @type {{name: string, at: number[][], vector: number[][]}[]} */
  let arrows = [];
  buttons.Masses.title = "give every link that has none the mass of a bar";
  spotted.input.addEventListener("keydown", (event) => {
    if (event.key !== "Enter") return;
    const z = place(spotted.input.value, length(), angle());
    if (!z) say(`${spotted.input.value || "nothing"} is no place: write 120 mm, 50 mm or 0.3 m @ 45`, true);
    else {
      spotted.input.value = "";
      edit({ act: "pin", at: z });
    }
  });

  /** What a tool or an act does to the chosen pins; without them the pointer does it from now on. @param {string} name */
  function press(name) {
    const { chosen } = store;
    if (name === "Masses") return void edit({ act: name, pins: [] });
    if (name === "Delete" && store.link) return void edit({ act: "remove", part: ["links", store.link] }).then(() => set({ link: "", part: [] }));
    const enough = PAIRS.includes(name) ? chosen.length > 1 : chosen.length > 0;
    if (!enough || !ours()) {
      if (name === "Copy" || name === "Delete") return void say(`${name}: choose pins first`, true);
      set({ tool: name });
      return void say(`${name}: ${PAIRS.includes(name) ? "drag from pin to pin" : "click on a pin"}; Esc ends it`);
    }
    return void act(name, chosen);
  }

  /** @param {string} name @param {string[]} names */
  function act(name, names) {
    const turn = along.input.value.trim() ? quantity(along.input.value, "rad", angle()) : null;
    return edit({ act: name, pins: names, angle: turn, on: slot.input.value || (name === "Slider" && carrier(names[0])) || "frame" });
  }

  /** The link that passes below a pin that it does not have. @param {string} name */
  function carrier(name) {
    const one = /** @type {Pin} */ (pin(name));
    const p = shown(one);
    return drawing()?.links.find((link) => {
      if (one.links.includes(link.name)) return false;
      const ends = link.ends.flatMap((end) => { const own = typeof end === "string" && pin(end); return own ? [shown(own)] : []; });
      return ends.some((a, k) => beside(p, a, ends[(k + 1) % ends.length]) < BAR);
    })?.name;
  }

  /** Fetch the arrows that are shown, of the sheet as it is. */
  async function arrowed() {
    const what = show.input.value;
    arrows = [];
    if (what && store.sheet?.motion && !store.simulated)
      try {
        arrows = await ask(`documents/${store.id}/vectors`, { ...asked(), what });
        if (!arrows.length) say(`there are no ${what} here`);
      } catch (error) {
        if (!(error instanceof Refused)) throw error;
        say(error.words, true);
      }
    if (store.pose === null && arrows.length) showPose(0);
    draw();
  }

  // Arrows of one quantity on one scale; circles at pins, as many times as large as they need.
  function drawArrows() {
    const k = store.pose;
    if (k === null || drag) return;
    const sizes = arrows.flatMap(({ vector: [x, y] }) => x.map((v, i) => Math.hypot(v, y[i]))).filter(Number.isFinite);
    const most = Math.max(...sizes) || 1;
    const circles = show.input.value === "friction circles";
    const many = 10 ** Math.max(0, Math.floor(Math.log10(30 / (most * view.scale))));
    for (const { name, at: [x, y], vector: [dx, dy] } of arrows) {
      const [a, v] = [px([x[k], y[k]]), [dx[k], dy[k]]];
      if (!Number.isFinite(a.x + v[0])) continue;
      if (circles) put(svg, "circle", { cx: a.x, cy: a.y, r: many * v[0] * view.scale, class: "friction" });
      else {
        const [ex, ey] = [(80 * v[0]) / most, (-80 * v[1]) / most];
        const own = put(svg, "g", { class: show.input.value, "data-arrow": name });
        put(own, "line", { x1: a.x, y1: a.y, x2: a.x + ex, y2: a.y + ey });
        const turn = (Math.atan2(ey, ex) * 180) / Math.PI;
        if (Math.hypot(ex, ey) > 3) put(own, "path", { d: "M0 0L-7-3V3Z", transform: `translate(${a.x + ex} ${a.y + ey}) rotate(${turn})` });
      }
    }
  }

  // -- view ----------------------------------------------------------------------------------

  const size = () => ({ width: box.clientWidth, height: box.clientHeight });

  function fit() {
    const { width, height } = size();
    if (!width) return;
    const places = [...pins().map((one) => spot(one.at)), ...tracing.corners()];
    for (const one of pins()) for (const z of one.guide?.ends ?? []) places.push(spot(z));
    const { live, motion } = store;
    const free = (drawing()?.links ?? []).flatMap((link) => link.ends.filter((end) => typeof end !== "string")); // of links that end in no pin
    for (let k = 0; motion && live && k < motion.n; k += 20) {
      const frames = live instanceof Live ? live.poses(sample(k)) : live.at(k);
      for (const [link, x, y] of free) places.push(on(frames[link] ?? [NaN, NaN, 1, 0], Number(x), Number(y)));
    }
    if (store.motion && store.live && places.length) places.push(...track().flatMap(({ points }) => corners(points)));
    const span = SPAN[length()] ?? 0.5;
    const finite = places.filter(([x, y]) => Number.isFinite(x + y));
    view = finite.length ? fitted(finite, width, height) : fitted([[0, 0], [span, 0]], width, height);
  }

  const inside = (/** @type {Pin} */ one) => {
    const { width, height } = size();
    const { x, y } = shown(one);
    return Number.isNaN(x) || (x >= 0 && y >= 0 && x <= width && y <= height);
  };

  /** Whether all that is drawn would be a point on this scale. */
  function small() {
    const [low, high] = corners(pins().map(where));
    return Math.max(high[0] - low[0], high[1] - low[1]) * view.scale < 60 && pins().length > 1;
  }

  // -- the paths of pins -----------------------------------------------------------------------

  /** Places of moving pins over the whole motion. @returns {{name: string, points: Point[]}[]} */
  function track() {
    const live = ghost ? ghost.live : store.live;
    const { motion } = store;
    if (!live || !motion || !store.sheet?.motion) return [];
    const fixed = drawing()?.fixed ?? "";
    const moving = pins().filter((one) => !one.ground && one.at[0] !== fixed && !one.guide);
    const some = moving.length > FEW ? moving.filter((one) => store.chosen.includes(one.name)) : moving;
    /** @type {{name: string, points: Point[]}[]} */
    const rows = some.map(({ name }) => ({ name, points: [] }));
    const ats = some.map((one) => drag?.spots?.[one.name] ?? (drag?.moved?.[one.name] && at[one.at[0]] ? [one.at[0], ...local(at[one.at[0]], where(one))] : one.at));
    for (let k = 0; k < motion.n; k++) {
      const now = live instanceof Live ? live.poses(sample(k)) : live.at(k);
      ats.forEach((own, i) => rows[i].points.push(on(now[own[0]] ?? [NaN, NaN, 1, 0], Number(own[1]), Number(own[2]))));
    }
    return rows;
  }

  const sample = (/** @type {number} */ k) => Object.fromEntries(Object.entries(store.motion?.q ?? {}).map(([d, row]) => [d, row[k]]));

  // -- the picture -----------------------------------------------------------------------------

  function draw() {
    const { width, height } = size();
    if (!width || !store.sheet) return;
    at = drag?.base ?? (ghost?.live && store.motion ? { ...posedAll(), ...ghost.live.poses(store.q ?? store.motion.home) } : poses());
    const now = `${store.id} ${ours()}`;
    if (now !== known) pathless = Boolean(store.motion);
    if (!view.scale || now !== known || (pathless && store.live) || (few && pins().length && small()) || (!drag && !store.playing && !pins().every(inside) && store.pose === null)) fit();
    [known, few, pathless] = [now, !pins().length, pathless && !store.live && !drag];
    svg.replaceChildren();
    room = new Room();
    for (const one of pins()) { const { x, y } = shown(one); room.taken.push([x - 8, y - 8, 16, 16]); }
    tracing.draw(svg);
    drawGrid(width, height);
    if (store.paths && !store.playing || drag?.moved) drawPaths();
    drawLinks();
    for (const one of pins()) if (one.guide && !one.guide.hidden && Number.isFinite(shown(one).x)) drawGuide(one);
    for (const wheel of drawing()?.wheels ?? []) drawWheel(wheel);
    for (const load of drawing()?.loads ?? []) drawLoad(load);
    if (drag?.kind === "link" && drag.to) {
      const [a, b] = [px(drag.from.at), px(drag.to.at)];
      put(svg, "line", { x1: a.x, y1: a.y, x2: b.x, y2: b.y, class: "new" });
      for (const line of drag.to.lines ?? []) drawAim(line, drag.to.at, width, height);
    }
    for (const one of [...pins()].reverse()) drawPin(one);
    drawArrows();
    if (!drag && store.pose === null && ours()) {
      const stated = drawing()?.stated ?? [];
      for (const one of stated) if (one.type === "length") drawDimension(one.points[0], one.points[1], true); else drawStated(one);
      const lengths = stated.filter(({ type }) => type === "length").map(({ points }) => [...points].sort().join());
      for (const [a, b] of drawing()?.dimensions ?? []) if (!lengths.includes([a, b].join())) drawDimension(a, b);
      drawAngle();
    }
    if (drag?.kind === "box" && drag.now) put(svg, "rect", { ...between(drag.begun, drag.now), class: "box" });
    svg.dataset.tool = store.tool;
    svg.dataset.view = `${view.scale} ${view.x} ${view.y}`; // px/m and the origin, for who acts on places
    svg.dataset.live = drag?.moved ? (drag.live ? "exact" : "server") : "";
    guide.hidden = pins().length > 0 || !ours() || tracing.shown;
  }

  const posedAll = () => Object.fromEntries(Object.entries(drawing()?.poses ?? {}).map(([link, z]) => [link, posed(z)]));

  /** @param {number} width @param {number} height */
  function drawGrid(width, height) {
    const step = stepOf(60);
    const lines = put(svg, "g", { class: "grid", "aria-hidden": "true" });
    const [low, high] = [metres(view, { x: 0, y: height }), metres(view, { x: width, y: 0 })];
    let [down, words] = ["", /** @type {[number, number, string][]} */ ([])];
    for (let k = Math.ceil(low[0] / step); k * step < high[0]; k++) {
      const { x } = px([k * step, 0]);
      down += `M${x} 0V${height}`;
      words.push([x + 3, height - 4, signed(k * step * unit(), 6)]);
    }
    for (let k = Math.ceil(low[1] / step); k * step < high[1]; k++) {
      const { y } = px([0, k * step]);
      down += `M0 ${y}H${width}`;
      words.push([3, y - 3, signed(k * step * unit(), 6)]);
    }
    put(lines, "path", { d: down });
    for (const [x, y, text] of words) put(lines, "text", { x, y }, text);
    put(lines, "text", { x: width - 6, y: 14, "text-anchor": "end" }, `[${length()}]`);
  }

  function drawPaths() {
    for (const { name, points } of track()) {
      const pixels = points.map(px);
      const y = pixels.map((p) => (Number.isFinite(p.y) ? p.y : null));
      const look = { d: path(pixels.map((p) => p.x), y, (x) => x, (v) => v), class: "path", "data-path": name };
      put(svg, "path", look);
    }
  }

  function drawLinks() {
    const shapes = put(svg, "g");
    for (const link of drawing()?.links ?? []) {
      const ends = link.ends.map((end) => (typeof end === "string" ? pin(end) : end)).filter(Boolean);
      const places = ends.map((end) => px(Array.isArray(end) ? spot(end) : where(/** @type {Pin} */ (end))));
      if (!places.every((p) => Number.isFinite(p.x + p.y))) continue;
      places.forEach((p, k) => room.line(p, places[(k + 1) % places.length]));
      const points = places.map(({ x, y }) => `${x.toFixed(1)},${y.toFixed(1)}`).join(" ");
      for (const layer of ["edge", "link"]) {
        const part = put(shapes, "polygon", { points, class: `${layer}${link.slim ? " slim" : ""}`, "data-link": link.name });
        part.classList.toggle("chosen", store.link === link.name);
        if (layer === "link") part.style.setProperty("--fill", link.fill);
      }
    }
  }

  /** @param {Drawing["wheels"][number]} wheel */
  function drawWheel(wheel) {
    const turn = at[wheel.link] ?? [0, 0, 1, 0];
    if (wheel.points) {
      const points = wheel.points.map(([x, y]) => { const p = px(on(turn, x, y)); return `${p.x.toFixed(1)},${p.y.toFixed(1)}`; });
      put(svg, "polyline", { points: points.join(" "), class: "wheel" });
      return;
    }
    const own = wheel.pin ? pin(wheel.pin) : null;
    if (!own) return;
    const { x, y } = shown(own);
    const r = wheel.radius * view.scale;
    put(svg, "circle", { cx: x, cy: y, r, class: "wheel" });
    put(svg, "line", { x1: x, y1: y, x2: x + r * turn[2], y2: y - r * turn[3], class: "wheel" });
  }

  /** @param {Drawing["loads"][number]} load */
  function drawLoad(load) {
    const [a, b] = load.ends.map((end) => px(spot(end)));
    if (!a || !Number.isFinite(a.x)) return;
    if (load.force) {
      const most = Math.hypot(...load.force) || 1;
      const [dx, dy] = [(44 * load.force[0]) / most, (-44 * load.force[1]) / most];
      const turn = (Math.atan2(dy, dx) * 180) / Math.PI;
      const own = put(svg, "g", { class: "force" });
      put(own, "line", { x1: a.x, y1: a.y, x2: a.x + dx, y2: a.y + dy });
      put(own, "path", { d: "M0 0L-9-4V4Z", transform: `translate(${a.x + dx} ${a.y + dy}) rotate(${turn})` });
      room.line(a, { x: a.x + dx, y: a.y + dy });
      const best = room.word(a.x + dx, a.y + dy, load.name) ?? [6, 4];
      selectable(put(own, "text", { x: a.x + dx + best[0], y: a.y + dy + best[1] }, load.name), ["loads", load.name]);
    } else if (b && load.line.length) {
      selectable(put(svg, "polyline", { points: strokes(load.line, a, b), class: load.line.length > 4 ? "spring" : "spring strut" }), ["loads", load.name]);
    } else {
      put(svg, "circle", { cx: a.x, cy: a.y, r: 11, class: "couple" });
    }
  }

  /** A click shows the form of a part. @param {SVGElement} made @param {string[]} part */
  function selectable(made, part) {
    if (!ours()) return;
    made.classList.add("pick");
    made.addEventListener("pointerdown", (event) => { event.stopPropagation(); set({ part, chosen: [], link: "" }); });
  }

  /** @param {Pin} one */
  function drawPin(one) {
    const { x, y } = shown(one);
    if (!Number.isFinite(x + y)) return;
    if (one.guide && !one.guide.hidden) put(svg, "rect", { x: -13, y: -9, width: 26, height: 18, transform: `translate(${x} ${y}) rotate(${turnOf(one)})`, class: "block" });
    const own = put(svg, "g", { class: "pin", transform: `translate(${x.toFixed(2)} ${y.toFixed(2)})`, "data-pin": one.name });
    own.classList.toggle("chosen", store.chosen.includes(one.name));
    if (one.ground && !one.guide) {
      put(own, "path", { d: "M0 0L-11 17H11Z", class: "ground" });
      put(own, "path", { d: "M-14 17H14M-11 22l5-5M-4 22l5-5M3 22l5-5", class: "hatch" });
    }
    put(own, "circle", { r: 8, class: "ring" });
    if (!one.links.length && ours()) put(own, "path", { d: "M-5-5L5 5M-5 5L5-5", class: "cross" });
    else if (one.kind === "weld") put(own, "path", { d: "M-8 0L0-8L8 0L0 8Z", class: "weld" });
    else if (!one.guide || one.guide.hidden) put(own, "circle", { r: one.guide ? 3 : 5, class: "dot" });
    if (one.driven) put(own, "path", { d: "M13-9A16 16 0 0 0-13-9m-1-7l1 7l7-1", class: "arrow" }); // as angles count
    const words = one.label ?? one.name;
    const best = pins().length < 40 ? room.word(x, y, words) : null;
    if (best) put(own, "text", { x: best[0], y: best[1], class: "name" }, words);
  }

  /** How far a guide is turned on the screen [degrees]. @param {Pin} one */
  function turnOf({ guide }) {
    const link = at[guide?.at[0] ?? ""] ?? [0, 0, 1, 0];
    return -((Math.atan2(link[3], link[2]) + (guide?.angle ?? 0)) * 180) / Math.PI;
  }

  /** @param {Pin} one */
  function drawGuide(one) {
    const guide = /** @type {NonNullable<Pin["guide"]>} */ (one.guide);
    const link = at[guide.at[0]] ?? [0, 0, 1, 0];
    const { x, y } = shown(one);
    const [c, s] = [Math.cos((turnOf(one) * Math.PI) / 180), Math.sin((turnOf(one) * Math.PI) / 180)];
    const drawn = posedAll(); // the guide reaches from where its block is drawn to where that is now
    const home = on(drawn[one.at[0]] ?? [0, 0, 1, 0], one.at[1], one.at[2]);
    const from = drag ? { x, y } : px(on(link, ...local(drawn[guide.at[0]] ?? [0, 0, 1, 0], home)));
    const way = (x - from.x) * c + (y - from.y) * s;
    const ends = [Math.min(way, 0) - 46, Math.max(way, 0) + 46].map((k) => ({ x: from.x + k * c, y: from.y + k * s }));
    const [a, b] = guide.ends?.map((end) => px(spot(end))) ?? ends;
    put(svg, "path", { d: room.guide(a, b), class: "rail" });
  }

  /** @param {"x" | "y" | "turn"} line @param {Point} z @param {number} width @param {number} height */
  function drawAim(line, z, width, height) {
    const { x, y } = px(z);
    if (line === "x") put(svg, "line", { x1: x, x2: x, y1: 0, y2: height, class: "aim" });
    if (line === "y") put(svg, "line", { x1: 0, x2: width, y1: y, y2: y, class: "aim" });
  }

  /** A distance; of a dimension of the drawing with its line. @param {string} a @param {string} b */
  function drawDimension(a, b, stated = false) {
    const ends = [pin(a), pin(b)];
    if (!ends[0] || !ends[1]) return;
    const [z, w] = [where(ends[0]), where(ends[1])];
    const [p, q] = [px(z), px(w)];
    const most = Math.hypot(q.x - p.x, q.y - p.y);
    if (most < 44) return; // no room for a number
    const value = Math.hypot(w[0] - z[0], w[1] - z[1]);
    const text = rounded(value * unit());
    const away = 13 + (4 * text.length * Math.abs(q.y - p.y)) / most; // a number is wide
    const off = [(-(q.y - p.y) / most) * away, ((q.x - p.x) / most) * away];
    const up = off[1] > 0 ? -1 : 1;
    const middle = (/** @type {number} */ side, /** @type {number} */ share) => [p.x + share * (q.x - p.x) + side * off[0], p.y + share * (q.y - p.y) + side * off[1]];
    if (stated) {
      const lined = (/** @type {Pixel} */ end, /** @type {number} */ by) => `${end.x + by * up * off[0]} ${end.y + by * up * off[1]}`;
      const turn = (Math.atan2(q.y - p.y, q.x - p.x) * 180) / Math.PI;
      const line = put(svg, "g", { class: "stated" });
      put(line, "path", { d: `M${lined(p, 0.5)}L${lined(p, 2)}M${lined(q, 0.5)}L${lined(q, 2)}M${lined(p, 1.7)}L${lined(q, 1.7)}` });
      for (const [end, side] of /** @type {const} */ ([[p, 0], [q, 180]]))
        put(line, "path", { d: "M0 0L9-3V3Z", class: "tip", transform: `translate(${lined(end, 1.7)}) rotate(${turn + side})` });
    }
    const tried = [0.5, 0.3, 0.7].flatMap((share) => (stated ? [middle(2.3 * up, share)] : [middle(up, share), middle(-up, share)]));
    const best = room.take(tried, ([cx, cy]) => [cx - 4 * text.length, cy - 8, 8 * text.length, 15]);
    if (best) number(best[0], best[1], text, `distance ${a} to ${b}`, {
      old: value * unit(), unit: length(), si: "m", least: 0, wrong: "is no length: write 80 mm or 1/2 m",
      take: (x) => edit({ act: "dimension", ends: [a, b], value: x }),
    });
  }

  /** What else the drawing is to fulfil: its sign between its points. @param {Drawing["stated"][number]} stated */
  function drawStated({ name, sign, points, value }) {
    const ends = points.map(pin);
    if (!ends.every(Boolean)) return;
    const at_ = ends.map((one) => shown(/** @type {Pin} */ (one)));
    const [x, y] = (["x", "y"]).map((k) => at_.reduce((sum, p) => sum + p[/** @type {"x" | "y"} */ (k)], 0) / at_.length);
    const words = typeof value === "number" ? `${sign} ${rounded(value * degree())}${angle() === "deg" ? "\u00b0" : " rad"}` : sign;
    selectable(put(svg, "text", { x: x + 12, y: y - 12, class: "stated" }, words), ["dimensions", name]);
  }

  // The angle of the second of two chosen pins from the x axis, or of the last of three about the
  // second from the first.
  function drawAngle() {
    const names = store.chosen;
    const ends = names.map(pin);
    if (names.length < 2 || names.length > 3 || !ends.every(Boolean)) return;
    const [m, b] = ends.slice(-2).map((one) => where(/** @type {Pin} */ (one)));
    const turn = (/** @type {Point} */ z) => Math.atan2(z[1] - m[1], z[0] - m[0]);
    const base = names.length === 3 ? turn(where(/** @type {Pin} */ (ends[0]))) : 0;
    const off = Math.atan2(Math.sin(turn(b) - base), Math.cos(turn(b) - base));
    const [o, r] = [px(m), 36];
    const point = (/** @type {number} */ share, /** @type {number} */ radius) => [o.x + radius * Math.cos(base + share * off), o.y - radius * Math.sin(base + share * off)];
    put(svg, "path", { d: `M${point(0, r)}A${r} ${r} 0 0 ${off > 0 ? 0 : 1} ${point(1, r)}`, class: "arc" });
    const text = `${rounded(off * degree())}${angle() === "deg" ? "\u00b0" : " rad"}`;
    const best = room.take([point(0.5, 58), point(0.5, 78), point(1.4, 58)], ([cx, cy]) => [cx - 20, cy - 8, 40, 15]) ?? point(0.5, 58);
    number(best[0], best[1], text, `angle of ${names.join(", ")}`, {
      old: off * degree(), unit: angle(), si: "rad", least: -Infinity, wrong: "is no angle: write 45 deg",
      take: (x) => edit({ act: "angle", pins: names, value: x }),
    });
  }

  /**
   * A number of the picture that is edited by a click or with Enter.
   * @param {number} x @param {number} y @param {string} text @param {string} name
   * @param {{old: number, unit: string, si: string, least: number, wrong: string, take: (x: number) => void}} given
   */
  function number(x, y, text, name, given) {
    const label = put(svg, "text", {
      x, y: y + 4, class: "dimension", tabindex: 0, role: "button", "text-anchor": "middle", "aria-label": `${name} ${text} ${given.unit}`,
    }, text);
    const change = () => {
      const input = element(box, "input", "edit");
      input.style.left = `${x - 45}px`;
      input.style.top = `${y - 13}px`;
      input.value = rounded(given.old, 12);
      input.setAttribute("aria-label", `new ${name} in ${given.unit}`);
      input.focus();
      input.select();
      let open = true;
      const end = (/** @type {boolean} */ done) => {
        if (!open) return;
        open = false;
        const [word, value] = [input.value, quantity(input.value, given.si, given.unit)];
        input.remove();
        svg.focus();
        if (!done || word === rounded(given.old, 12)) return;
        if (value !== null && value > given.least) given.take(value);
        else say(`${word || "nothing"} ${given.wrong}`, true);
      };
      input.addEventListener("blur", () => end(true));
      input.addEventListener("keydown", (event) => {
        if (event.key === "Enter") end(true);
        if (event.key === "Escape") end(false);
        event.stopPropagation();
      });
    };
    label.addEventListener("pointerdown", (event) => event.stopPropagation());
    label.addEventListener("click", change);
    label.addEventListener("keydown", (event) => {
      if (event.key === "Enter") { event.preventDefault(); event.stopPropagation(); change(); }
    });
  }

  // -- gestures ----------------------------------------------------------------------------------

  const choose = (/** @type {string[]} */ names) => set({ chosen: names, link: "", part: names.length === 1 ? partOf(names[0]) : names.length ? store.part : [] });
  const linkPart = (/** @type {string} */ link) => (ours() ? ["links", link] : ["blocks", link.split(".")[0]]);

  /** The part of the document that a pin is. @param {string} name */
  function partOf(name) {
    const one = pin(name);
    if (!ours()) return ["blocks", name.split(".")[0]];
    if (one?.kind) return ["joints", name];
    return one?.links.length ? ["links", one.links[0]] : [];
  }

  svg.addEventListener("pointerdown", (event) => {
    bubble.hidden = menu.hidden = true;
    pointer = pixelIn(svg, event);
    if (event.button === 2) return;
    svg.focus();
    svg.setPointerCapture(event.pointerId);
    if (store.playing) set({ playing: false });
    at = poses();
    const one = closest(pins(), shown, pointer, TAKES);
    const link = /** @type {SVGElement} */ (event.target).dataset.link ?? "";
    const begun = { begun: pointer, grip: metres(view, pointer), text: "", pin: one, link, event };
    const { tool } = store;
    if (event.button === 1) drag = { kind: "pan", last: pointer, ...begun };
    else if (tracing.holding) drag = { kind: "link", from: { at: metres(view, pointer) }, ...begun };
    else if (!ours()) drag = one && one.held !== false ? { kind: "move", ...begun } : { kind: "pan", last: pointer, ...begun };
    else if (PAIRS.includes(tool)) {
      const from = one ? { pin: one.name, at: where(one) } : { at: target(pointer, event).at, on: link || null };
      drag = { kind: "link", from, ...begun };
    } else if (one && !tool) drag = { kind: "move", ...begun };
    else if (link && !tool) drag = { kind: "body", ...begun };
    else drag = { kind: event.shiftKey ? "box" : "pan", last: pointer, ...begun };
    event.preventDefault();
  });

  /** What a pointer means, with a drag's start. @param {Pixel} p @param {{altKey: boolean}} event @param {Point | null} start @param {string} but */
  function target(p, event, start = null, but = "") {
    return aim(metres(view, p), { scale: view.scale, step: grid(), pins: named(but), start, free: event.altKey });
  }

  svg.addEventListener("pointermove", (event) => {
    pointer = pixelIn(svg, event);
    if (!drag) return;
    drag.far ||= Math.hypot(pointer.x - drag.begun.x, pointer.y - drag.begun.y) > 4;
    if (!drag.far) return;
    drag.event = { altKey: event.altKey };
    later();
  });

  let waiting = false;
  function later() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      if (drag) { move(); draw(); }
    });
  }

  function move() {
    const p = pointer;
    if (drag.kind === "pan") {
      view = { ...view, x: view.x + p.x - drag.last.x, y: view.y + p.y - drag.last.y };
      drag.last = p;
    } else if (drag.kind === "box") drag.now = p;
    else if (drag.kind === "link") aimLink();
    else if (drag.kind === "move" || drag.kind === "body") drop();
  }

  function aimLink() {
    const start = /** @type {Point} */ (drag.from.at);
    const words = drag.text && vector(drag.text, length(), angle());
    if (words) {
      const z = metres(view, pointer);
      const r = words.length ?? Math.hypot(z[0] - start[0], z[1] - start[1]);
      const turn = words.angle ?? Math.atan2(z[1] - start[1], z[0] - start[0]);
      drag.to = { at: [start[0] + r * Math.cos(turn), start[1] + r * Math.sin(turn)] };
    } else drag.to = target(pointer, drag.event, start, drag.from.pin);
    const [dx, dy] = [0, 1].map((k) => drag.to.at[k] - start[k]);
    const turn = rounded(Math.atan2(dy, dx) * degree());
    const now = `${rounded(Math.hypot(dx, dy) * unit())} ${length()} @ ${turn}${angle() === "deg" ? "\u00b0" : " rad"}`;
    sayAt(typed, svg, drag.text ? `${drag.text}\u2502  ${now}` : `${now}  \u2013 or type a length`, pointer);
  }

  // Pins that are dragged, where they go, and what follows.
  function drop() {
    if (!drag.base) hold();
    const hand = metres(view, pointer);
    let by = [hand[0] - drag.grip[0], hand[1] - drag.grip[1]];
    if (drag.kind === "move") {
      const start = drag.start[drag.pin.name];
      const aimed = target(px([start[0] + by[0], start[1] + by[1]]), drag.event, null, drag.pin.name);
      const end = aimed.pin && drag.names.includes(aimed.pin) ? hand : aimed.at;
      by = [end[0] - start[0], end[1] - start[1]];
    }
    drag.moved = Object.fromEntries(drag.names.map((/** @type {string} */ n) => [n, drag.start[n].map((/** @type {number} */ x, /** @type {number} */ k) => Number((x + by[k]).toPrecision(12)))]));
    if (drag.kind === "move") {
      const [x, y] = drag.moved[drag.pin.name].map((/** @type {number} */ v) => signed(v * unit(), 5));
      sayAt(typed, svg, `${drag.pin.name}: ${x}, ${y} ${length()}`, pointer);
    }
    const { live } = store;
    drag.live = live instanceof Live && drag.ready && drag.names.every((/** @type {string} */ n) => live.drags(n));
    if (drag.live && live instanceof Live) live.move({ ...drag.places, ...drag.moved });
    if (drag.live && live instanceof Live && !ours()) {
      const { q, spots, upright } = live.held();
      drag.live = upright;
      if (upright) [drag.spots, drag.base, ghost] = [spots, { ...drag.base, ...live.poses(q) }, null];
    }
    if (!drag.live) preview();
  }

  // Take hold: the poses of now stay until the drag is over.
  function hold() {
    drag.base = at;
    const body = drag.kind === "body" ? drawing()?.links.find((link) => link.name === drag.link)?.ends.filter((end) => typeof end === "string") ?? [] : null;
    drag.names = body ?? (store.chosen.includes(drag.pin.name) && store.chosen.length > 1 && ours() ? store.chosen : [drag.pin.name]);
    drag.places = Object.fromEntries(pins().map((one) => [one.name, spot(one.at)]));
    drag.start = Object.fromEntries(drag.names.map((/** @type {string} */ n) => [n, drag.places[n]]));
    drag.poses = store.pose === null || !ours() ? null : Object.fromEntries(Object.entries(at).map(([link, [x, y, c, s]]) => [link, [x, y, Math.atan2(s, c)]]));
    const held = ours() ? { poses: drag.poses } : { hold: [drag.pin.name, store.q ?? store.motion?.home] };
    drag.ready = ours() && !drag.poses;
    if (!drag.ready) { const mine = drag; enliven(held).then(() => { mine.ready = true; if (drag === mine) later(); }); }
  }

  const meant = () => (ours() ? { act: "move", pins: drag.moved, poses: drag.poses ?? undefined }
    : { act: "drag", name: drag.pin.name, to: drag.moved[drag.pin.name], q: store.q ?? store.motion?.home });

  // What the server says that the drag would make: one question at a time, the newest next.
  let previewing = false;
  async function preview() {
    if (previewing || !store.sheet?.motion || !drag?.moved) return;
    previewing = true;
    const [mine, question] = [drag, meant()];
    try {
      const made = await ask(`documents/${store.id}/preview`, question);
      const live = made.live?.hash ? new Live(await kernel(made.live.hash), made.live) : null;
      if (drag === mine && !mine.live) { ghost = { drawing: made.drawing, live }; if (!ours()) drag.base = { ...posedAll(), ...(live?.poses(store.q ?? store.motion?.home ?? {}) ?? {}) }; }
    } catch { /* what cannot be stays as it was drawn last */ }
    previewing = false;
    if (drag === mine && drag) { draw(); if (JSON.stringify(meant()) !== JSON.stringify(question)) preview(); }
  }

  /** @param {PointerEvent} event */
  async function finish(event) {
    const done = drag;
    if (!done) return;
    typed.hidden = true;
    const more = event.ctrlKey || event.shiftKey || event.metaKey;
    if (!done.far && !done.text && !tracing.holding) {
      drag = null;
      tap(done, more, event);
    } else if (done.kind === "link") {
      drag = null;
      drawn(done, done.to?.pin || done.text ? null : under(event));
    } else if (done.moved) {
      const [act, { live, q, motion }] = [meant(), store];
      const end = done.live && live instanceof Live && !ours() ? live.held().q : q ?? motion?.home;
      const error = await edit(act);
      if (store.live instanceof Live && error) store.live.reset();
      [drag, ghost] = [null, null];
      if (error) sayAt(bubble, svg, error.words, pointer);
      else if (!ours() && end) showAt(end);
    } else {
      drag = null;
      if (done.kind === "box" && done.now) {
        const r = between(done.begun, done.now);
        const names = pins().filter((one) => { const p = shown(one); return p.x >= r.x && p.y >= r.y && p.x <= r.x + r.width && p.y <= r.y + r.height; });
        choose([...new Set([...(more ? store.chosen : []), ...names.map((one) => one.name)])]);
      }
    }
    draw();
  }

  /** Of blocks a dragged crank has turned: go on in the pose in which the joint is where it was put. @param {Record<string, number>} q */
  function showAt(q) {
    const { motion } = store;
    if (!motion) return;
    const off = (/** @type {string} */ driver, /** @type {number} */ x) => {
      const apart = x - (q[driver] ?? 0);
      return Math.abs(motion.units[driver] === "rad" ? Math.atan2(Math.sin(apart), Math.cos(apart)) : apart);
    };
    const offs = Array.from({ length: motion.n }, (_, k) => Object.entries(motion.q).reduce((sum, [driver, row]) => sum + off(driver, row[k]), 0));
    set({ pose: offs.indexOf(Math.min(...offs)), q: { ...motion.home, ...q } });
  }

  /** @param {any} done @param {string | null} link */
  async function drawn(done, link) {
    if (!done.to) return;
    if (tracing.holding) return void tracing.change(done.from.at, done.to.at, metres(view, pointer), Boolean(done.text));
    const error = await edit({ act: "draw", tool: store.tool, from: done.from, to: { ...done.to, on: link } });
    if (error) sayAt(bubble, svg, error.words, pointer);
  }

  const under = (/** @type {PointerEvent} */ event) => document.elementsFromPoint(event.clientX, event.clientY)
    .map((part) => /** @type {SVGElement} */ (part).dataset?.link).find(Boolean) ?? null;

  /** @param {any} done @param {boolean} more @param {PointerEvent} event */
  function tap(done, more, event) {
    const { chosen, tool } = store;
    const name = done.pin?.name;
    if (name && AT_PINS.includes(tool)) act(tool, [name]);
    else if (name && more) choose(chosen.includes(name) ? chosen.filter((n) => n !== name) : [...chosen, name]);
    else if (name) choose([name]);
    else if (done.link) set({ link: done.link, chosen: [], part: linkPart(done.link) });
    else if (chosen.length || store.link) set({ chosen: [], link: "", part: [] });
    else if (ours() && (tool === "Link" || !pins().length)) edit({ act: "pin", at: target(done.begun, event).at, on: done.link || null });
  }

  /** What a hand holds goes back to where it was. */
  function release() {
    [drag, ghost] = [null, null];
    typed.hidden = true;
    if (store.live instanceof Live) store.live.reset();
  }

  svg.addEventListener("pointerup", finish);
  svg.addEventListener("pointercancel", () => { release(); draw(); });
  svg.addEventListener("wheel", (event) => {
    [view, pathless] = [zoomed(view, Math.exp(-event.deltaY / 500), pixelIn(svg, event)), false];
    draw();
    event.preventDefault();
  }, { passive: false });
  svg.addEventListener("dblclick", () => { fit(); draw(); });
  svg.addEventListener("contextmenu", (event) => {
    event.preventDefault();
    pointer = pixelIn(svg, event);
    const one = closest(pins(), shown, pointer, TAKES);
    if (one && !store.chosen.includes(one.name)) choose([one.name]);
    openMenu(one ? [...AT_PINS, "Copy", "Delete"] : ["Show all"]);
  });

  /** @param {string[]} words */
  function openMenu(words) {
    if (!ours()) return;
    menu.replaceChildren();
    for (const word of words) {
      const item = button(menu, word, () => {
        menu.hidden = true;
        svg.focus();
        if (word === "Show all") { fit(); draw(); } else act(word, store.chosen);
      });
      item.setAttribute("role", "menuitem");
    }
    menu.style.transform = `translate(${pointer.x}px, ${pointer.y}px)`;
    menu.hidden = false;
    /** @type {HTMLElement} */ (menu.firstChild).focus();
  }

  menu.addEventListener("keydown", (event) => {
    const way = /** @type {Record<string, "nextElementSibling" | "previousElementSibling">} */ ({ ArrowDown: "nextElementSibling", ArrowUp: "previousElementSibling" })[event.key];
    if (way) /** @type {HTMLElement | null} */ (document.activeElement?.[way] ?? null)?.focus();
    if (event.key === "Escape") { menu.hidden = true; svg.focus(); }
    event.stopPropagation();
  });

  // -- keys ----------------------------------------------------------------------------------------

  /** What is typed while a link is drawn; whether it was for the drawing. @param {KeyboardEvent} event */
  function typing(event) {
    if (drag?.kind !== "link") return Boolean(drag) && event.key !== "Escape"; // what a hand holds ends first
    if (event.key === "Escape") { drag = null; typed.hidden = true; }
    else if (event.key === "Backspace") drag.text = drag.text.slice(0, -1);
    else if (event.key === "Enter") {
      const done = drag;
      if (done.text && !tracing.holding && !vector(done.text, length(), angle())) {
        say(`${done.text}: write a length as 80 mm, or 0.3 m @ 45 deg`, true);
        sayAt(bubble, svg, store.alert, pointer);
        [drag, typed.hidden] = [null, true];
      } else {
        move();
        drag = null;
        typed.hidden = true;
        drawn(done, null);
      }
    } else if (event.ctrlKey || event.metaKey || !writes(event.key)) return true;
    else drag.text += event.key;
    if (drag) { drag.far = true; move(); }
    draw();
    return true;
  }

  /** @param {string} name @param {KeyboardEvent} event whether it did something */
  function command(name, event) {
    const { chosen } = store;
    if (name === "escape") {
      bubble.hidden = true;
      if (drag) release();
      else if (tracing.holding) tracing.hold("");
      else if (store.tool) set({ tool: "" });
      else set({ chosen: [], link: "", part: [] });
      draw();
    } else if (name === "fit") { fit(); draw(); }
    else if (name === "arrow" && tracing.holding) tracing.nudge(ARROWS[event.key]);
    else if (name === "arrow" && chosen.length && ours()) {
      const step = grid() * (event.shiftKey ? 10 : 1);
      const [dx, dy] = ARROWS[event.key].map((k) => k * step);
      const at_ = chosen.map((n) => [n, where(/** @type {Pin} */ (pin(n)))]);
      edit({ act: "move", pins: Object.fromEntries(at_.map(([n, z]) => [n, [Number((Number(z[0]) + dx).toPrecision(12)), Number((Number(z[1]) + dy).toPrecision(12))]])) });
    } else if (name === "arrow" && store.motion && (event.key === "ArrowLeft" || event.key === "ArrowRight")) {
      const n = store.motion.n;
      showPose(((store.pose ?? 0) + (event.key === "ArrowRight" ? 1 : -1) + n) % n);
    } else if (name === "delete" && (chosen.length || store.link)) press("Delete");
    else if (name === "all") choose(pins().map((one) => one.name));
    else if (name === "copy" && chosen.length) press("Copy");
    else if (name === "Link") press("Link");
    else if (name === "menu") {
      const one = chosen.length ? pin(chosen[0]) : null;
      if (one) pointer = shown(one);
      openMenu(one ? [...AT_PINS, "Copy", "Delete"] : ["Show all"]);
    } else return false;
    return true;
  }

  // -- what follows ----------------------------------------------------------------------------------

  follow(["sheet", "chosen", "link", "pose", "q", "tool", "live", "paths", "units", "motion", "playing", "view"], () => { if (store.view === "drawing" || store.sheet?.kind) draw(); });
  follow(["sheet"], () => { if (show.input.value || arrows.length) arrowed(); });
  follow(["sheet", "tool", "units", "chosen", "paths"], ({ sheet, tool }) => {
    const mine = sheet?.kind === "joints";
    pick.setAttribute("aria-pressed", String(!tool));
    for (const [name, own] of Object.entries(buttons)) { own.setAttribute("aria-pressed", String(tool === name)); own.hidden = !mine; }
    for (const one of [along, slot, spotted]) one.cell.hidden = !mine;
    pick.hidden = !mine;
    redraw.hidden = mine || !sheet?.motion;
    begin.hidden = mine;
    paths.setAttribute("aria-pressed", String(store.paths));
    along.label.textContent = `along [${angle()}]`;
    const names = ["", "frame", ...(sheet?.drawing?.links ?? []).map((link) => link.name)];
    options(slot.input, mine ? names.map((n) => [n, n || "link below"]) : [], names.includes(slot.input.value) ? slot.input.value : "");
  });
  let [wide, high] = [0, 0];
  new ResizeObserver(() => { // what is in the middle stays there
    const { width, height } = size();
    if (!width) return;
    if (!drag && wide) view = { ...view, x: view.x + (width - wide) / 2, y: view.y + (height - high) / 2 };
    [wide, high] = [width, height];
    draw();
  }).observe(box);
  return { typing, command, fit: () => { fit(); draw(); } };
}
