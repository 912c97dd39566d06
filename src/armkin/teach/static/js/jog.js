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
    this.presses = 0; // so far: each begins one jog at most
    this.held = false;
    this.beating = 0;
    this.unanswered = 0; // signs of life
    this.spent = true; // the gamepad's button has to be let go before it begins a jog
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
    document.addEventListener("visibilitychange", () => this.stop());
    window.addEventListener("blur", () => this.stop());
  }

  /** What is chosen, in words of the server. @param {number} sign @param {string} [axis] of the tip, in the chosen frame */
  chosen(sign, axis) {
    const percent = sign * /** @type {HTMLInputElement} */ (get("jog-speed")).valueAsNumber;
    const [frame, own] = this.select.value.split(" ");
    return own ? { axis: axis ?? own, frame, percent } : { joint: Number(frame), percent };
  }

  /** @param {object} fields */
  begin(fields) {
    if (this.held) return;
    this.held = true;
    this.presses++;
    this.board.ask("jog", { press: this.presses, ...fields });
    this.beating = setInterval(() => this.beat(), BEAT);
  }

  /** A sign of life. A server that is slow has no line of them waiting before a STOP. */
  async beat() {
    if (this.unanswered > 1) return;
    this.unanswered++;
    await this.board.tell("jog_on", { press: this.presses });
    this.unanswered--;
  }

  /** The button is let go: what the server hears later of this press moves nothing. */
  end() {
    if (!this.held) return;
    this.forget();
    this.board.tell("jog_end", { press: this.presses });
  }

  /** Ended by something else than its button, which has to be pressed anew. */
  stop() {
    this.spent = true;
    this.end();
  }

  /** The server has ended it, or never begun it: the button has to be pressed anew. */
  over() {
    this.spent = true;
    this.forget();
  }

  forget() {
    clearInterval(this.beating);
    this.held = false;
  }

  /** A dead man's button: by pointer, and by the space bar or Enter. @param {string} id @param {number} sign */
  dead(id, sign) {
    const button = get(id);
    button.addEventListener("contextmenu", (event) => event.preventDefault()); // it would swallow the button's release
    button.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      button.setPointerCapture(event.pointerId); // held is what is pressed, also where the page moves beneath the pointer
      this.begin(this.chosen(sign));
    });
    for (const name of ["pointerup", "pointercancel", "blur", "lostpointercapture", "keyup"]) {
      button.addEventListener(name, () => this.end());
    }
    button.addEventListener("keydown", (event) => {
      if (event.key !== " " && event.key !== "Enter") return;
      event.preventDefault();
      if (!event.repeat) this.begin(this.chosen(sign)); // of a jog that has ended its held key begins no other
    });
  }

  /** The gamepad is switched on or off. */
  pad() {
    clearInterval(this.polling);
    if (this.pushed) this.end();
    this.pushed = "";
    this.spent = true;
    const on = /** @type {HTMLInputElement} */ (get("gamepad")).checked;
    get("pad").textContent = on ? "Press a button of the gamepad, so that the browser tells of it." : "";
    if (on) this.polling = setInterval(() => this.poll(), POLL);
  }

  poll() {
    const found = Array.from(navigator.getGamepads?.() ?? []).find((one) => one?.connected);
    if (found) get("pad").textContent = `${found.id.slice(0, 60)}: hold a shoulder button and push a stick; B is STOP.`;
    if (found?.buttons[CROSSED]?.pressed) get("stop").click();
    if (!found || document.hidden || !document.hasFocus()) this.spent = true;
    else if (!SHOULDERS.some((k) => found.buttons[k]?.pressed)) this.spent = false;
    const fields = found && !this.spent ? this.asked(found) : null;
    const wanted = fields ? JSON.stringify(fields) : "";
    if (this.pushed && wanted !== this.pushed) {
      this.pushed = "";
      this.end();
    }
    if (!fields || this.held || this.board.busy()) return; // what brakes still comes to rest first
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
