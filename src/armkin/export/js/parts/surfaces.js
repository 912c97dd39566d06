// Two joints about one line, all between them at rest (an elbow that is folded or stretched): their common motion keeps the
// target wherever the others are. A surface of postures that they sweep is a circle times a curve, and with the second of
// the two held it is that curve: each curve of the others is a surface of its own.
const ONE_LINE = 4.5e-4; // difference of columns of the Jacobian; where an elbow is stretched they are known to the root of rounding

/** @typedef {{joint: number, at: number}} Pin a joint that is held, and where */
/** @typedef {{i: number, j: number, way: number}} Pair joints about one line; the first turns by `way` as the second is turned back */

/** What is found while a joint is held, if one is. @template T @param {Pin | undefined} one @param {() => T} ask @returns {T} */
function whileHeld(one, ask) {
  const before = pin;
  pin = one ?? null;
  try {
    return ask();
  } finally {
    pin = before;
  }
}

/** Whether two joints are about one line at a posture. @param {Numbers} q @param {Pair} pair */
const aboutOneLine = (q, { i, j, way }) => slope(q).every((row) => Math.abs(row[j] - way * row[i]) < ONE_LINE);

/** Pairs of joints about one line where those between them rest. @param {Numbers} q @returns {Pair[]} */
function pairsAt(q) {
  const { V } = lost(q, ONE_LINE);
  if (V.length < 2) return [];
  const rests = V[0].map((_, k) => V.every((v) => Math.abs(v[k]) < ONE_LINE));
  /** @type {Pair[]} */
  const all = [];
  for (let i = 0; i < ARM.joints; i++)
    for (let j = i + 1; j < ARM.joints && !ARM.slides[i]; j++)
      if (!ARM.slides[j] && rests.every((rest, k) => rest || k <= i || k >= j)) all.push({ i, j, way: 1 }, { i, j, way: -1 });
  return all.filter((pair) => aboutOneLine(q, pair));
}

/**
 * What `components` lists, a row for each curve in place of those of surfaces. Where three joints are about one line, two of them
 * that are so at the most seeds sweep the most surfaces.
 * @param {Row[]} seeds @param {Float64Array} goal @param {Numbers} near
 */
function solutionSet(seeds, goal, near) {
  const found = components(seeds, goal);
  const pairs = found.rows.flatMap((row) => row.wide ?? []);
  const on = pairs.map((pair) => seeds.filter((seed) => aboutOneLine(seed.q, pair)));
  const most = on.reduce((best, some, k) => (some.length > (on[best]?.length ?? 0) ? k : best), 0);
  if (!pairs.length) return found;
  const { rows, free } = curvesOf(on[most], goal, near, pairs[most]);
  if (!rows.length) return found;
  const others = found.rows.filter((row) => !aboutOneLine(row.q, pairs[most]));
  const moves = new Set([...found.free, ...free]);
  return { ...found, rows: [...others, ...rows], free: [...moves].sort((a, b) => a - b) };
}

/** The curves of a target with the second joint of a pair held where `near` has it, and the joints that move.
 * @param {Row[]} seeds on surfaces @param {Float64Array} goal @param {Numbers} near @param {Pair} pair */
function curvesOf(seeds, goal, near, pair) {
  const { i, j, way } = pair;
  const own = { joint: j, at: near[j] };
  const turned = seeds.map((seed) => {
    const q = seed.q.slice();
    q[i] += way * (q[j] - near[j]);
    q[j] = near[j];
    return { q, branch: seed.branch };
  });
  const { rows, free } = whileHeld(own, () => components(turned, goal));
  const on = rows.filter((row) => row.path && aboutOneLine(row.q, pair)).map((row) => ({ ...row, pin: own }));
  return { rows: on, free: [...free, i, j] };
}
