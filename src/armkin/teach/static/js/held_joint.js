// @ts-check
/** The one joint that is held of an arm with a joint to spare: a slider of its own, and how far it can turn. */
import { fixed, get, turned } from "./dom.js";
import { interval } from "./redundant.js";

const PAUSE = 60; // [ms] without another posture after which the interval is found

export class Held {
  /** @param {import("./types.js").Arm} arm @param {(q: number[]) => void} swing turns the joint, the others follow */
  constructor(arm, swing) {
    this.arm = arm;
    this.slider = /** @type {HTMLInputElement} */ (get("held-slider"));
    this.joint = -1;
    /** @type {number[]} */
    this.q = [];
    /** @type {number[] | null} */
    this.legal = null;
    this.waiting = 0;
    turned(this.slider, (value) => {
      const [low, high] = this.legal ?? [-Infinity, Infinity];
      const q = [...this.q];
      q[this.joint] = Math.min(Math.max(value, low), high);
      swing(q);
    });
  }

  /** @param {import("./types.js").Look} look @param {Set<string>} held */
  show(look, held) {
    const { joints } = this.arm;
    const one = held.size === 1 && look.task === "pose" && joints.length === 7;
    this.joint = one ? joints.findIndex(({ name }) => held.has(name)) : -1;
    get("held").hidden = !one;
    clearTimeout(this.waiting);
    if (!one) return;
    const { name, unit, lower, upper, prismatic } = joints[this.joint];
    const turn = prismatic ? this.arm.reach : 180;
    const value = look.q[this.joint];
    const [low, high] = [lower ?? Math.min(-turn, value), upper ?? Math.max(turn, value)];
    this.q = look.q;
    Object.assign(this.slider, { min: String(low), max: String(high) });
    if (document.activeElement !== this.slider) this.slider.value = String(value);
    this.slider.setAttribute("aria-label", `${name}, the tip stays`);
    this.slider.setAttribute("aria-valuetext", `${fixed(value, 2)} ${unit}`);
    get("held-name").textContent = name;
    this.waiting = setTimeout(() => this.measure(low, high), PAUSE);
  }

  /** The legal interval, in the bar and in words. @param {number} low of the slider @param {number} high */
  measure(low, high) {
    const { unit } = this.arm.joints[this.joint];
    this.legal = interval(this.arm, this.q, this.joint);
    const [from, to] = this.legal ?? [low, low];
    const bar = /** @type {HTMLElement} */ (get("legal").firstElementChild);
    bar.style.marginLeft = `${(100 * (from - low)) / (high - low)}%`;
    bar.style.width = `${(100 * (to - from)) / (high - low)}%`;
    get("held-range").textContent = this.legal
      ? `within limits from ${fixed(from, 2)} to ${fixed(to, 2)} ${unit}, on this branch`
      : "the arm is outside its limits";
  }
}
