// @ts-check
/** In place of server.js in a page that asks no server: the arm's own module answers. */
// @ts-ignore: both are made when the page is written
import * as arm from "armkin/arm.js";
// @ts-ignore
import { plan, solver, arm as scene } from "armkin/data.js";
import { absent, get, make } from "../static/js/dom.js";

const DEGREE = Math.PI / 180;

/** An action that is refused. */
export class Refused extends Error {}

const scale = scene.joints.map((/** @type {import("../static/js/types.js").Joint} */ joint) => (joint.prismatic ? 1 : DEGREE));
const home = scene.joints.map((/** @type {import("../static/js/types.js").Joint} */ joint) => joint.home);

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
  scene.joints.flatMap((/** @type {import("../static/js/types.js").Joint} */ joint, /** @type {number} */ j) => {
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

/** Pulses of a posture and what rounding costs at the tip. @param {number[]} q [rad | mm] */
function motors(q) {
  if (!scene.motors) return null;
  const pulses = arm.pulses(q);
  const start = arm.pulses(inwards(home));
  const [wanted, got] = [arm.fk(q), arm.fk(arm.joints(pulses))];
  return {
    pulses,
    moves: pulses.map((/** @type {number} */ value, /** @type {number} */ k) => value - start[k]),
    from: "home",
    error_mm: Math.hypot(...[0, 1, 2].map((i) => wanted[i][3] - got[i][3])),
    best: false,
    outside_travel: scene.motors.flatMap((/** @type {{name: string}} */ motor, /** @type {number} */ k) => {
      const [low, high] = solver.pulse_range[k];
      return pulses[k] < (low ?? -Infinity) || pulses[k] > (high ?? Infinity) ? [motor.name] : [];
    }),
  };
}

/** @param {{q: number[], target?: number[], branch?: string, nearest?: boolean}} fields @returns {import("../static/js/types.js").Look} */
function look({ q, target: wanted, branch = "", nearest = true }) {
  const near = inwards(q);
  const goal = wanted ?? typed(near);
  const found = arm.ik(wanted ? target(wanted) : arm.target(near), near);
  /** @type {import("../static/js/types.js").Branch[]} */
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
  share(shown, goal);
  return {
    q: shown,
    outside: [...outside(shown), ...hitsAt(shown)],
    tip: { position_mm: [T[0][3], T[1][3], T[2][3]], rpy_deg: rpy(T) },
    motors: motors(inwards(shown)),
    task: solver.task, labels: solver.labels, units: solver.units, names: arm.branch_names,
    target: goal, status: found.status, complete: found.complete, free: found.free_joints, branches, chosen,
    closest: closest ? { joints: outwards(closest.joints), distance_mm: closest.distance_mm, angle_deg: closest.angle_deg } : null,
  };
}

/** Carry out an action. @param {string} name @param {any} [fields] @returns {Promise<any>} */
export async function act(name, fields = {}) {
  if (name === "look") return look(fields);
  if (name === "stop") return {};
  throw new Refused("this page has no server: start armkin teach for that");
}

/** The posture that the address names [deg | mm]; home if it names none. @returns {number[]} */
function addressed() {
  const words = new URLSearchParams(location.hash.slice(1)).get("q")?.split(",") ?? [];
  const values = words.map(Number);
  const good = words.length === home.length && words.every((word) => word.trim() !== "") && values.every(Number.isFinite);
  return good ? values : home;
}

const shared = { link: "", command: "", python: "" };

/** What the address and the buttons say. @param {number[]} q [deg | mm] @param {number[]} goal */
function share(q, goal) {
  const said = q.map((value) => Number(value.toFixed(6)) + 0).join(",");
  const words = goal.map((value) => Number(value.toFixed(6)) + 0);
  shared.link = `#q=${said}`;
  shared.command = `armkin ik ${solver.robot} ${words.join(" ")} --near ${said} --all-branches`;
  shared.python = [
    "import armkin, numpy as np",
    `arm = armkin.load(${JSON.stringify(solver.robot)})`,
    `q = np.array([${said.replaceAll(",", ", ")}]) * [${scene.joints.map((/** @type {any} */ j) => (j.prismatic ? "1" : "np.pi / 180")).join(", ")}]`,
    "T = armkin.fk(arm, q)",
  ].join("\n");
  try {
    history.replaceState(null, "", shared.link);
  } catch {
    // a page whose address cannot change, such as one in a frame, is shown all the same
  }
}

/** A button that copies a text. @param {string} title @param {() => string} text */
function copies(title, text) {
  const button = make("button", { type: "button" }, title);
  button.addEventListener("click", async () => {
    const box = make("textarea", { "aria-label": title, readonly: "" });
    try {
      await navigator.clipboard.writeText(text());
      get("copied").textContent = `${title}: copied`;
    } catch {
      box.value = text(); // no clipboard on a page from disk: the text is shown, and marked
      get("copied").replaceChildren(box);
      box.select();
    }
  });
  return button;
}

/** @param {any} page */
function ready(page) {
  for (const part of document.querySelectorAll("[data-served]")) absent.append(part);
  get("keys").querySelector("p")?.replaceChildren("1 to 8 a branch, arrows and Page up, Page down the end effector by 5 mm (with Shift 0.5 mm), P play, F fit the picture");
  if (plan) page.program.carry(plan);
  else absent.append(get("program"));
  const title = make("h2", { id: "share-title" }, "Share");
  const buttons = make(
    "div", { class: "row" },
    copies("Copy link", () => `${location.href.split("#")[0]}${shared.link}`),
    copies("Copy as command", () => shared.command),
    copies("Copy as Python", () => shared.python),
  );
  const section = make("section", { id: "share", "aria-labelledby": "share-title" }, title, buttons, make("p", { id: "copied", role: "status" }));
  get("keys").before(section);
  addEventListener("hashchange", () => page.turn(addressed()));
}

/**
 * @param {Object<string, (data: any) => void>} hears topic -> what to do
 * @returns {Promise<any>} the scene and what is shown
 */
export async function enter(hears) {
  /** @type {any} */ (window).armkin = arm;
  hears.control({ holder: "yours", pages: 1 });
  const program = { moves: [], blend: 0, speed: 100, tool_speed: null, via: false, undo: 0, redo: 0 };
  return { scene, look: look({ q: addressed() }), program, ready };
}
