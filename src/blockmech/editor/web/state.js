// What the page knows: the sheet as the server has it, and what is looked at and done here.
//
// `set` changes parts of it; who follows a part is told once in the next frame.

import { Live, Rows } from "./lib/live.js";
import { posed } from "../../exchange/page/web/geometry.js";
import { Refused, ask, kernel, stream } from "./api.js";

/** @typedef {import("../../exchange/page/web/geometry.js").Point} Point */
/** @typedef {[string, number, number]} Spot link, x, y */
/**
 * @typedef {{name: string, label?: string, at: Spot, links: string[], ground: boolean, driven: boolean, kind: string,
 *   held?: boolean, guide: {at: Spot, angle: number, hidden: boolean, ends?: Spot[]} | null}} Pin
 */
/**
 * @typedef {{fixed: string, poses: Record<string, number[]>, pins: Pin[],
 *   links: {name: string, fill: string, ends: (string | Spot)[], slim: boolean}[],
 *   dimensions: [string, string][], stated: {name: string, type: string, sign: string, points: string[], value?: any}[], loads: {name: string, ends: Spot[], force: [number, number] | null, line: number[][]}[],
 *   wheels: {name: string, pin?: string, radius: number, link: string, points?: Point[]}[]}} Drawing
 */
/**
 * @typedef {{n: number, q: Record<string, number[]>, home: Record<string, number>,
 *   travel: Record<string, [number, number]>, units: Record<string, string>, time: number[] | null,
 *   seconds: number, forward: boolean, gaps: [number, number][], why: string | null,
 *   poses?: Record<string, (number | null)[][]>}} Motion
 */
/** @typedef {import("../../exchange/page/web/panel.js").Panel} Panel */
/** @typedef {{along: import("../../exchange/page/web/panel.js").Along | null, panels: Panel[], margins: Panel[], said: string}} Curves */
/**
 * @typedef {{revision: number, name: string, file: string, saved: boolean, undoable: string,
 *   redoable: string, problems: {where: string, found: string, remedy?: string, code: string}[], status: string,
 *   empty: boolean, names: string[], kind: "joints" | "blocks",
 *   drawing: Drawing | null, motion: Motion | null, said: string, curves?: Curves}} Sheet
 */

/** What the page holds. */
export const store = {
  id: "",
  /** @type {Sheet | null} */ sheet: null,
  /** @type {Motion | null} */ motion: null, // of a turn, or of a simulation
  simulated: false,
  /** @type {Curves | null} */ curves: null,
  /** @type {Live | Rows | null} */ live: null,
  /** @type {string[]} */ chosen: [], // pins, or blocks and wires of the diagram
  link: "", // a chosen link
  /** @type {string[]} */ part: [], // whose form is shown
  tool: "",
  view: "drawing", // or "blocks"
  /** @type {number | null} */ pose: null, // a sample of the motion; null: as it is drawn
  /** @type {Record<string, number> | null} */ q: null, // coordinates of that pose
  playing: false,
  paths: true,
  /** @type {string[]} */ names: [], // chosen outputs
  friction: "newton",
  accuracy: "",
  units: (localStorage.getItem("blockmech units") ?? "mm|deg|rpm|N").split("|"),
  theme: localStorage.getItem("blockmech theme") ?? "",
  said: "",
  alert: "",
  moved: "",
  /** @type {Record<string, number>} */ held: {}, // where drivers were put by hand
};

/** @typedef {typeof store} Store */
/** @type {Map<(now: Store) => void, (keyof Store)[]>} */
const followers = new Map();
/** @type {Set<keyof Store>} */
let changed = new Set();

/** Change some parts; who follows them is told in the next frame. @param {Partial<Store>} parts */
export function set(parts) {
  if (!changed.size) requestAnimationFrame(tell);
  for (const key of /** @type {(keyof Store)[]} */ (Object.keys(parts))) changed.add(key);
  Object.assign(store, parts);
}

function tell() {
  const now = changed;
  changed = new Set();
  for (const [act, keys] of followers) if (keys.some((key) => now.has(key))) act(store);
}

/** Do something when some parts change, and now. @param {(keyof Store)[]} keys @param {(now: Store) => void} act */
export function follow(keys, act) {
  followers.set(act, keys);
  act(store);
}

export const length = () => store.units[0];
export const angle = () => store.units[1];

/** What every question of the sheet says of what is looked at. */
export const asked = () => ({
  names: store.names, friction: store.friction, accuracy: Number(store.accuracy) || null, units: store.units.join("|"),
  moved: store.moved, held: store.held,
});

/** The same of a sheet that was not looked at yet. */
const fresh = () => ({ ...asked(), names: [], moved: "", held: {} });

/** Say something, below the drawing and to screen readers. @param {string} said @param {boolean} wrong */
export const say = (said, wrong = false) => set(wrong ? { alert: said, said: "" } : { said, alert: "" });

/** @type {EventSource | null} */
let window_events = null;

/** Show a sheet. @param {object} what the document that is asked for, e.g. {example: "pump"} */
export async function open(what) {
  const { id, ...sheet } = await ask("documents", { ...what, ...fresh() });
  await show(id, sheet);
}

/** Show a sheet that the server has. @param {string} id */
export async function reopen(id) {
  await show(id, await ask(`documents/${id}`, fresh()));
}

/** @param {string} id @param {Sheet} sheet */
async function show(id, sheet) {
  if (location.search !== `?sheet=${id}`) history.pushState(null, "", `?sheet=${id}`);
  set({ id, tool: sheet.empty ? "Link" : "", chosen: [], link: "", part: [], pose: null, q: null, playing: false, moved: "", held: {} });
  set({ view: sheet.kind === "joints" || sheet.motion ? "drawing" : "blocks", live: null });
  window_events?.close();
  const isNews = (/** @type {number} */ revision) => store.id === id && store.sheet && revision > store.sheet.revision && !busy;
  window_events = stream(`documents/${id}/events`, async (revision) => {
    if (!isNews(revision)) return;
    const news = await ask(`documents/${id}`, asked());
    if (isNews(news.revision)) take(news); // not older than what an act of here has brought meanwhile
  });
  await take(sheet);
}

/** What the server answered to a change. @param {Sheet} sheet */
async function take(sheet) {
  set({
    sheet, motion: sheet.motion, simulated: false, curves: sheet.curves ?? null,
    names: sheet.names,
    chosen: store.chosen.filter((name) => store.view === "blocks" || sheet.drawing?.pins.some((pin) => pin.name === name)),
    ...(sheet.kind === "joints" ? { pose: null, q: null } : {}),
  });
  if (!sheet.motion) set({ pose: null, q: null, live: null, playing: false });
  else if (store.pose !== null) showPose(Math.min(store.pose, sheet.motion.n - 1));
  requestAnimationFrame(() => (document.documentElement.dataset.revision = String(sheet.revision))); // once it is drawn
  await enliven();
}

let asking = 0;

/** Fetch what moves the mechanism, and what follows when pins are dragged from poses, or a joint of blocks is held. @param {object} [held] */
export async function enliven(held) {
  const [mine, { id, sheet }] = [++asking, store];
  if (!sheet?.motion) return;
  const data = await ask(`documents/${id}/live`, { ...asked(), ...held });
  if (mine !== asking) return;
  if (!data) set({ live: null });
  else if (data.poses) set({ live: new Rows(data.poses) });
  else {
    const module = await kernel(data.hash);
    if (mine === asking) set({ live: new Live(module, data) });
  }
}

let busy = false;

/**
 * Do an act on the sheet, as one step; or "undo", "redo", "save". A refusal is said and leaves it as it was.
 * @param {{act: string, [key: string]: any}} act @returns {Promise<Refused | null>}
 */
export async function edit(act) {
  if (!store.sheet) return null;
  busy = true;
  try {
    const sheet = await ask(`documents/${store.id}/edit`, { ...asked(), base: store.sheet.revision, ...act });
    say(["undo", "redo", "save"].includes(act.act) ? "" : sheet.undoable);
    await take(sheet);
    return null;
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    if (error.status === 409) await take(await ask(`documents/${store.id}`, asked()));
    set({ sheet: store.sheet });
    say(error.words, true);
    return error;
  } finally {
    busy = false;
  }
}

/** Ask for curves of what is chosen now. */
export async function recompute() {
  if (store.sheet?.motion && !store.simulated) set({ curves: await ask(`documents/${store.id}/curves`, asked()) });
}

/** Show a sample of the motion. @param {number} k */
export function showPose(k) {
  const { motion } = store;
  if (!motion) return;
  const q = Object.fromEntries(Object.entries(motion.q).map(([driver, row]) => [driver, row[k]]));
  set({ pose: k, q });
}

/** Poses of all links as they are shown. @returns {Record<string, number[]>} */
export function poses() {
  const { sheet, live, motion, pose, q } = store;
  const drawn = Object.fromEntries(Object.entries(sheet?.drawing?.poses ?? {}).map(([link, z]) => [link, posed(z)]));
  if (pose === null || !live || !motion || !q) return drawn;
  return { ...drawn, ...(live instanceof Rows ? live.at(pose) : motion.poses && store.simulated ? new Rows(motion.poses).at(pose) : live.poses(q)) };
}
