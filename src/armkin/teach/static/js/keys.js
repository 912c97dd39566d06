// @ts-check
/** Keys of the whole page; what is typed into a box is left alone, but for Esc. */

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
    const at = event.target instanceof HTMLElement ? event.target.tagName : "";
    if (event.ctrlKey || event.altKey || event.metaKey || event.defaultPrevented) return;
    if (["INPUT", "SELECT", "TEXTAREA"].includes(at)) return;
    const way = ways[event.key];
    const action = actions[event.key.toLowerCase()];
    if (way) nudge(way.map((value) => value * (event.shiftKey ? 0.1 : 1)));
    else if (action && !event.repeat) action();
    else return;
    event.preventDefault();
  });
}
