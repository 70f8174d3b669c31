// The block diagram: what the hand does is drawn here, what it means the server knows.
//
// Places are pixels of a canvas that is moved and scaled as a whole; `drawing` has blocks with
// their handles, and wires with their ways. Every gesture ends in one message {act, ...}.

const NEAR = 16; // px of the screen within which a wire takes hold of a handle
const FAR = 4; // px by which a pointer has moved before it drags
const EDGE = 14; // px around all that is shown
const KINDS = "application/blockmech"; // what the palette gives to a drag

export function render({ model, el }) {
  const box = element(el, "div", "diagram");
  const palette = element(box, "div", "chips");
  const area = element(box, "div", "area");
  const svg = put(area, "svg", { tabindex: 0, role: "application", "aria-label": "block diagram" });
  const all = put(svg, "g", { class: "all" });
  const band = put(svg, "rect", { class: "band", width: 0, height: 0 });
  const tip = element(area, "div", "tip");
  const zoom = element(area, "div", "zoom");
  tip.hidden = true;

  const view = { scale: 1, x: 0, y: 0 };
  let drag = null; // what the hand does now
  let may = {}; // a wire, and why it cannot be or ""
  let ids = "";
  let over = ""; // the wire under the pointer

  const tell = (act, more = {}) => model.send_msg({ act, ...more });
  const blocks = () => model.drawing.blocks;
  const block = (name) => blocks().find((one) => one.id === name);
  const chosen = () => model.chosen;
  const place = (event) => placeIn(svg, event);
  const canvas = ({ x, y }) => ({ x: (x - view.x) / view.scale, y: (y - view.y) / view.scale });
  const at = (one) => drag?.moved?.[one.id] ?? one;

  const show = () => all.setAttribute("transform", `translate(${view.x} ${view.y}) scale(${view.scale})`);

  function fit() {
    const { width, height } = svg.getBoundingClientRect();
    if (!width || !blocks().length) return;
    const ends = blocks().flatMap((b) => [[b.x, b.y], [b.x + b.width, b.y + b.height]]);
    const ways = model.drawing.wires.flatMap((wire) => wire.way);
    const [[left, top], [right, bottom]] = corners([...ends, ...ways]);
    view.scale = Math.min(1, (width - 2 * EDGE) / (right - left), (height - 2 * EDGE) / (bottom - top));
    view.x = (width - (left + right) * view.scale) / 2;
    view.y = (height - (top + bottom) * view.scale) / 2;
    show();
  }

  function zoomBy(factor, p) {
    zoomed(view, Math.min(2, Math.max(0.02, view.scale * factor)) / view.scale, p);
    show();
  }

  // -- the picture -------------------------------------------------------------------------

  function end(side, id) {
    const [name, port] = id;
    const one = block(name);
    const row = one?.[side].findIndex((handle) => handle.id === port) ?? -1;
    if (row < 0) return null;
    const { x, y } = at(one);
    return [x + (side === "outputs" ? one.width : 0), y + (row + 1.5) * model.drawing.row];
  }

  // The way of a wire; of a block that is dragged a plain one until the server has laid it.
  function way(wire) {
    const [a, b] = [end("outputs", wire.from), end("inputs", wire.to)];
    if (!a || !b || !drag?.moved) return wire.way;
    if (!drag.moved[wire.from[0]] && !drag.moved[wire.to[0]]) return wire.way;
    const x = (a[0] + b[0]) / 2;
    return [a, [x, a[1]], [x, b[1]], b];
  }

  const line = (points) => `M${points.map((z) => z.join(" ")).join("L")}`;

  function draw() {
    all.replaceChildren();
    const front = put(all, "g"); // blocks; wires pass before their pale ground, as in print
    for (const one of blocks()) drawBlock(front, one);
    for (const wire of model.drawing.wires) {
      const [d, own] = [line(way(wire)), put(all, "g", { class: "wire", "data-id": wire.id })];
      own.classList.toggle("chosen", chosen().includes(wire.id));
      put(own, "path", { d, class: "wide" });
      put(own, "path", { d, class: "line" });
    }
    if (drag?.from) put(all, "path", { d: line([drag.start, drag.end]), class: "new" });
    show();
  }

  function drawBlock(parent, one) {
    const { x, y } = at(one);
    const own = put(parent, "g", {
      class: `block ${one.kind}`, transform: `translate(${x} ${y})`, "data-id": one.id,
      tabindex: 0, role: "group", "aria-label": one.lines.join(", "),
    });
    own.classList.toggle("bad", one.bad);
    own.classList.toggle("chosen", chosen().includes(one.id));
    put(own, "rect", { width: one.width, height: one.height, rx: 3, class: "body" });
    one.lines.forEach((text, k) => {
      const look = k ? "words" : "name";
      put(own, "text", { x: one.width / 2, y: 18 + 15 * k, class: look, "text-anchor": "middle" }, text);
    });
    for (const [side, x0] of [["inputs", 0], ["outputs", one.width]])
      one[side].forEach((handle, k) => drawHandle(own, one, side, handle, x0, (k + 1.5) * model.drawing.row));
  }

  function drawHandle(parent, one, side, handle, x, y) {
    const into = side === "inputs";
    const word = handle.said ? `${handle.id} \u26a0 ${handle.said}` : handle.id;
    const given = {
      class: `handle ${into ? "target" : "source"}`, "data-block": one.id, "data-port": handle.id,
      role: "img", "aria-label": `${word} (${handle.kind})`,
    };
    const square = handle.kind === "P" || handle.kind === "guide";
    const made = square || handle.kind === "load"
      ? put(parent, "rect", { ...given, x: x - 5, y: y - 5, width: 10, height: 10,
        ...(square ? {} : { transform: `rotate(45 ${x} ${y})` }) })
      : put(parent, "circle", { ...given, cx: x, cy: y, r: into ? 5 : 4 });
    made.classList.toggle("wrong", Boolean(handle.said));
    const name = { x: x + (into ? 10 : -9), y: y + 4, "text-anchor": into ? "start" : "end" };
    put(parent, "text", { ...name, class: "port" }, handle.id);
  }

  // -- what the pointer does -----------------------------------------------------------------

  const under = (event, name) => event.composedPath().find((part) => part.dataset && part.classList.contains(name));
  const handleAt = ({ clientX, clientY }) => svg.getRootNode().elementsFromPoint(clientX, clientY)
    .find((part) => part.classList.contains("handle")); // its wire lies on it
  const handles = (side) => [...all.querySelectorAll(`.handle.${side}`)];

  function middle(handle) {
    const [r, s] = [handle.getBoundingClientRect(), svg.getBoundingClientRect()];
    return { x: r.x + r.width / 2 - s.x, y: r.y + r.height / 2 - s.y };
  }

  function choose(names, more) {
    const known = chosen().filter((name) => !names.includes(name));
    const all_in = names.every((name) => chosen().includes(name));
    model.chosen = more ? [...known, ...(all_in ? [] : names)] : names;
    draw();
  }

  svg.addEventListener("pointerdown", (event) => {
    if (event.button > 1) return;
    const p = place(event);
    const [handle, own, wire] = [handleAt(event), under(event, "block"), under(event, "wire")];
    const begun = { begun: p, more: event.ctrlKey || event.shiftKey || event.metaKey };
    svg.setPointerCapture(event.pointerId);
    hide();
    if (handle && model.drawing.editable && event.button === 0) {
      const z = canvas(middle(handle));
      drag = { kind: "wire", from: handle, start: [z.x, z.y], end: [z.x, z.y], ...begun };
      drag.side = handle.classList.contains("source") ? "target" : "source";
    } else if (own && event.button === 0) drag = { kind: "block", name: own.dataset.id, ...begun };
    else if (wire) drag = { kind: "line", name: wire.dataset.id, ...begun };
    else if (event.shiftKey) drag = { kind: "box", ...begun };
    else drag = { kind: "pan", last: p, ...begun };
  });

  svg.addEventListener("pointermove", (event) => {
    const p = place(event);
    if (!drag) return hover(event);
    if (!drag.far && Math.hypot(p.x - drag.begun.x, p.y - drag.begun.y) < FAR) return;
    drag.far = true;
    if (drag.kind === "pan") {
      [view.x, view.y, drag.last] = [view.x + p.x - drag.last.x, view.y + p.y - drag.last.y, p];
      show();
    } else if (drag.kind === "block" && model.drawing.editable) {
      const names = chosen().includes(drag.name) ? chosen().filter(block) : [drag.name];
      const by = [p.x - drag.begun.x, p.y - drag.begun.y].map((d) => d / view.scale);
      drag.moved = Object.fromEntries(names.map((name) => [name,
        { x: block(name).x + by[0], y: block(name).y + by[1] }]));
      draw();
    } else if (drag.kind === "wire") {
      const onto = closest(handles(drag.side), middle, p, NEAR);
      const z = canvas(onto ? middle(onto) : p);
      drag.end = [z.x, z.y];
      if (onto?.dataset.port !== drag.onto?.port || onto?.dataset.block !== drag.onto?.block) {
        drag.onto = onto ? { ...onto.dataset } : null;
        hide();
        if (onto) tell("may", ends());
      }
      draw();
      judge();
    } else if (drag.kind === "box") {
      drag.box = between(drag.begun, p);
      for (const [key, value] of Object.entries(drag.box)) band.setAttribute(key, value);
    }
  });

  function ends() {
    const both = [drag.from.dataset, drag.onto].map(({ block: b, port }) => `${b}.${port}`);
    const [from, to] = drag.side === "target" ? both : both.reverse();
    return { from, to };
  }

  // What the server has said of the wire that is dragged: whether it may be, or why not.
  function judge() {
    if (drag?.kind !== "wire" || !drag.onto) return;
    const { from, to } = ends();
    if (may.wire !== `${from} -> ${to}`) return;
    const handle = handles(drag.side).find((one) =>
      one.dataset.block === drag.onto.block && one.dataset.port === drag.onto.port);
    handle?.classList.add(may.said ? "refused" : "valid");
    if (may.said) hint(may.said, middle(handle));
  }

  svg.addEventListener("pointerup", (event) => {
    const done = drag;
    if (done?.kind === "wire" && done.onto) tell("wire", ends());
    drag = null;
    if (done?.kind === "box") for (const key of ["width", "height"]) band.setAttribute(key, 0);
    if (!done) return;
    if (!done.far) choose(done.name === undefined ? [] : [done.name], done.more);
    else if (done.moved) {
      for (const [name, z] of Object.entries(done.moved)) Object.assign(block(name), z);
      tell("move", { at: done.moved });
    } else if (done.box) {
      const [low, high] = [done.box, { x: done.box.x + done.box.width, y: done.box.y + done.box.height }].map(canvas);
      choose(blocks().filter((b) => b.x >= low.x && b.y >= low.y && b.x + b.width <= high.x
        && b.y + b.height <= high.y).map((b) => b.id), done.more);
    }
    if (!done.far && done.kind === "block") tell("select", { name: done.name });
    draw();
    svg.focus();
    event.preventDefault();
  });
  svg.addEventListener("pointercancel", () => { drag = null; draw(); });
  svg.addEventListener("pointerleave", () => { if (!drag) hide(); });
  onWheel(svg, zoomBy);

  function hover(event) {
    const [wire, handle] = [under(event, "wire")?.dataset.id ?? "", handleAt(event)];
    if (handle?.classList.contains("wrong")) hint(handle.getAttribute("aria-label"), place(event));
    else if (wire !== over && wire) tell("hover", { wire, at: place(event) });
    else if (!wire) hide();
    over = wire;
  }

  const hint = (text, p) => sayAt(tip, svg, text, p);

  function hide() { tip.hidden = true; }

  // -- palette, keys, and what the server says -----------------------------------------------

  for (const [kind, family, words, why] of model.kinds) {
    const chip = pressed(palette, words, `Add ${words}`, () => tell("add", { kind, at: null }));
    Object.assign(chip, { className: family, draggable: true, title: why || kind, disabled: Boolean(why) });
    chip.dataset.kind = kind;
    chip.addEventListener("dragstart", (event) => event.dataTransfer.setData(KINDS, kind));
  }
  svg.addEventListener("dragover", (event) => event.preventDefault());
  svg.addEventListener("drop", (event) => {
    event.preventDefault();
    const kind = event.dataTransfer.getData(KINDS);
    if (kind) tell("add", { kind, at: canvas(place(event)) });
  });

  const centre = () => ({ x: area.clientWidth / 2, y: area.clientHeight / 2 });
  const buttons = [["+", "Zoom in", () => zoomBy(1.25, centre())],
    ["\u2212", "Zoom out", () => zoomBy(0.8, centre())], ["\u2922", "Fit View", fit],
    ["Lay out", "", () => tell("lay out")],
    ["Duplicate", "Duplicate block", () => tell("duplicate", { names: chosen() })],
    ["Delete", "Delete block", () => tell("delete", { names: chosen() })]];
  for (const [text, name, act] of buttons) pressed(zoom, text, name, act);

  svg.addEventListener("keydown", (event) => {
    const focused = under(event, "block")?.dataset.id;
    const names = chosen().length ? chosen() : focused ? [focused] : [];
    const command = event.ctrlKey || event.metaKey;
    if ((event.key === "Enter" || event.key === " ") && focused) {
      choose([focused], event.shiftKey);
      tell("select", { name: focused });
      [...all.querySelectorAll(".block")].find((one) => one.dataset.id === focused)?.focus();
    } else if (event.key === "Escape") { choose([]); hide(); }
    else if (event.key === "f") fit();
    else if (command && event.key === "a") choose(blocks().map((one) => one.id));
    else if (command && event.key === "z") tell(event.shiftKey ? "redo" : "undo");
    else if (!model.drawing.editable || !names.length) return;
    else if (event.key === "Delete" || event.key === "Backspace") tell("delete", { names });
    else if (command && event.key === "d") tell("duplicate", { names });
    else if (ARROWS[event.key]) {
      const step = model.drawing.row / (event.shiftKey ? 1 : 4);
      const [dx, dy] = [step * ARROWS[event.key][0], -step * ARROWS[event.key][1]];
      const moved = names.filter(block).map((name) => [name, { x: block(name).x + dx, y: block(name).y + dy }]);
      tell("move", { at: Object.fromEntries(moved) });
    } else return;
    event.preventDefault();
    event.stopPropagation();
  });

  function renew() {
    palette.hidden = !model.drawing.editable;
    const { width, height } = svg.getBoundingClientRect();
    const now = blocks().map((one) => one.id).join();
    const [low, high] = [canvas({ x: 0, y: 0 }), canvas({ x: width, y: height })];
    const inside = (b) => b.x >= low.x && b.y >= low.y && b.x + b.width <= high.x && b.y + b.height <= high.y;
    if (now !== ids && (!ids || !blocks().every(inside))) fit();
    ids = now;
    draw();
    judge();
  }

  model.on("drawing", renew);
  model.on("chosen", draw);
  model.on("msg:custom", (data) => {
    if (data.wire) { may = data; judge(); } else hint(data.text, data.at);
  });
  let known = 0;
  onSize(model, svg, ({ width }) => {
    if (width && width !== known) { [known, ids] = [width, ""]; renew(); }
  });
  return box;
}
