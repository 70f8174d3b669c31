// The page: a pose from the kernels at a row of inputs, the drawing of it, and curves over all rows.

const NS = "http://www.w3.org/2000/svg";
const values = Float64Array.from(DATA.parameters.flatMap(({ numbers }) => numbers));
const byName = new Map();
DATA.parameters.reduce((at, { name, numbers }) => (byName.set(name, at), at + numbers.length), 0);
const places = DATA.drawing.map((name) => byName.get(name.name)); // of the drawing's parameters
const own = Float64Array.from(DATA.drawing.flatMap(({ numbers }) => numbers));
const n = DATA.rows.length;
let [poses, words, answers] = [[], [], []];
let [pose, playing, begun] = [0, false, 0];

function work() {
  let at = 0;
  for (const [k, { numbers }] of DATA.drawing.entries())
    for (let i = 0; i < numbers.length; i++, at++)
      if (places[k] !== undefined) own[at] = values[places[k] + i];
  [poses, words, answers] = [[], [], []];
  for (const [k, row] of DATA.rows.entries()) {
    const [z, y] = [new Float64Array(DATA.places), new Float64Array(DATA.outputs.length)];
    drawing(own, DATA.drawn[k], z);
    words.push(curves(values, row, y));
    poses.push(z);
    answers.push(y);
  }
}

function put(parent, tag, given, text) {
  const made = document.createElementNS(NS, tag);
  for (const [name, value] of Object.entries(given)) made.setAttribute(name, value);
  if (text !== undefined) made.textContent = text;
  parent.append(made);
  return made;
}

const picture = document.getElementById("picture");
const point = (z, k) => [z[k], z[k + 1]];
const view = { scale: 1, x: 0, y: 0 };
const across = ([x]) => view.x + x * view.scale;
const down = ([, y]) => view.y - y * view.scale;
const text = (x) => (Number.isFinite(x) ? String(Number(x.toPrecision(6))).replace("-", "\u2212") : "none");

// A place: of an output of the drawing, or [x, y] in the frame of a link.
const place = (z, k) => (typeof k === "number" ? point(z, k) : seen(z, k.link, k.at));

function seen(z, link, [x, y]) {
  if (link === null) return [x, y];
  const [o, angle] = [point(z, link[0]), z[link[1]]];
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return [o[0] + c * x - s * y, o[1] + s * x + c * y];
}

function fit() {
  const ends = DATA.bodies.flatMap((body) => body.ends);
  const all = poses.flatMap((z) => ends.map((end) => place(z, end))).filter((p) => p.every(Number.isFinite));
  const both = [0, 1].map((k) => all.map((p) => p[k]));
  const [low, high] = [Math.min, Math.max].map((most) => both.map((row) => row.reduce((a, b) => most(a, b), row[0])));
  const { width, height } = picture.getBoundingClientRect();
  const size = Math.max((high[0] - low[0]) / (width - 120), (high[1] - low[1]) / (height - 120));
  view.scale = size > 0 && Number.isFinite(size) ? 1 / size : 1;
  view.x = width / 2 - ((low[0] + high[0]) / 2) * view.scale;
  view.y = height / 2 + ((low[1] + high[1]) / 2) * view.scale;
}

function hull(points) {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const half = (row) => {
    const kept = [];
    for (const p of row) {
      const turn = ([a, b]) => (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
      while (kept.length > 1 && turn(kept.slice(-2)) <= 0) kept.pop();
      kept.push(p);
    }
    return kept.slice(0, -1);
  };
  return points.length < 3 ? points : [...half(sorted), ...half(sorted.reverse())];
}

function draw() {
  picture.replaceChildren();
  const z = poses[pose];
  const line = (points) => points.map((p) => `${across(p)},${down(p)}`).join(" ");
  for (const { at } of DATA.pins) {
    const path = poses.map((row) => point(row, at)).filter((p) => p.every(Number.isFinite));
    put(picture, "polyline", { points: line(path), class: "path" });
  }
  for (const { link, ends } of DATA.rails) {
    const both = ends.map((p) => seen(z, link, p));
    if (both.flat().every(Number.isFinite)) put(picture, "polyline", { points: line(both), class: "rail" });
  }
  for (const { at } of DATA.pins.filter(({ ground }) => ground)) {
    const p = point(z, at);
    if (p.every(Number.isFinite))
      put(picture, "path", { d: "M0 0L-12 18H12ZM-16 18H16", class: "ground", transform: `translate(${across(p)} ${down(p)})` });
  }
  for (const { ends, fill } of DATA.bodies) {
    const points = ends.map((end) => place(z, end)).filter((p) => p.every(Number.isFinite));
    if (points.length < 2) continue;
    for (const layer of ["edge", "body"])
      put(picture, "polygon", { points: line(hull(points)), class: layer, style: `--fill: ${fill}` });
  }
  for (const { link, points } of DATA.wheels) {
    const round = points.map((p) => seen(z, link, p));
    if (round.flat().every(Number.isFinite)) put(picture, "polyline", { points: line(round), class: "wheel" });
  }
  for (const { at, link, turn } of DATA.blocks) {
    const p = place(z, at);
    if (!p.every(Number.isFinite)) continue;
    const angle = -((link === null ? 0 : z[link[1]]) + turn) * (180 / Math.PI);
    put(picture, "rect", { x: -14, y: -9, width: 28, height: 18, class: "block", transform: `translate(${across(p)} ${down(p)}) rotate(${angle})` });
  }
  for (const { at, name } of DATA.pins) {
    const p = point(z, at);
    if (!p.every(Number.isFinite)) continue;
    put(picture, "circle", { cx: across(p), cy: down(p), r: 5, class: "pin" });
    put(picture, "text", { x: across(p) + 9, y: down(p) - 9 }, name);
  }
  tell();
}

function tell() {
  const row = DATA.rows[pose];
  const given = DATA.inputs.map(({ name, comment }, k) => `${name} = ${text(row[k])} ${comment}`);
  const why = words[pose] ? ` \u2013 ${DATA.words[words[pose]]}` : "";
  document.getElementById("caption").textContent = given.slice(0, 3).join(", ") + why;
  for (const [k, { own: curve, value }] of shown.entries()) {
    value.textContent = `${DATA.outputs[k].name} = ${text(answers[pose][k])} ${DATA.outputs[k].unit}`;
    curve.cursor.setAttribute("x1", curve.at(pose));
    curve.cursor.setAttribute("x2", curve.at(pose));
  }
}

// -- curves ------------------------------------------------------------------------------------

const shown = DATA.outputs.map(() => {
  const box = document.createElement("div");
  box.className = "curve";
  const value = document.createElement("div");
  const chart = document.createElementNS(NS, "svg");
  chart.setAttribute("role", "img");
  box.append(value, chart);
  document.getElementById("curves").append(box);
  return { value, chart, own: null };
});

function plot() {
  for (const [k, one] of shown.entries()) {
    const { chart } = one;
    chart.replaceChildren();
    chart.setAttribute("aria-label", DATA.outputs[k].name);
    const { width, height } = chart.getBoundingClientRect();
    const y = answers.map((row, i) => (words[i] ? NaN : row[k]));
    const known = y.filter(Number.isFinite);
    const [low, high] = [Math.min(...known, 0), Math.max(...known, 0)];
    const at = (i) => 62 + ((width - 72) * i) / Math.max(n - 1, 1);
    const up = (v) => height - 8 - ((height - 16) * (v - low)) / (high - low || 1);
    for (const v of new Set([low, 0, high])) {
      put(chart, "line", { x1: 62, x2: width - 10, y1: up(v), y2: up(v), class: "axis" });
      put(chart, "text", { x: 58, y: up(v) + 4, "text-anchor": "end" }, String(Number(v.toPrecision(3))));
    }
    let d = "";
    y.forEach((v, i) => { if (Number.isFinite(v)) d += `${Number.isFinite(y[i - 1]) ? "L" : "M"}${at(i)} ${up(v)}`; });
    put(chart, "path", { d, class: "line" });
    const cursor = put(chart, "line", { y1: 0, y2: height, class: "cursor" });
    one.own = { cursor, at };
    chart.onclick = (event) => show(Math.round(((event.offsetX - 62) / (width - 72)) * (n - 1)));
  }
}

function renew() {
  work();
  plot();
  draw();
}

// -- what the reader does ------------------------------------------------------------------------

const slider = document.getElementById("pose");
slider.max = n - 1;

function show(k) {
  pose = Math.min(Math.max(k, 0), n - 1);
  slider.value = pose;
  draw();
}

function tick(now) {
  if (!playing) return;
  show(Math.floor((((now - begun) / 1000 / DATA.seconds) % 1) * n));
  requestAnimationFrame(tick);
}

slider.addEventListener("input", () => show(Number(slider.value)));
const play = document.getElementById("play");
play.addEventListener("click", () => {
  playing = !playing;
  play.textContent = playing ? "Pause" : "Play";
  begun = performance.now() - (pose / n) * DATA.seconds * 1000;
  if (playing) requestAnimationFrame(tick);
});

function number(name) {
  const at = byName.get(name);
  const first = values[at];
  const line = document.createElement("label");
  const [range, field] = [document.createElement("input"), document.createElement("input")];
  Object.assign(range, { type: "range", min: 0, max: 1000, value: 500 });
  range.setAttribute("aria-label", `${name}, by a slider`);
  Object.assign(field, { type: "number", step: "any", value: first });
  const size = Math.abs(first) || 1;
  const take = (x) => { values[at] = x; renew(); };
  range.addEventListener("input", () => { field.value = Number((first + (range.value / 500 - 1) * size * 0.5).toPrecision(6)); take(Number(field.value)); });
  field.addEventListener("change", () => { if (Number.isFinite(field.valueAsNumber)) take(field.valueAsNumber); });
  line.append(`${name.replace(/^P_/, "").replaceAll("_", " ")} `, field, range);
  document.getElementById("numbers").append(line);
}

const more = document.getElementById("more");
for (const name of DATA.offered) more.append(new Option(name.replace(/^P_/, "").replaceAll("_", " "), name));
more.addEventListener("change", () => {
  if (more.value) number(more.value);
  more.selectedOptions[0].disabled = true;
  more.value = "";
});
for (const name of DATA.chosen) {
  number(name);
  for (const option of more.options) if (option.value === name) option.disabled = true;
}
const file = document.getElementById("file");
file.href = URL.createObjectURL(new Blob([DATA.document], { type: "application/json" }));
file.download = DATA.file;
addEventListener("resize", () => { fit(); plot(); draw(); });
work();
fit();
plot();
draw();
