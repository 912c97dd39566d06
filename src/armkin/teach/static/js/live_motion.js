// @ts-check
/** The joints while the board moves: what it is told, dashed, and what it says. */
import { COLOURS, svg } from "./chart.js";
import { fixed, get, make } from "./dom.js";

const [WIDTH, HEIGHT] = [400, 90];
const KEPT = 20; // [s]

export class Live {
  /** @param {import("./types.js").Arm} arm */
  constructor(arm) {
    this.arm = arm;
    this.moved = false;
    /** @type {{t: number, read: number[], told: number[] | null}[]} */
    this.rows = [];
  }

  /** @param {import("./types.js").BoardState} state */
  show(state) {
    const moves = !["", "connect"].includes(state.doing);
    if (moves && !this.moved) this.rows = [];
    if (state.joints && (moves || this.moved)) {
      const t = performance.now() / 1000;
      this.rows.push({ t, read: state.joints, told: state.commanded ?? null });
      this.rows = this.rows.filter((row) => row.t >= t - KEPT);
      this.draw();
    }
    this.moved = moves;
  }

  draw() {
    const { rows } = this;
    const last = rows[rows.length - 1];
    if (rows.length < 2) return;
    const since = (/** @type {number[]} */ q) => q.map((value, i) => value - rows[0].read[i]);
    const all = rows.flatMap((row) => [...since(row.read), ...since(row.told ?? row.read)]);
    const [low, high] = [Math.min(...all), Math.max(...all)];
    const x = (/** @type {number} */ t) => (((t - rows[0].t) / Math.max(last.t - rows[0].t, 1e-3)) * WIDTH).toFixed(1);
    const y = (/** @type {number} */ q) => (HEIGHT - 4 - ((q - low) / Math.max(high - low, 1e-6)) * (HEIGHT - 8)).toFixed(1);
    /** @type {(i: number, told: boolean) => SVGElement} */
    const line = (i, told) => {
      const seen = told ? rows.filter((row) => row.told) : rows;
      const points = seen.map((row) => `${x(row.t)},${y(since(told ? row.told ?? row.read : row.read)[i])}`).join(" ");
      const look = { points, fill: "none", stroke: COLOURS[i % COLOURS.length], "stroke-width": told ? 3 : 1.6 };
      return svg("polyline", told ? { ...look, "stroke-dasharray": "2 5", opacity: 0.75 } : look);
    };
    const { joints } = this.arm;
    get("live").replaceChildren(...joints.map((_, i) => line(i, true)), ...joints.map((_, i) => line(i, false)));
    const said = joints.map(({ name, unit }, i) => {
      const off = rows.map(({ read, told }) => (told ? Math.abs(read[i] - told[i]) : -1)).reduce((a, b) => Math.max(a, b));
      return `${name} ${fixed(last.read[i], 1)} ${unit}${off < 0 ? "" : `, at most ${fixed(off, 2)} apart`}`;
    });
    get("live").setAttribute("aria-label", `What the joints have moved in ${fixed(last.t - rows[0].t, 0)} s, ${fixed(low, 1)} to ${fixed(high, 1)}: ${said.join("; ")}`);
    const keys = said.map((text, i) => {
      const dot = make("span", { class: "dot" });
      dot.style.background = COLOURS[i % COLOURS.length];
      return make("span", { class: "key" }, dot, text);
    });
    const head = `Moved in ${fixed(last.t - rows[0].t, 0)} s (${fixed(low, 1)} to ${fixed(high, 1)}): dots as told, lines as the board says`;
    get("live-keys").replaceChildren(head, ...keys);
    get("live-chart").hidden = false;
  }
}
