// Pure modules of the page. Run by `node --test`, and by test_web.py.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { frameAt, path, range, ticks } from "../../../src/blockmech/exchange/page/web/curve.js";
import { closest, fitted, guideway, local, metres, nice, on, pixel, posed, zoomed } from "../../../src/blockmech/exchange/page/web/geometry.js";
import { command, writes } from "../../../src/blockmech/editor/web/lib/keys.js";
import { Room } from "../../../src/blockmech/exchange/page/web/labels.js";
import { factor, place, quantity, rounded, vector } from "../../../src/blockmech/exchange/page/web/quantity.js";
import { aim } from "../../../src/blockmech/editor/web/lib/snap.js";
import { pathOf } from "../../../src/blockmech/editor/web/lib/trace.js";

let seed = 1;
const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
const CASES = JSON.parse(readFileSync(new URL("../../data/typed_quantities.json", import.meta.url), "utf-8"));

for (const { text, si, shown, value } of CASES)
  test(`quantity ${text} [${shown}]`, () => assert.equal(quantity(text, si, shown), value));

test("a value that is shown reads as itself", () => {
  for (let k = 0; k < 20000; k++) {
    const x = (random() - 0.5) * 10 ** (8 * random() - 4);
    const text = String(x);
    assert.equal(quantity(text, "m", "m"), x);
  }
  assert.equal(factor("m", "mm"), 1000);
  assert.equal(quantity(rounded(0.08 * factor("m", "mm"), 12), "m", "mm"), 0.08);
});

test("a typed length and direction", () => {
  assert.deepEqual(vector("80 mm", "m", "deg"), { length: 0.08, angle: null });
  assert.deepEqual(vector("0.3 m @ 45", "mm", "deg"), { length: 0.3, angle: 0.7853981633974483 });
  assert.deepEqual(vector("@ 90", "mm", "deg"), { length: null, angle: 1.5707963267948966 });
  for (const wrong of ["", "0", "-3", "abc", "1 @ x", "1@2@3", "@"]) assert.equal(vector(wrong, "mm", "deg"), null);
});

test("a typed place", () => {
  assert.deepEqual(place("120mm, 50mm", "m", "deg"), [0.12, 0.05]);
  assert.deepEqual(place("0,1; 0,2", "m", "deg"), [0.1, 0.2]);
  assert.deepEqual(place("3 4", "mm", "deg"), [0.003, 0.004]);
  const [x, y] = place("2 @ 90", "m", "deg");
  assert.ok(Math.abs(x) < 1e-15 && y === 2);
  for (const wrong of ["", "over there", "1", "1,2,3"]) assert.equal(place(wrong, "m", "deg"), null);
});

test("a pointer near a crossing means the crossing, whatever else is near", () => {
  for (let k = 0; k < 100000; k++) {
    const [scale, step] = [200 + 2000 * random(), 0.01];
    const crossing = [0, 1].map(() => Number((Math.round((random() - 0.5) * 100) * step).toPrecision(9)) || 0);
    const off = 0.3 * step * random();
    const turn = 2 * Math.PI * random();
    const start = [0, 1].map(() => Math.round((random() - 0.5) * 100) * step);
    const far = [{ name: "A", at: [crossing[0] + 20 / scale, crossing[1] + 3 / scale] }];
    const z = [crossing[0] + off * Math.cos(turn), crossing[1] + off * Math.sin(turn)];
    assert.deepEqual(aim(z, { scale, step, pins: Math.hypot(20, 3) > 13 ? far : [], start }).at, crossing);
  }
});

test("then a pin, its line, and a direction", () => {
  const pins = [{ name: "A", at: [0.1, 0.2] }];
  const given = { scale: 1000, step: 0.05, pins };
  assert.equal(aim([0.105, 0.204], given).pin, "A");
  const lined = aim([0.475, 0.203], given);
  assert.deepEqual([lined.at[1], lined.lines], [0.2, ["y"]]); // a slider-crank aimed in line has no offset
  const turned = aim([0.3741, 0.3742], { scale: 1000, step: 0.05, pins: [], start: [0.1, 0.1] });
  assert.deepEqual(turned.lines, ["turn"]);
  assert.ok(Math.abs(turned.at[0] - turned.at[1]) < 1e-9);
  assert.deepEqual(aim([0.4741, 0.3742], { ...given, free: true }).at, [0.4741, 0.3742]);
});

test("a view and its pixels are inverse", () => {
  const view = fitted([[0, 0], [2, 1]], 800, 600);
  for (let k = 0; k < 1000; k++) {
    const z = [random() * 4 - 2, random() * 4 - 2];
    const back = metres(view, pixel(view, z));
    assert.ok(Math.hypot(back[0] - z[0], back[1] - z[1]) < 1e-12);
  }
  const p = { x: 100, y: 50 };
  assert.deepEqual(metres(zoomed(view, 1.7, p), p).map((x) => x.toFixed(12)), metres(view, p).map((x) => x.toFixed(12)));
  const pose = posed([1, 2, 0.7]);
  const [x, y] = local(pose, on(pose, 0.3, -0.4));
  assert.ok(Math.hypot(x - 0.3, y + 0.4) < 1e-15);
  assert.equal(nice(0.03), 0.05);
  assert.equal(closest([{ x: 5, y: 0 }, { x: 3, y: 0 }], (q) => q, { x: 0, y: 0 }, 4).x, 3);
});

test("keys act wherever the focus is but in a field", () => {
  const key = (name, more = {}) => ({ key: name, ctrlKey: false, metaKey: false, shiftKey: false, altKey: false, ...more });
  const [free, button, field] = [{ field: false, pressable: false }, { field: false, pressable: true }, { field: true, pressable: false }];
  assert.equal(command(key("z", { ctrlKey: true }), button), "undo");
  assert.equal(command(key("z", { ctrlKey: true, shiftKey: true }), free), "redo");
  assert.equal(command(key("Delete"), button), "delete");
  assert.equal(command(key("Delete"), field), "");
  assert.equal(command(key(" "), button), "");
  assert.equal(command(key(" "), free), "play");
  assert.equal(command(key("ArrowLeft"), button), "");
  assert.ok(writes("5") && writes("@") && writes("m") && !writes("Enter"));
});

test("words stand where no other word stands", () => {
  const room = new Room();
  const area = ([x, y]) => [x, y, 10, 10];
  assert.deepEqual(room.take([[0, 0], [50, 50]], area), [0, 0]);
  assert.deepEqual(room.take([[5, 5], [50, 50]], area), [50, 50]);
  assert.equal(room.take([[5, 5]], area), null);
});

test("a guide lies below its line, whichever way that runs", () => {
  for (const [a, b] of [[0, 100], [100, 0]]) {
    const rows = guideway({ x: a, y: 50 }, { x: b, y: 50 }).split("M").slice(1).map((part) => part.split("L").map((z) => z.split(" ").map(Number)));
    assert.deepEqual(rows[0].map(([x]) => x).sort((x, y) => x - y), [-18, 118]);
    assert.ok(rows[0].every(([, y]) => y === 60) && rows.slice(1).every(([, [, y]]) => y === 65));
  }
});

test("axes have round ticks, and rounding noise is no curve", () => {
  assert.deepEqual(ticks(-20, 10), [-20, -10, 0, 10]);
  assert.deepEqual(range(-1e-19, 2e-19, 1e-12), [-1, 1]);
  assert.deepEqual(range(5, 5, 1e-12), [4.5, 5.5]);
  assert.equal(path([0, 1, 2, 3], [1, null, 2, 3], (x) => x, (y) => y), "M0.0 1.0M2.0 2.0L3.0 3.0");
  assert.deepEqual([0, 0.5, 0.999].map((share) => frameAt(share, 4, true)), [0, 2, 3]);
  assert.deepEqual([1, 1.25, 1.5].map((share) => frameAt(share, 4, false)), [2, 1, 0]);
});

test("a DXF is traced in its own unit", () => {
  const rows = ["9", "$INSUNITS", "70", "4", "0", "LINE", "10", "0", "20", "0", "11", "100", "21", "50", "0", "CIRCLE", "10", "0", "20", "0", "40", "10"];
  const made = pathOf(rows.join("\n"));
  assert.equal(made.scale, 1e-3);
  assert.ok(made.width >= 100 && made.d.includes("A10 10"));
  assert.equal(pathOf("0\nEOF"), null);
});
