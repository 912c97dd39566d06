// @ts-check
/** An arm as solid bodies: tubes along its skeleton, drums around its joints, rails for its slides. */
import {
  BoxGeometry, BufferGeometry, CapsuleGeometry, CylinderGeometry, Float32BufferAttribute, Group, Matrix4, Mesh, Quaternion,
  SphereGeometry, Vector3,
} from "three";
import { frames } from "./chain.js";

/** @typedef {import("./types.js").Arm} Arm */
/** @typedef {{geometry: import("three").BufferGeometry, drum: boolean}} Part */

/**
 * The parts of every body, in its own frame; shared by the solid arm and its ghosts.
 * @param {Arm} arm
 */
export class Shapes {
  /** @param {Arm} arm */
  constructor(arm) {
    this.arm = arm;
    const n = arm.joints.length;
    /** @param {number} i */
    this.radius = (i) => arm.reach * (0.042 - (0.022 * i) / Math.max(n, 1));
    /** @type {Part[][]} */
    this.bodies = arm.bodies.map((corners, i) => (i ? this.tubes(this.raised(corners, i), this.radius(i)) : this.foot(corners)));
    /** Each body but the base as a thin line, without drums. */
    this.lines = arm.bodies.slice(1).map((corners, i) => this.tubes(corners, 0.2 * this.radius(i + 1)));
    /** @type {(Part|null)[]} a slide's rail, in the frame before its motion */
    this.rails = arm.joints.map(() => null);
    arm.joints.forEach((joint, i) => this.joint(joint, i));
    const tool = this.gripper();
    this.bodies[n].push(...tool);
    arm.meshes?.bodies.forEach((text, i) => {
      if (!text) return;
      this.bodies[i] = [{ geometry: mesh(text, /** @type {any} */ (arm.meshes).unit), drum: false }];
      if (i) this.rails[i - 1] = null; // a slide's own mesh shows it
    });
  }

  /**
   * @param {number[][]} corners
   * @param {number} r
   * @returns {Part[]}
   */
  tubes(corners, r) {
    const parts = [];
    for (let k = 1; k < corners.length; k++) {
      const a = new Vector3(...corners[k - 1]);
      const way = new Vector3(...corners[k]).sub(a);
      const length = way.length();
      if (length < 1e-6 * this.arm.reach) continue;
      const tube = new CapsuleGeometry(r, length, 4, 14);
      parts.push({ geometry: along(tube, a.addScaledVector(way, 0.5), way), drum: false });
    }
    if (!parts.length) {
      const ball = new SphereGeometry(r, 14, 10);
      ball.translate(corners[0][0], corners[0][1], corners[0][2]);
      parts.push({ geometry: ball, drum: false });
    }
    return parts;
  }

  /** @param {import("./types.js").Joint} joint @param {number} i */
  joint(joint, i) {
    const r = this.radius(i);
    const centre = new Vector3(0, 0, joint.at);
    const z = new Vector3(0, 0, 1);
    if (!joint.prismatic) {
      centre.z += i === 0 ? this.above(joint, 1.45 * r) : this.beyond(i, 1.45 * r);
      const drum = new CylinderGeometry(1.45 * r, 1.45 * r, 2.9 * r, 24);
      this.bodies[i + 1].push({ geometry: along(drum, centre, z), drum: true });
      return;
    }
    const low = joint.lower ?? -0.25 * this.arm.reach;
    const high = joint.upper ?? 0.25 * this.arm.reach;
    const rail = new BoxGeometry(0.8 * r, Math.max(high - low, r), 0.8 * r);
    this.rails[i] = { geometry: along(rail, new Vector3(0, 0, joint.at + (low + high) / 2), z), drum: false };
    const box = new BoxGeometry(2.4 * r, 2.6 * r, 2.4 * r);
    this.bodies[i + 1].push({ geometry: along(box, centre, z), drum: true });
  }

  /** How far a drum is moved along its axis that a slide's box before it would hide: to the box's end. @param {number} i @param {number} half */
  beyond(i, half) {
    const slide = this.arm.joints[i - 1];
    const link = this.arm.links[i];
    const level = link[2][2] * this.arm.joints[i].at + link[2][3] - slide.at;
    const box = 1.3 * this.radius(i - 1);
    const hidden = slide.prismatic && Math.abs(link[2][2]) > 0.9 && Math.abs(level) < box && Math.hypot(link[0][3], link[1][3]) < box;
    return hidden ? Math.sign(link[2][2]) * (box + half - level) : 0;
  }

  /** The base: a post that ends flat on what it stands on. @param {number[][]} corners @returns {Part[]} */
  foot(corners) {
    const [a, b] = corners.map((corner) => new Vector3(...corner));
    const way = b.clone().sub(a);
    if (way.length() < 1e-6 * this.arm.reach) return [];
    const post = new CylinderGeometry(this.radius(0), this.radius(0), way.length(), 24);
    return [{ geometry: along(post, a.addScaledVector(way, 0.5), way), drum: false }];
  }

  /** Body 1 begins in its drum. @param {number[][]} corners @param {number} i */
  raised(corners, i) {
    const joint = this.arm.joints[0];
    if (i > 1 || joint.prismatic) return corners;
    const [first, ...rest] = corners;
    return [[first[0], first[1], first[2] + this.above(joint, 1.45 * this.radius(0))], ...rest];
  }

  /** How far joint 1's drum is raised along its axis to stand on the base's foot. @param {import("./types.js").Joint} joint @param {number} half */
  above(joint, half) {
    const [link, base] = [this.arm.links[0], this.arm.base];
    const axis = [0, 1, 2].map((row) => link[row][2]);
    const over = axis.reduce((sum, z, row) => sum + z * (link[row][3] + joint.at * z - base[row][3]), 0);
    const up = axis.reduce((sum, z, row) => sum + z * base[row][2], 0); // an axis may point into the floor
    const way = Math.sign(Math.abs(over) > 1e-6 * half ? over : up) || 1;
    return Math.abs(over) < half ? way * half - over : 0;
  }

  /** Two fingers that continue the last piece of the arm. @returns {Part[]} */
  gripper() {
    if (!this.arm.gripper) return [];
    const n = this.arm.joints.length;
    const r = this.radius(n);
    const tool = new Matrix4().fromArray(this.arm.links[n].flat()).transpose();
    const way = new Vector3(...this.arm.gripper.along);
    return [-1, 1].map((side) => {
      const finger = new BoxGeometry(0.5 * r, 3.2 * r, 0.9 * r);
      finger.translate(0.8 * side * r, -0.9 * r, 0);
      return { geometry: along(finger, new Vector3(), way).applyMatrix4(tool), drum: true };
    });
  }
}

/** Lay a geometry's y axis along a direction, its middle on a point. */
function along(/** @type {any} */ geometry, /** @type {Vector3} */ middle, /** @type {Vector3} */ way) {
  const turn = new Quaternion().setFromUnitVectors(new Vector3(0, 1, 0), way.clone().normalize());
  geometry.applyQuaternion(turn);
  geometry.translate(middle.x, middle.y, middle.z);
  return geometry;
}

/** A body's triangles: nine whole numbers each, in base64. @param {string} text @param {number} unit [mm] */
function mesh(text, unit) {
  const counts = new Int16Array(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new Float32BufferAttribute(Float32Array.from(counts, (x) => x * unit), 3));
  geometry.computeVertexNormals(); // no corner is shared: those of the triangles
  return geometry.setIndex([...new Array(counts.length / 3).keys()]);
}

/**
 * Parts as one geometry: one draw call. Where a computer draws in software, calls are what a picture costs.
 * @param {Part[]} parts
 */
export function merged(parts) {
  /** @type {number[]} */
  const position = [];
  /** @type {number[]} */
  const normal = [];
  /** @type {number[]} */
  const index = [];
  for (const { geometry } of parts) {
    const first = position.length / 3;
    position.push(...geometry.attributes.position.array);
    normal.push(...geometry.attributes.normal.array);
    for (const k of geometry.index?.array ?? []) index.push(first + k);
  }
  const whole = new BufferGeometry();
  whole.setAttribute("position", new Float32BufferAttribute(position, 3));
  whole.setAttribute("normal", new Float32BufferAttribute(normal, 3));
  whole.setIndex(index);
  return whole;
}

/** An arm in the scene: the solid one, or its shadow. */
export class Figure {
  /**
   * @param {Shapes} shapes
   * @param {import("three").Material} tube
   * @param {import("three").Material} drum
   */
  constructor(shapes, tube, drum) {
    this.shapes = shapes;
    this.group = new Group();
    /** @param {Part[]} parts */
    const body = (parts) => {
      const group = new Group();
      group.matrixAutoUpdate = false;
      for (const material of new Set([tube, drum])) {
        const of = parts.filter((part) => (part.drum ? drum : tube) === material);
        if (of.length) group.add(new Mesh(merged(of), material));
      }
      this.group.add(group);
      return group;
    };
    this.bodies = shapes.bodies.map(body);
    this.rails = shapes.rails.map((rail) => (rail ? body([rail]) : null));
    /** @type {import("./chain.js").Matrix[]} */
    this.at = [];
  }

  /** Paint some bodies in another colour, and all others in their own. @param {number[]} some @param {import("three").Material} other */
  paint(some, other) {
    this.bodies.forEach((group, i) => {
      for (const part of /** @type {Mesh[]} */ (group.children)) {
        part.userData.own ??= part.material;
        part.material = some.includes(i) ? other : part.userData.own;
      }
    });
  }

  /** Take a pose. @param {number[]} q */
  pose(q) {
    const { before, after, tool } = frames(this.shapes.arm, q);
    this.at = after;
    this.tool = tool;
    const put = (/** @type {Group | null} */ group, /** @type {number[]} */ T) => {
      if (!group) return;
      group.matrix.fromArray(T).transpose();
      group.matrixWorldNeedsUpdate = true;
    };
    after.forEach((T, i) => {
      put(this.bodies[i + 1], T);
      put(this.rails[i], before[i]);
    });
  }
}
