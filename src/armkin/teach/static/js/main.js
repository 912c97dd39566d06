// @ts-check
/** The page: one pose, shown by all of its parts. */
import { Board } from "./board.js";
import { isFlat } from "./chain.js";
import { get } from "./dom.js";
import { Held } from "./held_joint.js";
import { Joints } from "./joints.js";
import { keys } from "./keys.js";
import { Latest } from "./latest_request.js";
import { Motors } from "./motors.js";
import { Program } from "./program.js";
import { act, enter } from "./server.js";
import { ownSolver } from "./browser_answers.js";
import { theme } from "./theme.js";
import { Tip } from "./tip_target.js";
import { begun, trouble } from "./error_line.js";

/** @typedef {import("./types.js").Look} Look */

const CONFIRMED = 100; // [ms] between two questions to the server while this page answers itself

const drawing = import("./view.js"); // while the server is asked for the arm

class Page {
  /** @param {import("./types.js").Arm} arm @param {Look} look @param {((fields: any) => Look) | null} alone of a page without a server: its answer */
  constructor(arm, look, alone = null) {
    this.alone = alone;
    this.arm = arm;
    this.look = look;
    this.q = look.q;
    this.branch = "";
    this.joints = new Joints(arm, (q, byHand, held) => (held && this.tip.target.length ? this.swing(q) : this.turn(q, byHand)), () => this.refresh());
    this.tip = new Tip((target, goal) => this.aim(target, { goal }), (branch) => this.choose(branch), (q) => this.turn(q), () => {
      if (!this.moving) this.showGhosts();
    });
    this.held = new Held(arm, (q) => this.swing(q));
    this.motors = new Motors(arm, () => this.refresh());
    /** @type {import("./view.js").View | null} */
    this.view = null;
    this.moving = false; // the board moves: the page shows where its pins are
    this.jobs = 0; // that the board has ended
    /** @type {{look: (fields: any) => Look, held: string} | null} the arm's own module */
    this.own = null;
    this.mine = false; // whether this page holds control; one that watches asks for nothing
    const pose = /** @type {() => Promise<number[]>} */ (() => this.asking.idle().then(() => this.q));
    this.board = new Board(arm, {
      pose, show: (q) => this.turn(q), moved: (state) => this.moved(state), trouble: (text, source = "board") => trouble(text, source), begun,
    });
    this.program = new Program(arm, {
      pose, settled: () => this.refresh(), show: (q) => this.turn(q), played: (q) => this.played(q),
      trail: (tips, hit) => this.view?.trail(tips, hit),
      trouble: (text) => trouble(text, "program"), begun, mine: () => this.mine,
    });
    this.asking = new Latest((fields) => this.answer(fields), () => (this.answersItself() && !this.board.state?.follows ? CONFIRMED : 0));
    get("robot").textContent = arm.robot;
    document.title = `${arm.robot} - armkin teach`;
  }

  /** This page holds control from now on, or does not any more. @param {boolean} mine */
  hold(mine) {
    if (mine === this.mine) return;
    this.mine = mine;
    for (const source of ["page", "program", "board"]) trouble("", source);
    this.program.planning.push({});
    this.refresh();
  }

  /** Turn the joints. @param {number[]} q @param {boolean} [goal] whether a person drags or types: an arm that follows goes there */
  turn(q, goal = false) {
    begun();
    this.q = q;
    this.joints.show(q);
    if (!this.moving) this.view?.pose(q, this.look.red);
    this.ask({ goal });
  }

  /**
   * Aim the tip.
   * @param {number[]} target
   * @param {{dragging?: boolean, goal?: boolean}} [how] goal: as in `turn`
   */
  aim(target, { dragging = false, goal = false } = {}) {
    begun();
    this.ask({ target, branch: this.branch, nearest: !dragging, goal });
  }

  /** Turn a held joint of an arm that has one to spare: the others follow, the tip stays. @param {number[]} q */
  swing(q) {
    begun();
    this.ask({ q, target: this.tip.target, branch: this.branch, goal: true });
  }

  /** @param {import("./types.js").Branch} branch */
  choose(branch) {
    this.branch = branch.name;
    this.turn([...branch.joints]);
  }

  /** @param {object} fields */
  ask(fields) {
    if (!this.mine) return;
    document.documentElement.dataset.asking = "yes";
    const asked = { q: this.q, ...fields };
    if (this.alone) {
      this.answer(asked); // at once: nothing is waited for
      return;
    }
    this.asking.push(asked);
    this.first(asked);
  }

  /** Whether this page has a solver of the joints that are not held. */
  answersItself() {
    return this.own !== null && [...this.joints.held].join() === this.own.held && !this.motors.best.checked;
  }

  /** The first numbers, from this page itself; the server's answer confirms or corrects them. @param {any} fields */
  first(fields) {
    if (!this.answersItself() || !this.own) return;
    const stands = this.board.state?.pulses ?? null;
    this.show(this.own.look({ ...fields, stands }), fields.target !== undefined);
  }

  /** Ask for the same pose again; what waits to be asked is newer than that. */
  refresh() {
    if (this.asking.next === null) this.ask({});
  }

  /** @param {any} fields */
  async answer(fields) {
    try {
      const asked = { q: this.q, held: [...this.joints.held], best: this.motors.best.checked, ...fields };
      const look = this.alone ? this.alone(asked) : /** @type {Look} */ (await act("look", asked));
      const older = (this.answersItself() || !fields.target) && this.asking.next !== null; // what is shown is newer
      if (!older) this.show(look, fields.target !== undefined, this.asking.next !== null);
      trouble("");
    } catch (error) {
      trouble(/** @type {Error} */ (error).message);
    }
    if (this.asking.next === null) document.documentElement.dataset.asking = "no";
  }

  /** The program is played: the arm alone, without asking for every pose. @param {number[]} q */
  played(q) {
    if (this.moving) return;
    this.board.unfollow();
    this.q = q;
    this.joints.show(q);
    this.view?.pose(q);
    this.view?.showGhosts([]);
  }

  /** The board says where the arm stands. @param {import("./types.js").BoardState} state */
  moved(state) {
    const ended = state.ended.count !== this.jobs && state.doing === "";
    this.jobs = state.ended.count;
    this.moving = !["", "connect", "follow"].includes(state.doing);
    if (!this.view) return;
    if (this.moving && state.joints) {
      this.view.pose(state.joints);
      this.view.showGhosts([]);
    } else if (ended) {
      this.refresh();
      this.program.planning.push({}); // it starts where the arm stands
      this.show(this.look);
    } else this.showGhosts();
  }

  /** Ghosts: the other branches, the nearest pose, and the arm itself where it stands elsewhere. */
  showGhosts() {
    const ghosts = this.tip.ghosts();
    const stands = this.board.state?.joints;
    const away = stands?.some((value, i) => Math.abs(value - this.q[i]) > 0.1);
    if (stands && away) ghosts.push({ joints: stands, colour: "#3a444f", faint: false, solid: false });
    this.view?.showGhosts(ghosts);
  }

  /**
   * @param {Look} look
   * @param {boolean} [aimed] whether the pose follows a target
   * @param {boolean} [stale] whether something newer was asked for meanwhile
   */
  show(look, aimed = false, stale = false) {
    this.look = look;
    this.q = look.q;
    if (!aimed || look.chosen !== null) this.branch = look.branches[look.chosen ?? -1]?.name ?? this.branch;
    this.joints.show(look.q);
    this.joints.say(look.outside);
    this.tip.show(look, stale);
    this.motors.show(look);
    this.held.show(look, this.joints.held);
    if (!this.view || this.moving) return;
    this.view.pose(look.q, look.red);
    this.showGhosts();
    const flat = isFlat(look.task);
    const { position_mm: tip, rpy_deg } = look.tip;
    const target = look.target ?? tip;
    this.view.gizmo.show(look.task !== null, flat);
    get("turn").hidden = look.task !== "pose";
    this.view.gizmo.put(flat ? [target[0], target[1], tip[2]] : target, look.task === "pose" ? target.slice(3) : rpy_deg);
  }

  /** Draw in 3-D, where the browser can. */
  async draw() {
    const canvas = /** @type {HTMLCanvasElement} */ (get("canvas"));
    const { View } = await drawing;
    try {
      this.view = new View(canvas, this.arm);
    } catch {
      canvas.hidden = get("views").hidden = true;
      get("flat").hidden = false;
      return;
    }
    const view = this.view;
    view.legend();
    get("reach").addEventListener("click", () => view.reach());
    view.pointing.with(this.tip);
    view.gizmo.moved = (position, rpy) => {
      const rest = this.look.task === "pose" ? rpy : (this.look.target ?? []).slice(3);
      const flat = isFlat(this.look.task);
      const target = flat ? [...position.slice(0, 2), ...(this.look.target ?? []).slice(2)] : [...position, ...rest];
      this.aim(target, { dragging: true, goal: true });
    };
    view.gizmo.dropped = () => this.aim(this.tip.target, { goal: true });
    for (const button of document.querySelectorAll("[data-view]")) {
      button.addEventListener("click", () => view.look(/** @type {HTMLElement} */ (button).dataset.view ?? ""));
    }
    view.size();
    this.show(this.look); // the handle stands at the tip before all is fitted in
    view.look("space");
  }
}

async function start() {
  /** @type {{page: Page | null, mine: boolean}} of the news that may come before there is a page */
  const here = { page: null, mine: false };
  /** @type {() => void} */
  let told = () => {};
  const known = new Promise((resolve) => (told = () => resolve(null)));
  /** @param {{holder: string, pages: number}} news */
  const control = ({ holder, pages }) => {
    const mine = holder === "yours";
    here.mine = mine;
    here.page?.hold(mine);
    told();
    get("control").textContent = mine ? (pages > 1 ? `in control, ${pages - 1} watching` : "") : holder === "another"
      ? "watching: another page holds control" : "nobody holds control";
    get("take").hidden = mine;
    get("panels").inert = !mine;
    get("canvas").inert = !mine;
  };
  const opened = await enter(
    {
      control,
      look: (look) => here.page?.show(look),
      program: (state) => here.page?.program.show(state),
      board: (state) => here.page?.board.show(state),
    },
    (lost) => {
      trouble(lost ? "armkin teach does not answer: is it still running in its terminal?" : "", "line");
      here.page?.board.gone(lost);
    },
  );
  const one = new Page(opened.scene, opened.look, opened.alone);
  here.page = one;
  theme(matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light", one);
  get("theme").addEventListener("click", () => theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark", one));
  get("take").addEventListener("click", () => act("take").catch((error) => trouble(error.message)));
  const stop = () => {
    one.board.stopped();
    act("stop").catch((error) => trouble(`STOP did not get through: ${error.message}`, "stop"));
  };
  get("stop").addEventListener("click", stop);
  document.addEventListener("typed", (event) => trouble(/** @type {CustomEvent} */ (event).detail, "box"));
  /** @type {Object<string, () => void>} */
  const actions = {
    r: () => one.program.record(),
    p: () => one.program.play(),
    f: () => one.view?.look("fit"),
    g: () => one.board.grip(one.board.open ? "closed" : "open"),
  };
  for (let k = 1; k <= 8; k++) actions[String(k)] = () => one.tip.choose(k - 1);
  keys(actions, (way) => one.tip.nudge(way), stop);
  one.show(opened.look);
  one.program.show(opened.program);
  if (opened.board) one.board.show(opened.board);
  one.hold(here.mine);
  opened.ready?.(one); // of a page without a server
  await one.draw();
  if (!opened.ready) one.own = await ownSolver(opened.scene, act);
  await known; // who holds control
  document.documentElement.dataset.ready = "yes";
}

start().catch((error) => {
  trouble(error.message);
  console.error(error);
});
