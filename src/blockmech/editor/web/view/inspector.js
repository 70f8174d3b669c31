// The form of what is chosen: fields by path, which stay while their path and kind do.
//
// What is typed is sent at Enter or when a field is left. What is not sound yet is kept here and
// sent again with what is typed next; the reason stands under its field.

import { ask } from "../api.js";
import { edit, follow, set, store } from "../state.js";
import { button, element, field, options } from "../../../exchange/page/web/dom.js";

/** @typedef {{path: string[], kind: string, label: string, about: string, wrong: string, wide: boolean, keys: string[], options?: [string, string][], value: string, hint?: string}} Row */
/** @typedef {{part: string[], parts: string[][], kind: string, renamed: boolean, words: string, groups: {name: string, rows: Row[]}[]}} Form */
/** @typedef {{kind: string, cell: HTMLElement, label: HTMLElement, input: HTMLInputElement | HTMLSelectElement, wrong: HTMLElement, keys: HTMLElement, typed: boolean}} Cell */

const words = (/** @type {string[]} */ part) => (part.length ? (part[0] === "blocks" ? part[1] : `${part[0].slice(0, -1)} ${part[1]}`) : "mechanism");

/** @param {HTMLElement} parent */
export function inspector(parent) {
  const head = element(parent, "div", "head");
  const body = element(parent, "div", "fields");
  const chooser = field(head, "Edit", "select");
  const called = field(head, "Name", "input");
  const remove = button(head, "Remove", () => edit({ act: "remove", part: store.part }).then((error) => error || set({ part: [], link: "", chosen: [] })));
  const about = element(head, "p", "about");
  /** @type {Map<string, Cell>} */
  let known = new Map();
  /** @type {[string[], string | null][]} */
  let pending = []; // what was typed and is not sound yet
  let shown = ""; // part, revision and units that stand here

  chooser.input.addEventListener("change", () => set({ part: JSON.parse(chooser.input.value), chosen: [], link: "" }));
  called.input.addEventListener("change", async () => {
    const error = await edit({ act: "rename", name: store.part[1], to: called.input.value });
    if (!error) set({ part: ["blocks", called.input.value.trim()] });
  });

  /** @param {Row} row @param {string | null} text @param {string[]} path */
  async function send(row, text, path = row.path) {
    pending = [...pending.filter(([own]) => own.join() !== path.join()), [path, text]];
    const cell = known.get(row.path.join("\u0000"));
    const error = await edit({ act: "fields", part: store.part, edits: pending });
    if (cell) {
      cell.wrong.textContent = error ? error.problems.map((p) => [p.found, p.valid, p.remedy].filter(Boolean).join(". ")).join("; ") || error.message : "";
      cell.wrong.hidden = !error;
      cell.input.setAttribute("aria-invalid", String(Boolean(error)));
      if (!error) cell.typed = false;
    }
    if (!error) { pending = []; shown = ""; renew(); }
  }

  /** @param {Row} row @returns {[string, Cell]} */
  function cellOf(row) {
    const key = row.path.join("\u0000");
    let own = known.get(key);
    if (!own || own.kind !== row.kind) {
      const made = row.kind === "choice" ? field(body, row.label, "select") : field(body, row.label, "input");
      const wrong = element(made.cell, "p", "wrong");
      wrong.setAttribute("role", "alert");
      const cell = { kind: row.kind, ...made, wrong, keys: element(made.cell, "div", "keys"), typed: false };
      made.input.addEventListener("input", () => (cell.typed = row.kind !== "choice"));
      made.input.addEventListener("change", () => send(row, made.input.value));
      own = cell;
    }
    own.label.textContent = row.label;
    own.input.title = own.label.title = row.about;
    own.cell.classList.toggle("wide", row.wide);
    if (own.input instanceof HTMLSelectElement) options(own.input, row.options ?? [], row.value);
    else {
      own.input.placeholder = row.hint ?? "";
      if (!own.typed) own.input.value = row.value;
    }
    if (!own.typed) {
      own.wrong.textContent = row.wrong;
      own.wrong.hidden = !row.wrong;
      own.input.setAttribute("aria-invalid", String(Boolean(row.wrong)));
    }
    if (own.keys.dataset.keys !== row.keys.join("\u0000")) {
      own.keys.replaceChildren();
      for (const name of row.keys) button(own.keys, `Remove ${name}`, () => send(row, null, [...row.path, name]));
      own.keys.dataset.keys = row.keys.join("\u0000");
    }
    return [key, own];
  }

  /** @param {Form} form */
  function show(form) {
    options(chooser.input, form.parts.map((part) => [JSON.stringify(part), words(part)]), JSON.stringify(form.part));
    called.cell.hidden = !form.renamed;
    called.input.value = form.part[1] ?? "";
    remove.hidden = !form.part.length || form.renamed || form.part[1] === "frame";
    about.textContent = [form.kind, form.words].filter(Boolean).join(": ");
    const rows = form.groups.map((group) => /** @type {[string, [string, Cell][]]} */ ([group.name, group.rows.map(cellOf)]));
    const focus = document.activeElement;
    const parts = rows.flatMap(([name, cells]) => {
      if (!name) return cells.map(([, own]) => own.cell);
      const group = element(body, "h3", "", name);
      return [group, ...cells.map(([, own]) => own.cell)];
    });
    body.replaceChildren(...parts);
    if (focus instanceof HTMLElement && body.contains(focus)) focus.focus();
    known = new Map(rows.flatMap(([, cells]) => cells));
  }

  async function renew() {
    const { id, sheet, part, units } = store;
    if (!sheet) return;
    const now = JSON.stringify([id, sheet.revision, part, units]);
    if (now === shown) return;
    if (JSON.stringify(part) !== parent.dataset.part) { pending = []; known = new Map(); parent.dataset.part = JSON.stringify(part); }
    shown = now;
    try {
      const form = await ask(`documents/${id}/fields`, { part, units: units.join("|") });
      if (shown === now) show(form);
    } catch { if (part.length) set({ part: [] }); }
  }

  follow(["sheet", "part", "units"], () => { renew(); });
}
