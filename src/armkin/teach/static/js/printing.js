// @ts-check
/** The page on paper. */
import { get } from "./dom.js";

/** A canvas prints empty: an image of it stands in its place. @param {import("./view.js").View} view */
export function printing(view) {
  addEventListener("beforeprint", () => {
    view.rest();
    /** @type {HTMLImageElement} */ (get("printed")).src = view.canvas.toDataURL(); // while its picture is still there
  });
}
