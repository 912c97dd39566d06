// @ts-check
/** A slice of reach: cubic voxels of the plane of the arm's links, by the share of orientations that are reached. */
import { BoxGeometry, Color, InstancedMesh, Matrix4, MeshBasicMaterial } from "three";
import { get } from "./dom.js";
import { act } from "./server.js";
import { trouble } from "./error_line.js";

const COLOURS = [0x440154, 0x3b528b, 0x21918c, 0x5ec962, 0xfde725]; // viridis: a share of 0 to 1

/** @param {number} share */
function colour(share) {
  const place = Math.min(Math.max(share, 0), 1) * (COLOURS.length - 1);
  const i = Math.min(Math.floor(place), COLOURS.length - 2);
  return new Color(COLOURS[i]).lerp(new Color(COLOURS[i + 1]), place - i);
}

/** @param {import("./types.js").ReachSlice} found */
function voxels({ size, frame, centres, shares }) {
  const look = new MeshBasicMaterial({ transparent: true, opacity: 0.55, depthWrite: false });
  const cubes = new InstancedMesh(new BoxGeometry(0.86 * size, 0.86 * size, 0.86 * size), look, shares.length);
  const at = new Matrix4();
  shares.forEach((share, i) => {
    cubes.setMatrixAt(i, at.makeTranslation(centres[3 * i], centres[3 * i + 1], centres[3 * i + 2]));
    cubes.setColorAt(i, colour(share));
  });
  cubes.matrixAutoUpdate = false;
  cubes.matrix.fromArray(frame.flat()).transpose();
  cubes.frustumCulled = false;
  cubes.visible = false;
  return cubes;
}

export class Slice {
  /** @param {import("./view.js").View} view */
  constructor(view) {
    this.view = view;
    /** @type {InstancedMesh | null} */
    this.cubes = null;
    this.about = "";
    get("slice").addEventListener("click", () => this.toggle().catch((error) => trouble(error.message)));
  }

  /** What the legend says of it. */
  get words() {
    return this.cubes?.visible ? this.about : "";
  }

  /** Show it, or show it no more; the server is asked once. */
  async toggle() {
    const button = /** @type {HTMLButtonElement} */ (get("slice"));
    if (!this.cubes) {
      button.disabled = true;
      /** @type {import("./types.js").ReachSlice} */
      const found = await act("reach").finally(() => (button.disabled = false));
      const held = found.held ? `, ${found.held} ${found.values > 1 ? `at one of ${found.values} values` : "at home"}` : "";
      this.about = `; voxels of ${Math.round(found.size)} mm: share of ${found.of} orientations, dark 0, yellow all${held}`;
      this.cubes = voxels(found);
      this.view.scene.add(this.cubes);
    }
    this.cubes.visible = !this.cubes.visible;
    button.setAttribute("aria-pressed", String(this.cubes.visible));
    this.view.legend();
    this.view.draw();
  }
}
