const MOST_COLUMNS = 64; // of a matrix that is decomposed: six joints, or as many ways out of a posture
const ORTHOGONAL = 1e-15; // the cosine between columns that rounding leaves
const columns = new Float64Array(MOST_COLUMNS * 2 * MOST_COLUMNS); // of U S, and below them those of V
const squares = new Float64Array(MOST_COLUMNS);
const sizes = new Float64Array(MOST_COLUMNS); // singular values, as the columns stand
/** @type {number[]} */
const bySize = []; // the columns, that of the largest singular value first

/**
 * Singular value decomposition A = U S V' of a small matrix by rotations of its columns (Hestenes 1958): `columns`, `sizes`
 * and `bySize`, until the next one.
 * @param {number[][]} A m rows of n @param {boolean} [on] from the V that stands: that of a matrix nearly the same
 * @returns {number} m + n, the length of the columns
 */
function rotate(A, on = false) {
  const m = A.length;
  const n = A[0].length;
  const all = m + n;
  const W = columns;
  const square = squares;
  for (let j = 0; j < n && !on; j++) for (let i = 0; i < n; i++) W[all * j + m + i] = i === j ? 1 : 0;
  for (let i = 0; i < m; i++) {
    const row = A[i];
    for (let j = 0; j < n; j++) {
      let sum = on ? 0 : row[j];
      for (let k = 0; k < n && on; k++) sum += row[k] * W[all * j + m + k];
      W[all * j + i] = sum;
    }
  }
  for (let sweep = 0, rotated = true; rotated && sweep < 40; sweep++) {
    rotated = false;
    for (let j = 0; j < n; j++) {
      let sum = 0;
      for (let i = all * j; i < all * j + m; i++) sum += W[i] * W[i];
      square[j] = sum;
    }
    for (let j = 0; j < n; j++)
      for (let k = j + 1; k < n; k++) {
        const a = square[j];
        const b = square[k];
        let c = 0;
        for (let i = 0; i < m; i++) c += W[all * j + i] * W[all * k + i];
        if (c * c <= ORTHOGONAL * ORTHOGONAL * a * b || c * c < 1e-300) continue;
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
  bySize.length = n;
  for (let j = 0; j < n; j++) {
    let sum = 0;
    for (let i = all * j; i < all * j + m; i++) sum += W[i] * W[i];
    const size = Math.sqrt(sum);
    sizes[j] = size;
    let at = j;
    for (; at > 0 && sizes[bySize[at - 1]] < size; at--) bySize[at] = bySize[at - 1];
    bySize[at] = j;
  }
  return all;
}

/** Numbers of a column as an array, over a divisor: faster than `subarray`. @param {number} from @param {number} to @param {number} over */
function column(from, to, over) {
  const out = new Array(to - from);
  for (let i = from; i < to; i++) out[i - from] = columns[i] / over;
  return out;
}

/** The same as arrays.
 * @param {number[][]} A @returns {{U: number[][], S: number[], V: number[][]}} columns of U and V, largest singular value first */
function decompose(A) {
  const m = A.length;
  const all = rotate(A);
  return {
    U: bySize.map((j) => column(all * j, all * j + m, sizes[j] || 1)),
    S: bySize.map((j) => sizes[j]),
    V: bySize.map((j) => column(all * j + m, all * j + all, 1)),
  };
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
