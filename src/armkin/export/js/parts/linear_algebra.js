const MOST_COLUMNS = 64; // of a matrix that is decomposed: six joints, or as many ways out of a posture
const ORTHOGONAL = 1e-15; // the cosine between columns that rounding leaves
const wholeColumns = new Float64Array(MOST_COLUMNS * 2 * MOST_COLUMNS);
const squares = new Float64Array(MOST_COLUMNS);

/**
 * Singular value decomposition A = U S V' of a small matrix by rotations of its columns (Hestenes 1958).
 * @param {number[][]} A m rows of n
 * @returns {{U: number[][], S: number[], V: number[][]}} columns of U and V, largest singular value first
 */
function decompose(A) {
  const m = A.length;
  const n = A[0].length;
  const all = m + n; // columns of A V, and below them those of V
  const W = wholeColumns;
  const square = squares;
  for (let j = 0; j < n; j++) {
    for (let i = 0; i < m; i++) W[all * j + i] = A[i][j];
    for (let i = 0; i < n; i++) W[all * j + m + i] = i === j ? 1 : 0;
  }
  for (let sweep = 0, rotated = true; rotated && sweep < 40; sweep++) {
    rotated = false;
    for (let j = 0; j < n; j++) {
      square[j] = 0;
      for (let i = all * j; i < all * j + m; i++) square[j] += W[i] * W[i];
    }
    for (let j = 0; j < n; j++)
      for (let k = j + 1; k < n; k++) {
        const a = square[j];
        const b = square[k];
        let c = 0;
        for (let i = 0; i < m; i++) c += W[all * j + i] * W[all * k + i];
        if (Math.abs(c) <= ORTHOGONAL * Math.sqrt(a * b) || c * c < 1e-300) continue;
        rotated = true;
        const z = (b - a) / (2 * c);
        const t = (z < 0 ? -1 : 1) / (Math.abs(z) + Math.sqrt(1 + z * z));
        const cosine = 1 / Math.sqrt(1 + t * t);
        const sine = cosine * t;
        for (let to = all * j, from = all * k; to < all * j + all; to++, from++) {
          const x = W[to];
          const y = W[from];
          W[to] = cosine * x - sine * y;
          W[from] = cosine * y + sine * x;
        }
        square[j] = a - t * c;
        square[k] = b + t * c;
      }
  }
  /** @type {number[][]} */
  const U = [];
  /** @type {number[]} */
  const S = [];
  /** @type {number[][]} */
  const V = [];
  for (let j = 0; j < n; j++) {
    let size = 0;
    for (let i = all * j; i < all * j + m; i++) size += W[i] * W[i];
    size = Math.sqrt(size);
    const over = size > 0 ? size : 1;
    /** @type {number[]} */
    const u = [];
    /** @type {number[]} */
    const v = [];
    for (let i = all * j; i < all * j + m; i++) u.push(W[i] / over);
    for (let i = all * j + m; i < all * (j + 1); i++) v.push(W[i]);
    let at = j;
    for (; at > 0 && S[at - 1] < size; at--) {
      S[at] = S[at - 1];
      U[at] = U[at - 1];
      V[at] = V[at - 1];
    }
    S[at] = size;
    U[at] = u;
    V[at] = v;
  }
  return { U, S, V };
}

/** @param {Numbers} a @param {Numbers} b */
function dot(a, b) {
  let sum = 0;
  for (let i = 0; i < a.length; i++) sum += a[i] * b[i];
  return sum;
}

/** The length of a vector. @param {Numbers} v */
const norm = (v) => Math.sqrt(dot(v, v));

/** to -= factor what, n numbers from these places on.
 * @param {Float64Array} to @param {number} at @param {Numbers} what @param {number} from @param {number} factor @param {number} n */
function subtract(to, at, what, from, factor, n) {
  for (let j = 0; j < n; j++) to[at + j] -= factor * what[from + j];
}

/** Exchange n numbers of two rows. @param {Float64Array} a @param {number} one @param {number} other @param {number} n */
function swap(a, one, other, n) {
  for (let j = 0; j < n; j++) {
    const kept = a[one + j];
    a[one + j] = a[other + j];
    a[other + j] = kept;
  }
}

/** The row from k to n with the largest entry in a column; rows m long.
 * @param {Float64Array} a @param {number} k @param {number} column @param {number} n @param {number} m */
function pivot(a, k, column, n, m) {
  let most = Math.abs(a[k * m + column]);
  let best = k;
  for (let i = k + 1; i < n; i++) {
    const size = Math.abs(a[i * m + column]);
    if (size > most) [most, best] = [size, i];
  }
  return best;
}

/** Gaussian elimination with row pivots of an n x n system whose right sides stand from the column `right` on, rows m
 * long. Afterwards the right sides hold the solution. False if a pivot vanishes.
 * @param {Float64Array} a @param {number} n @param {number} right @param {number} m */
function reduce(a, n, right, m) {
  for (let k = 0; k < n; k++) {
    const best = pivot(a, k, k, n, m);
    if (!(Math.abs(a[best * m + k]) > 1e-300)) return false;
    if (best !== k) swap(a, k * m, best * m, m);
    const over = 1 / a[k * m + k];
    for (let i = k + 1; i < n; i++) {
      const factor = a[i * m + k] * over;
      if (factor !== 0) subtract(a, i * m + k, a, k * m + k, factor, m - k);
    }
  }
  for (let k = n - 1; k >= 0; k--) {
    const over = 1 / a[k * m + k];
    for (let j = right; j < m; j++) a[k * m + j] *= over;
    for (let i = 0; i < k; i++) subtract(a, i * m + right, a, k * m + right, a[i * m + k], m - right);
  }
  return true;
}
