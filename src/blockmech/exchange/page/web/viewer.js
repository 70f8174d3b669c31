// The page of a mechanism: it opens what it holds, or what a link behind `#doc=` holds, and needs no server.
//
// A mechanism comes as two programs, of its drawing and of its outputs, with their numbers; they are
// interpreted here, so that numbers can be changed and nothing is ever evaluated as code.

import { frameAt } from "./curve.js";
import { button, element, field, options, put } from "./dom.js";
import { corners, fitted, on, pixel, posed, strokes } from "./geometry.js";
import { Room } from "./labels.js";
import { drawPanel } from "./panel.js";
import { Program } from "./program.js";
import { factor, rounded, signed, unitsOf } from "./quantity.js";

/** @typedef {import("./geometry.js").Point} Point */
/** @typedef {number[] | {from: number, to: number}} Column values at the samples, or the ends of equal steps */
/** @typedef {{name: string, label: string, unit: string, numbers: number[]}} Parameter */
/** @typedef {{program: string, parameters: Parameter[], inputs: string[], outputs: {name: string, unit: string}[]}} Part */
/** @typedef {[number, number] | null} Frame where origin and angle of a link are among the outputs; null: the fixed one */
/** @typedef {number | {link: Frame, at: Point}} Place an output, or a place in the frame of a link */
/**
 * @typedef {{title: string, seconds: number, length: string, reasons: Record<string, string>, n: number, drawing: Part, curves: Part,
 *   columns: Record<string, Column>, along: {words: string, values: Column}, offered: string[], chosen: string[],
 *   sliders: {program: string, constants: number[], numbers: Parameter[], targets: ["drawing" | "curves", number][]},
 *   names: {at: Place, names: string[]}[], pins: {at: number, ground: boolean}[], bodies: {ends: Place[], fill: string}[],
 *   rails: {link: Frame, ends: Point[]}[], blocks: {at: Place, link: Frame, turn: number}[],
 *   wheels: {link: Frame, points: Point[]}[],
 *   loads: {name: string, ends: Place[], line: number[][], arrows: {at: Place, value: number, couple: boolean}[]}[]}} Contents
 */
/** @typedef {{document: string, file: string, page: Contents | null, why: string}} Link */

const LARGEST = 8 << 20; // bytes of a link that is unpacked

/** What an address holds behind `#doc=`. Throws for what is none. @param {string} hash @returns {Promise<Link>} */
async function unpacked(hash) {
  const word = hash.slice("#doc=".length).replaceAll("-", "+").replaceAll("_", "/");
  const bytes = Uint8Array.from(atob(word), (letter) => letter.charCodeAt(0));
  const reader = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw")).getReader();
  const decoder = new TextDecoder();
  let text = "";
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return JSON.parse(text + decoder.decode());
    text += decoder.decode(value, { stream: true });
    if (text.length > LARGEST) throw new Error("larger than a document may be");
  }
}

/** @param {Column} column @param {number} n @returns {number[]} */
function values(column, n) {
  if (Array.isArray(column)) return column;
  const step = (column.to - column.from) / Math.max(n - 1, 1);
  return Array.from({ length: n }, (_, k) => (k === n - 1 ? column.to : k * step + column.from));
}

/** A program with its numbers, and its outputs at all samples. */
class Run {
  /** @param {Part} part @param {Contents} contents */
  constructor({ program, parameters, inputs, outputs }, { n, columns }) {
    this.numbers = Float64Array.from(parameters.flatMap((own) => own.numbers));
    /** @type {Map<string, number>} */
    this.starts = new Map();
    parameters.reduce((at, own) => (this.starts.set(own.name, at), at + own.numbers.length), 0);
    this.program = new Program(program, this.numbers.length, inputs.length, outputs.length);
    const rows = inputs.map((name) => values(columns[name], n));
    this.rows = Array.from({ length: n }, (_, k) => rows.map((row) => row[k]));
    this.count = outputs.length;
    /** @type {Float64Array[]} */
    this.outputs = [];
    /** @type {number[]} */
    this.statuses = [];
  }

  compute() {
    this.outputs = this.rows.map(() => new Float64Array(this.count));
    this.statuses = this.rows.map((row, k) => this.program.run(this.numbers, row, this.outputs[k]));
  }

  /** @param {string} name @param {number} x */
  change(name, x) {
    const at = this.starts.get(name);
    if (at !== undefined) this.numbers[at] = x;
  }
}

/** The convex outline of some points. @param {Point[]} points @returns {Point[]} */
function hull(points) {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const half = (/** @type {Point[]} */ row) => {
    /** @type {Point[]} */
    const edge = [];
    for (const p of row) {
      const turn = ([a, b] = edge.slice(-2)) => (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
      while (edge.length > 1 && turn() <= 0) edge.pop();
      edge.push(p);
    }
    return edge.slice(0, -1);
  };
  return points.length < 3 ? points : [...half(sorted), ...half(sorted.reverse())];
}

const ARC = "M-5 15A16 16 0 1 0-15-5l6-6m-6 6l-1-8"; // a couple to the left
const effort = (/** @type {ArrayLike<number>} */ row, /** @type {number} */ k, couple = false) => [row[k], couple ? 0 : row[k + 1]];
const there = (/** @type {Point[]} */ points) => points.every((z) => Number.isFinite(z[0] + z[1]));

/** Shows a mechanism. @param {HTMLElement} main @param {HTMLElement} aside @param {Contents} contents */
function show(main, aside, contents) {
  const [drawing, curves] = [new Run(contents.drawing, contents), new Run(contents.curves, contents)];
  const { n, seconds, reasons } = contents;
  const along = { words: contents.along.words, values: values(contents.along.values, n), events: [] };
  const svg = put(main, "svg", { role: "img", "aria-label": "the mechanism in a pose", class: "canvas" });
  const row = element(main, "div", "row");
  const play = button(row, "Play", () => (playing ? pause() : start()));
  const slider = field(row, "Pose", "input").input;
  Object.assign(slider, { type: "range", min: "0", max: String(n - 1), value: "0", step: "1" });
  const caption = element(main, "p", "note");
  caption.setAttribute("role", "status");
  let [pose, playing, begun] = [0, false, 0];
  let view = { scale: 1, x: 0, y: 0 };
  let largest = 1; // force
  let room = new Room();
  /** @type {((k: number) => void)[]} */
  let cursors = [];

  // -- places --------------------------------------------------------------------------------

  /** @param {ArrayLike<number>} row @param {Frame} link @param {Point} at @returns {Point} */
  const placed = (row, link, at) => (link ? on(posed([row[link[0]], row[link[0] + 1], row[link[1]]]), at[0], at[1]) : at);
  /** @param {Place} place @param {ArrayLike<number>} row @returns {Point} */
  const at = (place, row = drawing.outputs[pose]) => (typeof place === "number" ? [row[place], row[place + 1]] : placed(row, place.link, place.at));
  const line = (/** @type {Point[]} */ points) => points.map((z) => pixel(view, z)).map(({ x, y }) => `${x.toFixed(1)},${y.toFixed(1)}`).join(" ");

  function fit() {
    const places = drawing.outputs.flatMap((row) => [...contents.bodies, ...contents.loads].flatMap(({ ends }) => ends.map((end) => at(end, row)))).filter((z) => there([z]));
    const [low, high] = corners(places);
    const [wide, tall] = [high[0] - low[0], high[1] - low[1]];
    const room = 0.3 * Math.max(wide, tall);
    svg.style.aspectRatio = `${wide + room} / ${tall + room}`;
    const { width, height } = svg.getBoundingClientRect();
    view = fitted(places, width, height);
  }

  // -- the picture -----------------------------------------------------------------------------

  function draw() {
    svg.replaceChildren();
    room = new Room();
    const now = drawing.outputs[pose];
    for (const pin of contents.pins) {
      const points = drawing.outputs.map((row) => at(pin.at, row)).filter((z) => there([z]));
      put(svg, "polyline", { points: line(points), class: "path" });
    }
    for (const { link, ends } of contents.rails) {
      const [a, b] = ends.map((z) => placed(now, link, z));
      if (there([a, b])) put(svg, "path", { d: room.guide(pixel(view, a), pixel(view, b)), class: "rail" });
    }
    for (const pin of contents.pins.filter(({ ground }) => ground)) mark(at(pin.at), "M0 0L-11 17H11ZM-14 17H14", "ground");
    for (const { ends, fill } of contents.bodies) {
      const points = ends.map((end) => at(end)).filter((z) => there([z]));
      points.forEach((z, k) => room.line(pixel(view, z), pixel(view, points[(k + 1) % points.length])));
      if (points.length > 1) for (const layer of ["edge", "link"]) put(svg, "polygon", { points: line(hull(points)), class: layer }).style.setProperty("--fill", fill);
    }
    for (const { link, points } of contents.wheels) polyline(points.map((z) => placed(now, link, z)), "wheel");
    for (const { at: place, link, turn } of contents.blocks) {
      const angle = -(((link ? now[link[1]] : 0) + turn) * 180) / Math.PI;
      mark(at(place), "M-13-9H13V9H-13Z", "block", ` rotate(${angle})`, 15);
    }
    for (const { at: place } of contents.pins) mark(at(place), "M-5 0A5 5 0 1 0 5 0A5 5 0 1 0-5 0Z", "dot", "", 8);
    contents.loads.forEach(drawLoad);
    for (const { at: place, names } of contents.names) word(at(place), names.join(", "));
    const status = curves.statuses[pose] || drawing.statuses[pose];
    caption.textContent = `${along.words}: ${signed(along.values[pose], 5)}${status ? ` \u2013 ${reasons[status]}` : ""}`;
    for (const point of cursors) point(pose);
    readings();
  }

  /** @param {Point[]} points @param {string} name */
  function polyline(points, name) {
    if (there(points)) put(svg, "polyline", { points: line(points), class: name });
  }

  /** A word beside a place, where it hides nothing if there is room. @param {Point} z @param {string} text @param {string} name */
  function word(z, text, name = "") {
    const { x, y } = pixel(view, z);
    const [right, down] = room.word(x, y, text) ?? [10, -10];
    if (Number.isFinite(x)) put(svg, "text", { x: x + right, y: y + down, class: name }, text);
  }

  /** @param {Point} z @param {string} d @param {string} name @param {string} turn @param {number} half of the room that it takes [px] */
  function mark(z, d, name, turn = "", half = 0) {
    const { x, y } = pixel(view, z);
    if (half) room.taken.push([x - half, y - half, 2 * half, 2 * half]);
    if (Number.isFinite(x)) put(svg, "path", { d, class: name, transform: `translate(${x.toFixed(1)} ${y.toFixed(1)})${turn}` });
  }

  /** A load: a line between its ends, arrows of forces, arcs of couples. @param {Contents["loads"][number]} load */
  function drawLoad({ name, ends, line, arrows }) {
    const places = ends.map((end) => at(end));
    if (line.length && there(places)) put(svg, "polyline", { points: strokes(line, pixel(view, places[0]), pixel(view, places[1])), class: line.length > 4 ? "spring" : "spring strut" });
    for (const { at: place, value, couple } of arrows) {
      const [x, y] = effort(drawing.outputs[pose], value, couple);
      const size = 18 + (28 * Math.hypot(x, y)) / largest;
      if (couple && x) mark(at(place), ARC, "force", ` scale(1 ${Math.sign(x)})`);
      else if (x || y) {
        mark(at(place), `M0 0H${size}l-8-4m8 4l-8 4`, "force", ` rotate(${(-Math.atan2(y, x) * 180) / Math.PI})`);
        const [from, way] = [pixel(view, at(place)), size / Math.hypot(x, y)];
        room.line(from, { x: from.x + way * x, y: from.y - way * y });
      }
    }
    word(at(arrows.length ? arrows[0].at : ends[0]), name, "force");
  }

  // -- curves ------------------------------------------------------------------------------------

  const lengths = field(aside, "Lengths in", "select").input;
  options(lengths, unitsOf("m").map((unit) => [unit, unit]), contents.length);
  const shownIn = (/** @type {string} */ unit) => (unit === "m" ? lengths.value : unit);
  const times = (/** @type {string} */ unit) => factor(unit, shownIn(unit));
  const numbers = element(aside, "div", "numbers");
  const more = field(aside, "Another number", "select").input;
  const table = element(aside, "dl", "values");
  const plots = element(aside, "div", "plots");

  function plot() {
    plots.replaceChildren();
    cursors = contents.curves.outputs.map(({ name, unit }, i) => {
      const row = curves.outputs.map((out, k) => (!curves.statuses[k] && Number.isFinite(out[i]) ? times(unit) * out[i] : null));
      const known = row.filter((x) => x !== null);
      /** @type {[number, number]} */
      const shown = [known.reduce((a, b) => Math.min(a, b), 0), known.reduce((a, b) => Math.max(a, b), 0)];
      const panel = { quantity: name.split(".").slice(-1 - Number(/\.[xy]$/.test(name))).join("."), unit: shownIn(unit) || "-", shown, curves: /** @type {[string, (number | null)[]][]} */ ([[name, row]]), without: [] };
      return drawPanel(plots, panel, along, gaps(), step);
    });
  }

  /** Runs of samples without an answer. */
  function gaps() {
    /** @type {[number, number][]} */
    const found = [];
    curves.statuses.forEach((status, k) => {
      const previous = found[found.length - 1];
      if (!status) return;
      if (previous?.[1] === k - 1) previous[1] = k;
      else found.push([k, k]);
    });
    return found;
  }

  function readings() {
    table.replaceChildren();
    contents.curves.outputs.forEach(({ name, unit }, i) => {
      const largest = Math.max(...curves.outputs.map((out) => Math.abs(out[i]) || 0));
      const x = Math.abs(curves.outputs[pose][i]) > 1e-13 * largest ? curves.outputs[pose][i] : curves.outputs[pose][i] * 0;
      element(table, "dt", "", name);
      element(table, "dd", "", Number.isFinite(x) && !curves.statuses[pose] ? `${signed(times(unit) * x, 12)} ${shownIn(unit)}` : "none");
    });
  }

  function compute() {
    for (const run of [drawing, curves]) run.compute();
    const forces = contents.loads.flatMap(({ arrows }) => arrows.filter(({ couple }) => !couple));
    largest = Math.max(1e-300, ...drawing.outputs.flatMap((row) => forces.map(({ value }) => Math.hypot(...effort(row, value)) || 0)));
  }

  function renew() {
    compute();
    plot();
    draw();
  }

  // -- what the reader does ------------------------------------------------------------------------

  /** @param {number} k */
  function step(k) {
    pose = Math.min(Math.max(k, 0), n - 1);
    slider.value = String(pose);
    draw();
  }

  function start() {
    [playing, begun, play.textContent] = [true, performance.now() - (pose / n) * seconds * 1e3, "Pause"];
    requestAnimationFrame(tick);
  }

  function pause() {
    [playing, play.textContent] = [false, "Play"];
  }

  /** @param {number} time */
  function tick(time) {
    if (!playing) return;
    step(frameAt(Math.max(time - begun, 0) / 1e3 / seconds, n, true));
    requestAnimationFrame(tick);
  }

  const parameter = (/** @type {string} */ name) => /** @type {Parameter} */ (contents.curves.parameters.find((x) => x.name === name));

  /** Numbers of the programs follow those of the document. */
  const { constants, numbers: own, targets, program } = contents.sliders;
  const followed = { program: new Program(program, constants.length, own.length, targets.length), from: own.map((x) => x.numbers[0]), to: new Float64Array(targets.length) };

  /** @param {number} k @param {number} x */
  function follow(k, x) {
    followed.from[k] = x;
    followed.program.run(constants, followed.from, followed.to);
    targets.forEach(([part, i], n) => (({ drawing, curves })[part].numbers[i] = followed.to[n]));
    renew();
  }

  /** A slider and a field for a number. @param {Parameter} own @param {(x: number) => void} take */
  function offer(own, take) {
    const first = own.numbers[0];
    let now = first;
    const { cell, label, input: typed } = field(numbers, "", "input");
    Object.assign(typed, { type: "number", step: "any" });
    const show = () => {
      label.textContent = own.label + (own.unit ? ` [${shownIn(own.unit)}]` : "");
      typed.value = now === first && times(own.unit) === 1 ? String(first) : rounded(times(own.unit) * now, 12);
    };
    show();
    lengths.addEventListener("change", show);
    const range = element(cell, "input");
    Object.assign(range, { type: "range", min: "0", max: "1000", value: "500" });
    range.setAttribute("aria-label", `${own.label}, by a slider`);
    range.addEventListener("input", () => {
      now = Number(rounded(first + (Number(range.value) / 500 - 1) * (Math.abs(first) || 1) * 0.5, 6));
      show();
      take(now);
    });
    typed.addEventListener("change", () => {
      if (Number.isFinite(typed.valueAsNumber)) take((now = typed.valueAsNumber / times(own.unit)));
    });
    for (const option of more.options) if (option.value === own.name) option.disabled = true;
  }

  /** A number of the programs. @param {string} name */
  function offerNumber(name) {
    offer(parameter(name), (x) => {
      for (const run of [drawing, curves]) run.change(name, x);
      renew();
    });
  }

  more.append(new Option("choose \u2026", ""), ...contents.offered.map((name) => new Option(parameter(name).label, name)));
  more.addEventListener("change", () => {
    if (more.value) offerNumber(more.value);
    more.value = "";
  });
  own.forEach((x, k) => offer(x, (value) => follow(k, value)));
  contents.chosen.forEach(offerNumber);
  lengths.addEventListener("change", () => { plot(); draw(); });
  slider.addEventListener("input", () => { pause(); step(Number(slider.value)); });
  new ResizeObserver(() => { fit(); plot(); draw(); }).observe(main);
  compute();
}

async function open() {
  const held = /** @type {HTMLElement} */ (document.getElementById("contents")).textContent ?? "";
  const parts = ["title", "main", "aside", "footer"].map((name) => /** @type {HTMLElement} */ (document.getElementById(name)));
  const [title, main, aside, footer] = parts;
  for (const part of [main, aside, footer]) part.replaceChildren();
  try {
    const link = location.hash.startsWith("#doc=") ? await unpacked(location.hash) : /** @type {Link} */ (JSON.parse(held));
    title.textContent = document.title = link.page?.title ?? link.file;
    if (link.page) show(main, aside, link.page);
    else element(main, "p", "wrong", link.why);
    const href = URL.createObjectURL(new Blob([link.document], { type: "application/json" }));
    const save = element(footer, "a", "", "The mechanism's file");
    Object.assign(save, { href, download: link.file });
    element(footer, "span", "", " opens in blockmech. All is computed in this page.");
  } catch {
    title.textContent = "No mechanism";
    element(main, "p", "wrong", "The address holds no mechanism, or is cut: copy the whole link again.");
  }
  document.documentElement.dataset.ready = "yes";
}

addEventListener("hashchange", () => location.reload());
open();
