/** Squared distance of two segments in `ends`: both feet of the common normal, or the nearest end.
 * @param {Numbers} one @param {number} a @param {Numbers} other @param {number} c places where they begin */
function segmentsApart(one, a, other, c) {
  const [ux, uy, uz] = [one[a + 3] - one[a], one[a + 4] - one[a + 1], one[a + 5] - one[a + 2]];
  const [vx, vy, vz] = [other[c + 3] - other[c], other[c + 4] - other[c + 1], other[c + 5] - other[c + 2]];
  const [wx, wy, wz] = [one[a] - other[c], one[a + 1] - other[c + 1], one[a + 2] - other[c + 2]];
  const uu = ux * ux + uy * uy + uz * uz;
  const vv = vx * vx + vy * vy + vz * vz;
  const uv = ux * vx + uy * vy + uz * vz;
  const uw = ux * wx + uy * wy + uz * wz;
  const vw = vx * wx + vy * wy + vz * wz;
  const at = (/** @type {number} */ s, /** @type {number} */ t) => {
    s = Math.min(Math.max(s, 0), 1);
    t = Math.min(Math.max(t, 0), 1);
    return (wx + s * ux - t * vx) ** 2 + (wy + s * uy - t * vy) ** 2 + (wz + s * uz - t * vz) ** 2;
  };
  let least = Math.min(at(0, vv > 0 ? vw / vv : 0), at(1, vv > 0 ? (vw + uv) / vv : 0));
  least = Math.min(least, at(uu > 0 ? -uw / uu : 0, 0), at(uu > 0 ? (uv - uw) / uu : 0, 1));
  const wide = uu * vv - uv * uv;
  if (!(wide > 0)) return least;
  const s = (uv * vw - vv * uw) / wide;
  const t = (uu * vw - uv * uw) / wide;
  return s > 0 && s < 1 && t > 0 && t < 1 ? Math.min(least, at(s, t)) : least;
}

/** Least signed distance of a segment to a box: centre, axes as rows, half edges.
 * @param {Numbers} ends @param {number} a where the segment begins @param {number[]} box */
function toBox(ends, a, box) {
  const half = box.slice(12, 15);
  const [p, w] = [[0, 0, 0], [0, 0, 0]];
  for (let k = 0; k < 3; k++)
    for (let j = 0; j < 3; j++) {
      p[k] += box[3 + 3 * k + j] * (ends[a + j] - box[j]);
      w[k] += box[3 + 3 * k + j] * (ends[a + 3 + j] - ends[a + j]);
    }
  let squared = 0;
  const slopeAt = (/** @type {number} */ t) => { // half the derivative of the squared distance, which it tells, too
    let slope = 0;
    squared = 0;
    for (let k = 0; k < 3; k++) {
      const x = p[k] + t * w[k];
      const beyond = x > half[k] ? x - half[k] : x < -half[k] ? x + half[k] : 0;
      slope += beyond * w[k];
      squared += beyond * beyond;
    }
    return slope;
  };
  let [low, high, slopeLow, slopeHigh] = [0, 1, slopeAt(0), slopeAt(1)];
  let nearest = slopeLow >= 0 ? 0 : 1;
  if (slopeLow < 0 && slopeHigh > 0) {
    for (let k = 0; k < 3; k++)
      for (const side of [-1, 1]) {
        const t = w[k] === 0 ? -1 : (side * half[k] - p[k]) / w[k];
        if (!(t > low && t < high)) continue;
        const slope = slopeAt(t);
        if (slope <= 0) [low, slopeLow] = [t, slope];
        if (slope >= 0) [high, slopeHigh] = [t, slope];
      }
    nearest = slopeHigh > slopeLow ? low - (slopeLow * (high - low)) / (slopeHigh - slopeLow) : low;
  }
  slopeAt(nearest);
  if (squared > 0) return Math.sqrt(squared);
  // inside: the greatest of six lines is least at an end, or where two of them meet
  const at = [...p.map((x, k) => x - half[k]), ...p.map((x, k) => -x - half[k])];
  const by = [...w, ...w.map((x) => -x)];
  let deepest = 0;
  for (let i = 0; i < 6; i++)
    for (let j = i; j < 6; j++) {
      if (i !== j && by[i] === by[j]) continue;
      const t = Math.min(Math.max(i === j ? (i < 2 ? i : 0) : (at[j] - at[i]) / (by[i] - by[j]), 0), 1);
      deepest = Math.min(deepest, Math.max(...at.map((x, k) => x + t * by[k])));
    }
  return deepest;
}

const segmentEnds = new Float64Array(6 * KEEP_OUT.thick.length);

/** The clearance of each pair, negative where it is a hit [mm]. @param {Numbers} q actual joint values */
function clearancesOf(q) {
  const { thick, solid, moving, shapes, crossings, pairs, clearance } = KEEP_OUT;
  endsOf(q, segmentEnds);
  const ends = segmentEnds;
  const out = new Array(pairs.length).fill(Infinity);
  shapes.forEach(({ kind, numbers }, k) => {
    for (const [segment, body] of moving) {
      const a = 6 * segment;
      let apart;
      if (kind === 0) apart = Math.min(ends[a + 2], ends[a + 5]) - numbers[0];
      else if (kind === 1) apart = toBox(ends, a, numbers);
      else apart = Math.sqrt(segmentsApart(ends, a, numbers, 0)) - numbers[6];
      const pair = k * solid + body;
      out[pair] = Math.min(out[pair], apart - thick[segment] - clearance);
    }
  });
  for (const [one, other, pair] of crossings) {
    const apart = Math.sqrt(segmentsApart(ends, 6 * one, ends, 6 * other)) - thick[one] - thick[other] - clearance;
    out[pair] = Math.min(out[pair], apart);
  }
  return out;
}

/** The least clearance of actual joint values [mm; null: nothing counts], and what they hit, the deepest first.
 * @param {Numbers} q @returns {{clearance_mm: number | null, hits: Hit[]}} */
function hitsOf(q) {
  const all = clearancesOf(q);
  const deep = all.map((_, k) => k).filter((k) => all[k] < 0).sort((a, b) => all[a] - all[b] || a - b);
  const hits = deep.map((k) => ({ body: KEEP_OUT.pairs[k][0], with: KEEP_OUT.pairs[k][1], depth_mm: -all[k] }));
  return { clearance_mm: all.length ? Math.min(...all) : null, hits };
}

/** How far joint values are from what the arm must not touch. @param {ArrayLike<number>} q [rad | mm]
 * @returns {{clearance_mm: number | null, hits: Hit[]}} of a hit the clearance is negative */
export function clearance(q) {
  return hitsOf(actual(q));
}
