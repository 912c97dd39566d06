// @ts-check
/** The other branches as thin lines, the one that is pointed at as a body: every part of all is one draw call. */
import { Color, Group, InstancedMesh, Matrix4, MeshLambertMaterial } from "three";
import { merged } from "./bodies.js";
import { frames } from "./chain.js";

/** @typedef {{joints: number[], colour: string, faint: boolean, solid: boolean, name?: string}} Ghost name: of a branch */

const ROOM = 8; // ghosts of a body that are provided for; more are, when they come
const PALE = 0.45; // share of the paper in the colour of a branch outside limits

export class Ghosts {
  /** @param {import("./bodies.js").Shapes} shapes */
  constructor(shapes) {
    this.arm = shapes.arm;
    this.group = new Group();
    const [lines, solids] = [shapes.lines.map(merged), shapes.bodies.slice(1).map(merged)];
    // A drum of it that coincides with the arm's own lies behind that.
    const whole = new MeshLambertMaterial({ transparent: true, opacity: 0.8, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 4 });
    /** Of every body: a line, pointed at. */
    this.kinds = lines.map((line, i) => /** @type {const} */ ([[line, new MeshLambertMaterial()], [solids[i], whole]]));
    this.paper = new Color();
    /** @type {Ghost[]} */
    this.wanted = [];
    /** @type {InstancedMesh[][]} */
    this.bodies = [];
    this.room(ROOM);
  }

  /** Provide for so many. @param {number} most */
  room(most) {
    this.most = most;
    for (const body of this.bodies.flat()) body.dispose();
    this.bodies = this.kinds.map((kinds) => kinds.map(([part, skin]) => new InstancedMesh(part, skin, most)));
    for (const body of this.bodies.flat()) body.frustumCulled = false;
    this.group.clear().add(...this.bodies.flat());
  }

  /** Show these and no others. @param {Ghost[]} wanted */
  show(wanted) {
    this.wanted = wanted;
    if (wanted.length > (this.most ?? 0)) this.room(2 * wanted.length);
    for (const body of this.bodies.flat()) body.count = 0;
    const at = new Matrix4();
    for (const { joints, colour, faint, solid } of wanted) {
      const paint = new Color(colour);
      if (faint && !solid) paint.lerp(this.paper, PALE); // lines that are seen through would mix to grey
      frames(this.arm, joints).after.forEach((T, i) => {
        const body = this.bodies[i][solid ? 1 : 0];
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
