const REGULAR = 1e-5; // singular value from which on a Jacobian is inverted

/** @type {number[]} */
const residualNumbers = []; // as `residual` leaves them, until the next one

let pin = /** @type {Pin | null} */ (null); // a joint that is held counts as one more number of the target

/**
 * What joint values miss of a target: lengths in reaches, angles in rad. The array is the same each time.
 * @param {Numbers} q @param {Numbers} goal @returns {number[]}
 */
function residual(q, goal) {
  poseOf(q, pose16);
  const T = pose16;
  const out = residualNumbers;
  let count = 0;
  const first = ARM.orientation === 'full' ? 9 : 0;
  for (let i = 0; i < ARM.position; i++) out[count++] = (goal[first + i] - T[4 * i + 3]) / ARM.reach;
  for (let k = 0; k < ARM.sums.length; k++) {
    const off = goal[ARM.position + k] - dot(ARM.sums[k], q) - ARM.offsets[k];
    out[count++] = off - TURN * rint(off / TURN);
  }
  if (ARM.orientation === 'full') {
    let [a, b, c, trace] = [0, 0, 0, 0];
    for (let k = 0; k < 3; k++) {
      const [x, y, z] = [goal[3 * k], goal[3 * k + 1], goal[3 * k + 2]];
      a += T[4 + k] * z - T[8 + k] * y;
      b += T[8 + k] * x - T[k] * z;
      c += T[k] * y - T[4 + k] * x;
      trace += T[k] * x + T[4 + k] * y + T[8 + k] * z;
    }
    const sine = 0.5 * Math.sqrt(a * a + b * b + c * c);
    const scale = 0.5 * (trace < 3 - 1e-8 && sine > 1e-12 ? Math.atan2(sine, (trace - 1) / 2) / sine : 1);
    // half a turn off has no axis to turn about: any will do
    out[count++] = trace < 0 && sine <= 1e-12 ? Math.PI : a * scale;
    out[count++] = b * scale;
    out[count++] = c * scale;
  }
  if (ARM.orientation === 'axis') {
    const z = [T[2], T[6], T[10]];
    const w = cross(z, [goal[3], goal[4], goal[5]]);
    const sine = norm(w);
    const cosine = z[0] * goal[3] + z[1] * goal[4] + z[2] * goal[5];
    const half = sine <= 1e-12 && cosine < 0;
    const scale = sine > 1e-12 ? Math.atan2(sine, cosine) / sine : 1;
    for (let k = 0; k < 3; k++) out[count++] = half ? Math.PI * T[4 * k] : w[k] * scale;
  }
  if (pin) out[count++] = less(pin.at, q[pin.joint], false);
  out.length = count;
  return out;
}

/** What joint values miss, as `misses` leaves it: a length [reaches], an angle [rad]. An array: V8 boxes every number that is
 * given to a variable outside functions. */
const off2 = new Float64Array(2);

/** What joint values miss: `off2`. @param {Numbers} q @param {Numbers} goal */
function misses(q, goal) {
  poseOf(q, pose16);
  apartFrom(pose16, q, goal);
}

/** What a pose of joint values misses: `off2`. @param {Float64Array} T @param {Numbers} q @param {Numbers} goal */
function apartFrom(T, q, goal) {
  if (ARM.orientation !== 'full') {
    let [length, angle] = [0, 0];
    for (let i = 0; i < ARM.position; i++) length += (goal[i] - T[4 * i + 3]) ** 2;
    for (let k = 0; k < ARM.sums.length; k++) {
      const off = goal[ARM.position + k] - dot(ARM.sums[k], q) - ARM.offsets[k];
      angle += (off - TURN * rint(off / TURN)) ** 2;
    }
    if (ARM.orientation === 'axis') {
      const a = T[6] * goal[5] - T[10] * goal[4];
      const b = T[10] * goal[3] - T[2] * goal[5];
      const c = T[2] * goal[4] - T[6] * goal[3];
      angle += Math.atan2(Math.sqrt(a * a + b * b + c * c), T[2] * goal[3] + T[6] * goal[4] + T[10] * goal[5]) ** 2;
    }
    off2[0] = Math.sqrt(length) / ARM.reach;
    off2[1] = Math.sqrt(angle);
    return;
  }
  const x = T[3] - goal[9];
  const y = T[7] - goal[10];
  const z = T[11] - goal[11];
  const a = T[4] * goal[2] - T[8] * goal[1] + T[5] * goal[5] - T[9] * goal[4] + T[6] * goal[8] - T[10] * goal[7];
  const b = T[8] * goal[0] - T[0] * goal[2] + T[9] * goal[3] - T[1] * goal[5] + T[10] * goal[6] - T[2] * goal[8];
  const c = T[0] * goal[1] - T[4] * goal[0] + T[1] * goal[4] - T[5] * goal[3] + T[2] * goal[7] - T[6] * goal[6];
  off2[0] = Math.sqrt(x * x + y * y + z * z) / ARM.reach;
  const sine = Math.sqrt(a * a + b * b + c * c) / 2;
  const trace =
    T[0] * goal[0] + T[1] * goal[3] + T[2] * goal[6] + T[4] * goal[1] + T[5] * goal[4] + T[6] * goal[7] + T[8] * goal[2] + T[9] * goal[5] + T[10] * goal[8];
  off2[1] = trace > 2 ? sine : Math.atan2(sine, (trace - 1) / 2); // half a turn has no sine
}

/** The rows that `slope` leaves, until the next one. @type {number[][]} */
const slopeRows = Array.from({ length: ARM.position + ARM.sums.length + (ARM.orientation === 'none' ? 0 : 3) }, () => new Array(ARM.joints).fill(0));

/** The rows of the residual's Jacobian, joints in rad and reaches. The arrays are the same each time.
 * @param {Numbers} q @returns {number[][]} */
function slope(q) {
  slopeOf(q, slopes);
  const n = ARM.joints;
  const rows = slopeRows;
  const [p, turns] = [ARM.position, ARM.position + ARM.sums.length];
  for (let i = 0; i < p; i++) for (let j = 0; j < n; j++) rows[i][j] = (slopes[n * i + j] * ARM.unit[j]) / ARM.reach;
  for (let i = p; i < turns; i++) for (let j = 0; j < n; j++) rows[i][j] = ARM.sums[i - p][j] * ARM.unit[j];
  if (ARM.orientation !== 'none')
    for (let i = 0; i < 3; i++) for (let j = 0; j < n; j++) rows[turns + i][j] = slopes[n * (3 + i) + j] * ARM.unit[j];
  if (ARM.orientation === 'axis') {
    poseOf(q, pose16); // a turn about the tool's z axis is none of the target's
    for (let j = 0; j < n; j++) {
      let along = 0;
      for (let i = 0; i < 3; i++) along += pose16[4 * i + 2] * rows[turns + i][j];
      for (let i = 0; i < 3; i++) rows[turns + i][j] -= pose16[4 * i + 2] * along;
    }
  }
  if (pin) return [...rows, rows[0].map((_, j) => (j === pin?.joint ? 1 : 0))];
  return rows;
}

/** How far joint values miss a target: the norm of the residual. @param {Numbers} q @param {Numbers} goal */
const missed = (q, goal) => norm(residual(q, goal));

/** @param {number[]} a @param {number[]} b */
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

const stepSystem = new Float64Array(ARM.joints * (2 * ARM.joints + 1));

/** The step that takes a residual away, where the Jacobian's inverse says that no direction is weak; else null.
 * @param {number[][]} J @param {number[]} r */
function regularStep(J, r) {
  const n = ARM.joints;
  const wide = 2 * n + 1;
  if (r.length !== n) return null;
  for (let i = 0; i < n; i++)
    for (let j = 0; j < wide; j++) stepSystem[wide * i + j] = j < n ? J[i][j] : j === n ? r[i] : j - n - 1 === i ? 1 : 0;
  if (!reduce(stepSystem, n, n, wide)) return null;
  let square = 0;
  for (let i = 0; i < n; i++) for (let j = n + 1; j < wide; j++) square += stepSystem[wide * i + j] ** 2;
  if (!(square * REGULAR ** 2 < 1)) return null; // its norm is no less than one over the weakest singular value
  const move = new Array(n);
  for (let j = 0; j < n; j++) move[j] = stepSystem[wide * j + n];
  return move;
}

/** The least step that takes a residual away, but along weak directions. @param {number[][]} J @param {number[]} r @param {number} weakest */
function weakStep(J, r, weakest) {
  const n = ARM.joints;
  const m = r.length;
  const all = rotate(J);
  const move = new Array(n).fill(0);
  for (let k = 0; k < n; k++) {
    const size = sizes[k];
    if (!(size > weakest)) continue;
    let along = 0;
    for (let i = 0; i < m; i++) along += columns[all * k + i] * r[i];
    along /= size * size;
    for (let j = 0; j < n; j++) move[j] += along * columns[all * k + m + j];
  }
  return move;
}

/**
 * Newton's method, the step along weak directions damped. Towards a double root a step leaves a quarter of the residual: then
 * the next one goes twice as far.
 * @param {Numbers} start @param {Numbers} goal @param {number} steps
 * @param {number} [weakest] singular value below which a direction is not moved along
 * @returns {{q: number[], missed: number}}
 */
function newton(start, goal, steps, weakest = 1e-10) {
  const n = ARM.joints;
  let q = Array.from(start);
  let best = { q, missed: Infinity };
  for (let step = 0, before = NaN; step <= steps; step++) {
    const r = residual(q, goal);
    const size = norm(r);
    const double = Math.abs(size / before - 0.25) < 0.02;
    before = size;
    if (size < best.missed) best = { q, missed: size };
    if (size < 1e-15 || step === steps) break;
    const J = slope(q);
    const move = (weakest < REGULAR && regularStep(J, r)) || weakStep(J, r, weakest); // on a self-motion one is weak
    let longest = 0;
    for (let j = 0; j < n; j++) longest = Math.max(longest, Math.abs(move[j]));
    q = stepped(q, move, longest > 0.3 ? 0.3 / longest : double ? 2 : 1);
  }
  return best;
}
