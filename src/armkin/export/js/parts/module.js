/** Names of all branches that a target may have. */
export const branch_names = ARM.names;

/** Whether a row hits nothing. @param {Found} one */
const free = (one) => !one.row.hits?.length;

/** Rows within limits and free of hits first, then those that hit, then by motion; of equal ones the first branch. @param {Found[]} found */
function sort(found) {
  let least = Infinity;
  for (let k = 0; k < found.length; k++) least = Math.min(least, found[k].rank);
  const after = (/** @type {Found} */ a, /** @type {Found} */ b) => {
    if (a.row.within_limits !== b.row.within_limits) return b.row.within_limits;
    if (a.row.within_limits && free(a) !== free(b)) return free(b);
    const more = rint((a.rank - least) * EQUAL) - rint((b.rank - least) * EQUAL);
    return more === 0 ? a.branch > b.branch : more > 0;
  };
  for (let k = 1; k < found.length; k++) {
    const one = found[k];
    let at = k;
    for (; at > 0 && after(found[at - 1], one); at--) found[at] = found[at - 1];
    found[at] = one;
  }
}

/**
 * All branches that reach a target.
 * @param {Target} target @TARGET@
 * @param {ArrayLike<number>} [near] joint values to stay close to [rad | mm], by default home
 * @returns {Answer} branches within limits and free of hits first, then by motion from `near`; joints and motion [rad | mm]
 */
export function ik(target, near = home) {
  const { goal, rounding } = read(target);
  const close = actual(near);
  for (let j = 0; j < ARM.joints; j++) if (!Number.isFinite(close[j])) throw new RangeError('near holds a value that is not finite');
  const { rows, status, complete, free: loose } = solutions(goal, close);
  /** @type {Found[]} */
  const found = [];
  for (let k = 0; k < rows.length; k++) found.push(placed(rows[k], close, goal));
  stay(found, close, goal, rounding);
  sort(found);
  const branches = [];
  for (let k = 0; k < found.length; k++) branches.push(found[k].row);
  const legal = found.length > 0 && found[0].row.within_limits;
  const best = legal && free(found[0]) ? 0 : null;
  let nearby = null;
  if (!legal) {
    const { q, distance, angle } = closest(goal, close, found.map((one) => one.q));
    const joints = q.map((x, j) => x / ARM.ratio[j]);
    nearby = { joints, position_mm: fk(joints).slice(0, 3).map((row) => row[3]), distance_mm: distance, angle_deg: angle * DEGREES };
  }
  return {
    status: status === 'unreachable' && found.length ? 'boundary' : status,
    complete,
    best,
    free_joints: loose.map((j) => names[j]),
    closest: nearby,
    branches,
  };
}
