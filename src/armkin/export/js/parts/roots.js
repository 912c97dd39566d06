/**
 * @typedef {object} Pencil see armkin/inverse/elimination/pencil.py for the symbols
 * @property {number} psi @property {number} slot which link carries the pose @property {boolean} backward
 * @property {number} hidden @property {number} dialytic which of the middle joints
 * @property {boolean} wide the third is dialytic, too @property {number} products 12, 16 of a wide role @property {number} rows
 * @property {number} r @property {number} w @property {number} size @property {number[]} order the joints by part
 * @property {boolean[]} slides @property {Float64Array} links @property {Float64Array} columns
 * @property {Float64Array | null} first @property {Float64Array | null} second @property {Float64Array | null} N
 * @property {Float64Array | null} recover @property {Float64Array | null} mix
 * @property {Float64Array | null} K_re @property {Float64Array | null} K_im @property {Float64Array} W
 */
/** @typedef {{N: Float64Array, recover: Float64Array}} Ends */

/** What a pose says of the two end joints: N, rows that remove them, and five that give them back; null where it says
 * nothing. @param {Pencil} pencil @param {Float64Array} Y @returns {Ends | null} */
function eliminate(pencil, Y) {
  if (pencil.slot === 1) return { N: /** @type {Float64Array} */ (pencil.N), recover: /** @type {Float64Array} */ (pencil.recover) };
  const first = /** @type {Float64Array} */ (pencil.first);
  const back = new Float64Array(12);
  const Q = new Float64Array(9 * 16);
  invert(Y, back);
  if (pencil.slot === 5) {
    const f = new Float64Array(16);
    features(back, f);
    for (let k = 0; k < 15; k++) subtract(Q, 0, first, 9 * 16 * k, -f[k], 9 * 16);
  } else {
    const second = /** @type {Float64Array} */ (pencil.second);
    const R = new Float64Array(15 * 16);
    const turned = new Float64Array(15 * 4);
    representation(back, R);
    for (let i = 0; i < 15; i++) for (let k = 0; k < 15; k++) subtract(turned, 4 * i, second, 4 * k, -R[16 * i + k], 4);
    const [one, two] = [[1, 1, 2, 2, 0, 1, 2, 0, 0], [1, 2, 1, 2, 0, 0, 0, 1, 2]];
    for (let j = 0; j < 9; j++)
      for (let k = 0; k < 15; k++) subtract(Q, 16 * j, first, 16 * (15 * one[j] + k), -turned[4 * k + two[j]], 16);
  }
  // Q's nine columns stand as rows of sixteen. Reflections turn them into a triangle; the same, backwards, turn the last
  // eleven unit vectors into rows of the orthonormal basis.
  const along = (/** @type {Float64Array} */ a, /** @type {number} */ p, /** @type {Float64Array} */ b, /** @type {number} */ s) => {
    let sum = 0;
    for (let i = 0; i < 16; i++) sum += a[p + i] * b[s + i];
    return sum;
  };
  const mirror = new Float64Array(9 * 16);
  const factor = new Float64Array(9);
  for (let j = 0; j < 9; j++) {
    for (let i = j; i < 16; i++) mirror[16 * j + i] = Q[16 * j + i];
    let size = Math.sqrt(along(mirror, 16 * j, mirror, 16 * j));
    if (!(size > 0)) return null;
    const own = Q[16 * j + j];
    size = own > 0 ? -size : size;
    factor[j] = 1 / (size * (size - own));
    mirror[16 * j + j] -= size;
    for (let k = j; k < 9; k++) subtract(Q, 16 * k, mirror, 16 * j, factor[j] * along(mirror, 16 * j, Q, 16 * k), 16);
  }
  const basis = new Float64Array(11 * 16);
  for (let k = 0; k < 11; k++) {
    basis[16 * k + 4 + k] = 1;
    for (let j = 8; j >= 0; j--) subtract(basis, 16 * k, mirror, 16 * j, factor[j] * along(mirror, 16 * j, basis, 16 * k), 16);
  }
  const system = new Float64Array(5 * 24);
  for (let i = 0; i < 5; i++)
    for (let j = 0; j < 24; j++) system[24 * i + j] = j < 5 ? Q[16 * (4 + j) + 4 + i] : j < 8 ? 0 : basis[16 * i + j - 8];
  if (!reduce(system, 5, 8, 24)) return null;
  const recover = new Float64Array(80);
  for (let i = 0; i < 5; i++) for (let j = 0; j < 16; j++) recover[16 * i + j] = system[24 * i + 8 + j];
  return { N: basis.slice(5 * 16), recover };
}

/** The p equations (4) of armkin/inverse/elimination/pencil.py, p x (p + size), p = products.
 * @param {Pencil} pencil @param {Float64Array} Y @param {Float64Array} N @returns {Float64Array} */
function equations(pencil, Y, N) {
  const m = pencil.rows;
  const p = pencil.products;
  const factors = pencil.wide ? 4 : 2;
  const width = factors * (p + pencil.size);
  if (pencil.slot === 1) {
    const R = new Float64Array(15 * 16);
    const moved = new Float64Array(m * 16);
    representation(Y, R);
    for (let i = 0; i < m; i++) for (let k = 0; k < 15; k++) subtract(moved, 16 * i, R, 16 * k, -N[16 * i + k], 16);
    N = moved;
  }
  const rows = new Float64Array(m * width);
  for (let i = 0; i < m; i++)
    for (let k = 0; k < 15; k++) subtract(rows, i * width, pencil.columns, k * width, -N[16 * i + k], width);
  const mix = pencil.mix;
  if (!mix) return rows;
  const c = p + pencil.size;
  const count = factors * m;
  const out = new Float64Array(p * c);
  for (let i = 0; i < p; i++)
    for (let k = 0; k < count; k++) if (mix[i * count + k] !== 0) subtract(out, i * c, rows, k * c, -mix[i * count + k], c);
  return out;
}

/** q from multiples of 1, q, q^2, ...: the least-squares quotient of neighbours.
 * @param {Float64Array} power @param {number} from @param {number} count @param {number} step */
function ratioOf(power, from, count, step) {
  let [above, below] = [0, 0];
  for (let i = 0; i + 1 < count; i++) {
    above += power[from + i * step] * power[from + (i + 1) * step];
    below += power[from + i * step] ** 2;
  }
  return above / Math.max(below, 1e-300);
}

/** (cos 3f, sin 3f, cos f, sin f) of f = q / 2. @param {number} q */
function halfPowers(q) {
  return [Math.cos(1.5 * q), Math.sin(1.5 * q), Math.cos(0.5 * q), Math.sin(0.5 * q)];
}

/** The equations at x, p x p, divided by x^2 if x is large. @param {Pencil} pencil @param {Float64Array} E @param {number} x */
function systemAt(pencil, E, x) {
  const { r, w, products: p } = pencil;
  const c = p + pencil.size;
  const far = Math.abs(x) > 1;
  const y = far ? 1 / x : x;
  const A = new Float64Array(p * p);
  for (let i = 0; i < p; i++) {
    const e = i * c;
    for (let j = 0; j < 2 * r; j++) A[p * i + j] = far ? E[e + j] + E[e + p + j] * y : E[e + j] * y + E[e + p + j];
    for (let j = 0; j < w; j++) {
      const two = E[e + 2 * r + j];
      const one = E[e + p + 2 * r + j];
      const none = E[e + p + 2 * r + w + j];
      A[p * i + 2 * r + j] = far ? two + (one + none * y) * y : (two * y + one) * y + none;
    }
  }
  return A;
}

/** The products v of a root x and what the equations there take to zero. @param {Pencil} pencil @param {Float64Array} u @param {number} x */
function vectorOf(pencil, u, x) {
  const { r, w, products: p } = pencil;
  const scale = (Math.abs(x) > 1 ? x : 1) / (1 + x * x);
  const v = new Float64Array(p);
  for (let i = 0; i < p; i++) {
    for (let j = 0; j < r; j++) {
      const K_re = /** @type {Float64Array} */ (pencil.K_re)[i * r + j];
      const K_im = /** @type {Float64Array} */ (pencil.K_im)[i * r + j];
      v[i] += scale * ((u[j] * x + u[r + j]) * K_re - (u[j] - u[r + j] * x) * K_im);
    }
    for (let j = 0; j < w; j++) v[i] += pencil.W[i * w + j] * u[2 * r + j];
  }
  return v;
}

/** The joint values for a root x of the pencil and its products v, and the squared sine between v and the product that a
 * solution's is (0 where slides move); null if it is a slide at infinity.
 * @param {Pencil} pencil @param {Float64Array} v @param {Float64Array} Y @param {Ends} ends @param {number} x
 * @returns {{q: Float64Array, defect: number} | null} */
function jointsFrom(pencil, v, Y, ends, x) {
  const { slides, hidden, dialytic } = pencil;
  const three = pencil.products / 4;
  const third = 3 - hidden - dialytic;
  // v is 4 x 3, 4 x 4 of a wide role: its longest row and column are the safest
  const rowSize = [0, 0, 0, 0];
  const columnSize = [0, 0, 0, 0];
  v.forEach((x, k) => {
    rowSize[Math.floor(k / three)] += x * x;
    columnSize[k % three] += x * x;
  });
  const row = rowSize.indexOf(Math.max(...rowSize));
  const column = columnSize.indexOf(Math.max(...columnSize));
  const middle = [0, 0, 0];
  middle[hidden] = pencil.psi + (slides[2 + hidden] ? 1 / (Math.abs(x) < 1e-100 ? 1e-100 : x) : 2 * Math.atan(x));
  middle[dialytic] = slides[2 + dialytic] ? ratioOf(v, column, 4, three) : 2 * Math.atan2(v[3 * three + column], v[2 * three + column]);
  const at = three * row;
  const sign = v[at] < 0 ? -1 : 1;
  if (slides[2 + third]) middle[third] = ratioOf(v, at, three, 1);
  else middle[third] = pencil.wide ? 2 * Math.atan2(v[at + 3], v[at + 2]) : Math.atan2(sign * v[at + 2], sign * v[at + 1]);
  if (!middle.every((value) => Math.abs(value) < 1e4)) return null;
  let defect = 0;
  if (!slides[2 + dialytic] && !slides[2 + third]) {
    const first = halfPowers(middle[dialytic]);
    const second = pencil.wide ? halfPowers(middle[third]) : [1, Math.cos(middle[third]), Math.sin(middle[third])];
    let along = 0;
    v.forEach((x, k) => (along += x * first[Math.floor(k / three)] * second[k % three]));
    defect = 1 - along ** 2 / (4 * Math.max(dot(rowSize, [1, 1, 1, 1]), 1e-300));
  }
  const link = (/** @type {number} */ i) => (i === pencil.slot ? Y : pencil.links.subarray(12 * i, 12 * i + 12));
  const a = Float64Array.from(link(1));
  const b = new Float64Array(12);
  for (let k = 0; k < 3; k++) {
    move(a, slides[2 + k], middle[k], b);
    times(b, link(2 + k), a);
  }
  const f = new Float64Array(16);
  features(a, f);
  const m = [0, 1, 2, 3, 4].map((i) => { // 1, b1, b2, a1, a2
    let sum = 0;
    for (let k = 0; k < 16; k++) sum += ends.recover[16 * i + k] * f[k];
    return sum;
  });
  const turned = m[0] < 0 ? -1 : 1;
  const one = Math.abs(m[0]) < 1e-300 ? 1 : m[0];
  const part = [slides[0] ? m[3] / one : Math.atan2(turned * m[4], turned * m[3]), slides[1] ? m[1] / one : Math.atan2(turned * m[2], turned * m[1]), ...middle, 0];
  const before = new Float64Array(12);
  const step = new Float64Array(12);
  move(link(5), slides[0], part[0], step);
  times(step, link(0), before);
  move(before, slides[1], part[1], step);
  let [across, level] = [0, 0];
  for (let j = 0; j < 3; j++) {
    across += step[j] * a[4 * j + 1] - step[4 + j] * a[4 * j]; // step A = Je^-1, a turn by -e about z
    level += step[j] * a[4 * j] + step[4 + j] * a[4 * j + 1];
  }
  part[5] = Math.atan2(across, level);
  const q = new Float64Array(6);
  for (let k = 0; k < 6; k++) q[pencil.order[k]] = pencil.backward ? -part[k] : part[k];
  return { q, defect };
}
