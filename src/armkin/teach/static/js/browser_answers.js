// @ts-check
/** Postures and targets answered by the arm's own module, in this browser: as the server answers `look`. */

const DEGREE = Math.PI / 180;

/**
 * @param {any} arm the module
 * @param {{robot: string, task: string, labels: string[], units: string[], pulse_range: (number | null)[][]}} solver words for it
 * @param {import("./types.js").Arm} scene
 */
export function solving(arm, solver, scene) {
  const scale = scene.joints.map((/** @type {import("./types.js").Joint} */ joint) => (joint.prismatic ? 1 : DEGREE));
  const home = scene.joints.map((/** @type {import("./types.js").Joint} */ joint) => joint.home);

  /** @param {number[]} q [deg | mm] @returns {number[]} [rad | mm] */
  const inwards = (q) => q.map((value, j) => value * scale[j]);
  /** @param {number[]} q [rad | mm] @returns {number[]} [deg | mm] */
  const outwards = (q) => q.map((value, j) => value / scale[j]);

  /** Roll, pitch and yaw [deg] of a pose: R = Rz(yaw) Ry(pitch) Rx(roll). @param {number[][]} T */
  function rpy(T) {
    const level = Math.hypot(T[0][0], T[1][0]);
    const pitch = Math.atan2(-T[2][0], level);
    if (level > 1e-9) return [Math.atan2(T[2][1], T[2][2]), pitch, Math.atan2(T[1][0], T[0][0])].map((x) => x / DEGREE);
    return [0, pitch, Math.atan2(-T[0][1], T[1][1])].map((x) => x / DEGREE);
  }

  /** A target as people type it as the module takes it. @param {number[]} values */
  function target(values) {
    const numbers = values.map((value, i) => (solver.units[i] === "deg" ? value * DEGREE : value));
    if (solver.task !== "pose") return numbers;
    const [x, y, z, roll, pitch, yaw] = numbers;
    const [cr, sr, cp, sp] = [Math.cos(roll), Math.sin(roll), Math.cos(pitch), Math.sin(pitch)];
    const [cy, sy] = [Math.cos(yaw), Math.sin(yaw)];
    return [
      [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, x],
      [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, y],
      [-sp, cp * sr, cp * cr, z],
      [0, 0, 0, 1],
    ];
  }

  /** The target that a posture answers, as people type it. @param {number[]} q [rad | mm] @returns {number[]} */
  function typed(q) {
    if (solver.task === "pose") {
      const T = arm.fk(q);
      return [T[0][3], T[1][3], T[2][3], ...rpy(T)];
    }
    return arm.target(q).map((/** @type {number} */ value, /** @type {number} */ i) => (solver.units[i] === "deg" ? value / DEGREE : value));
  }

  /** What a joint outside its limits is called. @param {number[]} q [deg | mm] */
  const outside = (q) =>
    scene.joints.flatMap((/** @type {import("./types.js").Joint} */ joint, /** @type {number} */ j) => {
      const low = joint.lower ?? -Infinity;
      const high = joint.upper ?? Infinity;
      if (q[j] >= low - 1e-7 && q[j] <= high + 1e-7) return [];
      const [from, to] = [joint.lower ?? "any", joint.upper ?? "any"];
      return [`${joint.name} = ${Number(q[j].toPrecision(10))} ${joint.unit} is outside ${from} to ${to} ${joint.unit}`];
    });

  /** Hits in words. @param {{body: string, with: string, depth_mm: number}[]} [hits] */
  const hitsIn = (hits = []) => {
    const words = hits.map((hit) => `${hit.with} by ${hit.depth_mm >= 0.05 ? `${hit.depth_mm.toFixed(1)} mm` : "less than 0.1 mm"} (${hit.body})`);
    return words.length ? `hits ${words.join(", ")}` : "";
  };

  /** What a posture hits, where there are keep-outs. @param {number[]} q [deg | mm] */
  function hitsAt(q) {
    const words = arm.clearance ? hitsIn(arm.clearance(inwards(q)).hits) : "";
    return words ? [`it ${words}`] : [];
  }

  /** Pulses of a posture and what rounding costs at the tip. @param {number[]} q [rad | mm] @param {number[] | null} stands pulses where the arm stands */
  function motors(q, stands) {
    if (!scene.motors) return null;
    const pulses = arm.pulses(q);
    const start = stands ?? arm.pulses(inwards(home));
    const [wanted, got] = [arm.fk(q), arm.fk(arm.joints(pulses))];
    return {
      pulses,
      moves: pulses.map((/** @type {number} */ value, /** @type {number} */ k) => value - start[k]),
      from: stands ? "arm" : "home",
      error_mm: Math.hypot(...[0, 1, 2].map((i) => wanted[i][3] - got[i][3])),
      best: false,
      outside_travel: scene.motors.flatMap((/** @type {{name: string}} */ motor, /** @type {number} */ k) => {
        const [low, high] = solver.pulse_range[k];
        return pulses[k] < (low ?? -Infinity) || pulses[k] > (high ?? Infinity) ? [motor.name] : [];
      }),
    };
  }

  /** @param {{q: number[], target?: number[], branch?: string, nearest?: boolean, stands?: number[] | null}} fields @returns {import("./types.js").Look} */
  function look({ q, target: wanted, branch = "", nearest = true, stands = null }) {
    const near = inwards(q);
    const goal = wanted ?? typed(near);
    const held = arm.redundant ? near[arm.names.indexOf(arm.redundant)] : undefined; // the page holds that joint
    const found = arm.ik(wanted ? target(wanted) : arm.target(near), near, held);
    /** @type {import("./types.js").Branch[]} */
    const branches = found.branches.map((/** @type {any} */ row) => {
      const joints = outwards(row.joints);
      const motion = joints.reduce((/** @type {number} */ sum, /** @type {number} */ x, /** @type {number} */ j) => sum + Math.abs(x - q[j]), 0);
      return { name: row.name, joints, within_limits: row.within_limits, outside: outside(joints), hits: hitsIn(row.hits), motion };
    });
    let chosen = null;
    let shown = q;
    if (!wanted) {
      const same = branches.findIndex(({ joints }) => joints.every((x, j) => Math.abs(x - q[j]) < 1e-4));
      chosen = same < 0 ? null : same;
    } else if (branches[0]?.within_limits) {
      chosen = branches.findIndex((one) => one.within_limits && one.name === branch);
      if (chosen < 0) chosen = 0;
      shown = branches[chosen].joints;
    }
    const T = arm.fk(inwards(shown));
    const closest = wanted && nearest && found.closest;
    return {
      q: shown,
      outside: [...outside(shown), ...hitsAt(shown)],
      tip: { position_mm: [T[0][3], T[1][3], T[2][3]], rpy_deg: rpy(T) },
      motors: motors(inwards(shown), stands),
      task: solver.task, labels: solver.labels, units: solver.units, names: arm.branch_names,
      target: goal, status: found.status, complete: found.complete, free: found.free_joints, branches, chosen,
      closest: closest ? { joints: outwards(closest.joints), distance_mm: closest.distance_mm, angle_deg: closest.angle_deg } : null,
    };
  }
  return { look, home };
}

/**
 * The arm's own module for a served page, so that a drag does not wait for the server; null where there is none.
 * @param {import("./types.js").Arm} scene @param {(name: string) => Promise<any>} act
 */
export async function ownSolver(scene, act) {
  try {
    const { module, about } = await act("solver");
    if (!module) return null;
    const { look } = solving(await import(`data:text/javascript;charset=utf-8,${encodeURIComponent(module)}`), about, scene);
    document.documentElement.dataset.own = "yes"; // for tests
    return { look, held: about.held ?? "" };
  } catch {
    return null; // the server answers alone
  }
}
