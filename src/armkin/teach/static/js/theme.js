// @ts-check
/** Light and dark. */
import { get } from "./dom.js";

/** @param {string} name @param {{view: {theme: () => void} | null}} page */
export function theme(name, page) {
  document.documentElement.dataset.theme = name;
  get("theme").textContent = name === "dark" ? "Light" : "Dark";
  page.view?.theme();
}
