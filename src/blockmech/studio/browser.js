// What the page asks of the browser itself, and what the addresses of a server's page open.

const YEARS = 10 * 365 * 86400; // s, for which a choice is kept

function addresses(model, on, heard) {
  const open = (address) => model.send_msg({ open: address });
  const fragment = () => {
    const { hash, search } = location;
    if (hash && search) location.assign(`/${hash}`);
    else if (hash) { history.replaceState(null, "", "/"); open(hash); }
  };
  on("click", (event) => {
    const to = event.composedPath().find((part) => part.tagName === "A")?.getAttribute("href");
    if (!to?.startsWith("?") || event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    open(to);
  });
  on("hashchange", fragment);
  on("popstate", () => {
    if (location.search === model.address) return;
    heard.abort(); // nothing is asked: the gallery lists what is not saved
    location.reload();
  });
  model.on("address", () => history.pushState(null, "", model.address));
  if (model.address) history.replaceState(null, "", model.address);
  fragment();
}

export function render({ model }) {
  const heard = new AbortController();
  const on = (name, act) => window.addEventListener(name, act, { signal: heard.signal });
  model.on("remove", () => heard.abort());
  on("beforeunload", (event) => { if (!model.saved) event.preventDefault(); });
  if (model.address !== null) addresses(model, on, heard); // a notebook's are its own
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
    setTimeout(() => URL.revokeObjectURL(saved.href), 6e4); // ms; at once, a busy browser saves nothing
  });
  return document.createElement("span");
}
