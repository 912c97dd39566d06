// Where the Jacobian loses one direction v, the joints move along v and the other directions take away all of the residual
// that they can (Lyapunov-Schmidt reduction). What is left, g(t), and the way x(t) are Chebyshev series on a span of t:
// the component of the solution set is the interval of |g| <= SOLUTION around t = 0.
const NODES = 10;
const SMOOTH = 1e-5; // of a span: how far the series may be off their curve
const ARRIVED = 1e-9; // [rad, reaches] a step that ends the iteration
const FINEST = 3e-6; // of a span: the first point at which |g| is compared
const STEPS = 200; // equal ones of a span: what rises above SOLUTION within one does so by less than a thousandth
// of a span, where |g| is compared
const POINTS = [0, ...Array.from({ length: 24 }, (_, k) => FINEST * (1 / STEPS / FINEST) ** (k / 23))];
for (let k = 2; k <= STEPS; k++) POINTS.push(k / STEPS);
const FINE = 32; // parts of a component at whose ends its slope is compared

/** @typedef {{span: number, v: number[], second: number, low: number, high: number, moves: number[], boundary: boolean,
 *   way: (s: number) => number[]}} Component moves: how far each joint moves along it [rad, reaches]; low, high: its ends along v */

/** Columns that are orthonormal to given ones. @param {number[][]} given @param {number} size @param {number} count */
function complement(given, size, count) {
  const all = given.slice();
  /** @param {number[]} e */
  const rest = (e) => all.reduce((left, u) => left.map((x, i) => x - dot(left, u) * u[i]), e);
  for (let k = 0; k < count; k++) {
    const left = Array.from({ length: size }, (_, i) => rest(Array.from({ length: size }, (_, j) => (i === j ? 1 : 0))));
    const best = left.reduce((a, b) => (dot(b, b) > dot(a, a) ? b : a));
    const once = rest(best);
    all.push(once.map((x) => x / Math.sqrt(dot(once, once))));
  }
  return all.slice(given.length);
}

/**
 * The posture t along v from q, and what is left of its residual: Newton's method on the bordered Jacobian (Keller 1977).
 * @param {number[]} q @param {Numbers} goal @param {number[]} v @param {number[][]} u directions that are not reached @param {number} t
 * @returns {number[] | null} the way from q [rad, reaches], and g; null where the curve turns away
 */
function beyond(q, goal, v, u, t) {
  const [n, k] = [q.length, u.length];
  const size = n + k;
  const wide = 2 * size + 1;
  const a = new Float64Array(size * wide);
  let away = v.map((x) => t * x);
  for (let step = 0; step < 8; step++) {
    const here = stepped(q, away, 1);
    const r = residual(here, goal);
    const J = slope(here);
    a.fill(0);
    for (let i = 0; i < size; i++) {
      const border = i === size - 1;
      for (let j = 0; j < n; j++) a[i * wide + j] = border ? v[j] : J[i][j];
      for (let j = 0; j < k && !border; j++) a[i * wide + n + j] = u[j][i];
      a[i * wide + size] = border ? t - dot(v, away) : r[i];
      a[i * wide + size + 1 + i] = 1;
    }
    if (!reduce(a, size, size, wide)) return null;
    const move = away.map((_, j) => a[j * wide + size]);
    away = away.map((x, j) => x + move[j]);
    const far = Math.max(...away.map(Math.abs));
    if (!(far < 3 * Math.abs(t))) return null;
    if (Math.max(...move.map(Math.abs)) < ARRIVED) return [...away, ...leastLeft(a, n, k, size, wide)];
  }
  return null;
}

/** What is left as long as the least residual across v: of L x = g, L L' the Gram matrix of the rows that give g.
 * @param {Float64Array} a @param {number} n @param {number} k @param {number} size @param {number} wide */
function leastLeft(a, n, k, size, wide) {
  const row = (/** @type {number} */ i) => Array.from(a.subarray((n + i) * wide + size + 1, (n + i) * wide + wide - 1));
  /** @type {number[][]} */
  const basis = [];
  /** @type {number[]} */
  const out = [];
  for (let i = 0; i < k; i++) { // Gram and Schmidt's rows are those of L
    let left = row(i);
    let value = a[(n + i) * wide + size];
    basis.forEach((b, m) => {
      const along = dot(left, b);
      left = left.map((x, j) => x - along * b[j]);
      value -= along * out[m];
    });
    const length = Math.sqrt(dot(left, left));
    basis.push(left.map((x) => x / length));
    out.push(value / length);
  }
  return out;
}

/** Values of Chebyshev series (coefficients, numbers) at s, Clenshaw's way. @param {number[][]} series @param {number} s */
const chebyshev = (series, s) =>
  series[0].map((_, j) => {
    let [b, c] = [0, 0];
    for (let m = series.length - 1; m > 0; m--) [b, c] = [series[m][j] + 2 * s * b - c, b];
    return series[0][j] + s * b - c;
  });

/** The series of the derivative. @param {number[][]} series */
function derivative(series) {
  const out = series.map((row) => row.map(() => 0));
  for (let m = series.length - 1; m > 0; m--)
    for (let j = 0; j < out[0].length; j++) out[m - 1][j] = (out[m + 1]?.[j] ?? 0) + 2 * m * series[m][j];
  out[0] = out[0].map((x) => x / 2);
  return out;
}

/**
 * The component around a posture that solves its target and loses one direction, or none.
 * @param {number[]} q @param {Numbers} goal @returns {Component | null} null where the curve was not followed far enough to tell
 */
function component(q, goal) {
  const [n, rows] = [ARM.joints, residual(q, goal).length];
  if (rows < n) return null;
  const { U, S, V } = decompose(slope(q));
  const v = V[n - 1];
  const u = complement(U.slice(0, n - 1), rows, rows - n + 1);
  let span = (1.2 * REACH) / Math.max(...v.map(Math.abs));
  for (let shrinks = 0; shrinks < 4; shrinks++, span /= 8) {
    /** @type {number[][]} */
    const values = [];
    for (let k = 0; k < NODES; k++) {
      const there = beyond(q, goal, v, u, span * Math.cos((Math.PI * (k + 0.5)) / NODES));
      if (!there) break;
      values.push(there);
    }
    if (values.length < NODES) continue;
    const series = values.map((_, m) =>
      values[0].map((_, j) => {
        const sum = values.reduce((all, value, k) => all + value[j] * Math.cos((Math.PI * m * (k + 0.5)) / NODES), 0);
        return ((m ? 2 : 1) * sum) / NODES;
      }),
    );
    const [x, g] = [series.map((row) => row.slice(0, n)), series.map((row) => row.slice(n))];
    const last = (/** @type {number[][]} */ part) => Math.max(...part.slice(-2).flat().map(Math.abs));
    if (!(last(x) < SMOOTH * span) || !(last(g) < 0.01 * SOLUTION)) continue;
    const found = decided(x, g, span);
    if (found) return { ...found, span, v, second: n > 1 ? S[n - 2] : 1, way: (s) => chebyshev(x, s) };
  }
  return null;
}

/** What the series say; null where the component leaves a span without any joint having moved by REACH.
 * @param {number[][]} x @param {number[][]} g @param {number} span */
function decided(x, g, span) {
  const over = (/** @type {number} */ s) => norm(chebyshev(g, s)) > SOLUTION;
  const [low, high] = [-1, 1].map((sign) => {
    let inner = 0;
    for (let outer of POINTS) {
      if (!over(sign * outer)) {
        inner = outer;
        continue;
      }
      for (let halving = 0; halving < 20; halving++) {
        const middle = (inner + outer) / 2;
        if (over(sign * middle)) outer = middle;
        else inner = middle;
      }
      return { end: sign * inner, ends: true };
    }
    return { end: sign, ends: false };
  });
  const points = Array.from({ length: FINE + 1 }, (_, k) => low.end + (k / FINE) * (high.end - low.end));
  const ways = points.map((s) => chebyshev(x, s));
  const moves = x[0].map((_, j) => Math.max(...ways.map((w) => w[j])) - Math.min(...ways.map((w) => w[j])));
  const long = Math.max(...moves) >= REACH;
  if (!long && !(low.ends && high.ends)) return null;
  const rate = derivative(g);
  const slopes = points.map((s) => chebyshev(rate, s).map((y) => y / span));
  const steepest = slopes.reduce((a, b) => (dot(b, b) > dot(a, a) ? b : a));
  const least = Math.min(...slopes.map((y) => dot(y, steepest))) / Math.max(Math.sqrt(dot(steepest, steepest)), 1e-300);
  return { low: low.end * span, high: high.end * span, moves, boundary: !long && least <= SOLUTION };
}

/** Whether a posture is one with q: on its component, as far as that is known. @param {Component} at @param {number[]} q @param {number[]} other */
function onComponent(at, q, other) {
  const way = between(other, q);
  const t = dot(way, at.v);
  const slack = (4 * SOLUTION) / at.second;
  if (!(t >= at.low - slack && t <= at.high + slack)) return false;
  const x = at.way(Math.min(Math.max(t / at.span, -1), 1));
  return Math.max(...way.map((y, j) => Math.abs(y - x[j]))) <= 4 * SMOOTH * at.span + slack;
}
