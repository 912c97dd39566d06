// @ts-check
/** The handle at the tip's target: drag it along an axis, in a plane, or turn it. */
import { Object3D } from "three";
import { TransformControls } from "/vendor/three/TransformControls.js";
import { get } from "./dom.js";

export class Gizmo {
  /** @param {import("./view.js").View} view */
  constructor(view) {
    this.handle = new Object3D();
    this.handle.rotation.order = "ZYX"; // R = Rz(yaw) Ry(pitch) Rx(roll)
    this.controls = new TransformControls(view.camera, view.canvas);
    this.controls.size = 0.75;
    this.dragging = false;
    this.there = false;
    /** @type {(position: number[], rpy: number[]) => void} */
    this.moved = () => {};
    /** @type {() => void} */
    this.dropped = () => {};
    view.scene.add(this.handle, this.controls.getHelper());
    this.controls.addEventListener("change", () => view.draw());
    this.controls.addEventListener("dragging-changed", (/** @type {any} */ event) => {
      this.dragging = event.value;
      view.orbit.enabled = !event.value;
      if (!event.value) this.dropped();
    });
    this.controls.addEventListener("objectChange", () => {
      const { position: p, rotation: r } = this.handle;
      this.moved([p.x, p.y, p.z], [r.x, r.y, r.z].map((angle) => (angle * 180) / Math.PI));
    });
    const turn = get("turn");
    turn.addEventListener("click", () => {
      const on = turn.getAttribute("aria-pressed") !== "true";
      turn.setAttribute("aria-pressed", String(on));
      this.mode(on ? "rotate" : "translate");
    });
  }

  /** @param {boolean} there @param {boolean} flat whether the tip moves in the xy plane alone */
  show(there, flat) {
    this.there = there;
    if (there) this.controls.attach(this.handle);
    else this.controls.detach();
    this.controls.showZ = !flat;
  }

  /** @param {"translate"|"rotate"} mode */
  mode(mode) {
    this.controls.setMode(mode);
    this.controls.setSpace(mode === "rotate" ? "local" : "world");
  }

  /** @param {number[]} position @param {number[]} rpy [deg] */
  put(position, rpy) {
    if (this.dragging) return;
    this.handle.position.set(position[0], position[1], position[2]);
    const [x, y, z] = rpy.map((angle) => (angle * Math.PI) / 180);
    this.handle.rotation.set(x, y, z, "ZYX");
    this.handle.updateMatrixWorld();
  }
}
