// The form of what is selected: fields by path, which stay while their path and kind do.
//
// What is typed and not yet sent is never written over; at Enter, or when a field is left, it is
// sent as text, and what it means the server knows.

export function render({ model, el }) {
  const box = element(el, "div", "form");
  const head = element(box, "div", "head");
  const body = element(box, "div", "body");
  let known = new Map(); // by path: {kind, cell, input, wrong}
  let count = 0;

  function labelled(parent, input) {
    const cell = element(parent, "div", "cell");
    const label = element(cell, "label", "");
    input.id = `f${count++}`;
    label.htmlFor = input.id;
    cell.append(input);
    return { cell, label, input };
  }

  function made(kind) {
    const input = document.createElement(kind === "choice" ? "select" : "input");
    input.addEventListener("input", () => (input.typed = kind !== "choice"));
    return input;
  }

  const edit = labelled(head, made("choice"));
  const called = labelled(head, made("text"));
  const about = element(head, "div", "about");
  edit.label.textContent = "Edit";
  called.label.textContent = "Name";
  edit.input.addEventListener("change", () => model.send_msg({ act: "edit", index: edit.input.selectedIndex }));
  sending(called.input, (value) => ({ act: "rename", value }));

  function sending(input, message) {
    input.addEventListener("change", () => {
      input.typed = false;
      model.send_msg(message(input.value));
    });
    input.addEventListener("keydown", (event) => event.stopPropagation());
  }

  function options(select, pairs, value) {
    const words = JSON.stringify(pairs);
    if (select.words !== words) {
      select.replaceChildren();
      for (const [own, text] of pairs) element(select, "option", "", text).value = own;
      select.words = words;
    }
    select.value = value;
  }

  function cell(row) {
    const key = row.path.join("\u0000");
    let own = known.get(key);
    if (own?.kind !== row.kind) {
      own = { kind: row.kind, ...labelled(body, made(row.kind)) };
      own.wrong = element(own.cell, "p", "wrong");
      own.keys = element(own.cell, "div", "keys");
      own.wrong.setAttribute("role", "alert");
      sending(own.input, (value) => ({ act: "typed", path: row.path, value }));
    }
    own.label.textContent = row.label;
    own.label.title = own.input.title = row.about;
    own.cell.classList.toggle("wide", row.wide);
    if (row.kind === "choice") options(own.input, row.options, row.value);
    else {
      own.input.placeholder = row.hint;
      if (!own.input.typed) own.input.value = row.value;
    }
    own.wrong.textContent = row.wrong;
    own.wrong.hidden = !row.wrong;
    own.input.setAttribute("aria-invalid", Boolean(row.wrong));
    if (own.keys.dataset.keys !== row.keys.join("\u0000")) {
      own.keys.replaceChildren();
      for (const key of row.keys)
        pressed(own.keys, `Remove ${key}`, "", () => model.send_msg({ act: "remove", path: row.path, key }));
      own.keys.dataset.keys = row.keys.join("\u0000");
    }
    return [key, own];
  }

  function renew() {
    const { parts, selected, name, kind, words, groups } = model.shown;
    options(edit.input, parts.map((text, k) => [String(k), text]), String(selected));
    called.cell.hidden = name === null;
    if (!called.input.typed) called.input.value = name ?? "";
    about.replaceChildren();
    if (kind) element(about, "h2", "", kind);
    if (words) element(about, "p", "", words);
    const rows = groups.map((group) => [group.name, group.rows.map(cell)]);
    const order = rows.flatMap(([heading, cells]) => [
      ...(heading ? [heading] : []), ...cells.map(([, own]) => own.cell),
    ]);
    const now = [...body.children].map((part) => (part.tagName === "H3" ? part.textContent : part));
    if (now.length !== order.length || now.some((part, k) => part !== order[k])) {
      const focus = body.getRootNode().activeElement;
      body.replaceChildren(...order.map((part) => (typeof part === "string" ? element(body, "h3", "", part) : part)));
      if (focus && body.contains(focus)) focus.focus();
    }
    known = new Map(rows.flatMap(([, cells]) => cells));
  }

  model.on("shown", renew);
  renew();
  return box;
}
