// @ts-check
/** Where the tip gets to: postures at random within the limits, as points. */
import { BufferGeometry, Float32BufferAttribute, Points, PointsMaterial } from "three";
import { frames } from "./chain.js";

export const POSTURES = 8000;
const PRIMES = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53];

/** The k-th point of a Halton sequence. @param {number} k @param {number} base */
function halton(k, base) {
  let [value, share] = [0, 1 / base];
  for (; k > 0; k = Math.floor(k / base), share /= base) value += (k % base) * share;
  return value;
}

/** Tips of evenly spread postures, three numbers each [mm]. @param {import("./types.js").Arm} arm */
export function tips(arm) {
  const out = new Float32Array(3 * POSTURES);
  for (let k = 0; k < POSTURES; k++) {
    const q = arm.joints.map(({ lower, upper, prismatic }, j) => {
      const far = prismatic ? arm.reach : 180;
      const [low, high] = [lower ?? -far, upper ?? far];
      return low + (high - low) * halton(k + 1, PRIMES[j % PRIMES.length]);
    });
    const T = frames(arm, q).tool;
    out.set([T[3], T[7], T[11]], 3 * k);
  }
  return out;
}

/** The cloud, to be added to a scene. @param {import("./types.js").Arm} arm */
export function cloud(arm) {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new Float32BufferAttribute(tips(arm), 3));
  const look = { color: 0x0072b2, size: 2.5, sizeAttenuation: false, transparent: true, opacity: 0.45, depthWrite: false };
  const points = new Points(geometry, new PointsMaterial(look));
  points.frustumCulled = false;
  return points;
}
