// @ts-check
/** Pulses and moves of every motor, and what whole pulses cost at the tip. */
import { fixed, get, make, signed } from "./dom.js";

export class Motors {
  /**
   * @param {import("./types.js").Arm} arm
   * @param {() => void} asked
   */
  constructor(arm, asked) {
    this.arm = arm;
    this.best = /** @type {HTMLInputElement} */ (get("best"));
    this.best.addEventListener("change", asked);
    const none = arm.motors === null;
    get("best-label").hidden = none;
    if (none) get("rounding").textContent = arm.no_motors;
  }

  /** @param {import("./types.js").Look} look */
  show({ motors }) {
    if (!motors || !this.arm.motors) return;
    const start = motors.from === "arm" ? "from where it stands" : "from home";
    const head = ["motor", "pulses", "", start].map((text) => make("th", { scope: "col" }, text));
    const rows = this.arm.motors.map((motor, k) => {
      const bad = motors.outside_travel.includes(motor.name);
      const cells = [motor.name, String(motors.pulses[k]), motor.unit, signed(motors.moves[k])];
      return make("tr", bad ? { class: "bad" } : {}, ...cells.map((text) => make("td", {}, text)));
    });
    const table = get("motors");
    table.querySelector("thead")?.replaceChildren(make("tr", {}, ...head));
    table.querySelector("tbody")?.replaceChildren(...rows);
    let text = `The tip is ${fixed(motors.error_mm)} mm off by rounding`;
    if (motors.best) text += ", the best of the neighbouring pulses";
    if (motors.outside_travel.length) text += `. Outside the servo's travel: ${motors.outside_travel.join(", ")}`;
    get("rounding").textContent = `${text}.`;
  }
}
