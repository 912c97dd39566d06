// @ts-check
/** How far a held joint of seven can turn while the tip stays: Newton's method, from posture to posture. */

const DEGREE = Math.PI / 180;
const STEP = 1; // [deg | mm] between postures
const FINEST = 1e-4; // [deg | mm] to which the ends are found
const EXACT = 1e-10; // [reaches, rad] of the tip
const SLACK = 1e-7; // [deg | mm] beyond a limit that still counts as on it

/** @typedef {import("./types.js").Arm} Arm */

/**
 * The tip's frame (3 x 4), and each joint's axis and a point of it.
 * @param {Arm} arm @param {number[]} q [deg | mm]
 */
function posture(arm, q) {
  let T = arm.links[0].slice(0, 3).flat();
  /** @type {number[][]} */
  const axes = [];
  arm.joints.forEach((joint, i) => {
    const by = q[i] * joint.ratio;
    axes.push([T[2], T[6], T[10], T[3], T[7], T[11]]);
    const [c, s] = joint.prismatic ? [1, 0] : [Math.cos(by * DEGREE), Math.sin(by * DEGREE)];
    const L = arm.links[i + 1];
    const out = new Array(12);
    for (let r = 0; r < 12; r += 4) {
      const x = c * T[r] + s * T[r + 1];
      const y = c * T[r + 1] - s * T[r];
      const z = T[r + 2];
      for (let k = 0; k < 4; k++) out[r + k] = x * L[0][k] + y * L[1][k] + z * L[2][k];
      out[r + 3] += T[r + 3] + (joint.prismatic ? by * z : 0);
    }
    T = out;
  });
  return { T, axes };
}

/** What a tip misses of another: [reaches, rad]. @param {number[]} T @param {number[]} goal @param {number} reach */
function missed(T, goal, reach) {
  const out = [3, 7, 11].map((k) => (goal[k] - T[k]) / reach);
  for (let i = 0; i < 3; i++) {
    const [a, b] = [4 * ((i + 1) % 3), 4 * ((i + 2) % 3)];
    let turn = 0;
    for (let k = 0; k < 3; k++) turn += T[a + k] * goal[b + k] - T[b + k] * goal[a + k];
    out.push(turn / 2);
  }
  return out;
}

/** Solves a square system in place, rows with their right-hand side last; false where it is singular. @param {number[][]} rows */
function solved(rows) {
  const n = rows.length;
  for (let j = 0; j < n; j++) {
    let best = j;
    for (let i = j + 1; i < n; i++) if (Math.abs(rows[i][j]) > Math.abs(rows[best][j])) best = i;
    if (!(Math.abs(rows[best][j]) > 1e-9)) return false;
    [rows[j], rows[best]] = [rows[best], rows[j]];
    for (let i = 0; i < n; i++) {
      const by = rows[i][j] / rows[j][j];
      if (i !== j) for (let k = j; k <= n; k++) rows[i][k] -= by * rows[j][k];
    }
  }
  return true;
}

/** A posture moved onto a tip's frame by all joints but the held one; null where Newton's method does not get there.
 * @param {Arm} arm @param {number[]} start @param {number[]} goal @param {number} held */
function onto(arm, start, goal, held) {
  const q = [...start];
  for (let round = 0; round < 8; round++) {
    const { T, axes } = posture(arm, q);
    const off = missed(T, goal, arm.reach);
    if (Math.hypot(...off) < EXACT) return q;
    const rows = off.map((x) => /** @type {number[]} */ ([x]));
    for (let j = arm.joints.length - 1; j >= 0; j--) {
      if (j === held) continue;
      const [x, y, z, px, py, pz] = axes[j];
      const { prismatic, ratio } = arm.joints[j];
      const [a, b, c] = [T[3] - px, T[7] - py, T[11] - pz];
      const way = prismatic ? [x, y, z, 0, 0, 0] : [y * c - z * b, z * a - x * c, x * b - y * a, x, y, z];
      const unit = ratio * (prismatic ? 1 : DEGREE);
      rows.forEach((row, i) => row.unshift((way[i] * unit) / (i < 3 ? arm.reach : 1)));
    }
    if (!solved(rows)) return null;
    const others = q.map((_, j) => j).filter((j) => j !== held);
    others.forEach((j, k) => (q[j] += rows[k][6] / rows[k][k]));
  }
  return null;
}

/**
 * The legal interval of a held joint: as far as the others follow within their limits, and their tip stays.
 * @param {Arm} arm of seven joints @param {number[]} q [deg | mm] @param {number} held
 * @returns {number[] | null} [deg | mm]; null where the posture itself is outside its limits
 */
export function interval(arm, q, held) {
  const inside = (/** @type {number[]} */ p) =>
    arm.joints.every(({ lower, upper }, j) => p[j] >= (lower ?? -Infinity) - SLACK && p[j] <= (upper ?? Infinity) + SLACK);
  if (!inside(q)) return null;
  const goal = posture(arm, q).T;
  const { lower, upper } = arm.joints[held];
  const [low, high] = [lower ?? Math.min(-180, q[held]), upper ?? Math.max(180, q[held])];
  return [low, high].map((end) => {
    const sign = Math.sign(end - q[held]);
    let [here, before, stride] = [q, q, STEP];
    while (stride > FINEST && here[held] !== end) {
      const by = Math.min(stride, Math.abs(end - here[held]));
      const last = here[held] - before[held];
      const start = here.map((x, j) => x + (last ? ((x - before[j]) / last) * sign * by : 0));
      start[held] = Math.abs(end - here[held]) <= stride ? end : here[held] + sign * by;
      const next = onto(arm, start, goal, held);
      const far = next && Math.max(...next.map((x, j) => Math.abs(x - start[j])));
      if (next && far !== null && far < 5 && inside(next)) {
        [before, here] = [here, next];
        stride = Math.min(STEP, 2 * stride);
      } else stride /= 2;
    }
    return here[held];
  });
}
