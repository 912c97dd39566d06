// @ts-check
/** Joint speeds over time, as shares of their limits. */
import { get, make } from "./dom.js";

export const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a5195", "#8c8c00"];
const [WIDTH, HEIGHT] = [400, 90];

/**
 * @param {string} tag
 * @param {Object<string, string | number>} attributes
 */
export function svg(tag, attributes) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  return element;
}

/**
 * A long row as the picture can show it: of what falls on one point of its width, the highest.
 * @param {number[]} time @param {number[]} row @param {number} duration
 */
function peaks(time, row, duration) {
  /** @type {Map<number, {t: number, share: number}>} */
  const found = new Map();
  row.forEach((share, k) => {
    const at = Math.round((2 * WIDTH * time[k]) / Math.max(duration, 1e-9));
    const best = found.get(at);
    if (!best || share > best.share) found.set(at, { t: time[k], share });
  });
  return [...found.values()];
}

/**
 * Draw a plan's speeds.
 * @param {import("./types.js").Played} plan
 * @param {string[]} names
 */
export function chart({ time, shares, duration_s: duration }, names) {
  const highest = shares.map((row) => row.reduce((most, share) => Math.max(most, share), 0));
  const top = Math.max(1, ...highest);
  const x = (/** @type {number} */ t) => ((t / Math.max(duration, 1e-9)) * WIDTH).toFixed(1);
  const y = (/** @type {number} */ share) => (HEIGHT - 2 - (share / top) * (HEIGHT - 12)).toFixed(1);
  const limit = svg("line", { x1: 0, x2: WIDTH, y1: y(1), y2: y(1), class: "limit" });
  const lines = shares.map((row, i) =>
    svg("polyline", {
      points: peaks(time, row, duration).map(({ t, share }) => `${x(t)},${y(share)}`).join(" "), fill: "none",
      stroke: COLOURS[i % COLOURS.length], "stroke-width": 1.6,
    }),
  );
  const now = svg("line", { id: "now", x1: 0, x2: 0, y1: 0, y2: HEIGHT, class: "now" });
  const picture = get("speeds");
  picture.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
  picture.replaceChildren(limit, ...lines, now);
  const most = highest.map((share, i) => `${names[i]} ${Math.round(100 * share)} %`);
  const text = "Joint speeds against their limits (dashed), at most:";
  picture.setAttribute("aria-label", `${text} ${most.join(", ")}`);
  const keys = most.map((said, i) => {
    const dot = make("span", { class: "dot" });
    dot.style.background = COLOURS[i % COLOURS.length];
    return make("span", { class: "key" }, dot, said);
  });
  get("shares").replaceChildren(text, ...keys);
}

/** Mark the time. @param {number} share of the duration */
export function mark(share) {
  const now = document.getElementById("now");
  if (!now) return;
  now.setAttribute("x1", String(share * WIDTH));
  now.setAttribute("x2", String(share * WIDTH));
}
