const shifted = new Float64Array(16);

/** Products of frames, 16 numbers each. @param {Numbers} a @param {Numbers} b @param {Float64Array} out another than both */
function product(a, b, out) {
  for (let i = 0; i < 16; i += 4)
    for (let j = 0; j < 4; j++) out[i + j] = a[i] * b[j] + a[i + 1] * b[4 + j] + a[i + 2] * b[8 + j] + a[i + 3] * b[12 + j];
}

/**
 * A target as that of the other joints: the redundant joint is the last or the first one, its motion is undone.
 * @param {Target} target @param {number} t its actual value @returns {Target}
 */
function moved(target, t) {
  const given = target.flatMap((/** @type {number | number[]} */ row) => row);
  const full = ARM.orientation === 'full';
  if (REDUNDANT.joint && !full) return target; // it turns about the tool's axis, which alone is asked for
  if (given.length !== (full ? 16 : ARM.labels.length)) return target; // refused with its own words
  const [c, s] = [Math.cos(t), Math.sin(t)];
  const back = [c, s, 0, 0, -s, c, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
  const [out, way] = [new Float64Array(16), new Float64Array(16)];
  product(REDUNDANT.before, back, shifted);
  product(shifted, REDUNDANT.after, way);
  if (full) {
    if (REDUNDANT.joint) product(given, way, out);
    else product(way, given, out);
    return [0, 4, 8, 12].map((k) => Array.from(out.subarray(k, k + 4)));
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

/**
 * All branches that reach a target while the redundant joint is held.
 * @param {Target} target @TARGET@
 * @param {ArrayLike<number>} [near] joint values to stay close to [rad | mm], by default home
 * @param {number} [held] where the redundant joint is held [rad], by default where `near` has it
 * @returns {Answer} branches within limits and free of hits first, then by motion from `near`; joints and motion [rad | mm]
 */
export function ik(target, near = home, held = near[REDUNDANT.joint]) {
  const j = REDUNDANT.joint;
  actual(near); // as many as joints
  if (!Number.isFinite(held)) throw new RangeError(`${names[j]} cannot be held at ${held}: give one finite number`);
  const whole = (/** @type {number[]} */ q) => [...q.slice(0, j), held, ...q.slice(j)];
  const others = Array.from(near).filter((_, k) => k !== j);
  const { closest, branches, ...found } = OTHERS.ik(moved(target, held * ARM.ratio[j]), others);
  const [low, high] = limits[j] ?? [null, null];
  const within = held >= (low ?? -Infinity) - 1e-9 && held <= (high ?? Infinity) + 1e-9;
  const rows = branches.map((/** @type {Branch} */ row) => {
    const joints = whole(row.joints);
    return {
      ...row,
      joints,
      within_limits: row.within_limits && within,
      violations: within ? row.violations : [...row.violations, { joint: names[j], value: held, lower: low, upper: high }],
      motion: row.motion + Math.abs(held - near[j]),
      ...hitsOf(actual(joints)),
    };
  });
  const rank = (/** @type {Branch} */ row) => (row.within_limits ? (row.hits?.length ? 1 : 0) : 2);
  rows.sort((/** @type {Branch} */ a, /** @type {Branch} */ b) => rank(a) - rank(b)); // of equal ones the order stays
  const legal = rows.some((/** @type {Branch} */ row) => row.within_limits);
  const joints = closest && whole(closest.joints);
  const nearest = joints && { ...closest, joints, position_mm: fk(joints).slice(0, 3).map((row) => row[3]) };
  return { ...found, best: rows.length && rank(rows[0]) === 0 ? 0 : null, closest: legal ? null : nearest, branches: rows };
}

/** Names of all branches that a target may have. */
export const branch_names = OTHERS.branch_names;
