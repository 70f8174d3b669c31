// @ts-nocheck: the same text is a part of kernels, without modules and types.
// Numbers as Python has them. Pairs [a, b] are sums a + b of two doubles, b below the last bit of a.
//
// Sources: Dekker, A floating-point technique for extending the available precision, 1971;
// Payne & Hanek's reduction is not needed, as angles of mechanisms are small: pi/2 has three parts.

function twoSum(a, b) {
  const s = a + b;
  const t = s - a;
  return [s, a - (s - t) + (b - t)];
}

function twoProduct(a, b) {
  const p = a * b;
  const [s, t] = [134217729 * a, 134217729 * b];
  const [high, top] = [s - (s - a), t - (t - b)];
  const [low, rest] = [a - high, b - top];
  return [p, high * top - p + high * rest + low * top + low * rest];
}

function add(a, b) {
  const [s, e] = twoSum(a[0], b[0]);
  const [t, f] = twoSum(a[1], b[1]);
  const [u, g] = twoSum(s, e + t);
  return twoSum(u, g + f);
}

function times(a, b) {
  const [p, e] = twoProduct(a[0], b[0]);
  return twoSum(p, e + (a[0] * b[1] + a[1] * b[0]));
}

function over(a, b) {
  const q = a[0] / b[0];
  const rest = add(a, times([-q, 0], b));
  const more = rest[0] / b[0];
  const last = add(rest, times([-more, 0], b));
  return add(twoSum(q, more), [last[0] / b[0], 0]);
}

const HALF_PI = [1.5707963267948966, 6.123233995736766e-17, -1.4973849048591833e-33];
const FACTORS = []; // 1 / n!
for (let n = 0, one = [1, 0]; n < 30; one = over(one, [++n, 0])) FACTORS.push(one);

// Sine and cosine of a pair, as pairs.
function both(x) {
  const quarter = Math.round(x[0] / HALF_PI[0]);
  let r = x;
  for (const part of HALF_PI) {
    const [p, e] = twoProduct(-quarter, part);
    r = add(r, [p, e]);
  }
  const square = times(r, r);
  const series = (first) => {
    let sum = [0, 0];
    for (let n = first + 26; n >= first; n -= 2) {
      const sign = ((n - first) / 2) % 2 ? -1 : 1;
      sum = add(times(sum, square), [sign * FACTORS[n][0], sign * FACTORS[n][1]]);
    }
    return sum;
  };
  const s = times(series(1), r);
  const c = series(0);
  const minus = ([a, b]) => [-a, -b];
  return [[s, c], [c, minus(s)], [minus(s), minus(c)], [minus(c), s]][((quarter % 4) + 4) % 4];
}

function sin(x) {
  return Number.isFinite(x) && x !== 0 ? both([x, 0])[0][0] : x - 0 * x;
}

function cos(x) {
  return Number.isFinite(x) ? both([x, 0])[1][0] : NaN;
}

function atan2(y, x) {
  const near = Math.atan2(y, x);
  if (!Number.isFinite(x) || !Number.isFinite(y) || x === 0 || y === 0) return near;
  const size = 2 ** -Math.floor(Math.log2(Math.max(Math.abs(x), Math.abs(y))));
  const [a, b] = [x * size, y * size];
  const [s, c] = both([near, 0]);
  const off = add(times([b, 0], c), times([-a, 0], s)); // sine of what is left, times the length
  const along = add(times([a, 0], c), times([b, 0], s));
  return near + over(off, along)[0];
}

function hypot(x, y) {
  const most = Math.max(Math.abs(x), Math.abs(y));
  if (!(most > 0) || most === Infinity) return Math.hypot(x, y);
  const size = 2 ** Math.floor(Math.log2(most));
  const [a, b] = [x / size, y / size];
  const square = add(twoProduct(a, a), twoProduct(b, b));
  const root = Math.sqrt(square[0]);
  const off = add(square, twoProduct(-root, root));
  return (root + off[0] / (2 * root)) * size;
}

function rest(x, y) {
  return x % y;
}

function even(x) {
  const near = Math.round(x);
  return Math.abs(x % 1) === 0.5 && near % 2 ? near - 1 : near;
}

function piece(knots, n, x) {
  let [low, high] = [0, n - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (knots[middle] <= x) low = middle;
    else high = middle;
  }
  return low;
}

// The n columns of a matrix; its smallest singular value over its largest takes the first place.
function spread(a, n) {
  let nought = 0;
  for (let i = 0; i < n * n; ++i) nought += a[i] * 0;
  for (let sweep = 0, turned = true; sweep < 60 && turned; ++sweep) {
    turned = false;
    for (let p = 0; p < n - 1; ++p)
      for (let q = p + 1; q < n; ++q) {
        let [uu, vv, uv] = [0, 0, 0];
        for (let i = 0; i < n; ++i) {
          uu += a[p * n + i] * a[p * n + i];
          vv += a[q * n + i] * a[q * n + i];
          uv += a[p * n + i] * a[q * n + i];
        }
        if (Math.abs(uv) > 2.220446049250313e-16 * Math.sqrt(uu * vv)) {
          const z = (vv - uu) / (2 * uv);
          const t = (z < 0 ? -1 : 1) / (Math.abs(z) + Math.sqrt(1 + z * z));
          const c = 1 / Math.sqrt(1 + t * t);
          const s = c * t;
          turned = true;
          for (let i = 0; i < n; ++i) {
            const held = a[p * n + i];
            a[p * n + i] = c * held - s * a[q * n + i];
            a[q * n + i] = s * held + c * a[q * n + i];
          }
        }
      }
  }
  let [least, largest] = [Infinity, 0];
  for (let p = 0; p < n; ++p) {
    let square = 0;
    for (let i = 0; i < n; ++i) square += a[p * n + i] * a[p * n + i];
    least = Math.min(least, square);
    largest = Math.max(largest, square);
  }
  a[0] = Math.sqrt(least) / Math.sqrt(largest) + nought;
}

export { atan2, cos, even, hypot, piece, rest, sin, spread };
