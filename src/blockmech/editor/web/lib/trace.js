// A picture or a DXF below the drawing, to be traced: it stays in the browser, and in no file.

/** @typedef {{d?: string, href?: string, x: number, y: number, width: number, height: number, scale: number | null}} Traced */
/** @typedef {{kind: string, xs: number[], ys: number[], codes: Record<number, number>}} Entity */

/** @type {Record<number, number>} */
const INSUNITS = { 1: 0.0254, 2: 0.3048, 4: 1e-3, 5: 1e-2, 6: 1 }; // m in a unit of a DXF

/** Lines, circles, arcs and polylines of a DXF as a path, y downwards as in a picture. @param {string} text @returns {Traced | null} */
export function pathOf(text) {
  const rows = text.split(/\r?\n/);
  /** @type {Entity[]} */
  const entities = [];
  /** @type {number | null} */
  let scale = null;
  for (let k = 0; k + 1 < rows.length; k += 2) {
    const [code, value] = [Number(rows[k]), rows[k + 1].trim()];
    const own = entities[entities.length - 1];
    if (code === 0) entities.push({ kind: value, xs: [], ys: [], codes: {} });
    else if (code === 9 && value === "$INSUNITS") scale = INSUNITS[Number(rows[k + 3])] ?? null;
    else if (!own) continue;
    else if (code === 10 || code === 11) own.xs.push(Number(value));
    else if (code === 20 || code === 21) own.ys.push(-Number(value));
    else own.codes[code] = Number(value);
  }
  /** @type {string[]} */
  const parts = [];
  /** @type {[number, number][]} */
  const points = [];
  const point = (/** @type {number} */ x, /** @type {number} */ y) => { points.push([x, y]); return `${x} ${y}`; };
  const chain = (/** @type {Entity} */ { xs, ys, codes }) =>
    parts.push(`M${xs.map((x, k) => point(x, ys[k])).join("L")}${codes[70] & 1 ? "Z" : ""}`);
  /** @type {Entity | null} */
  let line = null; // the older polyline, whose points are entities of their own
  for (const one of entities) {
    const { kind, xs: [x], ys: [y], codes } = one;
    const r = codes[40];
    if (kind === "LINE" || kind === "LWPOLYLINE") chain(one);
    else if (kind === "POLYLINE") line = { ...one, xs: [], ys: [] };
    else if (kind === "VERTEX" && line) { line.xs.push(x); line.ys.push(y); }
    else if (kind === "SEQEND" && line) { chain(line); line = null; }
    else if (r > 0 && (kind === "ARC" || kind === "CIRCLE")) {
      const [from, to] = kind === "ARC" ? [codes[50], codes[51]] : [0, 359.999];
      const at = (/** @type {number} */ turn) => point(x + r * Math.cos((turn * Math.PI) / 180), y - r * Math.sin((turn * Math.PI) / 180));
      const large = (to - from + 720) % 360 > 180 ? 1 : 0;
      parts.push(`M${at(from)}A${r} ${r} 0 ${large} 0 ${at(to)}`);
    }
  }
  if (!parts.length) return null;
  const [xs, ys] = [points.map((p) => p[0]), points.map((p) => p[1])];
  const [x, y] = [Math.min(...xs), Math.min(...ys)];
  return { d: parts.join(""), x, y, width: Math.max(...xs) - x, height: Math.max(...ys) - y, scale };
}

/** What a file shows, in units of its own; null for what is no picture. @param {File} file @returns {Promise<Traced | null>} */
export async function tracedFile(file) {
  if (/\.dxf$/i.test(file.name)) return pathOf(await file.text());
  const picture = new Image();
  picture.src = URL.createObjectURL(file);
  await picture.decode().catch(() => null);
  const { naturalWidth: width, naturalHeight: height, src: href } = picture;
  return width ? { href, x: 0, y: 0, width, height, scale: null } : null;
}
