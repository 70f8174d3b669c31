// Which command a key means, wherever the focus is but in a field.

/** @typedef {{key: string, ctrlKey: boolean, metaKey: boolean, shiftKey: boolean, altKey: boolean}} Key */

/** @type {Record<string, [number, number]>} */
export const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

const WITH_CONTROL = /** @type {Record<string, string>} */ ({ z: "undo", y: "redo", a: "all", d: "copy", s: "save" });
const ALONE = /** @type {Record<string, string>} */ ({
  Delete: "delete", Backspace: "delete", Escape: "escape", f: "fit", l: "Link", " ": "play", F10: "menu", ContextMenu: "menu",
});

/**
 * The command of a key, "" for none. @param {Key} event
 * @param {{field: boolean, pressable: boolean}} focus whether it is in a field, on a button or a tab
 */
export function command({ key, ctrlKey, metaKey, shiftKey, altKey }, { field, pressable }) {
  if (field || altKey) return "";
  if (ctrlKey || metaKey) {
    const found = WITH_CONTROL[key.toLowerCase()] ?? "";
    return found === "undo" && shiftKey ? "redo" : found;
  }
  if (pressable && (key === " " || key === "Enter" || ARROWS[key])) return "";
  if (ARROWS[key]) return "arrow";
  if (key === "F10" && !shiftKey) return "";
  return ALONE[key] ?? "";
}

/** A letter of a number that is typed while a link is drawn. @param {string} key */
export const writes = (key) => /^[-+.,@/*\d a-z\u00b0\u03c0]$/i.test(key);
