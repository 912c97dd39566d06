// @ts-check
/** The tip's target as the arm's task asks for it, what was found, and the branches to choose from. */
import { isFlat } from "./chain.js";
import { fixed, get, make, show, typed } from "./dom.js";

const NUDGE = 5; // [mm] of an arrow key

/** Okabe and Ito's colours, as in the pictures of `armkin plot`; told apart also by the colour-blind. */
const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a5195", "#8c8c00"];

/** What the numbers of a target mean. */
const MEANING = /** @type {Object<string, string>} */ ({
  roll: "turn about the tool's x axis: R = Rz(yaw) Ry(pitch) Rx(roll)",
  pitch: "turn about the y axis: R = Rz(yaw) Ry(pitch) Rx(roll)",
  yaw: "turn about the base's z axis",
  phi: "sum of the parallel joints' angles: the tool's pitch in the arm's own plane",
  theta: "sum of the joint angles: the tool's direction in the plane",
  ax: "the tool's z axis, along the base's x; any length", ay: "the tool's z axis, along the base's y; any length",
  az: "the tool's z axis, along the base's z; any length",
});

/** @param {number} k @returns {string} */
const colour = (k) => COLOURS[k] ?? `hsl(${(k * 137) % 360} 60% 50%)`;

export class Tip {
  /**
   * @param {(target: number[], goal: boolean) => void} aimed goal: typed, an arm that follows goes there
   * @param {(branch: import("./types.js").Branch) => void} chose
   * @param {(joints: number[]) => void} went
   * @param {() => void} pointed another branch's button is pointed at, or none
   */
  constructor(aimed, chose, went, pointed) {
    this.pointed = pointed;
    /** Name of the branch whose button is pointed at. */
    this.hovered = "";
    this.aimed = aimed;
    this.chose = chose;
    /** @type {HTMLInputElement[]} */
    this.boxes = [];
    this.labels = "";
    /** @type {string | null} */
    this.task = null;
    /** @type {number[]} */
    this.target = [];
    /** @type {{branch: import("./types.js").Branch, colour: string, chosen: boolean}[]} */
    this.rows = [];
    /** @type {number[]} */
    this.nearest = [];
    get("target").addEventListener("submit", (event) => event.preventDefault());
    get("nearest").addEventListener("click", () => went(this.nearest));
  }

  /** @param {import("./types.js").Look} look @param {boolean} stale whether the target has changed since */
  show(look, stale) {
    this.task = look.task;
    get("target").hidden = look.task === null;
    if (look.task === null) {
      get("answer").textContent = look.why ?? "";
      get("branches").replaceChildren();
      this.rows = [];
      return;
    }
    const { labels = [], units = [], target = [], names = [], chosen = null } = look;
    if (labels.join() !== this.labels) this.build(labels, units);
    if (!stale) {
      this.target = target;
      target.forEach((value, i) => show(this.boxes[i], value));
    }
    this.rows = look.branches.map((branch, k) => ({
      branch, colour: colour(names.indexOf(branch.name)), chosen: k === chosen,
    }));
    // The order of the names, not of the motion: a key chooses the same branch all the time.
    this.rows.sort((a, b) => names.indexOf(a.branch.name) - names.indexOf(b.branch.name));
    this.say(look);
    this.list();
  }

  /** @param {string[]} labels @param {string[]} units */
  build(labels, units) {
    this.labels = labels.join();
    this.boxes = labels.map(() => make("input", { type: "number", step: "any" }));
    get("target").replaceChildren(
      ...labels.map((name, i) => {
        typed(this.boxes[i], (value) => this.aim(i, value));
        this.boxes[i].addEventListener("keydown", (event) => {
          const way = { ArrowUp: 1, ArrowDown: -1 }[event.key];
          if (!way) return;
          event.preventDefault();
          this.aim(i, this.target[i] + way * (units[i] === "" ? 0.01 : 1));
        });
        const said = units[i] ? `${name} / ${units[i]}` : name;
        return make("label", MEANING[name] ? { title: MEANING[name] } : {}, make("span", {}, said), this.boxes[i]);
      }),
    );
  }

  /** @param {number} i @param {number} value */
  aim(i, value) {
    const target = [...this.target];
    target[i] = value;
    this.target = target;
    this.aimed(target, true);
  }

  /** Move the target from where it is. @param {number[]} way [steps] */
  nudge(way) {
    if (!this.target.length || !this.task) return;
    const flat = isFlat(this.task);
    this.target = this.target.map((value, i) => (i < (flat ? 2 : 3) ? value + NUDGE * way[i] : value));
    this.aimed(this.target, false);
  }

  /** @param {import("./types.js").Look} look */
  say(look) {
    const legal = look.branches.filter((branch) => branch.within_limits).length;
    const count = look.branches.length;
    let text = `${look.status}: ${count} branch${count === 1 ? "" : "es"}, ${legal} within limits`;
    if (look.status === "boundary") text += "; at the edge of what the arm reaches, branches meet";
    if (look.status === "singular") text += "; there is a way in which the tip cannot move at once";
    if (look.free?.length) text += `; free to turn while the tip rests: ${look.free.join(", ")}`;
    if (!look.complete) text += "; there may be more";
    const near = look.closest;
    this.nearest = near?.joints ?? [];
    if (near) {
      text += `. The nearest pose within limits is ${fixed(near.distance_mm)} mm away`;
      if (near.angle_deg > 1e-6) text += `, turned by ${fixed(near.angle_deg)} deg`;
      text += " (grey).";
    }
    get("answer").textContent = text;
    get("answer").className = legal ? "" : "bad";
    get("nearest").hidden = !near;
  }

  /** The buttons of the branches; those that are there are used again, so that one is not lost under the pointer. */
  list() {
    const place = get("branches");
    const any = this.rows.some((row) => row.chosen);
    while (place.childElementCount > this.rows.length) place.lastElementChild?.remove();
    while (place.childElementCount < this.rows.length) place.append(this.button(place.childElementCount));
    this.rows.forEach(({ branch, colour, chosen }, k) => {
      const button = get(`branch-${k}`);
      const [dot, name, note] = /** @type {HTMLElement[]} */ ([...button.children]);
      button.setAttribute("aria-checked", String(chosen));
      button.tabIndex = chosen || (!any && k === 0) ? 0 : -1;
      button.title = branch.outside.join("\n");
      dot.style.background = colour;
      name.textContent = branch.name || "branch";
      const joints = branch.outside.map((words) => words.split(" ")[0]);
      note.textContent = joints.length ? `outside: ${joints.join(", ")}` : branch.hits ?? "";
    });
  }

  /** @param {number} k */
  button(k) {
    const parts = ["dot", "name", "note"].map((name) => make("span", { class: name }));
    const button = make("button", { type: "button", role: "radio", id: `branch-${k}` }, ...parts);
    if (k < 8) button.append(make("kbd", { "aria-hidden": "true" }, String(k + 1)));
    button.addEventListener("click", () => this.choose(k));
    button.addEventListener("keydown", (event) => this.step(event, k));
    button.addEventListener("pointerenter", () => this.point(this.rows[k]?.branch.name ?? ""));
    button.addEventListener("pointerleave", () => this.point(""));
    button.addEventListener("focus", () => button.matches(":focus-visible") && this.point(this.rows[k]?.branch.name ?? ""));
    button.addEventListener("blur", () => this.point(""));
    return button;
  }

  /** A branch is pointed at, by its button or in the picture. @param {string} name or none */
  point(name) {
    this.hovered = name;
    this.rows.forEach(({ branch }, k) => get(`branch-${k}`).classList.toggle("pointed", name !== "" && branch.name === name));
    this.pointed();
  }

  /** Arrow keys go through the radio group; with Ctrl they only point, as the pointer does, and Space chooses. @param {KeyboardEvent} event @param {number} k */
  step(event, k) {
    const way = { ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1 }[event.key];
    if (!way) return;
    event.preventDefault();
    event.stopPropagation();
    const next = (k + way + this.rows.length) % this.rows.length;
    get(`branch-${next}`).focus();
    if (!event.ctrlKey) this.choose(next);
  }

  /** @param {number} k */
  choose(k) {
    if (this.rows[k]) this.chose(this.rows[k].branch);
  }

  /** What is drawn besides the solid arm. */
  ghosts() {
    /** @type {import("./ghosts.js").Ghost[]} */
    const found = this.rows
      .filter((row) => !row.chosen)
      .map(({ branch, colour }) => ({
        joints: branch.joints, colour, faint: !branch.within_limits, solid: branch.name === this.hovered, name: branch.name,
      }));
    if (this.nearest.length) found.push({ joints: this.nearest, colour: "#808890", faint: false, solid: false });
    return found;
  }
}
