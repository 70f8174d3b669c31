// The drawing of links and joints: what the hand does is drawn here, what it means the server knows.
//
// Places are metres, y upwards; `view` maps them to the pixels of the drawing. Every gesture ends
// in one message {act, ...}, and the drawing that comes back is the truth.

const NEAR = 13; // px within which a pointer takes hold of a pin
const TURN = Math.PI / 12; // directions that a dragged link snaps to
const LEAN = 0.05; // rad from such a direction
// A typed length and direction: "0.3", "0.3 @ 30", "@ 30"; null for what is none yet.
export function typedVector(text, unit, degree) {
  const number = "[-+]?(?:\\d+\\.?\\d*|\\.\\d+)";
  const found = text.match(new RegExp(`^\\s*(${number})?\\s*(?:@\\s*(${number}))?\\s*$`));
  if (!found || (found[1] === undefined && found[2] === undefined)) return null;
  return {
    length: found[1] === undefined ? null : Number(found[1]) / unit,
    angle: found[2] === undefined ? null : Number(found[2]) / degree,
  };
}

export function render({ model, el }) {
  const box = element(el, "div", "sketch");
  const svg = put(box, "svg", { tabindex: 0, role: "application" });
  svg.setAttribute("aria-label", "drawing of links and joints");
  const typed = element(box, "div", "typed");
  const bubble = element(box, "div", "bubble");
  const menu = element(box, "div", "menu");
  menu.setAttribute("role", "menu");
  const guide = element(box, "ol", "guide");
  bubble.setAttribute("aria-hidden", "true"); // the line below says it to screen readers
  for (const part of [typed, bubble, menu]) part.hidden = true;

  const view = { scale: 0, x: 0, y: 0 };
  let pointer = { x: 60, y: 60 }; // px, where something is said
  let drag = null; // what the hand does now
  let taken = []; // where words stand
  let lined = []; // points of the outlines of links, on which none should
  let trace = null; // the picture below: what `tracedFile` gives, its corner [m] and m in its unit
  let hold = ""; // what a drag does to it: "Place" or "Scale"

  const across = (x) => view.x + x * view.scale;
  const down = (y) => view.y - y * view.scale;
  const metres = ({ x, y }) => [(x - view.x) / view.scale, (view.y - y) / view.scale];
  const pins = () => model.drawing.pins;
  const pin = (name) => pins().find((one) => one.name === name);
  const at = (one) => drag?.moved?.[one.name] ?? one.at;
  const chosen = () => model.chosen.filter(pin);
  const tell = (act, more = {}) => model.send_msg({ act, ...more });
  const stepOf = (least) => nice((least / view.scale) * model.drawing.unit) / model.drawing.unit; // in the unit shown
  const grid = () => stepOf(12);
  const place = (event) => placeIn(svg, event);

  function fit() {
    const { width, height } = svg.getBoundingClientRect();
    if (!width) return;
    const places = pins().map((one) => one.at);
    if (trace) places.push(trace.at, farCorner());
    const [low, high] = corners(places.length ? places : [[0, 0], [1, 1]]);
    const size = [0, 1].map((k) => high[k] - low[k]);
    const most = Math.max(...size) || Math.max(...low.map(Math.abs)) || 1;
    const room = [width - 120, height - 110];
    view.scale = Math.min(...size.map((own, k) => Math.max(room[k], 50) / (own || most / 3)));
    view.x = width / 2 - ((low[0] + high[0]) / 2) * view.scale;
    view.y = height / 2 + ((low[1] + high[1]) / 2) * view.scale;
  }

  const inside = (one) => {
    const { width, height } = svg.getBoundingClientRect();
    const [x, y] = [across(one.at[0]), down(one.at[1])];
    return x >= 0 && y >= 0 && x <= width && y <= height;
  };

  const shown = (one) => ({ x: across(at(one)[0]), y: down(at(one)[1]) });
  const nearest = (p, but = null) => closest(pins().filter(({ name }) => name !== but), shown, p, NEAR);

  // Where a dragged end goes: a pin, what was typed, a direction, the grid.
  function aimed(p, event, start = null, but = null) {
    const step = grid();
    const onto = nearest(p, but);
    const words = drag && typedVector(drag.text, model.drawing.unit, model.drawing.degree);
    if (words && start) {
      const z = metres(p);
      const length = words.length ?? Math.hypot(z[0] - start[0], z[1] - start[1]);
      const angle = words.angle ?? Math.atan2(z[1] - start[1], z[0] - start[0]);
      return { at: [start[0] + length * Math.cos(angle), start[1] + length * Math.sin(angle)] };
    }
    if (onto) return { pin: onto.name, at: at(onto) };
    const z = metres(p);
    if (event.altKey) return { at: z };
    if (start) {
      const [dx, dy] = [z[0] - start[0], z[1] - start[1]];
      const angle = Math.atan2(dy, dx);
      const near = Math.round(angle / TURN) * TURN;
      if (Math.abs(angle - near) < LEAN) {
        const length = Math.max(Math.round(Math.hypot(dx, dy) / step), 1) * step;
        const end = [Math.cos(near), Math.sin(near)].map((k, i) => start[i] + k * length);
        return { at: end.map((x) => Number(x.toPrecision(9))) };
      }
    }
    return { at: z.map((x) => Number((Math.round(x / step) * step).toPrecision(9))) };
  }

  // -- the picture -------------------------------------------------------------------------

  function draw() {
    svg.replaceChildren();
    for (const part of [...tools.children].slice(1)) part.hidden = !trace;
    for (const [act, part] of holds) part.setAttribute("aria-pressed", hold === act);
    taken = pins().map((one) => [across(at(one)[0]) - 8, down(at(one)[1]) - 8, 16, 16]);
    lined = [];
    const { width, height } = svg.getBoundingClientRect();
    if (!view.scale || !width) return;
    drawTrace();
    drawGrid(width, height);
    const shapes = put(svg, "g");
    for (const link of model.drawing.links) {
      const ends = link.pins.map(pin).filter(Boolean);
      const points = ends.map(shown).map(({ x, y }) => `${x},${y}`).join(" ");
      ends.forEach((one, k) => alongLine(at(one), at(ends[(k + 1) % ends.length])));
      for (const layer of ["edge", "link"])
        put(shapes, "polygon", { points, class: layer, "data-link": link.name, style: `--fill: ${link.fill}` });
    }
    for (const gear of model.drawing.wheels) {
      const r = gear.radius * view.scale;
      put(svg, "circle", { cx: across(gear.at[0]), cy: down(gear.at[1]), r, class: "wheel" });
    }
    for (const load of model.drawing.loads) drawLoad(load);
    if (drag?.kind === "link" && drag.to) {
      const [a, b] = [drag.from.at, drag.to.at];
      put(svg, "line", { x1: across(a[0]), y1: down(a[1]), x2: across(b[0]), y2: down(b[1]), class: "new" });
    }
    for (const one of [...pins()].reverse()) drawPin(one); // a block below its pin
    if (!drag) for (const dim of model.drawing.dimensions) drawDimension(dim);
    if (!drag) drawAngle();
    if (drag?.kind === "box" && drag.now) put(svg, "rect", { ...between(drag.begun, drag.now), class: "box" });
    svg.dataset.tool = model.tool;
    guide.hidden = pins().length > 0 || Boolean(trace) || !model.drawing.ours;
  }

  // -- the picture below ---------------------------------------------------------------------

  const farCorner = () => [trace.at[0] + trace.scale * trace.width, trace.at[1] - trace.scale * trace.height];

  function drawTrace() {
    if (!trace) return;
    const turn = `translate(${across(trace.at[0])} ${down(trace.at[1])}) scale(${view.scale * trace.scale}) translate(${-trace.x} ${-trace.y})`;
    const look = { transform: turn, class: "trace", opacity: opacity.value / 100, "aria-hidden": "true" };
    if (trace.d) put(svg, "path", { ...look, d: trace.d });
    else put(svg, "image", { ...look, href: trace.href, width: trace.width, height: trace.height });
  }

  async function load(file) {
    const found = file && (await tracedFile(file));
    if (file && !found) tell("wrong", { said: `${file.name}: it is no picture, and no DXF with lines` });
    if (!found) return;
    const { width, height } = svg.getBoundingClientRect();
    const fits = Math.min(width / found.width, height / found.height) * 0.8 / view.scale;
    const scale = found.scale ?? fits;
    const [x, y] = found.scale ? [0, scale * found.height] : metres({ x: width * 0.1, y: height * 0.1 });
    trace = { ...found, scale, at: [x, y] };
    if (found.scale) fit();
    draw();
  }

  // What was dragged: from a point of the picture to where it belongs, or along a typed length.
  function changeTrace({ from, to, text }) {
    const apart = (z) => Math.hypot(z[0] - from.at[0], z[1] - from.at[1]);
    const by = hold === "Scale" ? apart(to.at) / apart(metres(pointer)) : 1;
    if (hold === "Scale" && !text) tell("wrong", { said: "type the true length while you drag along it" });
    else if (hold === "Place") trace.at = trace.at.map((x, k) => x + to.at[k] - from.at[k]);
    else if (by > 0 && Number.isFinite(by)) {
      trace.at = trace.at.map((x, k) => from.at[k] + by * (x - from.at[k]));
      trace.scale *= by;
    }
  }

  const tools = element(box, "div", "tracing");
  const file = element(box, "input", "");
  Object.assign(file, { type: "file", hidden: true, accept: "image/*,.dxf" });
  file.addEventListener("change", () => { load(file.files[0]); file.value = ""; });
  pressed(tools, "Trace\u2026", "Trace a picture or DXF", () => file.click());
  const holds = Object.entries({
    Place: "drag a point of the picture to where it belongs, or use the arrows",
    Scale: "drag along a length of the picture and type what it is, or use the arrows",
  }).map(([act, title]) => {
    const take = () => { hold = hold === act ? "" : act; draw(); svg.focus(); };
    return [act, Object.assign(pressed(tools, act, `${act} the picture`, take), { title })];
  });
  const opacity = element(tools, "input", "");
  Object.assign(opacity, { type: "range", min: 5, max: 100, value: 50 });
  opacity.setAttribute("aria-label", "opacity of the picture");
  opacity.addEventListener("input", () => draw());
  pressed(tools, "\u00d7", "Remove the picture", () => { trace = null; hold = ""; draw(); });

  function drawGrid(width, height) {
    const step = stepOf(60);
    const lines = put(svg, "g", { class: "grid", "aria-hidden": "true" });
    const [left, top] = metres({ x: 0, y: 0 });
    const [right, bottom] = metres({ x: width, y: height });
    const text = (x) => rounded(x * model.drawing.unit, 6).replace("-", "\u2212");
    for (let k = Math.ceil(left / step); k * step < right; k++) {
      put(lines, "line", { x1: across(k * step), x2: across(k * step), y1: 0, y2: height });
      put(lines, "text", { x: across(k * step) + 3, y: height - 4 }, text(k * step));
    }
    for (let k = Math.ceil(bottom / step); k * step < top; k++) {
      put(lines, "line", { x1: 0, x2: width, y1: down(k * step), y2: down(k * step) });
      put(lines, "text", { x: 3, y: down(k * step) - 3 }, text(k * step));
    }
    put(lines, "text", { x: width - 6, y: 14, "text-anchor": "end" }, `[${model.drawing.length}]`);
  }

  function alongLine(a, b) {
    const n = Math.ceil((Math.hypot(b[0] - a[0], b[1] - a[1]) * view.scale) / 9);
    for (let k = 0; k < n; k++) lined.push([0, 1].map((i) => a[i] + ((b[i] - a[i]) * k) / n));
  }

  // The first of some places of a word where no other word stands, if any, and few links do;
  // areas are [left, top, width, height].
  function roomy(places, area) {
    const free = ([x, y, w, h]) => taken.every(([x2, y2, w2, h2]) =>
      x + w <= x2 || x2 + w2 <= x || y + h <= y2 || y2 + h2 <= y);
    const under = ([x, y, w, h]) => lined.filter((z) =>
      Math.abs(across(z[0]) - x - w / 2) < w / 2 + 5 && Math.abs(down(z[1]) - y - h / 2) < h / 2 + 5).length;
    const able = places.map((one, k) => [under(area(one)) + k / 6, one]).filter(([, one]) => free(area(one)));
    const [, found] = able.reduce((best, one) => (one[0] < best[0] ? one : best), [Infinity]);
    if (found) taken.push(area(found));
    return found;
  }

  function drawPin(one) {
    const { x, y } = shown(one);
    const own = put(svg, "g", { class: "pin", transform: `translate(${x} ${y})`, "data-pin": one.name });
    own.classList.toggle("chosen", model.chosen.includes(one.name));
    own.classList.toggle("driven", one.driven);
    if (one.guide !== null) {
      const turn = `rotate(${(-one.guide * 180) / Math.PI})`;
      put(own, "line", { x1: -34, x2: 34, y1: 12, y2: 12, transform: turn, class: "rail" });
      put(own, "rect", { x: -13, y: -9, width: 26, height: 18, transform: turn, class: "block" });
    }
    if (one.ground && one.guide === null) {
      put(own, "path", { d: "M0 0L-11 17H11Z", class: "ground" });
      put(own, "path", { d: "M-14 17H14M-11 22l5-5M-4 22l5-5M3 22l5-5", class: "hatch" });
    }
    put(own, "circle", { r: 8, class: "ring" });
    if (one.loose) put(own, "path", { d: "M-5-5L5 5M-5 5L5-5", class: "cross" });
    else put(own, "circle", { r: 5, class: "dot" });
    if (one.driven) put(own, "path", { d: "M-13-9A16 16 0 0 1 13-9m1-7l-1 7l-7-1", class: "arrow" });
    const width = 6.8 * one.name.length;
    const tried = [0, 13, 26, 39].flatMap((more) => [[10, -10 - more], [10, 18 + more], [-10 - width, -10 - more],
      [-10 - width, 18 + more], [-width / 2, -18 - more], [-width / 2, 28 + more]]);
    const [dx, dy] = roomy(tried, ([ax, ay]) => [x + ax, y + ay - 11, width, 13]) ?? tried[0];
    put(own, "text", { x: dx, y: dy, class: "name" }, one.name);
  }

  function drawLoad(load) {
    const [x, y] = [across(load.at[0][0]), down(load.at[0][1])];
    if (load.force) {
      const size = Math.hypot(...load.force) || 1;
      const [dx, dy] = [(44 * load.force[0]) / size, (-44 * load.force[1]) / size];
      const turn = (Math.atan2(dy, dx) * 180) / Math.PI;
      const own = put(svg, "g", { class: "force" });
      put(own, "line", { x1: x, y1: y, x2: x + dx, y2: y + dy });
      put(own, "path", { d: "M0 0L-9-4V4Z", transform: `translate(${x + dx} ${y + dy}) rotate(${turn})` });
      put(own, "text", { x: x + dx + 6, y: y + dy + 4 }, load.name);
    } else if (load.at[1]) {
      const [x2, y2] = [across(load.at[1][0]), down(load.at[1][1])];
      const [n, ex, ey] = [14, (x2 - x) / 14, (y2 - y) / 14];
      const size = Math.hypot(x2 - x, y2 - y) || 1;
      const off = (k) => (k < 2 || k > n - 2 ? 0 : (k % 2 ? 7 : -7) / size);
      const points = Array.from({ length: n + 1 }, (_, k) =>
        `${x + ex * k - (y2 - y) * off(k)},${y + ey * k + (x2 - x) * off(k)}`);
      put(svg, "polyline", { points: points.join(" "), class: "spring" });
    }
  }

  function drawDimension(dim) {
    const [a, b] = [pin(dim.a).at, pin(dim.b).at].map((z) => [across(z[0]), down(z[1])]);
    const size = Math.hypot(b[0] - a[0], b[1] - a[1]);
    if (size < 44) return; // no room for a number
    const text = rounded(dim.value * model.drawing.unit);
    const away = 13 + 4 * text.length * Math.abs(b[1] - a[1]) / size; // a number is wide
    const off = [(-(b[1] - a[1]) / size) * away, ((b[0] - a[0]) / size) * away];
    const up = off[1] > 0 ? -1 : 1;
    const middle = (side, share) => [0, 1].map((k) => a[k] + share * (b[k] - a[k]) + side * off[k]);
    const tried = [0.5, 0.3, 0.7].flatMap((share) => [middle(up, share), middle(-up, share)]);
    const [x, y] = roomy(tried, ([cx, cy]) => [cx - 4 * text.length, cy - 8, 8 * text.length, 15]) ?? [];
    if (x === undefined) return; // it has room when the wheel makes the drawing larger
    const name = `distance ${dim.a} to ${dim.b}`;
    number(x, y, text, name, model.drawing.length, {
      value: dim.value * model.drawing.unit, wrong: "is no length; a length is a number above 0", least: 0,
      take: (value) => tell("dimension", { ends: [dim.a, dim.b], value: value / model.drawing.unit }),
    });
  }

  // The angle of the second of two chosen pins from the x axis, or of the last of three about
  // the second from the first.
  function drawAngle() {
    const names = chosen();
    if (names.length < 2 || names.length > 3) return;
    const [m, b] = names.slice(-2).map((name) => pin(name).at);
    const turn = (z) => Math.atan2(z[1] - m[1], z[0] - m[0]);
    const base = names.length === 3 ? turn(pin(names[0]).at) : 0;
    const angle = Math.atan2(Math.sin(turn(b) - base), Math.cos(turn(b) - base));
    const [x0, y0, r] = [across(m[0]), down(m[1]), 36];
    const on = (share, radius) => [x0 + radius * Math.cos(base + share * angle), y0 - radius * Math.sin(base + share * angle)];
    put(svg, "path", { d: `M${on(0, r)}A${r} ${r} 0 0 ${angle > 0 ? 0 : 1} ${on(1, r)}`, class: "arc" });
    const text = `${rounded(angle * model.drawing.degree)}${model.drawing.angle}`;
    const [x, y] = roomy([on(0.5, 58), on(0.5, 78), on(1.4, 58)], ([cx, cy]) => [cx - 20, cy - 8, 40, 15]) ?? on(0.5, 58);
    number(x, y, text, `angle of ${names.join(", ")}`, "", {
      value: angle * model.drawing.degree, wrong: "is no angle", least: -Infinity,
      take: (value) => tell("angle", { pins: names, value: value / model.drawing.degree }),
    });
  }

  // A number of the picture that is edited by a click or with Enter.
  function number(x, y, text, name, unit, given) {
    const change = () => edit(x, y, { ...given, name: `new ${name}${unit && ` in ${unit}`}` });
    const label = put(svg, "text", {
      x, y: y + 4, class: "dimension", tabindex: 0, role: "button", "text-anchor": "middle",
      "aria-label": `${name} ${text} ${unit}`,
    }, text);
    label.addEventListener("pointerdown", (event) => event.stopPropagation());
    label.addEventListener("click", change);
    label.addEventListener("keydown", (event) => {
      if (event.key === "Enter") change();
      event.stopPropagation();
    });
  }

  // A number of the picture, edited where it stands.
  function edit(x, y, { value: old, name, wrong, least, take }) {
    const field = element(box, "input", "edit");
    field.style.left = `${x - 45}px`;
    field.style.top = `${y - 13}px`;
    field.value = rounded(old, 12);
    field.setAttribute("aria-label", name);
    field.select();
    field.focus();
    const end = (done) => {
      const [typed, value] = [field.value, Number(field.value.replace(",", "."))];
      field.onblur = null;
      field.remove();
      svg.focus();
      if (!done || value === Number(rounded(old, 12))) return;
      if (typed && value > least && Number.isFinite(value)) take(value);
      else tell("wrong", { said: `${typed || "nothing"} ${wrong}` });
    };
    field.onblur = () => end(true);
    field.addEventListener("keydown", (event) => {
      if (event.key === "Enter") end(true);
      if (event.key === "Escape") end(false);
      event.stopPropagation();
    });
  }

  // -- gestures ----------------------------------------------------------------------------

  const choose = (names) => { model.chosen = names; draw(); };

  svg.addEventListener("pointerdown", (event) => {
    bubble.hidden = menu.hidden = true;
    pointer = place(event);
    if (!model.drawing.ours || event.button === 2) return;
    svg.focus();
    svg.setPointerCapture(event.pointerId);
    const one = nearest(pointer);
    const link = event.target.dataset?.link;
    const begun = { begun: pointer, text: "", pin: one, link };
    if (event.button === 1) drag = { kind: "pan", last: pointer, ...begun };
    else if (hold) drag = { kind: "link", from: { at: metres(pointer) }, ...begun };
    else if (one && chosen().includes(one.name) && !model.tool) drag = { kind: "move", moved: {}, ...begun };
    else if (one) drag = { kind: "link", from: { pin: one.name, at: one.at }, ...begun };
    else if (link && !model.tool) drag = { kind: "body", moved: {}, ...begun };
    else if (model.pairs.includes(model.tool) || !pins().length)
      drag = { kind: "link", from: { at: aimed(pointer, event).at, on: link ?? null }, ...begun };
    else drag = { kind: "box", ...begun };
    event.preventDefault();
  });

  svg.addEventListener("pointermove", (event) => {
    pointer = place(event);
    if (!drag) return;
    drag.far ||= Math.hypot(pointer.x - drag.begun.x, pointer.y - drag.begun.y) > 4;
    if (!drag.far) return;
    drag.event = { altKey: event.altKey };
    follow();
  });

  function follow() {
    const [p, event] = [pointer, drag.event ?? {}];
    if (drag.kind === "link") {
      drag.to = aimed(p, event, drag.from.at, drag.from.pin);
      const [dx, dy] = [0, 1].map((k) => drag.to.at[k] - drag.from.at[k]);
      const angle = Math.atan2(dy, dx) * model.drawing.degree;
      const now = `${rounded(Math.hypot(dx, dy) * model.drawing.unit)} ${model.drawing.length} @ ${rounded(angle)}${model.drawing.angle}`;
      sayAt(typed, svg, drag.text ? `${drag.text}\u2502  ${now}` : `${now}  \u2013 or type a length`, p);
    } else if (drag.kind === "move" || drag.kind === "body") {
      const names = drag.kind === "move" ? chosen() : model.drawing.links.find((l) => l.name === drag.link)?.pins ?? [];
      const [a, b] = [metres(drag.begun), metres(p)];
      let by = [b[0] - a[0], b[1] - a[1]];
      if (drag.kind === "move") {
        const to = aimed({ x: across(drag.pin.at[0] + by[0]), y: down(drag.pin.at[1] + by[1]) }, event);
        const onto = to.pin && !names.includes(to.pin) ? to.at : null;
        const step = grid();
        const end = onto ?? (event.altKey ? drag.pin.at.map((x, k) => x + by[k])
          : drag.pin.at.map((x, k) => Math.round((x + by[k]) / step) * step));
        by = [end[0] - drag.pin.at[0], end[1] - drag.pin.at[1]];
      }
      drag.moved = Object.fromEntries(names.map((n) => [n, pin(n).at.map((x, k) => Number((x + by[k]).toPrecision(12)))]));
    } else if (drag.kind === "box") drag.now = p;
    else if (drag.kind === "pan")
      [view.x, view.y, drag.last] = [view.x + p.x - drag.last.x, view.y + p.y - drag.last.y, p];
    draw();
  }

  function finish(event) {
    const done = drag;
    if (!done) return;
    [drag, typed.hidden] = [null, true];
    const more = event.ctrlKey || event.shiftKey || event.metaKey;
    if (!done.far && !done.text && !hold) tap(done, more, event);
    else if (done.kind === "link") drawn(done, done.to?.pin || done.text ? null : under(event));
    else if (done.kind === "move" || done.kind === "body") tell("move", { pins: done.moved });
    else if (done.kind === "box" && done.now) {
      const [a, b] = [done.begun, done.now];
      const within = (x, p, q) => x >= Math.min(p, q) && x <= Math.max(p, q);
      const names = pins().filter((one) => within(across(one.at[0]), a.x, b.x) && within(down(one.at[1]), a.y, b.y));
      choose([...new Set([...(more ? chosen() : []), ...names.map((one) => one.name)])]);
    }
    draw();
  }

  function drawn(done, on) {
    if (!done.to) return;
    if (hold) changeTrace(done);
    else tell("draw", { tool: model.tool, from: done.from, to: { ...done.to, on } });
  }

  const under = (event) => svg.getRootNode().elementsFromPoint?.(event.clientX, event.clientY)
      .map((part) => part.dataset?.link).find(Boolean) ?? null;

  function tap(done, more, event) {
    const known = chosen();
    if (done.pin && model.tool && !model.pairs.includes(model.tool)) tell(model.tool, { pins: [done.pin.name] });
    else if (done.pin && more)
      choose(known.includes(done.pin.name) ? known.filter((n) => n !== done.pin.name) : [...known, done.pin.name]);
    else if (done.pin) choose([done.pin.name]);
    else if (done.link && !model.tool)
      choose(model.drawing.links.find((link) => link.name === done.link)?.pins ?? []);
    else if (known.length) choose([]);
    else if (done.kind !== "pan") tell("pin", { at: aimed(done.begun, event).at, on: done.link ?? null });
  }

  svg.addEventListener("pointerup", finish);
  svg.addEventListener("pointercancel", () => { [drag, typed.hidden] = [null, true]; draw(); });
  onWheel(svg, (factor, p) => { zoomed(view, factor, p); draw(); });

  svg.addEventListener("contextmenu", (event) => {
    event.preventDefault();
    pointer = place(event);
    const one = nearest(pointer);
    if (!model.drawing.ours) return;
    if (one && !chosen().includes(one.name)) choose([one.name]);
    open(one ? model.menu : ["Show all"]);
  });

  function open(words) {
    menu.replaceChildren();
    for (const word of words) {
      const item = pressed(menu, word, "", () => {
        menu.hidden = true;
        svg.focus();
        if (word === "Show all") { fit(); draw(); } else tell(word, { pins: chosen() });
      });
      item.setAttribute("role", "menuitem");
    }
    menu.style.transform = `translate(${pointer.x}px, ${pointer.y}px)`;
    menu.hidden = false;
    menu.firstChild?.focus();
  }

  menu.addEventListener("keydown", (event) => {
    const way = { ArrowDown: "nextSibling", ArrowUp: "previousSibling" }[event.key];
    if (way) svg.getRootNode().activeElement?.[way]?.focus();
    if (event.key === "Escape") { menu.hidden = true; svg.focus(); }
    if (way) event.preventDefault();
  });

  // -- keys ----------------------------------------------------------------------------------

  svg.addEventListener("keydown", (event) => {
    const names = chosen();
    if (drag?.kind === "link" && /^[-+.,@\d ]$/.test(event.key)) drag.text += event.key.replace(",", ".");
    else if (drag?.kind === "link" && event.key === "Backspace") drag.text = drag.text.slice(0, -1);
    else if (drag?.kind === "link" && event.key === "Enter") {
      const done = drag;
      [drag, typed.hidden] = [null, true];
      drawn(done, null);
    } else if (event.key === "Escape") {
      if (drag) [drag, typed.hidden] = [null, true];
      else if (hold) hold = "";
      else if (model.tool) model.tool = "";
      else choose([]);
      bubble.hidden = true;
    } else if (ARROWS[event.key] && hold) {
      const [x, y] = ARROWS[event.key];
      if (hold === "Place") trace.at = trace.at.map((z, k) => z + grid() * [x, y][k]);
      else trace.scale *= 1.01 ** (x + y);
    } else if (ARROWS[event.key] && names.length) {
      const step = grid() * (event.shiftKey ? 10 : 1);
      const to = (one) => one.at.map((x, k) => Number((x + step * ARROWS[event.key][k]).toPrecision(12)));
      tell("move", { pins: Object.fromEntries(names.map((n) => [n, to(pin(n))])) });
    } else if ((event.key === "Delete" || event.key === "Backspace") && names.length)
      tell("Delete", { pins: names });
    else if ((event.ctrlKey || event.metaKey) && event.key === "a") choose(pins().map((one) => one.name));
    else if ((event.ctrlKey || event.metaKey) && event.key === "d" && names.length) tell("Copy", { pins: names });
    else if ((event.ctrlKey || event.metaKey) && event.key === "z") tell(event.shiftKey ? "redo" : "undo");
    else if (event.key === "ContextMenu" || (event.shiftKey && event.key === "F10")) {
      const one = names.length ? pin(names[0]) : null;
      if (one) pointer = shown(one);
      open(one ? model.menu : ["Show all"]);
    } else if (event.key === "f") fit();
    else return;
    event.preventDefault();
    event.stopPropagation();
    if (drag?.kind === "link" && drag.far) follow();
    else draw();
  });

  // -- what the server says ------------------------------------------------------------------

  function renew() {
    if (!view.scale || !pins().every(inside)) fit();
    draw();
  }

  for (const step of model.guide) element(guide, "li", "", step);
  for (const name of ["drawing", "chosen", "tool"]) model.on(name, renew);
  model.on("msg:custom", ({ text }) => sayAt(bubble, svg, text, pointer));
  onSize(model, svg, () => {
    if (!pins().length || !view.scale || !pins().every(inside)) fit();
    draw();
  });
  return box;
}
