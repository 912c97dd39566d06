/** @typedef {ArrayLike<number>} Numbers */
/** @typedef {Numbers | Numbers[]} Target numbers of the task, or a pose's rows */
/** @typedef {'exact' | 'boundary' | 'singular' | 'unreachable'} Status */
/** @typedef {{joint: string, value: number, lower: number | null, upper: number | null}} Violation */
/** @typedef {{body: string, with: string, depth_mm: number}} Hit */
/**
 * @typedef {object} Branch
 * @property {number[]} joints [rad | mm], the copy nearest to `near` that is within limits, whole turns apart
 * @property {string} name
 * @property {boolean} within_limits
 * @property {Violation[]} violations
 * @property {number} residual_mm
 * @property {number} residual_deg
 * @property {number | null} [clearance_mm] where the robot file or its scene has keep-outs: least distance of any pair, negative: a hit
 * @property {Hit[]} [hits] what it hits, the deepest first
 * @property {{joint: string, interval: number[]}} [family] of an arm with a joint to spare: the interval of that joint [rad] along which the
 *   family of this answer stays within limits
 * @property {number} motion sum of |change| from `near` [rad | mm]
 */
/**
 * @typedef {object} Answer
 * @property {Status} status what the geometry says, limits apart
 * @property {boolean} complete every isolated branch is listed
 * @property {number | null} best index of the branch within limits, free of hits, that moves the joints least
 * @property {string[]} free_joints joints that move along a self-motion
 * @property {{joints: number[], position_mm: number[], distance_mm: number, angle_deg: number} | null} closest
 *   the posture within limits that misses least, where no branch is within limits
 * @property {Branch[]} branches
 */
