// @ts-check
/** Small helpers around the document. */

/** Parts of the page that need a server, where there is none. */
export const absent = document.createDocumentFragment();

/**
 * The element of that id.
 * @template {HTMLElement} [T=HTMLElement]
 * @param {string} id
 * @returns {T}
 */
export function get(id) {
  const found = document.getElementById(id) ?? absent.getElementById(id);
  if (!found) throw new Error(`there is no #${id}`);
  return /** @type {T} */ (found);
}

/**
 * A new element.
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {Object<string, string>} [attributes]
 * @param {...(Node|string)} children
 * @returns {HTMLElementTagNameMap[K]}
 */
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

/**
 * A number as the command line prints it: fixed decimals, never -0.0000.
 * @param {number} value
 * @param {number} [digits]
 */
export function fixed(value, digits = 4) {
  const text = value.toFixed(digits);
  return /^-[0.]*$/.test(text) ? text.slice(1) : text;
}

/** A signed whole number. @param {number} value */
export const signed = (value) => (value > 0 ? `+${value}` : String(value));

/**
 * Set a number box, unless somebody types in it.
 * @param {HTMLInputElement} box
 * @param {number} value
 */
export function show(box, value) {
  box.dataset.shown = fixed(value);
  if (document.activeElement !== box || !box.dataset.typing) box.value = box.dataset.shown;
}

/**
 * Hear of a number that was typed: while it is typed, and when it is done. What is none is said, and not kept.
 * @param {HTMLInputElement} box
 * @param {(value: number) => void} hear
 */
export function typed(box, hear) {
  box.addEventListener("input", () => {
    box.dataset.typing = "yes";
    if (box.value !== "" && Number.isFinite(box.valueAsNumber)) hear(box.valueAsNumber);
  });
  const done = () => {
    if (!box.dataset.typing) return;
    delete box.dataset.typing;
    const shown = box.dataset.shown ?? "";
    const wrong = box.value === "" ? `${box.labels?.[0]?.textContent}: that is no number; it stays ${shown}` : "";
    box.value = wrong ? shown : fixed(box.valueAsNumber);
    document.dispatchEvent(new CustomEvent("typed", { detail: wrong }));
  };
  box.addEventListener("change", done);
  box.addEventListener("blur", done);
}

const ALONG = 12; // [px] that a finger goes along a slider before it turns it: less than a browser waits to see a swipe

/**
 * Hear of a slider that is turned. A finger that swipes over it to scroll the page turns nothing: the browser puts the
 * slider under the finger at once, and says only then that it scrolls.
 * @param {HTMLInputElement} slider
 * @param {(value: number) => void} hear
 */
export function turned(slider, hear) {
  let [before, from] = ["", 0]; // its value while a finger may still be scrolling, and where that touched it
  const sure = () => {
    if (!before) return;
    before = "";
    hear(slider.valueAsNumber);
  };
  slider.addEventListener("pointerdown", (event) => {
    if (event.pointerType === "touch") [before, from] = [slider.value, event.clientX];
  });
  slider.addEventListener("pointermove", (event) => {
    if (Math.abs(event.clientX - from) > ALONG) sure();
  });
  slider.addEventListener("pointerup", sure);
  slider.addEventListener("pointercancel", () => {
    if (before) slider.value = before;
    before = "";
  });
  slider.addEventListener("input", () => {
    if (!before) hear(slider.valueAsNumber);
  });
}
