const ACCEPTED = 1e-24; // squared residual of a candidate that needs no correction
const NEARBY = 1e-12; // and of one that is worth correcting
const LARGEST = 1e15; // mm, rad: of a target; its powers in polynomials stay finite
const ROUNDED = 1e-14; // distance from orthonormal columns that needs no correction
const DECIMAL = 4e-16; // relative distance of a number from a decimal one that it is printed as
const STARTS = 256; // postures from which self-motions are searched for
const DEGREES = 180 / Math.PI;

// of the target that `ik` is asked for; new typed arrays of more than eight numbers cost a microsecond
const givenNumbers = new Float64Array(ARM.orientation === 'full' ? 16 : ARM.labels.length);
const goalNumbers = new Float64Array(ARM.orientation === 'full' ? 12 : ARM.labels.length);
const closeTo = new Float64Array(ARM.joints);

/**
 * A target's numbers as the formulas take them, in `goalNumbers`: the columns x, y, z of a pose and its position; an axis of
 * length one.
 * @param {Target} target @returns {number} by how much its pose may be rounded
 */
function read(target) {
  const wanted = ARM.orientation === 'full' ? 16 : ARM.labels.length;
  let count = 0;
  const flat = givenNumbers;
  for (let i = 0; i < target?.length; i++) {
    const row = target[i];
    const numbers = typeof row === 'number' ? 1 : row?.length;
    for (let j = 0; j < numbers; j++, count++) if (count < wanted) flat[count] = typeof row === 'number' ? row : row[j];
  }
  if (count !== wanted)
    throw new RangeError(`a target is ${wanted === 16 ? 'a pose, four rows of four' : ARM.labels.join(' ')}: ${wanted} numbers, got ${count}`);
  for (let k = 0; k < wanted; k++)
    if (!(Math.abs(flat[k]) <= LARGEST)) throw new RangeError('a target holds a number that is not finite, or beyond 1e15');
  if (ARM.orientation === 'axis') {
    const length = Math.hypot(flat[3], flat[4], flat[5]);
    if (!(length > 1e-12)) throw new RangeError("a target's axis ax ay az has no length; give the direction of the tool's z axis");
    for (let k = 3; k < 6; k++) flat[k] /= length;
  }
  const goal = goalNumbers;
  if (ARM.orientation !== 'full') {
    goal.set(flat);
    return 0;
  }
  for (let j = 0; j < 4; j++) for (let i = 0; i < 3; i++) goal[3 * j + i] = flat[4 * i + j];
  let rounding = orthonormalised(goal);
  const given = rounding;
  for (let round = 0; round < 2 && rounding > 1e-15 && rounding <= ROTATION; round++) rounding = orthonormalised(goal);
  const x = goal[4] * goal[8] - goal[5] * goal[7];
  const y = goal[5] * goal[6] - goal[3] * goal[8];
  const z = goal[3] * goal[7] - goal[4] * goal[6];
  if (!(given <= ROTATION) || !(goal[0] * x + goal[1] * y + goal[2] * z > 0))
    throw new RangeError(`a target is no pose: its 3 x 3 part must be a rotation to ${ROTATION}`);
  if (given > ROUNDED) return Math.max(4 * given, 12 * lastPlace(flat));
  // a rotation of whole numbers shows nothing: there the position tells
  const whole = goal.every((x, k) => k > 8 || Math.abs(x - Math.round(x)) <= ROUNDED);
  return whole ? lastPlaceOfPosition([flat[3], flat[7], flat[11]]) / ARM.reach : 0;
}

/**
 * By how much a position may be off that has three decimals or six digits, and eleven at most, or is of single precision
 * [mm]: half a unit of the largest coordinate's last digit, in each coordinate.
 * @param {number[]} point
 */
function lastPlaceOfPosition(point) {
  const sizes = point.map(Math.abs).filter((x) => x >= 1e-9);
  const last = (/** @type {number} */ x, /** @type {number} */ digits) => 10 ** (digits - 1 - Math.floor(Math.log10(x)));
  if (sizes.every((x) => isDecimal(100 * x) && isDecimal(x * last(x, 5)))) return 0;
  const largest = Math.max(...sizes);
  for (let digits = 6; digits < 12; digits++)
    if (sizes.every((x) => isDecimal(x * last(x, digits)))) return (Math.sqrt(3) * 0.5) / last(largest, digits);
  return sizes.every((x) => Math.fround(x) === x) ? Math.sqrt(3) * 2 ** -24 * largest : 0;
}

/** Whether a number is whole but for rounding. @param {number} scaled */
function isDecimal(scaled) {
  return Math.abs(scaled - Math.round(scaled)) <= DECIMAL * scaled;
}

/** Half a unit of the last digit of a rotation's entries, or of single precision; 0 where of neither. @param {Float64Array} T */
function lastPlace(T) {
  const entries = [0, 1, 2, 4, 5, 6, 8, 9, 10].map((k) => Math.abs(T[k])).filter((x) => x >= 1e-4); // smaller ones have few
  if (entries.every((x) => Math.fround(x) === x)) return 2 ** -24;
  for (let digits = 5; digits < 12; digits++) {
    const has = (/** @type {number} */ x) => isDecimal(x * 10 ** (digits - 1 - Math.floor(Math.log10(x))));
    if (entries.every(has)) return 0.5 / 10 ** digits;
  }
  return 0;
}

/** R (3 - R'R) / 2, which squares the distance from a rotation; the largest entry of R'R - 1 before. @param {Float64Array} R */
function orthonormalised(R) {
  const xx = R[0] * R[0] + R[1] * R[1] + R[2] * R[2] - 1;
  const yy = R[3] * R[3] + R[4] * R[4] + R[5] * R[5] - 1;
  const zz = R[6] * R[6] + R[7] * R[7] + R[8] * R[8] - 1;
  const xy = R[0] * R[3] + R[1] * R[4] + R[2] * R[5];
  const yz = R[3] * R[6] + R[4] * R[7] + R[5] * R[8];
  const zx = R[6] * R[0] + R[7] * R[1] + R[8] * R[2];
  const off = Math.max(Math.abs(xx), Math.abs(yy), Math.abs(zz), Math.abs(xy), Math.abs(yz), Math.abs(zx));
  if (off <= 1e-15) return off;
  for (let k = 0; k < 3; k++) {
    const x = R[k];
    const y = R[3 + k];
    const z = R[6 + k];
    R[k] = x - 0.5 * (x * xx + y * xy + z * zx);
    R[3 + k] = y - 0.5 * (x * xy + y * yy + z * yz);
    R[6 + k] = z - 0.5 * (x * zx + y * yz + z * zz);
  }
  return off;
}

const allJoints = new Float64Array(ARM.branches * ARM.joints);
const allMisses = new Float64Array(3 * ARM.branches); // squared; of a closed form then of lengths [reaches] and of angles [rad] alone

/**
 * @typedef {object} Row
 * @property {number[]} q actual joint values @property {number} branch @property {number[][]} [path] of a self-motion
 * @property {Component} [at] what lies around it @property {Pair[]} [wide] of a surface: joints about one line
 * @property {Pin} [pin] of a surface: the joint that is held on its path
 */

/** Candidates of a target, in `allJoints` and `allMisses`; whether it is at an edge. @param {Float64Array} goal @param {Numbers} near */
function doubted(goal, near) {
  let edge = candidates(goal, near, allJoints, allMisses);
  for (let b = 0; b < ARM.branches; b++) {
    const miss = allMisses[b];
    edge = edge || (!(miss <= ACCEPTED) && !(miss > NEARBY));
  }
  return edge;
}

/**
 * One row for each solution of a target of which there are candidates.
 * @param {Float64Array} goal @param {Numbers} near actual joint values @param {boolean} edge
 */
function solutions(goal, near, edge) {
  /** @type {Row[]} */
  const rows = [];
  for (let b = 0; b < ARM.branches; b++) if (allMisses[b] <= SOLUTION ** 2) rows.push({ q: candidate(b), branch: b });
  const status = /** @type {Status} */ (rows.length ? 'exact' : 'unreachable');
  if (!edge) return { rows, status, complete: true, free: /** @type {number[]} */ ([]) };
  const seeds = rows.slice();
  const seed = (/** @type {Numbers} */ at, /** @type {Numbers} */ prefer, /** @type {number} */ most, /** @type {number} */ passes) => {
    const doubt = candidates(at, prefer, allJoints, allMisses, passes);
    for (let b = 0; b < ARM.branches; b++) {
      if (!(allMisses[b] < most) || seeds.some((one) => apart(one.q, candidate(b)) < 1e-7)) continue;
      const found = newton(candidate(b), goal, 40);
      const known = seeds.some((one) => apart(one.q, found.q) < 1e-7);
      if (found.missed <= SOLUTION && !known) seeds.push({ q: found.q, branch: b });
    }
    return doubt;
  };
  // joints that a target leaves free may be out of reach where `near` has them: ask elsewhere, too
  for (let k = 0; CLOSED_FORM && k <= 24; k++)
    seed(goal, Array.from(near, (x, j) => x + (k && ((k - 0.63) / 12 - 1) * Math.PI * ARM.unit[j])), 1e-6, 0);
  // of two roots in one an elimination may see none: beside the target both are real on one side
  let sure = true;
  for (let k = 0; !CLOSED_FORM && k < 8; k++) sure = !seed(beside(goal, k), near, Infinity, sure ? Infinity : 2) && sure;
  let found = solutionSet(seeds, goal, near);
  if (!CLOSED_FORM && found.status === 'singular') {
    // a self-motion takes all roots of an elimination, and a target beside it has none there: others are searched for
    for (let k = 1; k <= STARTS; k++) {
      const start = ARM.unit.map((unit, j) => unit * Math.PI * (2 * ((k * Math.sqrt(2 + 3 * j + j * j)) % 1) - 1));
      let one = newton(start, goal, 25);
      if (one.missed > SOLUTION && one.missed < 1e-2) {
        // Newton's method does not end on a curve of double roots; they nearly always stand at multiples of 45 degrees
        const even = one.q.map((x, j) => (ARM.slides[j] ? x : (Math.PI / 4) * rint(x / (Math.PI / 4))));
        one = newton(even, goal, 10);
      }
      if (one.missed <= SOLUTION && !seeds.some((other) => apart(other.q, one.q) < 1e-7)) seeds.push({ q: one.q, branch: 0 });
    }
    found = solutionSet(seeds, goal, near);
  }
  return { ...found, complete: found.complete && (CLOSED_FORM || (sure && found.status === 'exact')) };
}

/** A target 1e-4 beside another one, the k-th and its opposite in turn. @param {Float64Array} goal @param {number} k */
function beside(goal, k) {
  const out = Float64Array.from(goal);
  const by = [0, 1, 2, 3, 4, 5].map((i) => (k % 2 ? -1e-4 : 1e-4) * Math.sin(1 + 12.9898 * (6 * (k >> 1) + i)));
  const first = ARM.orientation === 'full' ? 9 : 0;
  for (let i = 0; i < ARM.position; i++) out[first + i] += by[i] * ARM.reach;
  if (ARM.orientation === 'none') for (let i = ARM.position; i < out.length; i++) out[i] += by[i];
  else
    for (const at of ARM.orientation === 'full' ? [0, 3, 6] : [3]) {
      const v = [out[at], out[at + 1], out[at + 2]];
      cross(by.slice(3), v).forEach((x, i) => (out[at + i] += x));
    }
  if (ARM.orientation === 'full') for (let round = 0; round < 3; round++) orthonormalised(out);
  return out;
}

/** Postures that solve a target, one of each component. @param {Row[]} seeds @param {Float64Array} goal */
function components(seeds, goal) {
  /** @type {Row[]} */
  const rows = [];
  let status = /** @type {Status} */ (seeds.length ? 'exact' : 'unreachable');
  let complete = true;
  const moves = new Array(ARM.joints).fill(false);
  // regular points of a self-motion first: its singular ones are met on the way
  const ranked = seeds.map((seed) => ({ seed, count: lost(seed.q, SPLIT).V.length })).sort((a, b) => a.count - b.count);
  /** @type {Row[]} */
  const met = []; // where self-motions cross
  for (const { seed } of ranked) {
    const known = (/** @type {Row} */ row) => {
      if (row.path) return onPath(seed.q, row.path, goal);
      if (row.wide) return row.wide.length ? row.wide.every((pair) => aboutOneLine(seed.q, pair)) : walked(seed.q, row.q, goal);
      return row.at ? apart(row.q, seed.q) < 1e-7 || onComponent(row.at, row.q, seed.q) : joined(row.q, seed.q, goal);
    };
    const crosses = met.includes(seed);
    if (!crosses && rows.some(known)) continue;
    const { kind, paths, crossings, moves: along, at } = structure(seed.q, goal, rows.flatMap((row) => (row.path ? [row.path] : [])));
    for (const q of crossings) {
      if (met.some((other) => apart(other.q, q) < SPLIT)) continue;
      const found = { ...seed, q };
      met.push(found);
      if (q !== seed.q) ranked.push({ seed: found, count: 2 }); // other self-motions begin there
    }
    if (crosses && kind !== 'curve') continue;
    along?.forEach((x, j) => (moves[j] = moves[j] || x > FREE));
    if (kind === 'boundary' && status === 'exact') status = kind;
    if (kind === 'curve' || kind === 'surface') status = 'singular';
    complete = complete && !crossings.length;
    if (kind === 'exact' || kind === 'boundary') {
      rows.push({ ...seed, at });
      continue;
    }
    if (!crosses && rows.some((row) => straight(row.q, seed.q, goal))) continue;
    if (kind === 'surface') rows.push({ ...seed, wide: pairsAt(seed.q) });
    for (const path of paths) {
      if (rows.some((row) => row.path && oneCurve(path, row.path, goal))) continue;
      rows.push({ ...seed, path });
      spread(path).forEach((x, j) => (moves[j] = moves[j] || x > FREE * 1000));
    }
  }
  // beside a crossing of self-motions the residual hardly grows: what solves the target there is one with them
  const paths = rows.flatMap((row) => row.path ?? []);
  const kept = rows.filter((one) => one.path || !paths.some((p) => apart(p, one.q) < STRIDE) || lost(one.q, SPLIT).V.length < 2);
  if (!CLOSED_FORM) [...kept].sort((a, b) => a.branch - b.branch).forEach((row, k) => (row.branch = k)); // roots in one leave no gap
  return { rows: kept, status, complete, free: moves.flatMap((yes, j) => (yes ? [j] : [])) };
}

/** Whether two postures are in one component: so is the way between them. @param {Numbers} a @param {Numbers} b @param {Float64Array} goal */
function joined(a, b, goal) {
  const away = apart(a, b);
  if (away < 1e-7) return true;
  if (away > REACH) return false;
  const way = between(b, a);
  return [0.25, 0.5, 0.75].every((t) => newton(stepped(a, way, t), goal, 3, SPLIT).missed <= SOLUTION);
}

/** Whether the joints can go straight from one posture to another while they keep the target, each joint either way round.
 * @param {Numbers} a @param {Numbers} b @param {Float64Array} goal */
function straight(a, b, goal) {
  let ways = [between(b, a)];
  for (let j = 0; j < ARM.joints; j++)
    if (!ARM.slides[j] && Math.abs(ways[0][j]) > 1e-3)
      ways = ways.flatMap((way) => [way, way.map((x, k) => (k === j ? x - TURN * Math.sign(x) : x))]);
  return ways.some((way) =>
    [0.25, 0.5, 0.75].every((share) => {
      const start = stepped(a, way, share);
      if (!(missed(start, goal) < 1e-3)) return false;
      const there = newton(start, goal, 3, SPLIT);
      return there.missed <= SOLUTION && apart(there.q, start) < 1e-3;
    }),
  );
}

/** Whether a walk over a surface of solutions leads from one posture to another: each step towards it, and back onto the target.
 * @param {number[]} a @param {number[]} b @param {Float64Array} goal */
function walked(a, b, goal) {
  let here = a;
  for (let away = apart(a, b); away > STRIDE; ) {
    const next = newton(stepped(here, between(b, here), STRIDE / away), goal, 4, SPLIT / 10);
    const left = apart(next.q, b);
    if (!(next.missed <= SOLUTION && apart(next.q, here) < 2 * STRIDE && left < away - STRIDE / 10)) return false;
    [here, away] = [next.q, left];
  }
  return straight(here, b, goal);
}

let copyInside = true;
const copyMotion = new Float64Array(2); // sums of |change|: [degrees, mm] and [rad, mm]

/** Of a self-motion the posture within limits that is nearest. @param {Row} row @param {Numbers} near @param {Float64Array} goal */
function nearest(row, near, goal) {
  let best = { q: row.q, rank: -1, motion: Infinity };
  const take = (/** @type {number[]} */ posture) => {
    const q = legal(posture.slice(), near);
    const { inside, motion } = { inside: copyInside, motion: copyMotion[0] };
    const free = !KEEPS_OUT || hitsOf(q).hits.length === 0;
    const rank = (inside ? 2 : 0) + (free ? 1 : 0);
    const better = rank !== best.rank ? rank > best.rank : motion < best.motion - 1 / EQUAL;
    if (better) best = { q, rank, motion };
    return better;
  };
  take(row.q);
  const path = row.path ?? [];
  let at = -1;
  path.forEach((q, k) => {
    if (take(q)) at = k;
  });
  for (const other of at < 0 ? [] : [at - 1, at + 1]) {
    if (!path[other]) continue;
    const way = between(path[other], path[at]);
    for (let step = 1; step < 32; step++) {
      const one = newton(stepped(path[at], way, step / 32), goal, 6, SPLIT / 10);
      if (one.missed <= SOLUTION) take(one.q);
    }
  }
  // of more than a curve there may be legal ones off the path: onto the limits and onto the target in turn
  for (let round = 0, q = best.q; round < 30 && best.rank < 2; round++) {
    const inside = q.map((x, j) => Math.max(Math.min(x, ARM.upper[j] - 1e-3 * ARM.unit[j]), ARM.lower[j] + 1e-3 * ARM.unit[j]));
    const one = newton(inside, goal, 6, SPLIT / 10);
    if (!(one.missed <= SOLUTION)) break;
    take(one.q);
    q = one.q;
  }
  return legal(best.q, near);
}

const stoodAt = new Float64Array(ARM.joints).fill(NaN); // the last `near`, and its pose
const stoodPose = new Float64Array(16);

/** Whether `near` is within limits and solves the target. @param {Float64Array} near @param {Float64Array} goal @param {number} rounding */
function solvesIt(near, goal, rounding) {
  let same = true;
  for (let j = 0; j < ARM.joints; j++) {
    if (!(near[j] >= ARM.lower[j] - SLACK && near[j] <= ARM.upper[j] + SLACK)) return false;
    same = same && near[j] === stoodAt[j];
  }
  if (!same) {
    stoodAt.set(near);
    poseOf(near, stoodPose);
  }
  // nearly all targets are elsewhere
  const far = (SOLUTION + rounding) * ARM.reach;
  for (let i = 0, first = ARM.orientation === 'full' ? 9 : 0; i < ARM.position; i++)
    if (Math.abs(goal[first + i] - stoodPose[4 * i + 3]) > far) return false;
  apartFrom(stoodPose, near, goal);
  return off2[0] * off2[0] + off2[1] * off2[1] <= (SOLUTION + rounding) ** 2;
}

/**
 * `near`, which is within limits and solves the target, is one of its rows: the arm that stands there stays.
 * @param {Found[]} found @param {Numbers} near @param {Float64Array} goal @param {number} rounding
 */
function stay(found, near, goal, rounding) {
  const stand = Array.from(near);
  const own = found.findIndex((one) => {
    if (one.path) return whileHeld(one.pin, () => onPath(stand, one.path ?? [], goal));
    return joined(one.q, near, goal) || (rounding > 0 && apart(one.q, near) < Math.sqrt(rounding));
  });
  const away = found.map((one) => apart(one.q, near));
  const like = found[own < 0 ? away.indexOf(Math.min(...away)) : own];
  const one = { ...placed({ q: stand, branch: like?.branch ?? 0 }, near, goal), path: like?.path, pin: like?.pin };
  if (own < 0) found.push(one);
  else found[own] = one;
}

/** @typedef {{q: number[], branch: number, path?: number[][], pin?: Pin, rank: number, row: Branch}} Found a row at its nearest legal copy;
 * rank: its motion in degrees and mm */

/** @param {Row} solution @param {Numbers} near @param {Float64Array} goal @returns {Found} */
function placed(solution, near, goal) {
  const q = solution.path || solution.wide ? nearest(solution, near, goal) : legal(solution.q, near);
  const [degrees, row] = [copyMotion[0], branchOf(q, solution.branch, goal, false)];
  return { q, branch: solution.branch, path: solution.path, pin: solution.pin, rank: degrees, row };
}

/** What is told of a posture that `legal` has turned. @param {number[]} q @param {number} b its branch @param {Float64Array} goal
 * @param {boolean} measured whether `allMisses` has what it misses */
function branchOf(q, b, goal, measured) {
  if (measured) {
    off2[0] = Math.sqrt(allMisses[ARM.branches + b]);
    off2[1] = Math.sqrt(allMisses[2 * ARM.branches + b]);
  } else misses(q, goal);
  const joints = CALIBRATED ? q.map((x, j) => x / ARM.ratio[j]) : q;
  /** @type {Branch} */
  const row = {
    joints,
    name: ARM.names[b],
    within_limits: copyInside,
    violations: copyInside ? [] : violations(q),
    residual_mm: off2[0] * ARM.reach,
    residual_deg: off2[1] * DEGREES,
    motion: copyMotion[1],
  };
  if (KEEPS_OUT) Object.assign(row, hitsOf(q));
  return row;
}

/** The joints outside their limits. @param {Numbers} q @returns {Violation[]} */
function violations(q) {
  /** @type {Violation[]} */
  const out = [];
  for (let j = 0; j < ARM.joints; j++) {
    if (!(q[j] < ARM.lower[j] - SLACK || q[j] > ARM.upper[j] + SLACK)) continue;
    const pair = limits[j];
    out.push({ joint: names[j], value: q[j] / ARM.ratio[j], lower: pair ? pair[0] : null, upper: pair ? pair[1] : null });
  }
  return out;
}
