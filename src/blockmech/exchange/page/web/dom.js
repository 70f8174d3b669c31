// Parts of the page: text is always text, never markup.

const SVG = "http://www.w3.org/2000/svg";

/**
 * @template {keyof SVGElementTagNameMap} T
 * @param {Element} parent @param {T} tag @param {Record<string, string | number>} given @param {string | null} text
 */
export function put(parent, tag, given = {}, text = null) {
  const made = document.createElementNS(SVG, tag);
  for (const name in given) made.setAttribute(name, String(given[name]));
  if (text !== null) made.textContent = text;
  parent.append(made);
  return made;
}

/**
 * @template {keyof HTMLElementTagNameMap} T
 * @param {Element} parent @param {T} tag @param {string} name @param {string} text
 * @returns {HTMLElementTagNameMap[T]}
 */
export function element(parent, tag, name = "", text = "") {
  const made = document.createElement(tag);
  if (name) made.className = name;
  made.textContent = text;
  parent.append(made);
  return made;
}

/** A button. @param {Element} parent @param {string} text @param {() => void} act @param {string} title */
export function button(parent, text, act, title = "") {
  const made = element(parent, "button", "", text);
  made.type = "button";
  if (title) made.title = title;
  made.addEventListener("click", act);
  return made;
}

let count = 0;

/**
 * A field with its label.
 * @template {"input" | "select"} T @param {Element} parent @param {string} words @param {T} tag
 */
export function field(parent, words, tag) {
  const cell = element(parent, "div", "cell");
  const label = element(cell, "label", "", words);
  const input = element(cell, tag);
  input.id = label.htmlFor = `f${count++}`;
  return { cell, label, input };
}

/** Where an event is in a part [px]. @param {Element} part @param {{clientX: number, clientY: number}} event */
export function pixelIn(part, { clientX, clientY }) {
  const { x, y } = part.getBoundingClientRect();
  return { x: clientX - x, y: clientY - y };
}

/** Say something in a bubble beside a place of a part; "" hides it. @param {HTMLElement} bubble @param {Element} part @param {string} text @param {{x: number, y: number}} at */
export function sayAt(bubble, part, text, { x, y }) {
  bubble.textContent = text;
  bubble.hidden = !text;
  if (text) bubble.style.transform = `translate(${Math.max(Math.min(x + 12, part.clientWidth - 320), 0)}px, ${y + 14}px)`;
}

/**
 * Options of a choice, made anew only where they are others.
 * @param {HTMLSelectElement} select @param {[string, string][]} pairs @param {string} value
 */
export function options(select, pairs, value) {
  const words = JSON.stringify(pairs);
  if (select.dataset.words !== words) {
    select.replaceChildren();
    for (const [own, text] of pairs) element(select, "option", "", text).value = own;
    select.dataset.words = words;
  }
  select.value = value;
}

/** Tabs of which one is shown. @param {Element} parent @param {Record<string, HTMLElement>} pages @param {(name: string) => void} shown */
export function tabs(parent, pages, shown = () => {}) {
  const row = element(parent, "div", "tabrow");
  const bar = element(row, "div", "tabs");
  bar.setAttribute("role", "tablist");
  const names = Object.keys(pages);
  const heads = names.map((name) => {
    const head = button(bar, name, () => show(name));
    head.setAttribute("role", "tab");
    pages[name].setAttribute("role", "tabpanel");
    pages[name].setAttribute("aria-label", name);
    parent.append(pages[name]);
    return head;
  });
  bar.addEventListener("keydown", (event) => {
    const by = event.key === "ArrowRight" ? 1 : event.key === "ArrowLeft" ? -1 : 0;
    const k = heads.indexOf(/** @type {HTMLButtonElement} */ (document.activeElement));
    if (by && k >= 0) heads[(k + by + heads.length) % heads.length].click();
  });
  let now = "";
  /** @param {string} name */
  function show(name, focus = true) {
    if (name === now) return;
    now = name;
    names.forEach((own, k) => {
      pages[own].hidden = own !== name;
      heads[k].setAttribute("aria-selected", String(own === name));
      heads[k].tabIndex = own === name ? 0 : -1;
      if (own === name && focus && bar.contains(document.activeElement)) heads[k].focus();
    });
    shown(name);
  }
  show(names[0], false);
  return { show: (/** @type {string} */ name) => show(name, false), row };
}
