// @ts-check
/** What stands around the arm in the 3-D view: light, a floor with the arm's shadow, and what it must not touch. */
import {
  AmbientLight, BufferGeometry, CustomBlending, DirectionalLight, DoubleSide, Float32BufferAttribute, GridHelper, HemisphereLight,
  Mesh, MeshBasicMaterial, MeshLambertMaterial, NotEqualStencilFunc, OneFactor, ReplaceStencilOp,
} from "three";
import { Figure } from "./bodies.js";

const AMBER = 0xe69f00; // what must not be hit
const SUN = [1.2, -1.6, 3]; // where the light comes from

/** @param {import("three").Scene} scene */
export function light(scene) {
  const sun = new DirectionalLight(0xffffff, 2.4);
  sun.position.set(SUN[0], SUN[1], SUN[2]);
  scene.add(sun, new HemisphereLight(0xffffff, 0x8090a0, 1.3), new AmbientLight(0xffffff, 0.25));
}

/** What the arm must not touch: seen through, and hiding nothing. @param {number[]} corners of triangles */
export function glass(corners) {
  const surface = new BufferGeometry();
  surface.setAttribute("position", new Float32BufferAttribute(corners, 3));
  surface.computeVertexNormals();
  const look = new MeshLambertMaterial({ color: AMBER, transparent: true, opacity: 0.3, side: DoubleSide, depthWrite: false });
  return new Mesh(surface, look);
}

/** A grid, and the arm's shadow on it: the arm itself, flattened along the light. */
export class Floor {
  /** @param {import("./types.js").Arm} arm @param {import("./bodies.js").Shapes} shapes @param {import("three").Scene} scene */
  constructor(arm, shapes, scene) {
    const r = arm.reach;
    this.step = 10 ** Math.floor(Math.log10(r / 2)); // [mm] a square's side
    const half = Math.ceil((1.4 * r) / this.step) * this.step;
    const z = Math.min(arm.base[2][3], 0);
    this.grid = new GridHelper(2 * half, (2 * half) / this.step);
    this.grid.rotateX(Math.PI / 2);
    this.grid.position.z = z - 0.001 * r;
    // The stencil lets every point be darkened once, however many bodies lie above it.
    const shade = new MeshBasicMaterial({
      color: 0x000000, opacity: 0.2, side: DoubleSide, depthWrite: false,
      blending: CustomBlending, blendSrcAlpha: OneFactor, // not "transparent", to be drawn first: nothing is under it
      stencilWrite: true, stencilRef: 1, stencilFunc: NotEqualStencilFunc, stencilZPass: ReplaceStencilOp,
    });
    this.shadow = new Figure(shapes, shade, shade);
    const [x, y] = [SUN[0] / SUN[2], SUN[1] / SUN[2]];
    const ground = z - 0.002 * r;
    this.shadow.group.matrixAutoUpdate = false;
    this.shadow.group.traverse((one) => (one.renderOrder = -1));
    this.shadow.group.matrix.set(1, 0, -x, x * ground, 0, 1, -y, y * ground, 0, 0, 0, ground, 0, 0, 0, 1);
    scene.add(this.grid, this.shadow.group);
  }

  /** @param {number} lines their colour */
  colour(lines) {
    const look = /** @type {any} */ (this.grid).material;
    look.vertexColors = false;
    look.color.set(lines);
    look.needsUpdate = true;
  }
}
