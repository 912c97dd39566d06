/** @typedef {ArrayLike<number>} Numbers */
/** @typedef {number[] | number[][]} Target */
/** @typedef {'exact' | 'boundary' | 'singular' | 'unreachable'} Status */
/** @typedef {{joint: string, value: number, lower: number | null, upper: number | null}} Violation */
/**
 * @typedef {object} Branch
 * @property {number[]} joints [rad | mm], the copy nearest to `near` that is within limits, whole turns apart
 * @property {string} name
 * @property {boolean} within_limits
 * @property {Violation[]} violations
 * @property {number} residual_mm
 * @property {number} residual_deg
 * @property {number} motion sum of |change| from `near` [rad | mm]
 */
/**
 * @typedef {object} Answer
 * @property {Status} status what the geometry says, limits apart
 * @property {boolean} complete every isolated branch is listed
 * @property {number | null} best index of the branch within limits that moves the joints least
 * @property {string[]} free_joints joints that move along a self-motion
 * @property {{joints: number[], position_mm: number[], distance_mm: number, angle_deg: number} | null} closest
 *   the posture within limits that misses least, where `best` is null
 * @property {Branch[]} branches
 */
