// @ts-check
/** The list of a program's moves: of two lists that follow each other, the rows that differ are made or changed. */
import { get, make } from "./dom.js";

/** @typedef {import("./types.js").ProgramMove} Move */
/** @typedef {{item: HTMLElement, put: (move: Move, k: number, last: boolean) => void, said: string}} Row */

const MOVES = ["joint", "line", "arc", "point", "spline", "polyline", "circle", "offset"];

export class Rows {
  /**
   * @param {(fields: object) => void} edit
   * @param {(k: number) => void} goto
   * @param {(k: number) => void} chose
   */
  constructor(edit, goto, chose) {
    this.edit = edit;
    this.goto = goto;
    this.chose = chose;
    /** @type {Row[]} */
    this.rows = [];
    /** @type {Move[]} */
    this.moves = [];
  }

  /** @param {Move[]} moves */
  show(moves) {
    const alike = (/** @type {Move} */ a, /** @type {Move} */ b) => JSON.stringify(a) === JSON.stringify(b);
    const before = this.moves;
    const shorter = Math.min(before.length, moves.length);
    let same = 0;
    while (same < shorter && alike(before[same], moves[same])) same += 1;
    let rest = 0;
    while (rest < shorter - same && alike(before[before.length - 1 - rest], moves[moves.length - 1 - rest])) rest += 1;
    const focused = document.activeElement?.closest("#moves") ? document.activeElement.id : "";
    // The rows between are used again, as far as there are as many: a focus stays where it is.
    const middle = this.rows.slice(same, before.length - rest);
    const needed = moves.length - same - rest;
    for (const row of middle.splice(needed)) row.item.remove();
    const next = this.rows[before.length - rest]?.item ?? null;
    while (middle.length < needed) {
      const row = this.row();
      get("moves").insertBefore(row.item, next);
      middle.push(row);
    }
    this.rows = [...this.rows.slice(0, same), ...middle, ...this.rows.slice(before.length - rest)];
    this.moves = moves;
    this.rows.forEach((row, k) => row.put(moves[k], k, k === moves.length - 1));
    if (focused && document.activeElement?.id !== focused) document.getElementById(focused)?.focus();
  }

  /** @returns {Row} */
  row() {
    let at = 0;
    const input = (/** @type {Object<string, string>} */ attributes) => make("input", attributes);
    const name = input({ type: "text", maxlength: "60" });
    name.addEventListener("change", () => this.edit({ do: "rename", index: at, name: name.value }));
    name.addEventListener("focus", () => this.chose(at));
    const blend = input({ type: "number", min: "0", step: "1", placeholder: "blend" });
    blend.addEventListener("change", () => this.edit({ do: "blend", index: at, blend: blend.value === "" ? null : blend.valueAsNumber }));
    const show = make("button", { type: "button", class: "kind" });
    show.addEventListener("click", () => this.goto(at));
    const button = (/** @type {string} */ sign, /** @type {() => object} */ fields) => {
      const one = make("button", { type: "button" }, sign);
      one.addEventListener("click", () => this.edit({ ...fields(), index: at }));
      return one;
    };
    const up = button("\u2191", () => ({ do: "reorder", to: at - 1 }));
    const down = button("\u2193", () => ({ do: "reorder", to: at + 1 }));
    const gone = button("\u2715", () => ({ do: "delete" }));
    /** @type {Row} */
    const row = { item: make("li", {}, show, name, blend, up, down, gone), said: "", put: () => {} };
    const label = (/** @type {HTMLElement} */ one, /** @type {string} */ id, /** @type {string} */ text) => {
      one.id = `${id}-${at}`;
      one.setAttribute("aria-label", text);
    };
    row.put = (move, k, last) => {
      const said = JSON.stringify([move, k, last]);
      if (said === row.said) return;
      row.said = said;
      at = k;
      const which = `move ${k + 1}`;
      label(name, "name", `name of ${which}`);
      label(blend, "blend", `blend radius of ${which} in mm`);
      label(show, "show", `show ${which}, ${move.kind}`);
      label(up, "move-up", `move up ${which}`);
      label(down, "move-down", `move down ${which}`);
      label(gone, "delete", `delete ${which}`);
      row.item.title = `${move.kind}: ${move.said}`;
      show.textContent = `${k + 1} ${move.kind}`;
      name.placeholder = move.said;
      name.value = move.name;
      blend.value = move.blend === null ? "" : String(move.blend);
      blend.disabled = !MOVES.includes(move.kind);
      up.disabled = k === 0;
      down.disabled = last;
    };
    return row;
  }
}
