// A picture or DXF below the drawing, to be traced.

import { metres, pixel } from "../../../exchange/page/web/geometry.js";
import { tracedFile } from "../lib/trace.js";
import { say } from "../state.js";
import { button, element, put } from "../../../exchange/page/web/dom.js";

/** @typedef {import("../../../exchange/page/web/geometry.js").Point} Point */
/** @typedef {import("../lib/trace.js").Traced & {at: Point, scale: number}} Placed */

export class Tracing {
  /**
   * @param {HTMLElement} bar
   * @param {() => {view: import("../../../exchange/page/web/geometry.js").View, svg: SVGSVGElement, step: number}} now @param {() => void} draw
   */
  constructor(bar, now, draw) {
    /** @type {Placed | null} */
    this.picture = null;
    this.holding = "";
    this.now = now;
    this.redraw = draw;
    const file = element(bar, "input");
    Object.assign(file, { type: "file", hidden: true, accept: "image/*,.dxf" });
    file.addEventListener("change", () => { if (file.files?.[0]) this.load(file.files[0]); file.value = ""; });
    button(bar, "Trace\u2026", () => file.click(), "a picture or DXF below the drawing");
    this.holds = ["Place", "Scale"].map((act) => button(bar, act, () => this.hold(this.holding === act ? "" : act),
      act === "Place" ? "drag a point of the picture to where it belongs, or use the arrows"
        : "drag along a length of the picture and type what it is, or use the arrows"));
    this.opacity = element(bar, "input");
    Object.assign(this.opacity, { type: "range", min: "5", max: "100", value: "50" });
    this.opacity.setAttribute("aria-label", "opacity of the picture");
    this.opacity.addEventListener("input", draw);
    this.away = button(bar, "\u00d7", () => { this.picture = null; this.hold(""); }, "remove the picture");
    this.show();
  }

  get shown() {
    return this.picture !== null;
  }

  show() {
    for (const part of [...this.holds, this.opacity, this.away]) part.hidden = !this.picture;
    this.holds.forEach((part) => part.setAttribute("aria-pressed", String(part.textContent === this.holding)));
  }

  /** What a drag does to the picture. @param {string} act */
  hold(act) {
    this.holding = act;
    this.show();
    this.redraw();
  }

  /** @returns {Point[]} */
  corners() {
    const one = this.picture;
    return one ? [one.at, [one.at[0] + one.scale * one.width, one.at[1] - one.scale * one.height]] : [];
  }

  /** @param {SVGSVGElement} svg */
  draw(svg) {
    const [one, { view }] = [this.picture, this.now()];
    if (!one) return;
    const { x, y } = pixel(view, one.at);
    const look = {
      transform: `translate(${x} ${y}) scale(${view.scale * one.scale}) translate(${-one.x} ${-one.y})`,
      class: "trace", opacity: Number(this.opacity.value) / 100, "aria-hidden": "true",
    };
    if (one.d) put(svg, "path", { ...look, d: one.d });
    else put(svg, "image", { ...look, href: one.href ?? "", width: one.width, height: one.height });
  }

  /** @param {File} file */
  async load(file) {
    const found = await tracedFile(file);
    if (!found) return say(`${file.name}: it is no picture, and no DXF with lines`, true);
    const { view, svg } = this.now();
    const fits = (Math.min(svg.clientWidth / found.width, svg.clientHeight / found.height) * 0.8) / view.scale;
    const scale = found.scale ?? fits;
    /** @type {Point} */
    const at = found.scale ? [0, scale * found.height] : metres(view, { x: svg.clientWidth * 0.1, y: svg.clientHeight * 0.1 });
    this.picture = { ...found, scale, at };
    this.show();
    this.redraw();
  }

  /** What was dragged: a point to where it belongs, or along a typed length. @param {Point} from @param {Point} to @param {Point} end @param {boolean} typed */
  change(from, to, end, typed) {
    const one = this.picture;
    if (!one) return;
    const apart = (/** @type {Point} */ z) => Math.hypot(z[0] - from[0], z[1] - from[1]);
    const by = this.holding === "Scale" ? apart(to) / apart(end) : 1;
    if (this.holding === "Scale" && !typed) say("type the true length while you drag along it", true);
    else if (this.holding === "Place") one.at = [one.at[0] + to[0] - from[0], one.at[1] + to[1] - from[1]];
    else if (by > 0 && Number.isFinite(by)) {
      one.at = [from[0] + by * (one.at[0] - from[0]), from[1] + by * (one.at[1] - from[1])];
      one.scale *= by;
    }
    this.redraw();
  }

  /** @param {[number, number]} by */
  nudge([x, y]) {
    const [one, { step }] = [this.picture, this.now()];
    if (!one) return;
    if (this.holding === "Place") one.at = [one.at[0] + step * x, one.at[1] + step * y];
    else one.scale *= 1.01 ** (x + y);
    this.redraw();
  }
}
