// @ts-check
/** What went wrong, in the page's one red line. */
import { get } from "./dom.js";

/** @type {Map<string, string>} */
const troubles = new Map();
const OF_REQUESTS = ["page", "program", "board", "box"]; // the others stay as long as they are so

/**
 * Say what went wrong.
 * @param {string} text or nothing
 * @param {string} [source] the part of the page that it is about: each part clears its own text alone
 */
export function trouble(text, source = "page") {
  troubles.set(source, text);
  get("trouble").textContent = [...troubles.values()].filter(Boolean).join("\n");
}

/** Something new was begun: what an earlier request was told is over. */
export function begun() {
  for (const source of OF_REQUESTS) trouble("", source);
}
