// @ts-check
/** The jog: a joint, or the tip along an axis, for as long as a button of the page, a key or a gamepad's is held. */
import { get, make } from "./dom.js";

const BEAT = 100; // [ms] between two signs of life: the arm stops 0.3 s after the last one
const POLL = 50; // [ms] between two looks at a gamepad that is switched on
const [SHOULDERS, CROSSED] = [[4, 5], 1]; // buttons of the standard mapping: held to move, pressed to STOP
const PUSHED = 0.5; // of a stick's way

/** What the sticks move: axis of the pad -> axis of the tip, and which way is its positive one. */
const STICKS = /** @type {[number, string, number][]} */ ([[1, "x", -1], [0, "y", -1], [3, "z", -1], [2, "rz", -1]]);

export class Jog {
  /**
   * @param {import("./types.js").Arm} arm
   * @param {{ask: (name: string, fields?: object) => Promise<void>, tell: (name: string, fields?: object) => Promise<void>, busy: () => boolean}} board
   */
  constructor(arm, board) {
    this.arm = arm;
    this.board = board;
    this.beating = 0;
    /** @type {Promise<unknown>} */
    this.answered = Promise.resolve(); // when all that was asked for has been answered
    this.polling = 0;
    this.pushed = ""; // what the gamepad asks for
    this.select = /** @type {HTMLSelectElement} */ (get("jog-joint"));
    /** @type {(label: string, options: [string, string][]) => HTMLElement} */
    const group = (label, options) =>
      make("optgroup", { label }, ...options.map(([value, text]) => make("option", { value }, text)));
    this.select.append(group("Joints", arm.joints.map((joint, i) => [String(i), joint.name])));
    for (const frame of arm.jogs?.length ? ["base", "tool"] : []) {
      const inFrame = (arm.jogs ?? []).filter((axis) => frame === "base" || /[xyz]$/.test(axis));
      this.select.append(group(`Tip, ${frame} axes`, inFrame.map((axis) => [`${frame} ${axis}`, `${axis} of the ${frame}`])));
    }
    this.dead("jog-down", -1);
    this.dead("jog-up", 1);
    get("gamepad").addEventListener("change", () => this.pad());
    document.addEventListener("visibilitychange", () => this.end());
    window.addEventListener("blur", () => this.end());
  }

  /** What is chosen, in words of the server. @param {number} sign @param {string} [axis] of the tip, in the chosen frame */
  chosen(sign, axis) {
    const percent = sign * /** @type {HTMLInputElement} */ (get("jog-speed")).valueAsNumber;
    const [frame, own] = this.select.value.split(" ");
    return own ? { axis: axis ?? own, frame, percent } : { joint: Number(frame), percent };
  }

  /** @param {object} fields */
  begin(fields) {
    if (this.beating) return;
    let asked = false;
    const beat = () => {
      if (!this.beating) return;
      const sent = asked ? this.board.tell("jog", fields) : this.board.ask("jog", fields);
      asked = true;
      this.answered = Promise.all([this.answered, sent]).then(() => {}); // not one list in another
    };
    this.beating = setInterval(beat, BEAT);
    this.answered.then(beat);
  }

  end() {
    if (!this.beating) return;
    this.stopped();
    // Not before the server has had every sign of life: one that came after the end would begin another jog.
    this.answered = this.answered.then(() => this.board.tell("jog_end"));
  }

  /** Nothing is asked for any more. */
  stopped() {
    clearInterval(this.beating);
    this.beating = 0;
  }

  /** A dead man's button: by pointer, and by the space bar or Enter. @param {string} id @param {number} sign */
  dead(id, sign) {
    const button = get(id);
    button.addEventListener("pointerdown", (event) => {
      button.setPointerCapture(event.pointerId); // held is what is pressed, also where the page moves beneath the pointer
      this.begin(this.chosen(sign));
    });
    for (const name of ["pointerup", "pointercancel", "blur", "lostpointercapture", "keyup"]) {
      button.addEventListener(name, () => this.end());
    }
    button.addEventListener("keydown", (event) => {
      if (event.key !== " " && event.key !== "Enter") return;
      event.preventDefault();
      this.begin(this.chosen(sign));
    });
  }

  /** The gamepad is switched on or off. */
  pad() {
    clearInterval(this.polling);
    if (this.pushed) this.end();
    this.pushed = "";
    const on = /** @type {HTMLInputElement} */ (get("gamepad")).checked;
    get("pad").textContent = on ? "Press a button of the gamepad, so that the browser tells of it." : "";
    if (on) this.polling = setInterval(() => this.poll(), POLL);
  }

  poll() {
    const found = Array.from(navigator.getGamepads?.() ?? []).find((one) => one?.connected);
    if (found) get("pad").textContent = `${found.id.slice(0, 60)}: hold a shoulder button and push a stick; B is STOP.`;
    const stop = found?.buttons[CROSSED]?.pressed;
    if (stop) get("stop").click();
    const fields = found && !stop && !document.hidden && document.hasFocus() ? this.asked(found) : null;
    const wanted = fields ? JSON.stringify(fields) : "";
    if (this.pushed && wanted !== this.pushed) {
      this.pushed = "";
      this.end();
    }
    if (!fields || this.beating || this.board.busy()) return; // what brakes still comes to rest first
    this.pushed = wanted;
    this.begin(fields);
  }

  /** What a gamepad asks for: nothing unless a shoulder button is held. @param {Gamepad} pad */
  asked(pad) {
    if (pad.mapping !== "standard" || !SHOULDERS.some((k) => pad.buttons[k]?.pressed)) return null;
    const ofTip = this.select.value.includes(" ");
    const sticks = STICKS.filter(([, axis]) => (ofTip ? this.arm.jogs?.includes(axis) : axis === "x"));
    const most = sticks.reduce((a, b) => (Math.abs(pad.axes[b[0]]) > Math.abs(pad.axes[a[0]]) ? b : a), sticks[0]);
    if (!most || !(Math.abs(pad.axes[most[0]]) > PUSHED)) return null;
    return this.chosen(Math.sign(pad.axes[most[0]]) * most[2], most[1]);
  }
}
