// @ts-check
/** The program: record, name, reorder, delete, undo; save and load the path file. */
import { fixed, get, make } from "./dom.js";
import { Latest } from "./latest_request.js";
import { Rows } from "./move_list.js";
import { Player } from "./player.js";
import { act } from "./server.js";

const OLD = 500; // [ms] that the plan of a program is shown which has been edited

export class Program {
  /**
   * @param {import("./types.js").Arm} arm
   * @param {{pose: () => Promise<number[]>, settled: () => void, show: (q: number[]) => void, played: (q: number[]) => void,
   *   trail: (tips: number[][], hit?: number[]) => void, trouble: (text: string) => void, begun: () => void, mine: () => boolean}} page
   */
  constructor(arm, page) {
    this.page = page;
    this.robot = arm.robot_file;
    this.player = new Player(arm, page.played, page.settled);
    this.chosen = -1;
    this.count = 0;
    this.carried = false; // the plan is part of the page
    this.shown = "";
    this.rows = new Rows((fields) => this.edit(fields), (k) => this.goto(k), (k) => (this.chosen = k));
    /** @type {Promise<void>} */
    this.editing = Promise.resolve();
    this.planning = new Latest(() => this.plan());
    const click = (/** @type {string} */ id, /** @type {() => void} */ action) => get(id).addEventListener("click", action);
    click("record", () => this.record());
    click("via", async () => this.edit({ do: "via", q: await page.pose() }));
    click("undo", () => this.edit({ do: "undo" }));
    click("redo", () => this.edit({ do: "redo" }));
    click("clear", () => this.edit({ do: "clear" }));
    click("save", () => this.save());
    click("play", () => this.play());
    click("add-wait", () => this.edit({ do: "record", kind: "wait", seconds: 1 }));
    click("add-open", () => this.edit({ do: "record", kind: "grip", value: "open" }));
    click("add-close", () => this.edit({ do: "record", kind: "grip", value: "closed" }));
    const kind = /** @type {HTMLSelectElement} */ (get("kind"));
    const arc = () => (get("via").hidden = kind.value !== "arc");
    kind.addEventListener("change", arc);
    arc();
    get("add-open").hidden = get("add-close").hidden = arm.gripper === null;
    const file = /** @type {HTMLInputElement} */ (get("load"));
    file.addEventListener("change", async () => {
      const [chosen] = file.files ?? [];
      if (chosen) await this.change("load", { text: await chosen.text(), name: chosen.name });
      file.value = "";
    });
    for (const key of ["blend", "speed", "tool_speed"]) {
      const box = /** @type {HTMLInputElement} */ (get(`program-${key}`));
      box.addEventListener("change", () => this.edit({ do: "settings", [key]: box.value === "" ? null : box.valueAsNumber }));
    }
  }

  record() {
    this.editing = this.recorded();
    return this.editing;
  }

  async recorded() {
    const kind = /** @type {HTMLSelectElement} */ (get("kind")).value;
    const index = this.chosen >= 0 && this.chosen < this.count - 1 ? { index: this.chosen } : {};
    this.chosen = index.index === undefined ? -1 : this.chosen + 1;
    await this.edit({ do: "record", kind, q: await this.page.pose(), ...index });
  }

  /** @param {object} fields */
  edit(fields) {
    return this.change("program", fields);
  }

  /** @param {string} action @param {object} fields */
  change(action, fields) {
    this.editing = this.changed(action, fields);
    return this.editing;
  }

  /** @param {string} action @param {object} fields */
  async changed(action, fields) {
    this.page.begun();
    try {
      this.show(await act(action, fields));
    } catch (error) {
      this.page.trouble(/** @type {Error} */ (error).message);
    }
  }

  /** A plan that is part of the page. @param {import("./types.js").Played} plan */
  carry(plan) {
    this.carried = true;
    this.take(plan);
  }

  /** @param {import("./types.js").Played} plan */
  take(plan) {
    this.player.load(plan.time ? plan : null);
    this.page.trail(plan.tips, plan.hit);
    if (plan.refused) {
      get("planned").textContent = `${plan.refused} (the red place)`;
      get("planned").className = "bad";
      return;
    }
    let text = `${fixed(plan.duration_s, 3)} s`;
    if (plan.approach_s) text = `first a joint move to its start, ${fixed(plan.approach_s, 3)} s; then ${text}`;
    if (plan.length_mm) text += `, ${fixed(plan.length_mm, 1)} mm on lines and arcs`;
    if (plan.shown_mm > 0.5) text += `; it is long: the tip shown is up to ${fixed(plan.shown_mm, 1)} mm off`;
    get("planned").textContent = text;
    get("planned").className = "";
  }

  async plan() {
    if (this.carried) return;
    if (!this.count || !this.page.mine()) {
      this.none("");
      return;
    }
    const late = setTimeout(() => this.none("planning ..."), OLD); // what is shown is the plan of another program
    try {
      const plan = /** @type {import("./types.js").Played} */ (await act("plan"));
      if (this.planning.next === null) this.take(plan); // else it has been edited meanwhile
    } catch (error) {
      this.none(/** @type {Error} */ (error).message);
      get("planned").className = "bad";
    }
    clearTimeout(late);
  }

  /** Nothing to play. @param {string} why */
  none(why) {
    this.player.load(null);
    this.page.trail([]);
    get("planned").textContent = why;
    get("planned").className = "";
  }

  /** Show the pose where a move ends; the next one is recorded behind it. @param {number} k */
  async goto(k) {
    this.chosen = k;
    this.page.begun();
    try {
      this.page.show((await act("end", { index: k })).q);
    } catch (error) {
      this.page.trouble(/** @type {Error} */ (error).message);
    }
  }

  async save() {
    this.page.begun();
    try {
      const { text, name } = await act("save");
      const link = make("a", { href: URL.createObjectURL(new Blob([text], { type: "text/yaml" })), download: name });
      link.click();
      URL.revokeObjectURL(link.href);
      get("saved").textContent = `armkin path ${this.robot} ${name} plans it again, armkin send ${this.robot} --path ${name} runs it.`;
    } catch (error) {
      this.page.trouble(/** @type {Error} */ (error).message);
    }
  }

  /** @param {import("./types.js").ProgramState} state */
  show(state) {
    const said = JSON.stringify(state);
    if (said === this.shown) return; // the answer to an edit, and the news of it, are one
    this.shown = said;
    this.count = state.moves.length;
    this.chosen = Math.min(this.chosen, this.count - 1);
    this.rows.show(state.moves);
    const off = (/** @type {string} */ id, /** @type {boolean} */ when) => {
      /** @type {HTMLButtonElement} */ (get(id)).disabled = when;
    };
    off("undo", !state.undo);
    off("redo", !state.redo);
    off("clear", !this.count);
    off("save", !this.count);
    get("via").setAttribute("aria-pressed", String(state.via));
    for (const key of /** @type {("blend"|"speed"|"tool_speed")[]} */ (["blend", "speed", "tool_speed"])) {
      const box = /** @type {HTMLInputElement} */ (get(`program-${key}`));
      if (document.activeElement !== box) box.value = state[key] === null ? "" : String(state[key]);
    }
    this.planning.push({});
  }

  /** Play or pause; what has just been edited is planned first. */
  async play() {
    if (!this.player.playing) {
      await this.editing;
      await this.planning.idle();
    }
    this.player.toggle();
  }
}
