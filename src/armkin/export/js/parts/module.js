/** Names of all branches that a target may have. */
export const branch_names = ARM.names;

/** @param {ArrayLike<number>} q @returns {number[]} actual joint values of commanded ones, which calibration tells apart */
function actual(q) {
  if (q.length !== ARM.joints) throw new RangeError(`${ARM.name} has ${ARM.joints} joints, ${names.join(' ')}; got ${q.length} values`);
  const out = [];
  for (let j = 0; j < q.length; j++) out.push(q[j] * ARM.ratio[j]);
  return out;
}

/** The tool's pose, four rows of four. @param {ArrayLike<number>} q [rad | mm] @returns {number[][]} [mm] */
export function fk(q) {
  poseOf(actual(q), pose16);
  return [0, 4, 8, 12].map((k) => Array.from(pose16.subarray(k, k + 4)));
}

/**
 * The geometric Jacobian in the base's axes, six rows, linear ones first.
 * @param {ArrayLike<number>} q [rad | mm] @returns {number[][]} [mm/rad, 1; slides: 1, 0]
 */
export function jacobian(q) {
  const n = ARM.joints;
  slopeOf(actual(q), slopes);
  return [0, 1, 2, 3, 4, 5].map((i) => Array.from(ARM.ratio, (ratio, j) => slopes[n * i + j] * ratio));
}

/** The target that joint values reach. @param {ArrayLike<number>} q [rad | mm] @returns {Target} */
export function target(q) {
  const goal = new Float64Array(ARM.orientation === 'full' ? 16 : ARM.labels.length);
  targetOf(actual(q), goal);
  if (ARM.orientation !== 'full') return Array.from(goal);
  return [0, 4, 8, 12].map((k) => Array.from(goal.subarray(k, k + 4)));
}

/**
 * All branches that reach a target.
 * @param {Target} target @TARGET@
 * @param {ArrayLike<number>} [near] joint values to stay close to [rad | mm], by default home
 * @returns {Answer} branches within limits first, then by motion from `near`; joints and motion [rad | mm]
 */
export function ik(target, near = home) {
  const { goal, rounding } = read(target);
  const close = actual(near);
  for (const value of close) if (!Number.isFinite(value)) throw new RangeError('near holds a value that is not finite');
  const { rows, status, complete, free } = solutions(goal, close);
  const found = [];
  for (const row of rows) found.push(placed(row, close, goal));
  stay(found, close, goal, rounding);
  let least = Infinity;
  for (const one of found) least = Math.min(least, one.rank);
  found.sort((a, b) => {
    if (a.row.within_limits !== b.row.within_limits) return a.row.within_limits ? -1 : 1;
    return rint((a.rank - least) * EQUAL) - rint((b.rank - least) * EQUAL) || a.branch - b.branch;
  });
  const best = found.length && found[0].row.within_limits ? 0 : null;
  let nearby = null;
  if (best === null) {
    const { q, distance, angle } = closest(goal, close, found.map((one) => one.q));
    const joints = q.map((x, j) => x / ARM.ratio[j]);
    nearby = { joints, position_mm: fk(joints).slice(0, 3).map((row) => row[3]), distance_mm: distance, angle_deg: angle * DEGREES };
  }
  return {
    status: status === 'unreachable' && found.length ? 'boundary' : status,
    complete,
    best,
    free_joints: free.map((j) => names[j]),
    closest: nearby,
    branches: found.map((one) => one.row),
  };
}
