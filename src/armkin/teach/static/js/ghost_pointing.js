// @ts-check
/** Ghosts under the pointer: the nearest one is pointed at, a click chooses it, and its name stands beside it. */
import { Matrix4, Vector3 } from "three";
import { frames } from "./chain.js";
import { get, make } from "./dom.js";

const NEAR = 9; // [px] from a ghost's line that still points at it
const STILL = 4; // [px] that the pointer may move in a click

/** @typedef {{name: string, colour: string, pieces: Vector3[][], label: Vector3}} Shown */

export class Pointing {
  /** @param {import("./view.js").View} view */
  constructor(view) {
    this.view = view;
    /** @type {Shown[]} */
    this.shown = [];
    this.all = false; // whether every name is shown
    this.at = -1; // index of the ghost that is pointed at
    /** @type {(name: string) => void} */
    this.pointed = () => {};
    /** @type {(name: string) => void} */
    this.chose = () => {};
    const canvas = view.canvas;
    /** @type {PointerEvent | null} */
    let down = null;
    canvas.addEventListener("pointerdown", (event) => (down = event));
    canvas.addEventListener("pointermove", (event) => {
      if (!event.buttons) this.point(event);
    });
    canvas.addEventListener("pointerleave", () => this.point(null));
    canvas.addEventListener("pointerup", (event) => {
      const moved = down ? Math.hypot(event.clientX - down.clientX, event.clientY - down.clientY) : STILL;
      down = null;
      const k = moved < STILL && !view.gizmo.controls.axis ? this.nearest(event) : -1;
      if (k < 0) return;
      this.at = -1;
      this.pointed("");
      this.chose(this.shown[k].name);
    });
    const button = get("names");
    button.addEventListener("click", () => {
      this.all = button.getAttribute("aria-pressed") !== "true";
      button.setAttribute("aria-pressed", String(this.all));
      this.labels();
    });
  }

  /** Tell the list of branches. @param {import("./tip_target.js").Tip} tip */
  with(tip) {
    this.pointed = (name) => tip.point(name);
    this.chose = (name) => tip.choose(tip.rows.findIndex(({ branch, chosen }) => branch.name === name && !chosen));
  }

  /** @param {import("./ghosts.js").Ghost[]} ghosts @param {number[]} q of the solid arm */
  show(ghosts, q) {
    const arm = this.view.arm;
    const chains = ghosts.map((ghost) => frames(arm, ghost.joints).after);
    /** Corners of each body in the world. @param {number[][]} chain */
    const bodies = (chain) => chain.map((T, i) => {
      const at = new Matrix4().fromArray(T).transpose();
      return arm.bodies[i + 1].map(([x, y, z]) => new Vector3(x, y, z).applyMatrix4(at));
    });
    const drawn = [frames(arm, q).after, ...chains].map(bodies);
    const middles = drawn.map((pieces) => pieces.map((corners) => corners[0].clone().lerp(/** @type {Vector3} */ (corners.at(-1)), 0.5)));
    this.shown = ghosts.flatMap((ghost, k) => {
      if (!ghost.name) return [];
      // its name stands where it is farthest from the others: all of them end at one point
      const own = middles[k + 1];
      const apart = own.map((point, i) => Math.min(...middles.map((other, m) => (m === k + 1 ? Infinity : other[i].distanceTo(point)))));
      return [{ name: ghost.name, colour: ghost.colour, pieces: drawn[k + 1], label: own[apart.indexOf(Math.max(...apart))] }];
    });
    if (this.at >= this.shown.length) this.at = -1;
    this.labels();
  }

  /** @param {Vector3} point @returns {number[]} [px] in the picture */
  place(point) {
    const at = point.clone().project(this.view.camera);
    const { clientWidth, clientHeight } = this.view.canvas;
    return [((at.x + 1) / 2) * clientWidth, ((1 - at.y) / 2) * clientHeight];
  }

  /** The ghost under the pointer, or -1. @param {PointerEvent} event */
  nearest(event) {
    const { left, top } = this.view.canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - left, event.clientY - top];
    let [best, least] = [-1, NEAR];
    this.shown.forEach(({ pieces }, k) => {
      for (const piece of pieces) {
        const points = piece.map((point) => this.place(point));
        for (let i = 1; i < points.length; i++) {
          const [[ax, ay], [bx, by]] = [points[i - 1], points[i]];
          const long = (bx - ax) ** 2 + (by - ay) ** 2;
          const share = long ? Math.min(Math.max(((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / long, 0), 1) : 0;
          const off = Math.hypot(ax + share * (bx - ax) - x, ay + share * (by - ay) - y);
          if (off < least) [best, least] = [k, off];
        }
      }
    });
    return best;
  }

  /** @param {PointerEvent | null} event null: the pointer has left */
  point(event) {
    const at = event && !this.view.gizmo.controls.axis ? this.nearest(event) : -1;
    if (at === this.at) return;
    this.at = at;
    this.view.canvas.style.cursor = at < 0 ? "" : "pointer";
    this.pointed(this.shown[at]?.name ?? "");
  }

  /** Names beside the ghosts: of the one that is pointed at, or of all. */
  labels() {
    const layer = get("labels");
    const wanted = this.shown.filter((_, k) => this.all || k === this.at);
    while (layer.childElementCount > wanted.length) layer.lastElementChild?.remove();
    while (layer.childElementCount < wanted.length) layer.append(make("span"));
    /** @type {number[][]} */
    const taken = [];
    wanted.forEach(({ name, colour, label }, k) => {
      const span = /** @type {HTMLElement} */ (layer.children[k]);
      const [x, y] = this.place(label);
      let top = y - 24;
      while (taken.some(([left, height]) => Math.abs(left - x) < 8 * name.length && Math.abs(height - top) < 18)) top += 6;
      taken.push([x, top]);
      span.textContent = name;
      span.dataset.at = `${x} ${y}`; // for tests
      span.style.borderColor = colour;
      span.style.transform = `translate(${x + 8}px, ${top}px)`;
    });
  }
}
