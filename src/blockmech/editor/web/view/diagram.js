// The block diagram: what the hand does is drawn here, what it means the server knows.
//
// Places are pixels of a canvas that is moved and scaled as a whole; the diagram has blocks with
// their handles, and wires with their ways. Every gesture ends in one act.

import { ask } from "../api.js";
import { between, closest, corners, zoomed } from "../../../exchange/page/web/geometry.js";
import { ARROWS } from "../lib/keys.js";
import { asked, edit, follow, set, store } from "../state.js";
import { button, element, pixelIn, put, sayAt } from "../../../exchange/page/web/dom.js";

/** @typedef {import("../../../exchange/page/web/geometry.js").Pixel} Pixel */
/** @typedef {{id: string, kind: string, said: string}} Handle */
/** @typedef {{id: string, kind: string, bad: boolean, lines: string[], inputs: Handle[], outputs: Handle[], x: number, y: number, width: number, height: number}} Block */
/** @typedef {{id: string, from: [string, string], to: [string, string], way: [number, number][]}} Wire */

const NEAR = 16; // px of the screen within which a wire takes hold of a handle
const FAR = 4; // px by which a pointer has moved before it drags
const EDGE = 14; // px around all that is shown
const KINDS = "application/blockmech"; // what the palette gives to a drag

/** @param {HTMLElement} parent */
export function diagramView(parent) {
  const palette = element(parent, "div", "palette");
  const area = element(parent, "div", "canvas diagram");
  const svg = put(area, "svg", { tabindex: 0, role: "application", "aria-label": "block diagram" });
  const all = put(svg, "g", { class: "all" });
  const band = put(svg, "rect", { class: "box", width: 0, height: 0 });
  const tip = element(area, "div", "bubble tip");
  const zoom = element(area, "div", "zoom");
  tip.hidden = true;

  let view = { scale: 1, x: 0, y: 0 };
  /** @type {any} */
  let drag = null; // what the hand does now
  /** @type {{blocks: Block[], wires: Wire[], editable: boolean, row: number, pixels: number}} */
  let shown = { blocks: [], wires: [], editable: false, row: 20, pixels: 1 };
  let may = { wire: "", said: "" }; // a wire, and why it cannot be or ""
  let over = ""; // the wire under the pointer
  let drawnSheet = "";
  let ids = "";

  const block = (/** @type {string} */ name) => shown.blocks.find((one) => one.id === name);
  const canvas = (/** @type {Pixel} */ { x, y }) => ({ x: (x - view.x) / view.scale, y: (y - view.y) / view.scale });
  const at = (/** @type {Block} */ one) => drag?.moved?.[one.id] ?? one;
  const points = (/** @type {Pixel} */ { x, y }) => [x / shown.pixels, y / shown.pixels]; // [pt] of a file's view
  const places = () => Object.fromEntries(shown.blocks.map((one) => [one.id, points(one)]));
  const place = () => all.setAttribute("transform", `translate(${view.x} ${view.y}) scale(${view.scale})`);

  function fit() {
    const { clientWidth: width, clientHeight: height } = area;
    if (!width || !shown.blocks.length) return;
    const ends = shown.blocks.flatMap((b) => /** @type {[number, number][]} */ ([[b.x, b.y], [b.x + b.width, b.y + b.height]]));
    const [[left, top], [right, bottom]] = corners([...ends, ...shown.wires.flatMap((wire) => wire.way)]);
    const scale = Math.min(1, (width - 2 * EDGE) / (right - left), (height - 2 * EDGE) / (bottom - top));
    view = { scale, x: (width - (left + right) * scale) / 2, y: (height - (top + bottom) * scale) / 2 };
    place();
  }

  /** @param {number} by @param {Pixel} p */
  function zoomBy(by, p) {
    view = zoomed(view, Math.min(2, Math.max(0.02, view.scale * by)) / view.scale, p);
    place();
  }

  // -- the picture -------------------------------------------------------------------------

  /** @param {"inputs" | "outputs"} side @param {[string, string]} id @returns {[number, number] | null} */
  function end(side, [name, port]) {
    const one = block(name);
    const row = one?.[side].findIndex((handle) => handle.id === port) ?? -1;
    if (!one || row < 0) return null;
    const { x, y } = at(one);
    return [x + (side === "outputs" ? one.width : 0), y + (row + 1.5) * shown.row];
  }

  /** The way of a wire; of a block that is dragged a plain one until the server has laid it. @param {Wire} wire @returns {[number, number][]} */
  function way(wire) {
    const [a, b] = [end("outputs", wire.from), end("inputs", wire.to)];
    if (!a || !b || !(drag?.moved?.[wire.from[0]] || drag?.moved?.[wire.to[0]])) return wire.way;
    const x = (a[0] + b[0]) / 2;
    return [a, [x, a[1]], [x, b[1]], b];
  }

  const line = (/** @type {[number, number][]} */ points_) => `M${points_.map((z) => z.join(" ")).join("L")}`;

  function draw() {
    all.replaceChildren();
    const front = put(all, "g"); // blocks; wires pass before their pale ground, as in print
    for (const one of shown.blocks) drawBlock(front, one);
    for (const wire of shown.wires) {
      const [d, own] = [line(way(wire)), put(all, "g", { class: "wire", "data-id": wire.id })];
      own.classList.toggle("chosen", store.chosen.includes(wire.id));
      put(own, "path", { d, class: "wide" });
      put(own, "path", { d, class: "line" });
    }
    if (drag?.from) put(all, "path", { d: line([drag.start, drag.end]), class: "new" });
    place();
  }

  /** @param {Element} front @param {Block} one */
  function drawBlock(front, one) {
    const { x, y } = at(one);
    const own = put(front, "g", {
      class: `block ${one.kind}`, transform: `translate(${x} ${y})`, "data-id": one.id, tabindex: 0, role: "group", "aria-label": one.lines.join(", "),
    });
    own.classList.toggle("bad", one.bad);
    own.classList.toggle("chosen", store.chosen.includes(one.id));
    put(own, "rect", { width: one.width, height: one.height, rx: 3, class: "body" });
    one.lines.forEach((text, k) => put(own, "text", { x: one.width / 2, y: 18 + 15 * k, class: k ? "words" : "title", "text-anchor": "middle" }, text));
    for (const side of /** @type {("inputs" | "outputs")[]} */ (["inputs", "outputs"]))
      one[side].forEach((handle, k) => drawHandle(own, one, side, handle, side === "inputs" ? 0 : one.width, (k + 1.5) * shown.row));
  }

  /** @param {Element} own @param {Block} one @param {string} side @param {Handle} handle @param {number} x @param {number} y */
  function drawHandle(own, one, side, handle, x, y) {
    const into = side === "inputs";
    const word = handle.said ? `${handle.id} \u26a0 ${handle.said}` : handle.id;
    const given = {
      class: `handle ${into ? "target" : "source"}`, "data-block": one.id, "data-port": handle.id, role: "img", "aria-label": `${word} (${handle.kind})`,
    };
    const square = handle.kind === "P" || handle.kind === "guide";
    /** @type {Record<string, string>} */
    const turned = square ? {} : { transform: `rotate(45 ${x} ${y})` };
    const made = square || handle.kind === "load"
      ? put(own, "rect", { ...given, x: x - 5, y: y - 5, width: 10, height: 10, ...turned })
      : put(own, "circle", { ...given, cx: x, cy: y, r: into ? 5 : 4 });
    made.classList.toggle("wrong", Boolean(handle.said));
    put(own, "text", { x: x + (into ? 10 : -9), y: y + 4, "text-anchor": into ? "start" : "end", class: "port" }, handle.id);
  }

  // -- what the pointer does -----------------------------------------------------------------

  /** @param {Event} event @param {string} name */
  const under = (event, name) => /** @type {SVGElement | undefined} */ (event.composedPath().find((part) => part instanceof SVGElement && part.classList.contains(name)));
  /** @param {PointerEvent} event */
  const handleAt = ({ clientX, clientY }) => /** @type {SVGElement | undefined} */ (document.elementsFromPoint(clientX, clientY).find((part) => part.classList.contains("handle")));
  const handles = (/** @type {string} */ side) => /** @type {SVGElement[]} */ ([...all.querySelectorAll(`.handle.${side}`)]);

  /** @param {Element} handle */
  function middle(handle) {
    const [r, s] = [handle.getBoundingClientRect(), svg.getBoundingClientRect()];
    return { x: r.x + r.width / 2 - s.x, y: r.y + r.height / 2 - s.y };
  }

  /** @param {string[]} names @param {boolean} more */
  function choose(names, more = false) {
    const known = store.chosen.filter((name) => !names.includes(name));
    const every = names.every((name) => store.chosen.includes(name));
    const part = names.length === 1 && block(names[0]) && shown.editable ? ["blocks", names[0]] : [];
    set({ chosen: more ? [...known, ...(every ? [] : names)] : names, ...(more ? {} : { part }) });
  }

  svg.addEventListener("pointerdown", (event) => {
    if (event.button > 1) return;
    const p = pixelIn(svg, event);
    const [handle, own, wire] = [handleAt(event), under(event, "block"), under(event, "wire")];
    const begun = { begun: p, more: event.ctrlKey || event.shiftKey || event.metaKey };
    svg.setPointerCapture(event.pointerId);
    tip.hidden = true;
    if (handle && shown.editable && event.button === 0) {
      const z = canvas(middle(handle));
      drag = { kind: "wire", from: handle.dataset, start: [z.x, z.y], end: [z.x, z.y], ...begun };
      drag.side = handle.classList.contains("source") ? "target" : "source";
    } else if (own && event.button === 0) drag = { kind: "block", name: own.dataset.id, ...begun };
    else if (wire) drag = { kind: "line", name: wire.dataset.id, ...begun };
    else drag = { kind: event.shiftKey ? "box" : "pan", last: p, ...begun };
  });

  svg.addEventListener("pointermove", (event) => {
    const p = pixelIn(svg, event);
    if (!drag) return void hover(event);
    if (!drag.far && Math.hypot(p.x - drag.begun.x, p.y - drag.begun.y) < FAR) return;
    drag.far = true;
    if (drag.kind === "pan") {
      view = { ...view, x: view.x + p.x - drag.last.x, y: view.y + p.y - drag.last.y };
      drag.last = p;
      place();
    } else if (drag.kind === "block" && shown.editable) {
      const names = store.chosen.includes(drag.name) ? store.chosen.filter(block) : [drag.name];
      const [dx, dy] = [(p.x - drag.begun.x) / view.scale, (p.y - drag.begun.y) / view.scale];
      drag.moved = Object.fromEntries(names.map((name) => {
        const one = /** @type {Block} */ (block(name));
        return [name, { x: one.x + dx, y: one.y + dy }];
      }));
      draw();
    } else if (drag.kind === "wire") {
      const onto = closest(handles(drag.side), middle, p, NEAR);
      const z = canvas(onto ? middle(onto) : p);
      drag.end = [z.x, z.y];
      if (onto?.dataset.port !== drag.onto?.port || onto?.dataset.block !== drag.onto?.block) {
        drag.onto = onto ? { ...onto.dataset } : null;
        tip.hidden = true;
        if (onto) allowed(ends());
      }
      draw();
      judge();
    } else if (drag.kind === "box") {
      drag.box = between(drag.begun, p);
      for (const [key, value] of Object.entries(drag.box)) band.setAttribute(key, String(value));
    }
  });

  function ends() {
    const both = [drag.from, drag.onto].map(({ block: b, port }) => `${b}.${port}`);
    const [from, to] = drag.side === "target" ? both : both.reverse();
    return { from, to };
  }

  /** @param {{from: string, to: string}} wire */
  async function allowed(wire) {
    const { said } = await ask(`documents/${store.id}/wire`, { ...wire, may: true });
    may = { wire: `${wire.from} -> ${wire.to}`, said };
    judge();
  }

  // What the server has said of the wire that is dragged: whether it may be, or why not.
  function judge() {
    if (drag?.kind !== "wire" || !drag.onto) return;
    const { from, to } = ends();
    if (may.wire !== `${from} -> ${to}`) return;
    const handle = handles(drag.side).find((one) => one.dataset.block === drag.onto.block && one.dataset.port === drag.onto.port);
    handle?.classList.add(may.said ? "refused" : "valid");
    if (may.said && handle) sayAt(tip, svg, may.said, middle(handle));
  }

  svg.addEventListener("pointerup", (event) => {
    const done = drag;
    if (done?.kind === "wire" && done.onto) edit({ act: "wire", ...ends() });
    drag = null;
    if (!done) return;
    if (done.kind === "box") for (const key of ["width", "height"]) band.setAttribute(key, "0");
    if (!done.far) choose(done.name === undefined ? [] : [done.name], done.more);
    else if (done.moved) {
      for (const [name, z] of Object.entries(done.moved)) Object.assign(/** @type {Block} */ (block(name)), z);
      arrange(Object.keys(done.moved));
    } else if (done.box) {
      const [low, high] = [done.box, { x: done.box.x + done.box.width, y: done.box.y + done.box.height }].map(canvas);
      choose(shown.blocks.filter((b) => b.x >= low.x && b.y >= low.y && b.x + b.width <= high.x && b.y + b.height <= high.y).map((b) => b.id), done.more);
    }
    draw();
    svg.focus();
    event.preventDefault();
  });
  svg.addEventListener("pointercancel", () => { drag = null; draw(); });
  svg.addEventListener("pointerleave", () => { if (!drag) tip.hidden = true; });
  svg.addEventListener("wheel", (event) => { zoomBy(Math.exp(-event.deltaY / 500), pixelIn(svg, event)); event.preventDefault(); }, { passive: false });

  const arrange = (/** @type {string[]} */ names) => edit({ act: "arrange", names, places: places() });

  /** @param {PointerEvent} event */
  async function hover(event) {
    const [wire, handle] = [under(event, "wire")?.dataset.id ?? "", handleAt(event)];
    const p = pixelIn(svg, event);
    if (handle?.classList.contains("wrong")) sayAt(tip, svg, handle.getAttribute("aria-label") ?? "", p);
    else if (!wire) tip.hidden = true;
    if (wire === over) return;
    over = wire;
    if (!wire || !store.sheet?.motion) return;
    const [from, to] = wire.split(" -> ");
    const { said } = await ask(`documents/${store.id}/wire`, { ...asked(), from, to, pose: store.pose ?? 0 });
    if (over === wire) sayAt(tip, svg, said, p);
  }

  // -- palette, keys, and what the server says -----------------------------------------------

  const add = (/** @type {string} */ kind, /** @type {number[] | null} */ where) => edit({ act: "add", kind, at: where, places: places() });
  const offer = (/** @type {[string, string, string, string]} */ [kind, family, words, why]) => {
    const chip = button(palette, words, () => add(kind, null), why || kind);
    Object.assign(chip, { className: family, draggable: true, disabled: Boolean(why) });
    chip.setAttribute("aria-label", `Add ${words}`);
    chip.dataset.kind = kind;
    chip.addEventListener("dragstart", (event) => event.dataTransfer?.setData(KINDS, kind));
  };
  svg.addEventListener("dragover", (event) => event.preventDefault());
  svg.addEventListener("drop", (event) => {
    event.preventDefault();
    const kind = event.dataTransfer?.getData(KINDS);
    if (kind) add(kind, points(canvas(pixelIn(svg, event))));
  });

  const centre = () => ({ x: area.clientWidth / 2, y: area.clientHeight / 2 });
  const act = (/** @type {string} */ name) => edit({ act: name, names: store.chosen, places: places() });
  button(zoom, "+", () => zoomBy(1.25, centre()), "zoom in");
  button(zoom, "\u2212", () => zoomBy(0.8, centre()), "zoom out");
  button(zoom, "Fit", fit, "show all");
  button(zoom, "Lay out", () => act("lay out"));
  button(zoom, "Duplicate", () => act("duplicate"), "duplicate block");
  button(zoom, "Delete", () => act("delete blocks"), "delete block");

  /** @param {string} name @param {KeyboardEvent} event */
  function command(name, event) {
    const focused = document.activeElement?.closest(".block")?.getAttribute("data-id");
    const names = store.chosen.length ? store.chosen : focused ? [focused] : [];
    if (name === "escape") { choose([]); tip.hidden = true; }
    else if (name === "fit") fit();
    else if (name === "all") set({ chosen: shown.blocks.map((one) => one.id) });
    else if (!shown.editable || !names.length) return false;
    else if (name === "delete") edit({ act: "delete blocks", names });
    else if (name === "copy") edit({ act: "duplicate", names, places: places() });
    else if (name === "arrow") {
      const step = shown.row / (event.shiftKey ? 1 : 4);
      const [dx, dy] = [step * ARROWS[event.key][0], -step * ARROWS[event.key][1]];
      for (const own of names.map(block)) if (own) Object.assign(own, { x: own.x + dx, y: own.y + dy });
      arrange(names.filter(block));
    } else return false;
    return true;
  }

  svg.addEventListener("keydown", (event) => {
    const focused = under(event, "block")?.dataset.id;
    if ((event.key !== "Enter" && event.key !== " ") || !focused) return;
    choose([focused], event.shiftKey);
    event.preventDefault();
    event.stopPropagation();
  });

  async function renew() {
    const { id, sheet } = store;
    const now = `${id} ${sheet?.revision}`;
    if (!sheet || store.view !== "blocks" || now === drawnSheet) return;
    drawnSheet = now;
    const made = await ask(`documents/${id}/diagram`);
    if (now !== drawnSheet) return;
    shown = made;
    palette.hidden = !shown.editable;
    if (!palette.firstChild) made.kinds.forEach(offer);
    const own = `${id} ${shown.blocks.map((one) => one.id).join()}`;
    const [low, high] = [canvas({ x: 0, y: 0 }), canvas({ x: area.clientWidth, y: area.clientHeight })];
    const inside = shown.blocks.every((b) => b.x >= low.x && b.y >= low.y && b.x + b.width <= high.x && b.y + b.height <= high.y);
    if (own !== ids && (!ids.startsWith(id) || !inside)) fit();
    ids = own;
    const focus = document.activeElement?.closest(".block")?.getAttribute("data-id");
    draw();
    if (focus) /** @type {SVGElement | null} */ (all.querySelector(`[data-id="${CSS.escape(focus)}"]`))?.focus();
  }

  follow(["sheet", "view", "id"], () => { renew(); });
  follow(["chosen"], () => { if (store.view === "blocks") draw(); });
  let known = 0;
  new ResizeObserver(() => { if (area.clientWidth && area.clientWidth !== known) { known = area.clientWidth; fit(); } }).observe(area);
  return { command };
}
