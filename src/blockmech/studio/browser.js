// What the page asks of the browser itself.

const YEARS = 10 * 365 * 86400; // s, for which a choice is kept

export function render({ model }) {
  const unsaved = (event) => { if (!model.saved) event.preventDefault(); };
  window.addEventListener("beforeunload", unsaved);
  model.on("remove", () => window.removeEventListener("beforeunload", unsaved));
  model.on("units", () => {
    document.cookie = `blockmech_units=${model.units}; path=/; max-age=${YEARS}; samesite=strict`;
  });
  model.on("msg:custom", ({ link, name, file }) => {
    if (link) {
      const address = `${location.origin}/${link}`;
      navigator.clipboard.writeText(address).catch(() => prompt("the link", address));
      return;
    }
    const saved = document.createElement("a");
    [saved.href, saved.download] = [URL.createObjectURL(new Blob([file])), name];
    saved.click();
    URL.revokeObjectURL(saved.href);
  });
  return document.createElement("span");
}
