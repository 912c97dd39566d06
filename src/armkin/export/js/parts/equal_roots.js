// Solutions that share the hidden joint: their root is multiple, its vectors are any mixtures of theirs, and are taken apart
// as in `armkin.inverse.elimination.equal_roots`.
const SHARED = 8; // solutions that one root may stand for
const CUBIC = [[0.25, 0, 0.75, 0], [0, 0.25, 0, 0.25], [-0.25, 0, 0.25, 0], [0, -0.25, 0, 0.75]];
const [TILTED_C, TILTED_S] = [0.9156396939833165, 0.4019999388086255]; // of 0.4137 rad

/** @typedef {{q: Float64Array, defect: number, tilt: number, root: number}} Seed a candidate: joint values of the loop, the defect
 * of its vector, its imaginary part as an angle; root: which one it is of, -1 of a multiple one all of whose solutions are known */

/** Orthonormal rows of what an n x n matrix takes to zero; null if that has not d dimensions.
 * @param {Float64Array} a @param {number} n @param {number} d */
function nullSpace(a, n, d) {
  const place = Array.from({ length: n }, (_, k) => k);
  let [first, last, rest] = [0, 0, 0];
  for (let k = 0; k <= n - d; k++) { // complete pivots: the last round only asks what is left
    let [row, column, most] = [k, k, 0];
    for (let i = k; i < n; i++)
      for (let j = k; j < n; j++) if (Math.abs(a[n * i + j]) > most) [most, row, column] = [Math.abs(a[n * i + j]), i, j];
    if (k === 0) first = most;
    if (k === n - d) {
      rest = most;
      break;
    }
    last = most;
    if (!(most > 1e-9 * first)) return null;
    swap(a, n * k, n * row, n);
    for (let i = 0; i < n; i++) [a[n * i + k], a[n * i + column]] = [a[n * i + column], a[n * i + k]];
    [place[k], place[column]] = [place[column], place[k]];
    for (let i = k + 1; i < n; i++) subtract(a, n * i + k, a, n * k + k, a[n * i + k] / a[n * k + k], n - k);
  }
  if (!(rest < 1e-3 * last && rest < 1e-5 * first)) return null;
  /** @type {Float64Array[]} */
  const basis = [];
  for (let f = 0; f < d; f++) {
    const y = new Float64Array(n);
    y[n - d + f] = 1;
    for (let k = n - d - 1; k >= 0; k--) {
      let sum = 0;
      for (let j = k + 1; j < n; j++) sum += a[n * k + j] * y[j];
      y[k] = -sum / a[n * k + k];
    }
    const out = new Float64Array(n);
    for (let j = 0; j < n; j++) out[place[j]] = y[j];
    for (let round = 0; round < 2; round++) {
      for (const other of basis) subtract(out, 0, other, 0, dot(out, other), n);
      const size = Math.sqrt(dot(out, out));
      for (let j = 0; j < n; j++) out[j] /= size;
    }
    basis.push(out);
  }
  return basis;
}

/** The transpose of X, d x d, of high = X low for mixtures' rows, turned so that no joint stands where its tangent is infinite;
 * null if it is not determined. @param {number[][]} low @param {number[][]} high @returns {Float64Array | null} */
function quotient(low, high) {
  const d = low.length;
  const below = low.map((row, i) => row.map((x, k) => TILTED_C * x - TILTED_S * high[i][k]));
  const above = low.map((row, i) => row.map((x, k) => TILTED_S * x + TILTED_C * high[i][k]));
  const system = new Float64Array(d * 2 * d);
  let most = 0;
  for (let i = 0; i < d; i++) {
    for (let j = 0; j < 2 * d; j++) system[2 * d * i + j] = dot(below[i], j < d ? below[j] : above[j - d]);
    most = Math.max(most, system[2 * d * i + i]);
  }
  if (!reduce(system, d, d, 2 * d)) return null;
  for (let i = 0; i < d; i++) if (!(Math.abs(system[2 * d * i + i]) > 1e-8 * most)) return null;
  const out = new Float64Array(d * d);
  for (let i = 0; i < d; i++) for (let j = 0; j < d; j++) out[d * i + j] = system[2 * d * i + d + j];
  return out;
}

/** Weights of the real products among mixtures v, d rows of 4 x three; null where not every product among them is known.
 * @param {Float64Array[]} v @param {number} three @returns {Float64Array[] | null} */
function products(v, three) {
  const d = v.length;
  const cubed = (/** @type {(j: number) => number} */ of) => CUBIC.map((row) => row[0] * of(0) + row[1] * of(1) + row[2] * of(2) + row[3] * of(3));
  const each = Array.from({ length: three }, (_, k) => k);
  const firsts = v.map((row) => each.map((k) => cubed((j) => row[three * j + k])));
  const along = quotient(firsts.map((c) => c.flatMap((x) => x.slice(0, 3))), firsts.map((c) => c.flatMap((x) => x.slice(1))));
  if (!along) return null;
  const four = [0, 1, 2, 3];
  // (1 + cos, sin) and (sin, 1 - cos): the tangent of half the angle leads from one to the other
  const halves = (/** @type {Float64Array} */ row, /** @type {number} */ k) => [row[3 * k] + row[3 * k + 1], row[3 * k + 2], row[3 * k] - row[3 * k + 1]];
  const seconds = v.map((row) => four.map((k) => (three === 3 ? halves(row, k) : cubed((j) => row[4 * k + j]))));
  const second = quotient(seconds.map((c) => c.flatMap((x) => x.slice(0, -1))), seconds.map((c) => c.flatMap((x) => x.slice(1))));
  if (!second) return null;
  for (let i = 0; i < d * d; i++) along[i] += 0.618 * second[i]; // those that have the first joint alike differ by the second
  const M = along.slice();
  const [re, im] = [new Float64Array(d), new Float64Array(d)];
  balance(M, d);
  hessenberg(M, d);
  if (!eigenvalues(M, d, re, im)) return null;
  for (let i = 0; i < d; i++) {
    const slant = Math.abs(im[i]) / (1 + re[i] * re[i] + im[i] * im[i]);
    if (slant > 0 && slant < LOOP.upright) return null;
    for (let j = 0; j < i; j++) if (!(Math.hypot(re[i] - re[j], im[i] - im[j]) > LOOP.upright)) return null;
  }
  const weights = [];
  for (let b = 0; b < d; b++) {
    if (im[b] !== 0) continue;
    const A = along.slice();
    for (let i = 0; i < d; i++) A[d * i + i] -= re[b];
    const one = new Float64Array(d);
    nullVector(A, one);
    weights.push(one);
  }
  return weights;
}

/** Candidates of a root x that d solutions share; null where they are not all known.
 * @param {Pencil} pencil @param {Float64Array} E @param {Float64Array} Y @param {Ends} ends @param {number} x @param {number} d
 * @returns {Seed[] | null} */
function sharedBy(pencil, E, Y, ends, x, d) {
  const p = pencil.products;
  const basis = nullSpace(systemAt(pencil, E, x), p, d);
  if (!basis) return null;
  const v = basis.map((u) => vectorOf(pencil, u, x));
  const weights = products(v, p / 4);
  if (!weights) return null;
  return weights.flatMap((by) => {
    const one = new Float64Array(p);
    v.forEach((row, k) => subtract(one, 0, row, 0, -by[k], p));
    const found = jointsFrom(pencil, one, Y, ends, x);
    return found ? [{ ...found, tilt: 0, root: -1 }] : [];
  });
}

/** All candidates of a pencil whose roots are (re, im), those with a tilt below `most`; part: roots are taken apart that several
 * solutions share. @param {Pencil} pencil @param {Float64Array} E @param {Float64Array} Y @param {Ends} ends
 * @param {Float64Array} re @param {Float64Array} im @param {number} most @param {boolean} part @returns {Seed[]} */
function seedsOf(pencil, E, Y, ends, re, im, most, part) {
  const angle = Array.from(re, (x) => 2 * Math.atan(x));
  const tilt = Array.from(re, (x, i) => (2 * Math.abs(im[i])) / (1 + x * x + im[i] * im[i]));
  const order = [...re.keys()].filter((i) => im[i] >= 0 && tilt[i] < most).sort((a, b) => angle[a] - angle[b]);
  const gap = (/** @type {number} */ j) => angle[order[j]] - angle[order[j - 1]];
  /** @type {Seed[]} */
  const out = [];
  for (let i = 0, j = 0; i < order.length; i = j) { // groups of equal ones
    let [mean, d] = [0, 0];
    for (j = i; j < order.length && (j === i || gap(j) < LOOP.equalRoots); j++) {
      const both = tilt[order[j]] > 0 && tilt[order[j]] < LOOP.equalRoots ? 2 : 1; // rounding made a pair of some
      d += both;
      mean += both * re[order[j]];
    }
    const apart = (i === 0 || gap(i) > LOOP.twinRoots) && (j === order.length || gap(j) > LOOP.twinRoots);
    const found = part && d > 1 && d <= SHARED && apart ? sharedBy(pencil, E, Y, ends, mean / d, d) : null;
    if (found) out.push(...found);
    for (const root of found ? [] : order.slice(i, j)) {
      const u = new Float64Array(pencil.products);
      nullVector(systemAt(pencil, E, re[root]), u);
      const own = jointsFrom(pencil, vectorOf(pencil, u, re[root]), Y, ends, re[root]);
      if (own) out.push({ ...own, tilt: tilt[root], root });
    }
  }
  return out;
}
