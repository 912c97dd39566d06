// @ts-check
/** Plays a plan with its own time law: pause, speed, step from stop to stop, scrub. */
import { chart, mark } from "./chart.js";
import { fixed, get } from "./dom.js";

/** Number of the first value that is not below t, or of the last. @param {number[]} values @param {number} t */
function first(values, t) {
  let [low, high] = [0, values.length - 1];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] < t) low = middle + 1;
    else high = middle;
  }
  return low;
}

export class Player {
  /**
   * @param {import("./types.js").Arm} arm
   * @param {(q: number[]) => void} show
   * @param {() => void} settled the arm rests at the pose last shown
   */
  constructor(arm, show, settled) {
    this.arm = arm;
    this.pose = show;
    this.settled = settled;
    /** @type {import("./types.js").Played | null} */
    this.plan = null;
    this.at = 0; // [s]
    this.last = 0; // [ms]
    this.playing = false;
    this.slider = /** @type {HTMLInputElement} */ (get("when"));
    this.slider.addEventListener("input", () => {
      this.pause();
      this.go(this.slider.valueAsNumber);
    });
    this.slider.addEventListener("change", settled);
    get("back").addEventListener("click", () => this.step(-1));
    get("forth").addEventListener("click", () => this.step(1));
  }

  /** @param {import("./types.js").Played | null} plan */
  load(plan) {
    this.pause();
    this.plan = plan;
    this.at = 0;
    get("player").hidden = !plan;
    if (!plan) return;
    this.slider.max = String(plan.duration_s);
    this.slider.value = "0";
    chart(plan, this.arm.joints.map((joint) => joint.name));
    this.say();
  }

  toggle() {
    if (!this.plan) return;
    if (this.playing) {
      this.pause();
      this.settled();
      return;
    }
    if (this.at >= this.plan.duration_s) this.at = 0;
    this.playing = true;
    this.last = performance.now();
    get("play").textContent = "Pause";
    requestAnimationFrame((now) => this.tick(now));
  }

  pause() {
    this.playing = false;
    get("play").textContent = "Play";
  }

  /** @param {number} now [ms] */
  tick(now) {
    if (!this.playing || !this.plan) return;
    const rate = Number(/** @type {HTMLSelectElement} */ (get("rate")).value);
    this.go(Math.min(this.plan.duration_s, this.at + ((now - this.last) / 1000) * rate));
    this.last = now;
    if (this.at < this.plan.duration_s) {
      requestAnimationFrame((next) => this.tick(next));
      return;
    }
    this.pause();
    this.settled();
  }

  /** To the next stop, or the one before. @param {number} way */
  step(way) {
    if (!this.plan) return;
    this.pause();
    const stops = way > 0 ? this.plan.stops.filter((t) => t > this.at + 1e-3) : this.plan.stops.filter((t) => t < this.at - 1e-3);
    const next = way > 0 ? stops[0] : stops[stops.length - 1];
    if (next === undefined) return;
    this.go(next);
    this.settled();
  }

  /** Show the arm as it is at a time. @param {number} t [s] */
  go(t) {
    if (!this.plan) return;
    this.at = t;
    const { time, joints } = this.plan;
    const k = first(time, t);
    const [before, after] = [time[Math.max(k - 1, 0)], time[k]];
    const share = after > before ? (t - before) / (after - before) : 0;
    const from = joints[Math.max(k - 1, 0)];
    this.pose(joints[k].map((value, i) => from[i] + share * (value - from[i])));
    this.slider.value = String(t);
    mark(t / Math.max(this.plan.duration_s, 1e-9));
    this.say();
  }

  say() {
    if (!this.plan) return;
    const text = `${fixed(this.at, 2)} of ${fixed(this.plan.duration_s, 2)} s`;
    get("clock").textContent = text;
    this.slider.setAttribute("aria-valuetext", text);
  }
}
