// @ts-check
/** A slider and a number box for each joint, its limits and home, and its lock. */
import { fixed, get, make, show, turned, typed } from "./dom.js";

export class Joints {
  /**
   * @param {import("./types.js").Arm} arm
   * @param {(q: number[], byHand?: boolean, held?: boolean) => void} moved byHand: dragged or typed; held: of a joint that is held
   * @param {() => void} locked
   */
  constructor(arm, moved, locked) {
    this.arm = arm;
    /** @type {number[]} */
    this.q = [];
    /** @type {HTMLInputElement[]} */
    this.sliders = [];
    /** @type {HTMLInputElement[]} */
    this.boxes = [];
    /** @type {Set<string>} */
    this.held = new Set(arm.lock ? [arm.lock] : []);
    const rows = get("sliders");
    arm.joints.forEach((joint, i) => {
      const turn = joint.prismatic ? arm.reach : 180;
      const [low, high] = [joint.lower ?? -turn, joint.upper ?? turn];
      const name = make("label", { for: `box-${i}` }, joint.name);
      const marks = make("datalist", { id: `marks-${i}` }, make("option", { value: String(joint.home) }));
      const slider = make("input", {
        type: "range", min: String(low), max: String(high), step: String(joint.step), list: `marks-${i}`,
        "aria-label": `${joint.name} slider`, title: `home: ${joint.home} ${joint.unit}`,
      });
      const box = make("input", { type: "number", step: "1", id: `box-${i}` });
      const change = (/** @type {number} */ value) => {
        const q = [...this.q];
        q[i] = value;
        moved(q, true, this.held.has(joint.name));
      };
      turned(slider, change);
      typed(box, change);
      rows.append(name, slider, box, make("span", {}, joint.unit), this.lock(joint, locked), marks);
      const ends = [joint.lower, joint.upper].map((end) => make("span", {}, end === null ? "no limit" : String(Number(end.toFixed(1)))));
      rows.append(make("span", { class: "ends", "aria-hidden": "true" }, ...ends));
      this.sliders.push(slider);
      this.boxes.push(box);
    });
    for (const [name, q] of Object.entries(arm.poses)) {
      const button = make("button", { type: "button" }, name);
      button.addEventListener("click", () => moved([...q]));
      get("poses").append(button);
    }
  }

  /** @param {import("./types.js").Joint} joint @param {() => void} locked */
  lock(joint, locked) {
    if (!this.arm.locks) return make("span");
    const label = `hold ${joint.name} where it is`;
    const held = String(this.held.has(joint.name));
    const button = make("button", { type: "button", "aria-pressed": held, "aria-label": label }, "hold");
    button.addEventListener("click", () => {
      if (!this.held.delete(joint.name)) this.held.add(joint.name);
      button.setAttribute("aria-pressed", String(this.held.has(joint.name)));
      locked();
    });
    return button;
  }

  /** @param {number[]} q */
  show(q) {
    this.q = q;
    q.forEach((value, i) => {
      this.reachable(i, value);
      if (document.activeElement !== this.sliders[i]) this.sliders[i].value = String(value);
      this.sliders[i].setAttribute("aria-valuetext", `${fixed(value, 2)} ${this.arm.joints[i].unit}`);
      show(this.boxes[i], value);
    });
  }

  /** A joint without limits may be anywhere: its slider goes as far to both sides of that. @param {number} i @param {number} value */
  reachable(i, value) {
    const [joint, slider] = [this.arm.joints[i], this.sliders[i]];
    if (joint.lower !== null || joint.upper !== null || (value >= Number(slider.min) && value <= Number(slider.max))) return;
    const half = (Number(slider.max) - Number(slider.min)) / 2;
    slider.min = String(value - half);
    slider.max = String(value + half);
  }

  /** @param {string[]} words what is outside */
  say(words) {
    get("outside").textContent = words.join("\n");
    this.arm.joints.forEach((joint, i) => {
      const bad = words.some((text) => text.startsWith(`${joint.name} = `));
      this.boxes[i].setAttribute("aria-invalid", String(bad));
    });
  }
}
