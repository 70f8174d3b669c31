// A picture or a DXF below the drawing, to be traced: it stays in the browser, and in no file.

const INSUNITS = { 1: 0.0254, 2: 0.3048, 4: 1e-3, 5: 1e-2, 6: 1 }; // m in a unit of a DXF

// Lines, circles, arcs and polylines of a DXF as a path, y downwards as in a picture.
function pathOf(text) {
  const rows = text.split(/\r?\n/);
  const entities = [];
  let scale = null;
  for (let k = 0; k + 1 < rows.length; k += 2) {
    const [code, value] = [Number(rows[k]), rows[k + 1].trim()];
    if (code === 0) entities.push({ kind: value, xs: [], ys: [] });
    else if (code === 9 && value === "$INSUNITS") scale = INSUNITS[Number(rows[k + 3])] ?? null;
    else if (entities.length) {
      const own = entities.at(-1);
      if (code === 10 || code === 11) own.xs.push(Number(value));
      else if (code === 20 || code === 21) own.ys.push(-Number(value));
      else own[code] = Number(value);
    }
  }
  const [parts, xs, ys] = [[], [], []];
  let line = null; // the older polyline, whose points are entities of their own
  const point = (x, y) => { xs.push(x); ys.push(y); return `${x} ${y}`; };
  const chain = ({ xs: across, ys: down, 70: flags }) =>
    parts.push(`M${across.map((x, k) => point(x, down[k])).join("L")}${flags & 1 ? "Z" : ""}`);
  for (const one of entities) {
    const { kind, xs: [x], ys: [y], 40: r } = one;
    if (kind === "LINE" || kind === "LWPOLYLINE") chain(one);
    else if (kind === "POLYLINE") line = { ...one, xs: [], ys: [] };
    else if (kind === "VERTEX" && line) [line.xs, line.ys] = [[...line.xs, x], [...line.ys, y]];
    else if (kind === "SEQEND" && line) { chain(line); line = null; }
    else if (r > 0 && (kind === "ARC" || kind === "CIRCLE")) {
      const [from, to] = kind === "ARC" ? [one[50], one[51]] : [0, 359.999];
      const at = (turn) => point(x + r * Math.cos((turn * Math.PI) / 180), y - r * Math.sin((turn * Math.PI) / 180));
      const large = (to - from + 720) % 360 > 180 ? 1 : 0;
      parts.push(`M${at(from)}A${r} ${r} 0 ${large} 0 ${at(to)}`);
    }
  }
  if (!parts.length) return null;
  const [x, y] = [Math.min(...xs), Math.min(...ys)];
  return { d: parts.join(""), x, y, width: Math.max(...xs) - x, height: Math.max(...ys) - y, scale };
}

// What a file shows: {x, y, width, height} in units of its own, and a path or an address; null for none.
async function tracedFile(file) {
  if (/\.dxf$/i.test(file.name)) return pathOf(await file.text());
  const picture = new Image();
  picture.src = URL.createObjectURL(file);
  await picture.decode().catch(() => null);
  const { naturalWidth: width, naturalHeight: height, src: href } = picture;
  return width ? { href, x: 0, y: 0, width, height, scale: null } : null;
}
