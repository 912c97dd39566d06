const pose16 = new Float64Array(16);
const slopes = new Float64Array(6 * ARM.joints);

/** Actual joint values of commanded ones, which calibration tells apart.
 * @template {number[] | Float64Array} T @param {ArrayLike<number>} q @param {T} out @returns {T} */
function actual(q, out = /** @type {T} */ (new Array(ARM.joints))) {
  if (q?.length !== ARM.joints) throw new RangeError(`${ARM.name} has ${ARM.joints} joints, ${names.join(' ')}; got ${q?.length ?? 'no'} values`);
  for (let j = 0; j < ARM.joints; j++) out[j] = q[j] * ARM.ratio[j];
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
