// What the drawings of the studio share; it stands before each of their texts.

const SVG = "http://www.w3.org/2000/svg";
const STEPS = [1, 2, 5, 10]; // of which each ten's round steps are made

function nice(least) {
  const ten = 10 ** Math.floor(Math.log10(least));
  return STEPS.map((k) => k * ten).find((step) => step >= least * 0.999);
}

function put(parent, tag, given = {}, text = null) {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(given)) made.setAttribute(name, value);
  if (text !== null) made.textContent = text;
  parent.append(made);
  return made;
}

function element(parent, tag, name, text = "") {
  const made = document.createElement(tag);
  made.className = name;
  made.textContent = text;
  parent.append(made);
  return made;
}

// Where an event is in a part [px].
function placeIn(part, { clientX, clientY }) {
  const { x, y } = part.getBoundingClientRect();
  return { x: clientX - x, y: clientY - y };
}

// Least and largest coordinates of some places: two corners.
const corners = (places) => [Math.min, Math.max].map((of) =>
  [0, 1].map((k) => places.reduce((so_far, z) => of(so_far, z[k]), places[0][k])));

// The one of some things that is nearest to a place [px]; `at` gives theirs, null: none is near.
function closest(things, at, p, reach) {
  let [best, least] = [null, reach];
  for (const one of things) {
    const off = Math.hypot(at(one).x - p.x, at(one).y - p.y);
    if (off < least) [best, least] = [one, off];
  }
  return best;
}

// Say something in a bubble beside a place of a part [px], within its width; "" hides it.
function sayAt(bubble, part, text, { x, y }) {
  const { width } = part.getBoundingClientRect();
  bubble.textContent = text;
  bubble.hidden = !text;
  bubble.style.transform = `translate(${Math.max(Math.min(x + 12, width - 320), 0)}px, ${y + 14}px)`;
}

function zoomed(view, factor, p) {
  [view.x, view.y] = [p.x + (view.x - p.x) * factor, p.y + (view.y - p.y) * factor];
  view.scale *= factor;
}

// The wheel calls `act` with a factor and a place.
function onWheel(part, act) {
  part.addEventListener("wheel", (event) => {
    act(Math.exp(-event.deltaY / 500), placeIn(part, event));
    event.preventDefault();
  }, { passive: false });
}

const between = (a, b) => ({
  x: Math.min(a.x, b.x), y: Math.min(a.y, b.y), width: Math.abs(a.x - b.x), height: Math.abs(a.y - b.y),
});

const rounded = (x, digits = 4) => String(Number(x.toPrecision(digits)));

function pressed(parent, text, name, act) {
  const made = Object.assign(element(parent, "button", "", text), { type: "button", onclick: act });
  if (name) made.setAttribute("aria-label", (made.title = name));
  return made;
}

// `act` is called with the size [px] of a part whenever that changes.
function onSize(model, part, act) {
  const watcher = new ResizeObserver(() => act(part.getBoundingClientRect()));
  watcher.observe(part);
  model.on("remove", () => watcher.disconnect());
}

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
