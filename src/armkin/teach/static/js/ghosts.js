// @ts-check
/** The other branches as transparent arms: every body of all of them is one draw call. */
import { Color, Group, InstancedMesh, Matrix4, MeshLambertMaterial } from "three";
import { merged } from "./bodies.js";
import { frames, same } from "./chain.js";

/** @typedef {{joints: number[], colour: string, faint: boolean}} Ghost */

const ROOM = 8; // ghosts of a body that are provided for; more are, when they come

export class Ghosts {
  /** @param {import("./bodies.js").Shapes} shapes */
  constructor(shapes) {
    this.arm = shapes.arm;
    this.group = new Group();
    this.parts = shapes.bodies.slice(1).map(merged);
    // In front of what it coincides with stands the solid arm.
    const skin = (/** @type {number} */ opacity) => new MeshLambertMaterial({
      transparent: true, opacity, depthWrite: false, polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 2,
    });
    this.skins = [skin(0.36), skin(0.13)];
    /** @type {InstancedMesh[][]} of every body, those within limits and those outside */
    this.bodies = [];
    this.room(ROOM);
  }

  /** Provide for so many. @param {number} most */
  room(most) {
    this.most = most;
    for (const body of this.bodies.flat()) body.dispose();
    this.bodies = this.parts.map((part) => this.skins.map((skin) => new InstancedMesh(part, skin, most)));
    for (const body of this.bodies.flat()) body.frustumCulled = false;
    this.group.clear().add(...this.bodies.flat());
  }

  /**
   * Show these and no others; a body that coincides with the solid arm's is not drawn.
   * @param {Ghost[]} wanted
   * @param {import("./bodies.js").Figure} solid
   */
  show(wanted, solid) {
    if (wanted.length > (this.most ?? 0)) this.room(2 * wanted.length);
    for (const body of this.bodies.flat()) body.count = 0;
    const at = new Matrix4();
    for (const { joints, colour, faint } of wanted) {
      const paint = new Color(colour);
      frames(this.arm, joints).after.forEach((T, i) => {
        if (same(T, solid.at[i], this.arm.reach)) return;
        const body = this.bodies[i][faint ? 1 : 0];
        body.setMatrixAt(body.count, at.fromArray(T).transpose());
        body.setColorAt(body.count, paint);
        body.count += 1;
      });
    }
    for (const body of this.bodies.flat()) {
      body.visible = body.count > 0;
      body.instanceMatrix.needsUpdate = true;
      if (body.instanceColor) body.instanceColor.needsUpdate = true;
      body.boundingBox = null;
    }
  }
}
