// @ts-check
/** The board: where the arm stands, and what it is told to do. Nothing here moves it but a button. */
import { fixed, get } from "./dom.js";
import { Jog } from "./jog.js";
import { Live } from "./live_motion.js";
import { act } from "./server.js";

const WORDS = /** @type {Object<string, string>} */ ({
  known: "position known", retained: "position retained through a reset", lost: "position lost",
  unknown: "not connected",
});

export class Board {
  /**
   * @param {import("./types.js").Arm} arm
   * @param {{pose: () => Promise<number[]>, show: (q: number[]) => void, moved: (state: import("./types.js").BoardState) => void,
   *   trouble: (text: string, source?: string) => void, begun: () => void}} page
   */
  constructor(arm, page) {
    this.arm = arm;
    this.page = page;
    /** @type {import("./types.js").BoardState | null} */
    this.state = null;
    this.open = true; // the gripper, as last told
    this.lost = false; // the server does not answer
    this.jog = new Jog(arm, {
      ask: (name, fields) => this.ask(name, fields),
      tell: (name, fields) => this.tell(name, fields),
      busy: () => this.state?.doing !== "" || !this.state.connected || this.lost,
    });
    this.live = new Live(arm);
    get("gripper").hidden = arm.gripper === null;
    if (arm.gripper) {
      get("grip-unit").textContent = arm.gripper.unit;
      /** @type {HTMLInputElement} */ (get("grip-value")).value = String(arm.gripper.open);
    }
    this.wire();
  }

  wire() {
    const number = (/** @type {string} */ id) => /** @type {HTMLInputElement} */ (get(id)).valueAsNumber;
    const checked = (/** @type {string} */ id) => /** @type {HTMLInputElement} */ (get(id)).checked;
    const click = (/** @type {string} */ id, /** @type {() => void} */ action) => get(id).addEventListener("click", action);
    click("send", async () => this.ask("send", { q: await this.page.pose(), speed: number("speed") }));
    click("run", () => this.ask("run", { speed: number("speed") }));
    click("home", () => this.ask("home"));
    click("connect", () => this.ask("connect"));
    click("here", () => this.state?.joints && this.page.show([...this.state.joints]));
    click("grip", () => this.grip(this.open ? "closed" : "open"));
    get("grip-value").addEventListener("change", () => this.grip(number("grip-value")));
    get("consent").addEventListener("change", () => this.buttons());
    click("assume", () => {
      this.ask("assume_home", { consent: checked("consent") });
      /** @type {HTMLInputElement} */ (get("consent")).checked = false;
    });
    get("follow").addEventListener("change", () => (checked("follow") ? this.follow() : this.tell("follow", { on: false })));
  }

  /** From where it stands: what is shown instead was not dragged. */
  async follow() {
    if (this.state?.joints) this.page.show([...this.state.joints]);
    await this.page.pose();
    await this.ask("follow", { on: true });
    this.follows();
  }

  /** The page shows what nobody has dragged. */
  unfollow() {
    if (!this.state?.follows) return;
    this.state.follows = false; // it is asked for once
    this.follows();
    this.tell("follow", { on: false });
  }

  follows() {
    /** @type {HTMLInputElement} */ (get("follow")).checked = this.state?.follows ?? false;
  }

  /** Something new. @param {string} name @param {object} [fields] */
  ask(name, fields = {}) {
    // Before it is asked for: what the board says of it may come sooner than the answer.
    this.page.begun();
    get("arrived").textContent = "";
    return this.tell(name, fields);
  }

  /** What goes on, or ends: the board may have said meanwhile how it ended. @param {string} name @param {object} [fields] */
  async tell(name, fields = {}) {
    try {
      await act(name, fields);
    } catch (error) {
      this.page.trouble(/** @type {Error} */ (error).message);
      if (name.startsWith("jog")) this.jog.over();
    }
  }

  /** @param {string | number} value */
  grip(value) {
    if (!this.state || !this.arm.gripper) return;
    const assume = /** @type {HTMLInputElement} */ (get("grip-assume")).checked;
    this.open = value !== "closed";
    get("grip").textContent = this.open ? "Close" : "Open";
    this.ask("grip", { value, assume });
  }

  /** STOP was pressed. */
  stopped() {
    this.jog.stop();
  }

  /** @param {import("./types.js").BoardState} state */
  show(state) {
    const before = this.state;
    this.state = state;
    get("no-board").hidden = true;
    get("with-board").hidden = get("sending").hidden = false;
    const { doing, position } = state;
    const words = state.connected || doing ? WORDS[position] : "not connected";
    get("standing").textContent = `${doing ? `${doing}: ` : ""}${words} · ${state.board} on ${state.port}`;
    get("standing").dataset.position = position;
    get("position").textContent = state.joints
      ? `It stands at ${this.arm.joints.map((joint, i) => `${joint.name} ${fixed(state.joints?.[i] ?? 0, 2)}`).join(", ")}.`
      : position === "lost" ? "Nobody knows where the arm stands: home it, or put it in its home pose and say so." : "";
    const bar = /** @type {HTMLProgressElement} */ (get("progress"));
    bar.hidden = !doing || !state.total_s;
    bar.value = state.total_s ? state.done_s / state.total_s : 0;
    if (before && state.ended.count !== before.ended.count) {
      const held = state.ended.name === "jog" && this.jog.held; // at a limit, say, or its signs of life came late
      if (state.error || held) this.jog.over();
      const more = held ? ": let go and press again to go on" : "";
      get("arrived").textContent = state.error ? "" : `${state.ended.name}: done${more}`;
      if (state.error && state.error !== "stopped") this.page.trouble(state.error);
    }
    if (state.error === "stopped") get("arrived").textContent = "stopped: the arm stands on its path, its position is known";
    this.page.trouble(state.connected ? "" : state.error, "port"); // as long as it is so
    const stop = "STOP is no emergency stop: for that, cut the motors' power.";
    if (state.simulated) get("how-safe").textContent = "A simulated board: nothing real moves.";
    else if (state.differences.length) get("how-safe").textContent = `${state.differences.join(". ")}. ${stop}`;
    else get("how-safe").textContent = "If this page is closed, its browser ends or armkin teach is paused while the arm moves, the board holds it "
        + "along its path within a second, and its position stays known. " + stop;
    this.follows();
    this.live.show(state);
    this.buttons();
    this.page.moved(state);
  }

  /** The server does not answer, or does again: what it said last is no news. @param {boolean} lost */
  gone(lost) {
    this.lost = lost;
    if (!this.state) return;
    if (!lost) {
      this.show(this.state);
      return;
    }
    get("standing").textContent = "armkin teach is gone: nobody knows where the arm is";
    get("standing").dataset.position = "unknown";
    get("position").textContent = get("arrived").textContent = "";
    this.buttons();
  }

  buttons() {
    const state = this.state;
    if (!state) return;
    const busy = state.doing !== "" || !state.connected || this.lost;
    const consent = /** @type {HTMLInputElement} */ (get("consent")).checked;
    const off = (/** @type {string} */ id, /** @type {boolean} */ when) => {
      /** @type {HTMLButtonElement} */ (get(id)).disabled = when;
    };
    off("send", busy);
    off("run", busy);
    off("home", busy);
    off("grip", busy);
    off("here", !state.joints || this.lost);
    for (const id of ["jog-down", "jog-up", "follow"]) off(id, !state.connected || this.lost);
    off("assume", busy || !consent);
    get("lost").hidden = state.position !== "lost";
    get("connect").hidden = state.connected || state.doing !== "" || this.lost;
  }
}
