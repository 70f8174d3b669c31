// The mechanism in motion: all poses are here, so that the slider and Play need no server.
//
// `drawing` has layers of shapes whose places are points of the page around a `middle` [m];
// `view` maps metres to the pixels of the canvas. What the hand means is sent, one message at a
// time: while the server has not answered, only the newest is kept.

const GRIP = 14; // px within which a pointer takes hold of a joint
const ROOM = 36; // px around all that moves, in which names stand
const FEW = 0.6; // of the scale that shows all, below which the view fits again
const CLOSE = 1.02; // of the scale that the layers were made for

// Which of n poses is shown after a share of a whole motion: round, or to and fro.
export function frameAt(share, n, forward) {
  const k = Math.floor(share * n);
  return forward ? k % n : n - 1 - Math.abs(n - 1 - (k % Math.max(2 * n - 2, 1)));
}

export function render({ model, el }) {
  const box = element(el, "div", "mechanism");
  const area = element(box, "div", "area");
  const canvas = element(area, "canvas", "picture");
  canvas.setAttribute("role", "img");
  canvas.tabIndex = 0;
  const bar = element(box, "div", "bar");
  const play = pressed(bar, "", "", () => toggle(!playing));
  play.className = "play";
  const slider = ranged(bar, "Pose");
  const drivers = element(box, "div", "drivers");
  const caption = element(box, "div", "caption");
  const pen = canvas.getContext("2d");
  const colours = getComputedStyle(box);

  const view = { scale: 0, x: 0, y: 0 };
  let pose = model.pose;
  let begun = 0; // ms, when pose 0 would have been shown; while it plays
  let playing = false;
  let drag = null;
  let [busy, next, asked] = [false, null, null]; // asked: the pose that an act on its way asks for
  let size = { width: 0, height: 0 };
  let rows = []; // of the sliders of several drivers

  const n = () => model.drawing.samples;
  const across = (x) => view.x + x * view.scale;
  const down = (y) => view.y - y * view.scale;

  function ranged(parent, name) {
    const label = element(parent, "label", "", `${name} `);
    const input = element(label, "input", "");
    Object.assign(input, { type: "range", min: 0, step: 1 });
    return input;
  }

  function send(act, more) {
    if (busy) next = [act, more];
    else {
      [busy, asked] = [true, more.pose];
      model.send_msg({ act, seen: model.pose, ...more });
    }
  }

  model.on("done", () => {
    const waiting = next;
    [busy, asked, next] = [false, null, null];
    if (waiting) send(...waiting);
  });

  function stand(k) {
    pose = k;
    slider.value = k;
    for (const { input, values } of rows) input.value = values[k];
    draw();
  }

  function show(k) {
    stand(k);
    if (k !== model.pose || next) send("pose", { pose: k });
  }

  // -- the view ----------------------------------------------------------------------------

  function whole() {
    const [[left, low], [right, high]] = model.drawing.bounds;
    const room = [size.width - 2 * ROOM, size.height - 2 * ROOM].map((x) => Math.max(x, 40));
    const scales = [room[0] / (right - left), room[1] / (high - low)].filter(Number.isFinite);
    const scale = scales.length ? Math.min(...scales) : 1;
    return { scale, x: size.width / 2 - ((left + right) / 2) * scale, y: size.height / 2 + ((low + high) / 2) * scale };
  }

  function fit() {
    if (!model.drawing.bounds || !size.width) return;
    Object.assign(view, whole());
    draw();
    told();
  }

  let later = null;
  function told() {
    clearTimeout(later);
    const made = model.drawing.unit * view.scale * model.drawing.pixels;
    const off = Math.max(made, 1 / made);
    if (off > CLOSE) later = setTimeout(() => send("scale", { scale: view.scale }), 120);
  }

  function kept() {
    if (!view.scale) return false;
    const [[left, low], [right, high]] = model.drawing.bounds;
    const inside = across(left) >= 0 && across(right) <= size.width && down(high) >= 0 && down(low) <= size.height;
    return inside && view.scale >= FEW * whole().scale;
  }

  // -- the picture -------------------------------------------------------------------------

  function draw() {
    pen.clearRect(0, 0, size.width, size.height);
    if (!view.scale) return;
    grid();
    const [x0, y0] = [across(model.drawing.middle[0]), down(model.drawing.middle[1])];
    const k = model.drawing.unit * view.scale;
    for (const layer of model.drawing.layers) paint(layer, x0, y0, k);
    if (drag?.name !== undefined) ring(drag.at);
    pen.fillStyle = colours.getPropertyValue("--bm-ink");
    pen.textAlign = "left";
    pen.fillText(model.drawing.words, 6, size.height - 20);
  }

  function grid() {
    const { length, factor } = model.drawing;
    const step = nice((64 / view.scale) * factor) / factor;
    pen.lineWidth = 1;
    pen.font = '11px system-ui, "DejaVu Sans", sans-serif';
    pen.textBaseline = "alphabetic";
    const [line, grey] = ["--bm-pale", "--bm-grey"].map((name) => colours.getPropertyValue(name));
    const text = (x) => rounded(x * factor, 6).replace("-", "\u2212");
    const lines = (from, to, put_) => { for (let i = Math.ceil(from / step); i * step <= to; i++) put_(i * step); };
    pen.strokeStyle = line;
    pen.fillStyle = grey;
    pen.textAlign = "left";
    pen.beginPath();
    lines(-view.x / view.scale, (size.width - view.x) / view.scale, (x) => {
      pen.moveTo(Math.round(across(x)) + 0.5, 0);
      pen.lineTo(Math.round(across(x)) + 0.5, size.height);
      pen.fillText(text(x), across(x) + 3, size.height - 4);
    });
    lines((view.y - size.height) / view.scale, view.y / view.scale, (y) => {
      pen.moveTo(0, Math.round(down(y)) + 0.5);
      pen.lineTo(size.width, Math.round(down(y)) + 0.5);
      if (down(y) < size.height - 24) pen.fillText(text(y), 3, down(y) - 3);
    });
    pen.stroke();
    pen.textAlign = "right";
    pen.fillText(`[${length}]`, size.width - 5, 13);
  }

  function paint({ glyph, places, looks, starts, offsets, count }, x0, y0, k) {
    const row = places.length > 2 * count ? pose * 2 * count : 0;
    let shape = 0; // of which all points are carried by one place
    const at = offsets ? (i, c) => places[row + 2 * shape + c] + offsets[2 * i + c] : (i, c) => places[row + 2 * i + c];
    const x = (i) => x0 + at(i, 0) * k;
    const y = (i) => y0 - at(i, 1) * k;
    pen.lineJoin = "round";
    looks.name.forEach((_, i) => {
      shape = i;
      const [from, to] = starts.length ? [starts[i], starts[i + 1]] : [i, i + 1];
      if (glyph === "text") return write(looks.text[i], looks.text_color[i], x(i), y(i));
      pen.beginPath();
      let on = false;
      for (let j = from; j < to; j++) {
        if (Number.isNaN(at(j, 0))) on = false;
        else if (glyph === "scatter") pen.arc(x(j), y(j), looks.size[i] / 2, 0, 2 * Math.PI);
        else if (on) pen.lineTo(x(j), y(j));
        else {
          pen.moveTo(x(j), y(j));
          on = true;
        }
      }
      if (glyph === "patches" && on) pen.closePath();
      if (looks.fill_color && looks.fill_color[i] !== "transparent") {
        pen.fillStyle = looks.fill_color[i];
        pen.fill();
      }
      pen.strokeStyle = looks.line_color[i];
      pen.lineWidth = looks.line_width[i];
      pen.setLineDash(looks.line_dash[i] === "solid" ? [] : looks.line_dash[i].split(" ").map(Number));
      if (looks.line_width[i] > 0) pen.stroke(); // the pen would keep the width before
    });
    pen.setLineDash([]);
  }

  function write(words, colour, x, y) {
    pen.font = '12px system-ui, "DejaVu Sans", sans-serif';
    [pen.textAlign, pen.textBaseline] = ["center", "middle"];
    pen.strokeStyle = colours.getPropertyValue("--bm-paper");
    pen.lineWidth = 3;
    pen.strokeText(words, x, y);
    pen.fillStyle = colour;
    pen.fillText(words, x, y);
  }

  function ring({ x, y }) {
    pen.beginPath();
    pen.arc(x, y, 9, 0, 2 * Math.PI);
    pen.strokeStyle = colours.getPropertyValue("--bm-blue");
    pen.lineWidth = 3;
    pen.stroke();
  }

  // -- what the pointer does -----------------------------------------------------------------

  const place = (event) => placeIn(canvas, event);

  // Where a place [m] is on the screen, and where joints are: for tests and for other tools.
  canvas.screen = ([x, y]) => {
    const { x: left, y: top } = canvas.getBoundingClientRect();
    return [left + across(x), top + down(y)];
  };

  function nearest(p) {
    const rings = model.drawing.layers.at(-1);
    const { middle: [x0, y0], unit, held } = model.drawing;
    const joints = (held && rings?.looks.name) || [];
    return closest(joints.map((name, i) => {
      const j = 2 * (pose * rings.count + i);
      return { name, at: { x: across(x0 + rings.places[j] * unit), y: down(y0 + rings.places[j + 1] * unit) } };
    }), (one) => one.at, p, GRIP);
  }

  canvas.addEventListener("pointerdown", (event) => {
    const p = place(event);
    canvas.setPointerCapture(event.pointerId);
    drag = { begun: p, last: p, ...(event.button === 0 ? nearest(p) : null) };
  });
  canvas.addEventListener("pointermove", (event) => {
    const p = place(event);
    if (!drag) canvas.style.cursor = nearest(p) ? "grab" : "default";
    else if (drag.name === undefined) {
      [view.x, view.y, drag.last] = [view.x + p.x - drag.last.x, view.y + p.y - drag.last.y, p];
      draw();
    } else {
      drag.far ||= Math.hypot(p.x - drag.begun.x, p.y - drag.begun.y) > 3;
      if (drag.far) drag.at = p;
      draw();
    }
  });
  canvas.addEventListener("pointerup", () => {
    const done = drag;
    drag = null;
    if (done?.far) {
      const to = [(done.at.x - view.x) / view.scale, (view.y - done.at.y) / view.scale];
      send("drag", { name: done.name, to, pose });
    }
    draw();
  });
  canvas.addEventListener("pointercancel", () => { drag = null; draw(); });
  canvas.addEventListener("dblclick", fit);
  onWheel(canvas, (factor, p) => { zoomed(view, factor, p); draw(); told(); });
  canvas.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (by && n()) show((pose + by + n()) % n());
    else if (event.key === "f") fit();
    else if (event.key === " ") toggle(!playing);
    else return;
    event.preventDefault();
  });

  // -- motion --------------------------------------------------------------------------------

  function toggle(on) {
    playing = on && n() > 1;
    play.textContent = playing ? "\u275a\u275a Pause" : "\u25b6 Play";
    play.setAttribute("aria-pressed", playing);
    begun = performance.now() - (pose / n()) * 1e3 * model.drawing.seconds;
    if (playing) requestAnimationFrame(tick);
  }

  function tick(now) {
    if (!playing || !box.isConnected) return;
    const { samples, forward, seconds } = model.drawing;
    const k = frameAt(Math.max(now - begun, 0) / 1e3 / seconds, samples, forward);
    if (k !== pose) show(k);
    requestAnimationFrame(tick);
  }

  slider.addEventListener("input", () => show(Number(slider.value)));

  function sliders() {
    if (rows.map(({ name }) => name).join() !== model.drivers.map(({ name }) => name).join()) {
      drivers.replaceChildren();
      rows = model.drivers.map(({ name }) => {
        const input = ranged(drivers, "");
        const row = { name, input, label: input.parentNode.firstChild };
        input.addEventListener("input", () => send("drive", { driver: name, value: Number(input.value) }));
        return row;
      });
    }
    model.drivers.forEach(({ label, start, end, values, disabled }, i) => {
      Object.assign(rows[i], { values });
      rows[i].label.textContent = `${label} `;
      Object.assign(rows[i].input, { min: start, max: end, step: (end - start) / 360 || 1, disabled, value: values[pose] });
    });
  }

  // -- what the server says ------------------------------------------------------------------

  function renew() {
    const last = Math.max(n() - 1, 0);
    pose = Math.min(pose, last);
    Object.assign(slider, { max: Math.max(last, 1), disabled: !last, value: pose });
    play.disabled = !last;
    canvas.dataset.length = model.drawing.length;
    if (!last) toggle(false);
    if (model.drawing.bounds && size.width && !kept()) fit();
    if (!model.drawing.bounds) view.scale = 0;
    draw();
  }

  function say() {
    caption.replaceChildren();
    for (const [words, wrong] of model.said) element(caption, wrong ? "b" : "span", "", words);
    canvas.setAttribute("aria-label", `mechanism: ${model.said.map(([words]) => words).join("; ")}`);
  }

  model.on("drawing", renew);
  model.on("drivers", sliders);
  model.on("said", say);
  model.on("pose", () => {
    if (playing || model.pose === pose || model.pose === asked || (next && next[0] !== "pose")) return;
    next = null; // what is shown now, by a tap on a curve, say, is later than a pose that waits
    stand(model.pose);
  });
  onSize(model, area, ({ width, height }) => {
    const ratio = window.devicePixelRatio || 1;
    [canvas.width, canvas.height] = [width * ratio, height * ratio];
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    const before = size.width;
    size = { width, height };
    if (before && view.scale) view.x += (width - before) / 2;
    if (width) renew();
  });
  toggle(false);
  sliders();
  say();
  renew();
  return box;
}
