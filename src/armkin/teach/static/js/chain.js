// @ts-check
/** Forward kinematics, for drawing alone: link[0] Z1 link[1] ... Zn link[n] (4 x 4, row by row). */

/** @typedef {number[]} Matrix 16 numbers, row by row */

/** @param {Matrix} a @param {Matrix} b @returns {Matrix} */
export function times(a, b) {
  const out = new Array(16);
  for (let i = 0; i < 4; i++) {
    for (let j = 0; j < 4; j++) {
      out[4 * i + j] = a[4 * i] * b[j] + a[4 * i + 1] * b[4 + j] + a[4 * i + 2] * b[8 + j] + a[4 * i + 3] * b[12 + j];
    }
  }
  return out;
}

/**
 * Frames of a pose.
 * @param {import("./types.js").Arm} arm
 * @param {number[]} q joint values [deg | mm]
 * @returns {{before: Matrix[], after: Matrix[], tool: Matrix}} of every joint before and after its motion; the tip's
 */
export function frames(arm, q) {
  let T = arm.links[0].flat();
  /** @type {Matrix[]} */
  const before = [];
  /** @type {Matrix[]} */
  const after = [];
  arm.joints.forEach((joint, i) => {
    before.push(T);
    T = times(T, motion(joint.prismatic, q[i] * joint.ratio));
    after.push(T);
    T = times(T, arm.links[i + 1].flat());
  });
  return { before, after, tool: T };
}

/** @param {boolean} slides @param {number} value @returns {Matrix} */
function motion(slides, value) {
  if (slides) return [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, value, 0, 0, 0, 1];
  const c = Math.cos((value * Math.PI) / 180);
  const s = Math.sin((value * Math.PI) / 180);
  return [c, -s, 0, 0, s, c, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
}

/** Whether a task's targets lie in the base's x-y plane. @param {string | null} task */
export const isFlat = (task) => task === "xy" || task === "xy_theta";
