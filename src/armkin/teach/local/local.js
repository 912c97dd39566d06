// @ts-check
/** In place of server.js in a page that asks no server: the arm's own module answers. */
// @ts-ignore: both are made when the page is written
import * as arm from "armkin/arm.js";
// @ts-ignore
import { plan, slice, solver, arm as scene } from "armkin/data.js";
import { absent, get, make } from "../static/js/dom.js";
import { solving } from "../static/js/browser_answers.js";

/** An action that is refused. */
export class Refused extends Error {}

const { look, home } = solving(arm, solver, scene);

/** Look, and have the address say what is shown. @param {any} fields */
function shown(fields) {
  const answer = look(fields);
  share(answer.q, answer.target ?? []);
  return answer;
}

/** Carry out an action. @param {string} name @returns {Promise<any>} */
export async function act(name) {
  if (name === "stop") return {};
  if (name === "reach") return slice;
  throw new Refused("this page has no server: start armkin teach for that");
}

/** The posture that an address names [deg | mm]; home if it names none. @param {string} link @returns {number[]} */
function addressed(link) {
  const words = new URLSearchParams(new URL(link).hash.slice(1)).get("q")?.split(",") ?? [];
  const values = words.map(Number);
  const good = words.length === home.length && words.every((word) => word.trim() !== "") && values.every(Number.isFinite);
  return good ? values : home;
}

const shared = { link: "", command: "", python: "" };
const PACE = 100; // [ms] from one change of the address to the next: browsers refuse hundreds in a few seconds
let [addressAt, waiting] = [-Infinity, false];

/** The address says what is shown, when it may change again: never while an answer is waited for, which it delays by as
 * long as the browser's other processes take. */
function address() {
  if (waiting) return;
  waiting = true;
  setTimeout(() => {
    waiting = false;
    addressAt = performance.now();
    try {
      history.replaceState(null, "", shared.link);
    } catch {
      // a page whose address cannot change, such as one in a frame, is shown all the same
    }
  }, Math.max(addressAt + PACE - performance.now(), 0));
}

/** What the address and the buttons say. @param {number[]} q [deg | mm] @param {number[]} goal */
function share(q, goal) {
  const said = q.map((value) => Number(value.toFixed(6)) + 0).join(",");
  const words = goal.map((value) => Number(value.toFixed(6)) + 0);
  shared.link = `#q=${said}`;
  shared.command = `armkin ik ${solver.robot} ${words.join(" ")} --near ${said} --all-branches`;
  shared.python = [
    "import armkin, numpy as np",
    `arm = armkin.load(${JSON.stringify(solver.robot)})`,
    `q = np.array([${said.replaceAll(",", ", ")}]) * [${scene.joints.map((/** @type {any} */ j) => (j.prismatic ? "1" : "np.pi / 180")).join(", ")}]`,
    "T = armkin.fk(arm, q)",
  ].join("\n");
  address();
}

/** A button that copies a text. @param {string} title @param {() => string} text */
function copies(title, text) {
  const button = make("button", { type: "button" }, title);
  button.addEventListener("click", async () => {
    const box = make("textarea", { "aria-label": title, readonly: "" });
    try {
      await navigator.clipboard.writeText(text());
      get("copied").textContent = `${title}: copied`;
    } catch {
      box.value = text(); // no clipboard on a page from disk: the text is shown, and marked
      get("copied").replaceChildren(box);
      box.select();
    }
  });
  return button;
}

const FIRST = 12;

/** Solve some postures beside home while nobody asks: what a browser has run before, it has compiled for the first drag.
 * @param {number} [left] */
function practise(left = FIRST) {
  if (!left) return;
  const q = home.slice();
  q[left % q.length] += 3 * left;
  look({ q });
  const idle = window.requestIdleCallback ?? setTimeout;
  idle(() => practise(left - 1));
}

/** @param {any} page */
function ready(page) {
  for (const part of document.querySelectorAll("[data-served]")) absent.append(part);
  if (plan) page.program.carry(plan);
  else absent.append(get("program"), get("play-key"));
  if (!slice) absent.append(get("slice"));
  const title = make("h2", { id: "share-title" }, "Share");
  const buttons = make(
    "div", { class: "row" },
    copies("Copy link", () => `${location.href.split("#")[0]}${shared.link}`),
    copies("Copy as command", () => shared.command),
    copies("Copy as Python", () => shared.python),
  );
  const section = make("section", { id: "share", "aria-labelledby": "share-title" }, title, buttons, make("p", { id: "copied", role: "status" }));
  get("keys").before(section);
  // the event's own address: the page may have written the posture before into it meanwhile
  addEventListener("hashchange", (event) => page.turn(addressed(event.newURL)));
  setTimeout(() => practise(), 0);
}

/**
 * @param {Object<string, (data: any) => void>} hears topic -> what to do
 * @returns {Promise<any>} the scene and what is shown
 */
export async function enter(hears) {
  /** @type {any} */ (window).armkin = arm;
  hears.control({ holder: "yours", pages: 1 });
  const program = { moves: [], blend: 0, speed: 100, tool_speed: null, via: false, undo: 0, redo: 0 };
  return { scene, look: shown({ q: addressed(location.href) }), program, ready, alone: shown };
}
