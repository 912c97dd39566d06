const way = new Float64Array(16); // what undoes the redundant joint's motion, where it was held last
let wayAt = NaN;
const givenPose = new Float64Array(16);
const movedPose = new Float64Array(16);

/** Products of frames, 16 numbers each. @param {Numbers} a @param {Numbers} b @param {Float64Array} out another than both */
function product(a, b, out) {
  for (let i = 0; i < 16; i += 4)
    for (let j = 0; j < 4; j++) out[i + j] = a[i] * b[j] + a[i + 1] * b[4 + j] + a[i + 2] * b[8 + j] + a[i + 3] * b[12 + j];
}

/** Leaves in `way` what undoes the joint's motion. @param {number} t its actual value */
function undo(t) {
  if (t === wayAt) return;
  const [c, s] = [Math.cos(t), Math.sin(t)];
  product(REDUNDANT.before, [c, s, 0, 0, -s, c, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], movedPose);
  product(movedPose, REDUNDANT.after, way);
  wayAt = t;
}

/**
 * A target as that of the other joints: the redundant joint is the last or the first one, its motion is undone.
 * @param {Target} target @param {number} t its actual value @returns {ArrayLike<number> | Target} of a pose 16 numbers
 */
function moved(target, t) {
  const full = ARM.orientation === 'full';
  if (REDUNDANT.joint && !full) return target; // it turns about the tool's axis, which alone is asked for
  const given = givenPose;
  const wanted = full ? 16 : ARM.labels.length;
  let count = 0;
  for (let i = 0; i < target?.length; i++) {
    const row = target[i];
    if (typeof row === 'number') given[count++] = row;
    else for (let k = 0; k < row?.length; k++) given[count++] = row[k]; // an array of 16 keeps no more
  }
  if (count !== wanted) return target; // refused with its own words
  undo(t);
  if (full) {
    if (REDUNDANT.joint) product(given, way, movedPose);
    else product(way, given, movedPose);
    return movedPose;
  }
  const turned = (/** @type {number} */ first, /** @type {number} */ count, /** @type {number} */ shift) =>
    Array.from({ length: count }, (_, i) => {
      let sum = shift * way[4 * i + 3];
      for (let k = 0; k < count; k++) sum += way[4 * i + k] * given[first + k];
      return sum;
    });
  const p = ARM.position;
  const sums = REDUNDANT.sums.map((by, k) => given[p + k] - t * by);
  return [...turned(0, p, 1), ...sums, ...(ARM.orientation === 'axis' ? turned(3, 3, 0) : [])];
}

const others = new Float64Array(ARM.joints - 1); // of `near` all but the redundant joint

/** Joint values with the redundant one, the last or the first, among them.
 * @param {number[]} q of the others @param {number} held @returns {number[]} */
const whole = (q, held) => (REDUNDANT.joint ? [...q, held] : [held, ...q]);

/** The order of rows: within limits and free, within limits, others. @param {Branch} row */
const rank = (row) => (row.within_limits ? (row.hits?.length ? 1 : 0) : 2);

/**
 * A row of the other joints as one of all, with the redundant one at a value.
 * @param {Branch} row @param {number} value [rad] @param {ArrayLike<number>} near @param {boolean} within whether its limits allow it
 */
function withRedundant(row, value, near, within) {
  const j = REDUNDANT.joint;
  const [low, high] = limits[j] ?? [null, null];
  row.joints = whole(row.joints, value);
  row.motion += Math.abs(value - near[j]);
  if (!within) {
    row.within_limits = false;
    row.violations.push({ joint: names[j], value, lower: low, upper: high });
  }
  if (KEEPS_OUT) Object.assign(row, hitsOf(actual(row.joints)));
  return row;
}

/**
 * All branches that reach a target while the redundant joint is held.
 * @param {Target} target @param {ArrayLike<number>} near @param {number} value where it is held [rad] @returns {Answer}
 */
function heldAnswer(target, near, value) {
  const j = REDUNDANT.joint;
  for (let k = 0; k < others.length; k++) others[k] = near[k < j ? k : k + 1];
  const answer = OTHERS.ik(moved(target, value * ARM.ratio[j]), others);
  const rows = answer.branches;
  const [low, high] = limits[j] ?? [null, null];
  const within = value >= (low ?? -Infinity) - 1e-9 && value <= (high ?? Infinity) + 1e-9;
  for (const row of rows) withRedundant(row, value, near, within);
  if (KEEPS_OUT) rows.sort((/** @type {Branch} */ a, /** @type {Branch} */ b) => rank(a) - rank(b)); // of equal ones the order stays
  answer.best = rows.length && rank(rows[0]) === 0 ? 0 : null;
  if (rows.some((/** @type {Branch} */ row) => row.within_limits)) answer.closest = null;
  if (answer.closest) {
    const joints = whole(answer.closest.joints, value);
    answer.closest = { ...answer.closest, joints, position_mm: fk(joints).slice(0, 3).map((row) => row[3]) };
  }
  return answer;
}

/**
 * All answers to a target: a row for each legal interval of a family of them, its posture nearest to `near`.
 * @param {Target} target @TARGET@
 * @param {ArrayLike<number>} [near] joint values to stay close to [rad | mm], by default home
 * @param {number} [held] where the redundant joint is held instead [rad]; an arm without a closed form holds it in any case,
 *   by default where `near` has it
 * @returns {Answer} branches within limits and free of hits first, then by motion from `near`; joints and motion [rad | mm]
 */
export function ik(target, near = home, held = undefined) {
  const j = REDUNDANT.joint;
  for (const x of actual(near)) if (!Number.isFinite(x)) throw new RangeError('near holds a value that is not finite');
  if (held === undefined && CLOSED_FORM) return families(target, near);
  const value = held === undefined ? near[j] : held;
  if (!Number.isFinite(value)) throw new RangeError(`${names[j]} cannot be held at ${value}: give one finite number`);
  return heldAnswer(target, near, value);
}

/** Names of all branches that a target may have. */
export const branch_names = OTHERS.branch_names;
