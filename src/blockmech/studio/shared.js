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

function rounded(x, digits = 4) {
  return String(Number(x.toPrecision(digits)));
}
