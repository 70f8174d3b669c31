// What is asked and what is answered: curves, motions, margins, analyses, synthesis.

import { ask, save, stream } from "../api.js";
import { signed } from "../../../exchange/page/web/quantity.js";
import { asked, edit, follow, recompute, say, set, showPose, store } from "../state.js";
import { drawPanel } from "../../../exchange/page/web/panel.js";
import { button, element, field, options, tabs } from "../../../exchange/page/web/dom.js";

const FRICTIONS = ["newton", "successive", "single", "none"];
const ACCURACIES = ["1e-3", "1e-6", "1e-9", "1e-12"];

/** @type {(() => void) | null} */
let stop = null; // ends what is under way

/** Long work, one at a time. @param {object} task @param {(answer: any) => void} done @param {(said: string) => void} told */
function work(task, done, told) {
  if (stop) return void say("one thing after the other: Stop ends what is under way", true);
  const all = { ...asked(), pose: store.pose ?? 0, simulated: store.simulated, ...task };
  const source = stream(`documents/${store.id}/work?ask=${encodeURIComponent(JSON.stringify(all))}`, ({ state, said, answer }) => {
    if (["done", "failed"].includes(state)) end(said);
    else told(said);
    if (state === "done") done(answer);
  });
  const end = (/** @type {string} */ said) => { source.close(); stop = null; show(); told(said); };
  source.addEventListener("error", () => end("the server does not answer"));
  stop = () => end("stopped");
  show();
}
/** @type {HTMLButtonElement[]} */
const stops = [];
const show = () => stops.forEach((own) => (own.hidden = !stop));

/** A button that ends what is under way. @param {HTMLElement} parent */
export function stopButton(parent) {
  const own = button(parent, "Stop", () => stop?.(), "end what is under way");
  own.className = "stop";
  stops.push(own);
  show();
}

/** A picture from the server, in which no script runs. @param {HTMLElement} parent @param {string} svg @param {string} alt */
function picture(parent, svg, alt) {
  const made = element(parent, "img");
  made.alt = alt;
  made.src = URL.createObjectURL(new Blob([svg], { type: "image/svg+xml" }));
  made.addEventListener("load", () => URL.revokeObjectURL(made.src));
  return made;
}

/** @param {HTMLElement} parent @param {{analyses: Record<string, string>, formats: Record<string, string[]>}} about */
export function answersView(parent, about) {
  const pages = Object.fromEntries(["Curves", "Motion", "Margins", "Analyses", "Synthesis"].map((name) => [name, document.createElement("div")]));
  const { row } = tabs(parent, pages, () => set({ curves: store.curves }));
  const said = element(row, "span", "said");
  said.setAttribute("role", "status");
  stopButton(row);
  const tell = (/** @type {string} */ text) => { said.textContent = text; said.title = text; };
  let [of, names] = ["", Promise.resolve({ outputs: /** @type {string[]} */ ([]), parameters: /** @type {string[]} */ ([]) })];
  /** What can be chosen of the sheet: asked for when somebody is about to. */
  const known = () => {
    const now = `${store.id} ${store.sheet?.revision} ${store.moved} ${JSON.stringify(store.held)}`;
    if (store.sheet && now !== of) [of, names] = [now, ask(`documents/${store.id}/names`, asked())];
    return names;
  };

  // -- curves ----------------------------------------------------------------------------------
  const choices = element(pages.Curves, "div", "choices");
  const find = field(choices, "Add an output", "input");
  const list = element(choices, "datalist");
  list.id = "outputs";
  find.input.setAttribute("list", "outputs");
  find.input.placeholder = "part of its name";
  const friction = field(choices, "Friction", "select");
  const accuracy = field(choices, "Accuracy", "select");
  options(friction.input, FRICTIONS.map((name) => [name, name]), "newton");
  options(accuracy.input, [["", "default"], ...ACCURACIES.map((x) => /** @type {[string, string]} */ ([x, x]))], "");
  const chips = element(pages.Curves, "div", "chips");
  const drawn = element(pages.Curves, "div", "plots");
  const note = element(pages.Curves, "p", "note");
  const margins = element(pages.Margins, "div", "plots");
  find.input.addEventListener("change", async () => {
    const name = find.input.value;
    if (!(await known()).outputs.includes(name)) return;
    find.input.value = "";
    set({ names: [...new Set([...store.names, name])] });
    recompute();
  });
  find.input.addEventListener("input", async () => {
    const [word, { outputs }] = [find.input.value.toLowerCase(), await known()];
    list.replaceChildren();
    for (const name of outputs.filter((n) => n.toLowerCase().includes(word)).slice(0, 24)) element(list, "option").value = name;
  });
  friction.input.addEventListener("change", () => { set({ friction: friction.input.value }); recompute(); });
  accuracy.input.addEventListener("change", () => { set({ accuracy: accuracy.input.value }); recompute(); });
  follow(["names", "sheet"], ({ names }) => {
    chips.replaceChildren();
    for (const name of names) button(chips, `${name} \u00d7`, () => { set({ names: store.names.filter((n) => n !== name) }); recompute(); }, `hide ${name}`);
  });
  /** @type {((k: number | null) => void)[]} */
  let cursors = [];
  const redraw = () => {
    const { curves } = store;
    cursors = [];
    for (const [parent, panels] of /** @type {const} */ ([[drawn, curves?.panels], [margins, curves?.margins]])) {
      parent.replaceChildren();
      if (!curves?.along || !parent.clientWidth) continue;
      for (const panel of panels ?? []) cursors.push(drawPanel(parent, panel, curves.along, store.motion?.gaps ?? [], showPose));
    }
    for (const point of cursors) point(store.pose);
    note.textContent = curves?.said ?? "";
  };
  follow(["curves", "units"], redraw);
  let width = 0;
  new ResizeObserver(() => {
    if (parent.clientWidth && parent.clientWidth !== width) { width = parent.clientWidth; redraw(); }
  }).observe(parent);
  const values = element(pages.Curves, "dl", "values");
  follow(["curves", "pose"], ({ curves, pose }) => {
    for (const point of cursors) point(pose);
    values.replaceChildren();
    if (pose === null) return;
    for (const panel of curves?.panels ?? [])
      for (const [name, row] of panel.curves) {
        element(values, "dt", "", name);
        element(values, "dd", "", row[pose] === null || row[pose] === undefined ? "none" : `${signed(Number(row[pose]), 6)} ${panel.unit}`);
      }
  });

  // -- margins, motion -------------------------------------------------------------------------
  const until = field(pages.Motion, "Simulate until", "input");
  until.input.value = "time=2";
  const acts = element(pages.Motion, "div", "row");
  button(acts, "Simulate", () => work({ what: "simulate", until: until.input.value }, (answer) => {
    set({ motion: answer.motion, curves: answer.curves, simulated: true, playing: true });
    showPose(0);
    motion.textContent = answer.text;
  }, tell), "move the mechanism under its loads, from the pose that is shown");
  button(acts, "Turn", () => { set({ motion: store.sheet?.motion ?? null, curves: store.sheet?.curves ?? null, simulated: false }); showPose(0); }, "back to the turn of the drivers");
  const motion = element(pages.Motion, "p", "note");
  motion.setAttribute("role", "status");

  // -- analyses --------------------------------------------------------------------------------
  const asking = element(pages.Analyses, "div", "row");
  const number = field(asking, "Number", "select");
  const share = field(asking, "\u00b1 [%]", "input");
  share.input.value = "10";
  const title = element(pages.Analyses, "h3");
  const text = element(pages.Analyses, "pre");
  text.tabIndex = 0;
  const image = element(pages.Analyses, "div", "picture");
  for (const [name, words] of Object.entries(about.analyses)) button(asking, name, () => {
    [title.textContent, text.textContent] = [`${name}: ${words}`, ""];
    image.replaceChildren();
    work({ what: name, number: number.input.value, share: Number(share.input.value.replace(",", ".")) || 10 }, (answer) => {
      text.textContent = answer.text;
      image.replaceChildren();
      if (answer.picture) picture(image, answer.picture, `${name}, as a picture`);
    }, (now) => { tell(now); if (now && now !== `${name} ...`) text.textContent = now; });
  }, words);
  const renew = async () => {
    const { parameters } = await known();
    options(number.input, ["", ...parameters].map((n) => [n, n]), parameters.includes(number.input.value) ? number.input.value : "");
  };
  for (const sign of ["pointerenter", "focusin"]) parent.addEventListener(sign, renew);
  follow(["sheet"], () => { if (parent.matches(":hover, :focus-within")) renew(); });

  // -- synthesis -------------------------------------------------------------------------------
  element(pages.Synthesis, "p", "note", "Draw what is wanted with links and joints, three or more of a kind: points of a path (a click each with the tool Link, in their order), or positions of a body (a lone link each).");
  button(pages.Synthesis, "Candidates", () => {
    cards.replaceChildren();
    work({ what: "synthesis" }, ({ designs, text: none }) => {
      if (none) element(cards, "p", "", none);
      designs.forEach((/** @type {{words: string, picture: string, form: object}} */ design, /** @type {number} */ k) => {
        const card = element(cards, "div", "card");
        picture(card, design.picture, `candidate ${k + 1}`);
        element(card, "p", "", design.words);
        button(card, `Take ${k + 1}`, () => edit({ act: "take", form: design.form }));
      });
    }, tell);
  });
  const cards = element(pages.Synthesis, "div", "cards");
}

/** Write a file, in a process of its own, and let the browser save it. @param {string} kind */
export const exportAs = (kind) => work({ what: "export", kind }, ({ name, data }) => {
  save(new Blob([Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0))]), name);
  say(`exported ${kind}`);
}, say);
