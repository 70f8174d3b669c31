// The page: a bar, the drawing or the blocks with what moves them, the form, and the answers.

import { Refused, ask } from "./api.js";
import { command } from "./lib/keys.js";
import { factor, quantity, rounded } from "../../exchange/page/web/quantity.js";
import { frameAt } from "../../exchange/page/web/curve.js";
import { Live } from "./lib/live.js";
import { angle, asked, edit, follow, length, open, recompute, reopen, say, set, showPose, store } from "./state.js";
import { answersView, exportAs, stopButton } from "./view/answers.js";
import { diagramView } from "./view/diagram.js";
import { button, element, field, options, tabs } from "../../exchange/page/web/dom.js";
import { galleryView } from "./view/gallery.js";
import { inspector } from "./view/inspector.js";
import { sheetView } from "./view/sheet.js";

const page = /** @type {HTMLElement} */ (document.getElementById("sheet"));
const front = /** @type {HTMLElement} */ (document.getElementById("gallery"));
const about = JSON.parse(/** @type {HTMLElement} */ (document.getElementById("about")).textContent ?? "");

follow(["id"], ({ id }) => {
  [page.hidden, front.hidden] = [!id, Boolean(id)];
  if (id) front.replaceChildren();
});

// -- the bar -------------------------------------------------------------------------------------

const bar = element(page, "header", "bar");
button(bar, "\u2302", () => go("."), "all sheets");
const file = field(bar, "File", "input");
const keep = button(bar, "Save", () => write(false));
const replace = button(bar, "Replace the file", () => write(true));
const undo = button(bar, "Undo", () => edit({ act: "undo" }));
const redo = button(bar, "Redo", () => edit({ act: "redo" }));
button(bar, "Copy link", share);
const viewer = field(bar, "Page", "input");
Object.assign(viewer.input, { value: localStorage.getItem("blockmech viewer") ?? "", placeholder: "its address", title: "where links open: a page that blockmech page wrote" });
const kind = field(bar, "Export as", "select");
for (const [name, words] of Object.entries(/** @type {Record<string, string[]>} */ (about.formats))) {
  const group = element(kind.input, "optgroup");
  group.label = name;
  for (const word of words) element(group, "option", "", word).value = word;
}
button(bar, "Export", () => exportAs(kind.input.value));
element(bar, "span", "space");
const chosen = Object.entries(/** @type {Record<string, string[]>} */ (about.units)).map(([words, known], k) => {
  const own = field(bar, words, "select");
  own.label.remove(); // so that the bar has one line at 1280 px
  Object.assign(own.input, { title: words, ariaLabel: words });
  options(own.input, known.map((unit) => [unit, unit]), store.units[k]);
  own.input.addEventListener("change", () => {
    const units = chosen.map(({ input }) => input.value);
    localStorage.setItem("blockmech units", units.join("|"));
    set({ units });
    recompute();
  });
  return own;
});
button(bar, "\u25d0", () => {
  const dark = store.theme ? store.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  const theme = dark ? "light" : "dark";
  localStorage.setItem("blockmech theme", theme);
  set({ theme });
}, "light or dark");
follow(["theme"], ({ theme }) => { document.documentElement.dataset.theme = theme; });
replace.hidden = true;

/** @param {boolean} over */
async function write(over) {
  const error = await edit({ act: "save", name: file.input.value, replace: over });
  replace.hidden = error?.problems[0]?.code !== "changed-file";
  if (!error) say(`wrote ${file.input.value}`);
}

async function share() {
  const { link } = await ask(`documents/${store.id}/link`, asked());
  const at = viewer.input.value.trim().replace(/#.*/, "");
  const address = `${at || `${location.origin}/`}${link}`;
  localStorage.setItem("blockmech viewer", at);
  await navigator.clipboard.writeText(address).catch(() => prompt("the link", address));
  say(at ? "the link is copied: it opens in that page, without blockmech"
    : "the link is copied: it opens in any studio. Export a page, put it on a server, type its address under Page: then everybody opens it");
}

follow(["sheet", "id"], ({ sheet }) => {
  if (!sheet) return;
  document.title = `${sheet.name} \u2013 blockmech`;
  file.input.value = sheet.file || file.input.value || `${sheet.name}.json`;
  for (const [part, what] of /** @type {[HTMLButtonElement, string][]} */ ([[undo, sheet.undoable], [redo, sheet.redoable]])) [part.disabled, part.title] = [!what, what || "nothing"];
  keep.textContent = sheet.saved && sheet.file ? "Saved" : "Save";
});

// -- the two halves ------------------------------------------------------------------------------

const main = element(page, "main");
const left = element(main, "section", "left");
const right = element(main, "section", "right");
left.setAttribute("aria-label", "sheet");
right.setAttribute("aria-label", "form and answers");
const halves = { Drawing: document.createElement("div"), Blocks: document.createElement("div") };
for (const half of Object.values(halves)) half.className = "half";
const views = tabs(left, halves, (name) => set({ view: name === "Blocks" ? "blocks" : "drawing" }));
const drawing = sheetView(halves.Drawing);
const diagram = diagramView(halves.Blocks);
follow(["view"], ({ view }) => views.show(view === "blocks" ? "Blocks" : "Drawing"));

// -- what moves ------------------------------------------------------------------------------------

const motion = element(left, "div", "motion");
const play = button(motion, "\u25b6 Play", () => set({ playing: !store.playing }));
const slider = field(motion, "Pose", "input");
Object.assign(slider.input, { type: "range", min: "0", step: "1" });
slider.input.addEventListener("input", () => { set({ playing: false }); showPose(Number(slider.input.value)); });
const drawnAt = button(motion, "As drawn", () => set({ pose: null, q: null, playing: false }), "the pose of the drawing");
const sliders = element(left, "div", "drivers");
const status = element(left, "p", "status");
status.setAttribute("role", "status");
const alert = element(left, "p", "wrong");
alert.setAttribute("role", "alert");
stopButton(left);

follow(["motion", "pose", "playing"], ({ motion: now, pose, playing }) => {
  const last = Math.max((now?.n ?? 1) - 1, 0);
  Object.assign(slider.input, { max: String(last), value: String(pose ?? 0), disabled: !last });
  play.disabled = !last;
  play.textContent = playing ? "\u275a\u275a Pause" : "\u25b6 Play";
  drawnAt.disabled = pose === null || store.sheet?.kind !== "joints";
});

// A driver of several is moved by its own slider, the others held; the turn is then its own.
/** @type {string} */
let shown = "";
follow(["motion", "pose", "units", "q"], ({ motion: now, q }) => {
  const names = Object.keys(now?.travel ?? {});
  const words = names.join();
  if (words !== shown) {
    shown = words;
    sliders.replaceChildren();
    for (const driver of names) {
      const own = field(sliders, driver, "input");
      const typed = element(own.cell, "input", "coordinate");
      Object.assign(own.input, { type: "range", step: "any" });
      typed.setAttribute("aria-label", `${driver}, coordinate`);
      own.input.addEventListener("input", () => drive(driver, Number(own.input.value)));
      typed.addEventListener("change", () => {
        const si = store.motion?.units[driver] ?? "rad";
        const x = quantity(typed.value, si, si === "m" ? length() : angle());
        if (x === null) say(`${typed.value} is no coordinate of ${driver}`, true);
        else drive(driver, x);
      });
    }
  }
  names.forEach((driver, k) => {
    const [low, high] = now?.travel[driver] ?? [0, 1];
    const si = now?.units[driver] ?? "rad";
    const unit = si === "m" ? length() : angle();
    const x = (q ?? now?.home ?? {})[driver] ?? 0;
    const turn = si === "rad" ? low + ((((x - low) % (2 * Math.PI)) + 2 * Math.PI) % (2 * Math.PI)) : x;
    const [label, range, typed] = sliders.children[k].children;
    label.textContent = `${driver} [${unit}]`;
    Object.assign(range, { min: String(low), max: String(high), disabled: !(low < high) });
    if (document.activeElement !== range) /** @type {HTMLInputElement} */ (range).value = String(q ? x : turn);
    if (document.activeElement !== typed) /** @type {HTMLInputElement} */ (typed).value = rounded(x * factor(si, unit), 6);
  });
});

/** @param {string} driver @param {number} x */
async function drive(driver, x) {
  const { motion: now, live } = store;
  if (!now) return;
  set({ playing: false });
  const alone = Object.entries(now.q).filter(([, row]) => row.some((v) => v !== row[0])).map(([name]) => name);
  if (alone.length !== 1 || alone[0] !== driver) {
    const at = { ...now.home, ...(store.q ?? {}), [driver]: x };
    set({ q: at, pose: 0, moved: driver, held: at });
    clearTimeout(timer);
    timer = setTimeout(async () => {
      const sheet = await ask(`documents/${store.id}`, asked());
      set({ sheet: { ...sheet }, motion: sheet.motion, curves: sheet.curves ?? null, simulated: false });
      showPose(nearest(sheet.motion.q[driver], store.held[driver]));
    }, 120);
    return;
  }
  const k = nearest(now.q[driver], x);
  showPose(k);
  if (live instanceof Live && store.q) set({ q: { ...store.q, [driver]: x } });
}
/** @type {ReturnType<typeof setTimeout> | undefined} */
let timer;

/** @param {number[]} row @param {number} x */
function nearest(row, x) {
  const offs = row.map((v) => Math.abs(v - x));
  return offs.indexOf(Math.min(...offs));
}

let begun = 0;
follow(["playing"], ({ playing, motion: now, pose }) => {
  if (!playing || !now) return;
  begun = performance.now() - ((pose ?? 0) / now.n) * 1e3 * now.seconds;
  requestAnimationFrame(tick);
});

/** @param {number} time */
function tick(time) {
  const { playing, motion: now } = store;
  if (!playing || !now) return;
  const k = frameAt(Math.max(time - begun, 0) / 1e3 / now.seconds, now.n, now.forward);
  if (k !== store.pose) showPose(k);
  requestAnimationFrame(tick);
}

follow(["sheet", "said", "alert", "pose", "motion"], ({ sheet, said, alert: wrong, pose, motion: now }) => {
  const gap = pose !== null && now?.gaps.some(([a, b]) => a <= pose && pose <= b) ? now : null;
  if (gap && gap.why === null) explain(gap);
  const time = now?.time && pose !== null ? `t = ${now.time[pose].toFixed(3)} s. ` : "";
  status.textContent = time + [said && `${said}.`, sheet?.status].filter(Boolean).join(" ");
  alert.textContent = wrong || gap?.why || (sheet?.problems.length ? "" : sheet?.said ?? "");
  alert.hidden = !alert.textContent;
});

/** Ask why poses of a motion have no answer. @param {import("./state.js").Motion} gapped */
async function explain(gapped) {
  gapped.why = "";
  gapped.why = (await ask(`documents/${store.id}/gap`, asked())).said;
  set({ motion: store.motion });
}

// -- form and answers --------------------------------------------------------------------------------

const form = element(right, "div", "form");
form.setAttribute("role", "region");
form.setAttribute("aria-label", "form of what is chosen");
inspector(form);
const answers = element(right, "div", "answers");
answersView(answers, about);

// -- keys ----------------------------------------------------------------------------------------------

document.addEventListener("keydown", (event) => {
  if (page.hidden) return;
  const at = /** @type {HTMLElement} */ (document.activeElement ?? document.body);
  const writing = at.matches("input:not([type=range]):not([type=file]), select, textarea");
  if (!writing && drawing.typing(event)) return void event.preventDefault();
  const name = command(event, { field: writing, pressable: at.matches("button, [role=button], [type=range], [tabindex]:not(svg)") });
  if (!name) return;
  const done = name === "undo" || name === "redo" ? (edit({ act: name }), true)
    : name === "save" ? (write(false), true)
    : name === "play" ? (set({ playing: !store.playing }), true)
    : (store.view === "blocks" ? diagram : drawing).command(name, event);
  if (done) event.preventDefault();
});

// A link that is pasted is opened: of blockmech, or of PMKS+.
document.addEventListener("paste", async (event) => {
  const at = /** @type {HTMLElement} */ (document.activeElement ?? document.body);
  const text = event.clipboardData?.getData("text").trim() ?? "";
  const link = text.includes("#doc=") ? { link: text.slice(text.indexOf("#doc=")) } : /^https:/i.test(text) ? { address: text } : null;
  if (!link || at.matches("input, textarea")) return;
  event.preventDefault();
  await opened(() => open(link));
});

// -- addresses -------------------------------------------------------------------------------------------

/** @param {string} to */
function go(to) {
  history.pushState(null, "", to);
  route();
}

function route() {
  const id = new URLSearchParams(location.search).get("sheet");
  return opened(() => (location.hash.startsWith("#doc=") ? open({ link: location.hash }) : id ? reopen(id) : Promise.reject(null)));
}

/** Show a sheet, or the first page with the reason why there is none. @param {() => Promise<void>} act */
async function opened(act) {
  try {
    await act();
  } catch (error) {
    if (error !== null && !(error instanceof Refused)) throw error;
    if (error && store.id) return say(error.words, true);
    set({ id: "", sheet: null, playing: false });
    await galleryView(front);
    if (error) element(front, "p", "wrong", error.words).setAttribute("role", "alert");
  }
  requestAnimationFrame(() => (document.documentElement.dataset.ready = "yes")); // once it is drawn
}

addEventListener("popstate", route);
addEventListener("hashchange", route);
addEventListener("beforeunload", (event) => { if (store.sheet && !store.sheet.saved) event.preventDefault(); });
route();
