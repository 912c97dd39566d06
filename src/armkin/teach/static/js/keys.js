// @ts-check
/** Keys of the whole page; what an input has a use for itself is left to it, but for Esc. */

const STEPS = /^(Arrow|Page)/;

/**
 * Whether an element has a use for a key: a box for all that is typed, a slider for the arrows.
 * @param {EventTarget | null} at @param {string} key
 */
function used(at, key) {
  if (at instanceof HTMLInputElement) {
    if (["checkbox", "button", "file"].includes(at.type)) return false;
    return at.type !== "range" || STEPS.test(key);
  }
  return at instanceof HTMLElement && ["SELECT", "TEXTAREA"].includes(at.tagName);
}

/**
 * @param {Object<string, () => void>} actions key -> what it does
 * @param {(way: number[]) => void} nudge moves the target along [x, y, z]
 * @param {() => void} stop
 */
export function keys(actions, nudge, stop) {
  /** @type {Object<string, number[]>} */
  const ways = {
    ArrowLeft: [0, 1, 0], ArrowRight: [0, -1, 0], ArrowUp: [1, 0, 0], ArrowDown: [-1, 0, 0],
    PageUp: [0, 0, 1], PageDown: [0, 0, -1],
  };
  document.addEventListener(
    "keydown",
    (event) => {
      if (event.key === "Escape") {
        event.preventDefault();
        stop();
      }
    },
    true,
  );
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.defaultPrevented) return;
    if (used(event.target, event.key)) return;
    const way = ways[event.key];
    const action = actions[event.key.toLowerCase()];
    if (way) nudge(way.map((value) => value * (event.shiftKey ? 0.1 : 1)));
    else if (action && !event.repeat) action();
    else return;
    event.preventDefault();
  });
}
