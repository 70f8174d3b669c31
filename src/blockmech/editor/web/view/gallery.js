// The first page: empty sheets, files of the folder, what is not saved, the gallery.

import { Refused, ask } from "../api.js";
import { open, reopen } from "../state.js";
import { button, element } from "../../../exchange/page/web/dom.js";

/** @param {HTMLElement} parent */
export async function galleryView(parent) {
  parent.replaceChildren();
  const alert = element(parent, "p", "wrong");
  alert.setAttribute("role", "alert");
  const to = (/** @type {Promise<void>} */ act) => act.catch((error) => {
    if (!(error instanceof Refused)) throw error;
    alert.textContent = error.words;
  });
  element(parent, "h1", "", "blockmech studio");
  const begin = element(parent, "p", "begin");
  button(begin, "Draw links and joints", () => to(open({ new: "joints" })));
  button(begin, "Wire blocks", () => to(open({ new: "blocks" })));
  const pick = element(begin, "label", "pick", "Open a file ");
  const file = element(pick, "input");
  Object.assign(file, { type: "file", accept: ".json" });
  file.addEventListener("change", async () => {
    const one = file.files?.[0];
    if (one) await to(open({ text: await one.text(), name: one.name }));
  });
  const { files, left, gallery } = await ask("files");
  if (left.length) {
    element(parent, "h2", "", "Not saved");
    const list = element(parent, "ul", "files");
    for (const { id, name, step } of left) button(element(list, "li"), `${name}${step ? `: ${step}` : ""}`, () => to(reopen(id)));
  }
  if (files.length) {
    element(parent, "h2", "", "In this folder");
    const list = element(parent, "ul", "files");
    for (const name of files) button(element(list, "li"), name, () => to(open({ file: name })));
  }
  element(parent, "h2", "", "Gallery");
  const cards = element(parent, "div", "cards");
  /** @type {[HTMLImageElement, string][]} */
  const images = [];
  for (const { name, words } of gallery) {
    const card = button(cards, "", () => to(open({ example: name })));
    card.className = "card";
    const image = element(card, "img");
    Object.assign(image, { alt: "", width: 150, height: 110 });
    images.push([image, name]);
    element(card, "b", "", name);
    element(card, "span", "", words);
  }
  draw(images);
}

/** Pictures one after the other, those in sight first, as long as they are looked at: a sheet comes before them. @param {[HTMLImageElement, string][]} images */
async function draw(images) {
  const seen = new Set();
  const watch = new IntersectionObserver((cards) => cards.forEach(({ target, isIntersecting }) => seen[isIntersecting ? "add" : "delete"](target)));
  for (const [image] of images) watch.observe(image);
  while (images.length) {
    const [[image, name]] = images.splice(Math.max(images.findIndex(([one]) => seen.has(one)), 0), 1);
    if (!image.isConnected) return watch.disconnect();
    const ended = new Promise((done) => ["load", "error"].forEach((what) => image.addEventListener(what, done)));
    image.src = `picture/${encodeURIComponent(name)}.svg`;
    await ended;
  }
}
