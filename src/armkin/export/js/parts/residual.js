const REGULAR = 1e-5; // singular value from which on a Jacobian is inverted

/**
 * What joint values miss of a target: lengths in reaches, angles in rad.
 * @param {Numbers} q @param {Numbers} goal @returns {number[]}
 */
function residual(q, goal) {
  poseOf(q, pose16);
  const T = pose16;
  const out = [];
  const first = ARM.orientation === 'full' ? 9 : 0;
  for (let i = 0; i < ARM.position; i++) out.push((goal[first + i] - T[4 * i + 3]) / ARM.reach);
  ARM.sums.forEach((row, k) => {
    const off = goal[ARM.position + k] - dot(row, q) - ARM.offsets[k];
    out.push(off - TURN * rint(off / TURN));
  });
  if (ARM.orientation === 'full') {
    let trace = 0;
    const w = [0, 0, 0];
    for (let k = 0; k < 3; k++)
      for (let i = 0; i < 3; i++) {
        const [x, y] = [(i + 1) % 3, (i + 2) % 3];
        w[i] += 0.5 * (T[4 * x + k] * goal[3 * k + y] - T[4 * y + k] * goal[3 * k + x]);
        trace += T[4 * i + k] * goal[3 * k + i];
      }
    const sine = Math.hypot(w[0], w[1], w[2]);
    const scale = trace < 3 - 1e-8 && sine > 1e-12 ? Math.atan2(sine, (trace - 1) / 2) / sine : 1;
    // half a turn off has no axis to turn about: any will do
    if (trace < 0 && sine <= 1e-12) w[0] = Math.PI;
    out.push(w[0] * scale, w[1] * scale, w[2] * scale);
  }
  if (ARM.orientation === 'axis') {
    const z = [T[2], T[6], T[10]];
    const w = cross(z, [goal[3], goal[4], goal[5]]);
    const sine = Math.hypot(w[0], w[1], w[2]);
    const cosine = z[0] * goal[3] + z[1] * goal[4] + z[2] * goal[5];
    if (sine > 1e-12) out.push(...w.map((x) => (x * Math.atan2(sine, cosine)) / sine));
    else out.push(...(cosine < 0 ? [Math.PI * T[0], Math.PI * T[4], Math.PI * T[8]] : w));
  }
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

/** The rows of the residual's Jacobian, joints in rad and reaches. @param {Numbers} q @returns {number[][]} */
function slope(q) {
  slopeOf(q, slopes);
  const n = ARM.joints;
  const row = (/** @type {number} */ i, /** @type {number} */ scale) => {
    const out = new Array(n);
    for (let j = 0; j < n; j++) out[j] = slopes[n * i + j] * ARM.unit[j] * scale;
    return out;
  };
  const rows = [];
  for (let i = 0; i < ARM.position; i++) rows.push(row(i, 1 / ARM.reach));
  for (const sum of ARM.sums) rows.push(sum.map((x, j) => x * ARM.unit[j]));
  if (ARM.orientation === 'none') return rows;
  const turns = [row(3, 1), row(4, 1), row(5, 1)];
  if (ARM.orientation === 'axis') {
    poseOf(q, pose16); // a turn about the tool's z axis is none of the target's
    const z = [pose16[2], pose16[6], pose16[10]];
    for (let j = 0; j < n; j++) {
      const along = z[0] * turns[0][j] + z[1] * turns[1][j] + z[2] * turns[2][j];
      for (let i = 0; i < 3; i++) turns[i][j] -= z[i] * along;
    }
  }
  return [...rows, ...turns];
}

/** How far joint values miss a target: the norm of the residual. @param {Numbers} q @param {Numbers} goal */
const missed = (q, goal) => norm(residual(q, goal));

/** @param {number[]} a @param {number[]} b */
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

const stepSystem = new Float64Array(ARM.joints * (2 * ARM.joints + 1));

/** The step that takes a residual away, where the Jacobian's inverse says that no direction is weak; else null.
 * @param {number[][]} J @param {number[]} r @param {number} weakest */
function regularStep(J, r, weakest) {
  const n = ARM.joints;
  const wide = 2 * n + 1;
  if (r.length !== n) return null;
  for (let i = 0; i < n; i++)
    for (let j = 0; j < wide; j++) stepSystem[wide * i + j] = j < n ? J[i][j] : j === n ? r[i] : j - n - 1 === i ? 1 : 0;
  if (!reduce(stepSystem, n, n, wide)) return null;
  let square = 0;
  for (let i = 0; i < n; i++) for (let j = n + 1; j < wide; j++) square += stepSystem[wide * i + j] ** 2;
  if (!(square * Math.max(weakest, REGULAR) ** 2 < 1)) return null; // its norm is no less than one over the weakest singular value
  const move = new Array(n);
  for (let j = 0; j < n; j++) move[j] = stepSystem[wide * j + n];
  return move;
}

/** The least step that takes a residual away, but along weak directions. @param {number[][]} J @param {number[]} r @param {number} weakest */
function weakStep(J, r, weakest) {
  const { U, S, V } = decompose(J);
  const move = new Array(ARM.joints).fill(0);
  for (let k = 0; k < S.length; k++) {
    if (!(S[k] > weakest)) continue;
    const along = dot(U[k], r) / S[k];
    for (let j = 0; j < move.length; j++) move[j] += along * V[k][j];
  }
  return move;
}

/**
 * Newton's method, the step along weak directions damped.
 * @param {Numbers} start @param {Numbers} goal @param {number} steps
 * @param {number} [weakest] singular value below which a direction is not moved along
 * @returns {{q: number[], missed: number}}
 */
function newton(start, goal, steps, weakest = 1e-10) {
  let q = Array.from(start);
  let best = { q, missed: Infinity };
  for (let step = 0; step <= steps; step++) {
    const r = residual(q, goal);
    const size = norm(r);
    if (size < best.missed) best = { q, missed: size };
    if (size < 1e-15 || step === steps) break;
    const J = slope(q);
    const move = regularStep(J, r, weakest) ?? weakStep(J, r, weakest);
    let longest = 0;
    for (let j = 0; j < move.length; j++) longest = Math.max(longest, Math.abs(move[j]));
    const scale = longest > 0.3 ? 0.3 / longest : 1;
    q = q.map((x, j) => x + scale * move[j] * ARM.unit[j]);
  }
  return best;
}
