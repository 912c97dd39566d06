/** The right singular vector of the smallest singular value of an n x n matrix, n = v.length: inverse iteration on A'A.
 * @param {Float64Array} a @param {Float64Array} v */
function nullVector(a, v) {
  const n = v.length;
  const lower = new Float64Array(n * n);
  const w = new Float64Array(n);
  const over = new Float64Array(n);
  for (let k = 0; k < n; k++) {
    const best = pivot(a, k, k, n, n);
    if (best !== k) {
      swap(a, n * k, n * best, n);
      swap(lower, n * k, n * best, n);
    }
    if (!(Math.abs(a[n * k + k]) > 1e-14)) a[n * k + k] = 1e-14; // rounding's size: an exact root has no last pivot
    over[k] = 1 / a[n * k + k];
    for (let i = k + 1; i < n; i++) {
      const factor = a[n * i + k] * over[k];
      lower[n * i + k] = factor;
      subtract(a, n * i, a, n * k, factor, n);
    }
  }
  for (let i = 0; i < n; i++) v[i] = 1 + 0.37 * i - 0.11 * i * i; // any start that no arm is made for
  for (let i = 0; i < n; i++) {
    w[i] = v[i] * over[i];
    subtract(v, 0, a, n * i, w[i], n);
  }
  for (let k = n - 1; k > 0; k--) subtract(w, 0, lower, n * k, w[k], n);
  let size = 0;
  for (let i = 0; i < n; i++) size = Math.max(size, Math.abs(w[i]));
  for (let i = 0; i < n; i++) w[i] /= size;
  for (let i = 1; i < n; i++) for (let k = 0; k < i; k++) w[i] -= lower[n * i + k] * w[k];
  size = 0;
  for (let i = n - 1; i >= 0; i--) {
    let sum = w[i];
    for (let k = n - 1; k > i; k--) sum -= a[n * i + k] * v[k];
    v[i] = sum * over[i];
    size = Math.max(size, Math.abs(v[i]));
  }
  for (let i = 0; i < n; i++) v[i] /= size;
}

/** Similarity transformations that make rows and columns about equally long (Osborne 1960).
 * @param {Float64Array} a @param {number} n rows, n long */
function balance(a, n) {
  for (let round = 0, done = false; round < 20 && !done; round++) {
    done = true;
    for (let i = 0; i < n; i++) {
      let [c, r, f] = [0, 0, 1];
      for (let j = 0; j < n; j++)
        if (j !== i) {
          c += Math.abs(a[j * n + i]);
          r += Math.abs(a[i * n + j]);
        }
      if (!(c > 0) || !(r > 0)) continue;
      const before = c + r;
      for (; c < r / 2; c *= 4) f *= 2;
      for (; c >= r * 2; c /= 4) f /= 2;
      if ((c + r) / f >= 0.95 * before) continue;
      done = false;
      for (let j = 0; j < n; j++) a[i * n + j] /= f;
      for (let j = 0; j < n; j++) a[j * n + i] *= f;
    }
  }
}

/** To upper Hessenberg form by eliminations with row pivots (Wilkinson, The Algebraic Eigenvalue Problem, 6.8).
 * @param {Float64Array} a @param {number} n */
function hessenberg(a, n) {
  const factor = new Float64Array(n);
  for (let m = 1; m < n - 1; m++) {
    const best = pivot(a, m, m - 1, n, n);
    if (best !== m) {
      swap(a, best * n, m * n, n);
      for (let j = 0; j < n; j++) [a[j * n + best], a[j * n + m]] = [a[j * n + m], a[j * n + best]];
    }
    if (!(Math.abs(a[m * n + m - 1]) > 1e-300)) continue;
    const over = 1 / a[m * n + m - 1];
    for (let i = m + 1; i < n; i++) {
      factor[i] = a[i * n + m - 1] * over;
      subtract(a, i * n + m, a, m * n + m, factor[i], n - m);
      a[i * n + m - 1] = 0;
    }
    for (let j = 0; j < n; j++) {
      let sum = a[j * n + m];
      for (let i = m + 1; i < n; i++) sum += a[j * n + i] * factor[i];
      a[j * n + m] = sum;
    }
  }
}

/** Eigenvalues of an upper Hessenberg matrix by Francis' double-shift QR steps (Martin, Peters & Wilkinson 1970). False
 * if they do not converge. @param {Float64Array} a @param {number} n @param {Float64Array} re @param {Float64Array} im */
function eigenvalues(a, n, re, im) {
  let [norm, shift, last, steps] = [0, 0, n - 1, 0];
  for (let i = 0; i < n; i++) for (let j = i > 0 ? i - 1 : 0; j < n; j++) norm += Math.abs(a[i * n + j]);
  while (last >= 0) {
    let [p, q, r] = [0, 0, 0];
    let l = last;
    for (; l > 0; l--) {
      const size = Math.abs(a[(l - 1) * n + l - 1]) + Math.abs(a[l * n + l]) || norm;
      if (Math.abs(a[l * n + l - 1]) <= Number.EPSILON * size) {
        a[l * n + l - 1] = 0;
        break;
      }
    }
    let x = a[last * n + last];
    if (l === last) {
      re[last] = x + shift;
      im[last] = 0;
      last--;
      steps = 0;
      continue;
    }
    let y = a[(last - 1) * n + last - 1];
    let w = a[last * n + last - 1] * a[(last - 1) * n + last];
    let z;
    if (l === last - 1) {
      p = (y - x) / 2;
      q = p * p + w;
      z = Math.sqrt(Math.abs(q));
      x += shift;
      if (q >= 0) {
        z = p + (p < 0 ? -z : z);
        re[last - 1] = re[last] = x + z;
        if (z !== 0) re[last] = x - w / z;
        im[last - 1] = im[last] = 0;
      } else {
        re[last - 1] = re[last] = x + p;
        im[last - 1] = z;
        im[last] = -z;
      }
      last -= 2;
      steps = 0;
      continue;
    }
    if (steps === 60) return false;
    if (steps % 10 === 9) {
      shift += x;
      for (let i = 0; i <= last; i++) a[i * n + i] -= x;
      const size = Math.abs(a[last * n + last - 1]) + Math.abs(a[(last - 1) * n + last - 2]);
      x = y = 0.75 * size;
      w = -0.4375 * size * size;
    }
    steps++;
    let m = last - 2;
    for (; m >= l; m--) {
      const d = m * n + m;
      z = a[d];
      r = x - z;
      const u = y - z;
      p = (r * u - w) / a[d + n] + a[d + 1];
      q = a[d + n + 1] - z - r - u;
      r = a[d + 2 * n + 1];
      const size = 1 / (Math.abs(p) + Math.abs(q) + Math.abs(r));
      p *= size;
      q *= size;
      r *= size;
      if (m === l) break;
      const left = Math.abs(a[d - 1]) * (Math.abs(q) + Math.abs(r));
      const right = Math.abs(p) * (Math.abs(a[d - n - 1]) + Math.abs(z) + Math.abs(a[d + n + 1]));
      if (left <= Number.EPSILON * right) break;
    }
    for (let i = m + 2; i <= last; i++) {
      a[i * n + i - 2] = 0;
      if (i > m + 2) a[i * n + i - 3] = 0;
    }
    for (let k = m; k < last; k++) {
      const up = k * n;
      const mid = up + n;
      const low = mid + n;
      const three = k < last - 1;
      const end = Math.min(last, k + 3);
      if (k > m) {
        p = a[up + k - 1];
        q = a[mid + k - 1];
        r = three ? a[low + k - 1] : 0;
      }
      let size = Math.sqrt(p * p + q * q + r * r);
      if (!(size > 0)) continue;
      size = p < 0 ? -size : size;
      if (k > m) a[up + k - 1] = -size;
      else if (l < m) a[up + k - 1] = -a[up + k - 1];
      p += size;
      x = p / size;
      y = q / size;
      z = r / size;
      q /= p;
      r /= p;
      if (three) {
        for (let j = k; j <= last; j++) {
          const t = a[up + j] + q * a[mid + j] + r * a[low + j];
          a[up + j] -= t * x;
          a[mid + j] -= t * y;
          a[low + j] -= t * z;
        }
        for (let i = l; i <= end; i++) {
          const c = i * n + k;
          const t = x * a[c] + y * a[c + 1] + z * a[c + 2];
          a[c] -= t;
          a[c + 1] -= t * q;
          a[c + 2] -= t * r;
        }
      } else {
        for (let j = k; j <= last; j++) {
          const t = a[up + j] + q * a[mid + j];
          a[up + j] -= t * x;
          a[mid + j] -= t * y;
        }
        for (let i = l; i <= end; i++) {
          const c = i * n + k;
          const t = x * a[c] + y * a[c + 1];
          a[c] -= t;
          a[c + 1] -= t * q;
        }
      }
    }
  }
  return true;
}
