// A solution is a connected component of the postures that miss the target by at most SOLUTION. Where the Jacobian loses
// a direction, what the component is follows from the residual along that direction: long, a self-motion manifold;
// short with a turning point, a boundary; short without, an isolated solution.
const SOLUTION = 1e-9; // of the reach, rad
const REACH = 0.1; // rad or reaches: a component in which a joint moves so far is a self-motion
const SPLIT = 1e-3; // singular value below which a direction is nearly lost; a turning point within SOLUTION needs 1e-4
const STRIDE = 0.05; // rad or reaches between neighbouring postures of a self-motion
const MOVED = 1e-3; // of the way: a joint that moves less along a self-motion does not move
const FREE = 1e-5; // joints that a self-motion holds move by less

/** @param {Numbers} q @param {Numbers} v @param {number} by [rad, reaches] */
function stepped(q, v, by) {
  const out = new Array(ARM.joints);
  for (let j = 0; j < ARM.joints; j++) out[j] = q[j] + by * v[j] * ARM.unit[j];
  return out;
}

/** @param {Numbers} a @param {Numbers} b @returns {number[]} from b to a [rad, reaches] */
function between(a, b) {
  const out = new Array(ARM.joints);
  for (let j = 0; j < ARM.joints; j++) out[j] = less(a[j], b[j], ARM.slides[j]) / ARM.unit[j];
  return out;
}

/** The directions that the Jacobian loses at q, or nearly. @param {Numbers} q @param {number} most @param {boolean} [on] as `rotate` has it */
function lost(q, most, on = false) {
  const J = slope(q);
  const [m, n] = [J.length, ARM.joints];
  const all = rotate(J, on);
  let from = 0;
  while (from < Math.min(m, n) && sizes[bySize[from]] > most) from++;
  const weak = bySize.slice(from);
  return { V: weak.map((j) => column(all * j + m, all * j + all, 1)), S: weak.map((j) => sizes[j]) };
}

/**
 * A self-motion of one dimension, or as much of it as REACH needs to be one: from a posture both ways.
 * @param {number[]} q @param {number[]} v the direction that is lost there @param {Numbers} goal
 * @returns {{path: number[][], extent: number, crossings: number[][]}} crossings: postures where another self-motion may meet it
 */
function follow(q, v, goal) {
  /** @type {number[][][]} */
  const halves = [];
  /** @type {Map<number[], number>} */
  const seconds = new Map(); // of each posture the second smallest singular value, where that is small
  let closed = false;
  for (const sign of [1, -1]) {
    const path = [q];
    halves.push(path);
    let [here, way, stride, gone] = [q, v.map((x) => sign * x), STRIDE, 0];
    while (stride > 1e-4 && gone < 4 * TURN && path.length < 1000) {
      const next = newton(stepped(here, way, stride), goal, 6, SPLIT / 10);
      const move = between(next.q, here);
      const size = Math.sqrt(dot(move, move));
      if (!(next.missed <= SOLUTION) || !(dot(move, way) > 0.5 * stride) || size > 1.5 * stride) {
        stride /= 2;
        continue;
      }
      gone += size;
      path.push(next.q);
      if (gone > 3 * STRIDE && apart(next.q, q) < 0.75 * STRIDE) {
        closed = true;
        break;
      }
      const { V, S } = lost(next.q, STRIDE, path.length > 2);
      if (S.length > 1) seconds.set(next.q, S[S.length - 2]);
      const along = V.map((u) => dot(u, move) / size);
      const turned = next.q.map((_, j) => V.reduce((sum, u, k) => sum + along[k] * u[j], 0));
      const length = Math.sqrt(dot(turned, turned));
      if (!(length > 0.5)) break; // the manifold ends where nothing is lost
      way = turned.map((x) => x / length);
      here = next.q;
      stride = Math.min(STRIDE, 2 * stride);
    }
    if (closed) break;
  }
  const path = closed ? halves[halves.length - 1] : [...halves[1].slice(1).reverse(), ...halves[0]];
  const round = closed ? [...path.slice(0, -1), ...path.slice(0, 3)] : path;
  const at = round.map((p) => seconds.get(p) ?? STRIDE);
  const least = [...at.keys()].filter((k) => k > 0 && at[k] < at[k - 1] && at[k] <= at[k + 1] && at[k - 1] > SPLIT);
  const crossings = least.map((k) => crossing(round.slice(k - 1, k + 2), goal)).filter((p) => lost(p, SPLIT).V.length > 1);
  return { path, extent: Math.max(...spread(path)), crossings };
}

/** Where along three postures of a self-motion the Jacobian loses a second direction most. @param {number[][]} path @param {Numbers} goal */
function crossing([a, b, c], goal) {
  const [back, on] = [between(a, b), between(c, b)];
  const at = (/** @type {number} */ t) => newton(t < 0 ? stepped(b, back, -t) : stepped(b, on, t), goal, 4, SPLIT / 10).q;
  const square = (/** @type {number} */ t) => { // a parabola beside a crossing
    rotate(slope(at(t)));
    return sizes[bySize[ARM.joints - 2]] ** 2;
  };
  let [t, h] = [0, 0.5];
  for (let round = 0; round < 4; round++) {
    const [low, middle, high] = [square(t - h), square(t), square(t + h)];
    t += Math.min(Math.max((h * (low - high)) / (2 * (low - 2 * middle + high) || 1), -h), h);
    h /= 8;
  }
  return at(t);
}

/** How far each joint moves along a path [rad, reaches], whole turns included. @param {number[][]} path */
function spread(path) {
  /** @type {number[][]} */
  const [low, high, at] = [0, 0, 0].map(() => new Array(ARM.joints).fill(0));
  for (let k = 1; k < path.length; k++)
    between(path[k], path[k - 1]).forEach((d, j) => {
      at[j] += d;
      low[j] = Math.min(low[j], at[j]);
      high[j] = Math.max(high[j], at[j]);
    });
  return high.map((x, j) => x - low[j]);
}

/**
 * Ways (of length one) within lost directions: spread evenly, and those that hold joints, along which self-motions cross.
 * @param {number[][]} V
 */
function ways(V) {
  const [n, count] = [V[0].length, V.length === 2 ? 12 : 64];
  /** @type {number[][]} */
  const mixes = [];
  for (let k = 0; k < count; k++) {
    const turn = (Math.PI * (k + 0.5)) / count;
    mixes.push(V.length === 2 ? [Math.cos(turn), Math.sin(turn)] : V.map((_, i) => Math.cos((k + 1) * (i + 1.618) * 2.4)));
  }
  for (let i = 0; i < n; i++) {
    if (V.length === 2) mixes.push([V[1][i], -V[0][i]]);
    if (V.length === 3) for (let j = 0; j < i; j++) mixes.push(cross(V.map((v) => v[i]), V.map((v) => v[j])));
  }
  return mixes.flatMap((mix) => {
    const size = Math.sqrt(dot(mix, mix));
    if (!(size > 1e-3)) return [];
    const way = V[0].map((_, j) => V.reduce((sum, v, i) => sum + (mix[i] / size) * v[j], 0));
    return mixes.indexOf(mix) < count ? [way] : [way, way.map((x) => -x)];
  });
}

/**
 * What the solution set is around a posture that solves the target.
 * @param {number[]} q @param {Numbers} goal @param {number[][][]} known self-motions that need not be followed again
 * @returns {{kind: 'exact' | 'boundary' | 'curve' | 'surface', paths: number[][][], crossings: number[][], moves?: number[], at?: Component}} paths of the
 *   self-motions through it, and where others meet them; how far each joint moves along it, as far as that is known
 */
function structure(q, goal, known) {
  const { V } = lost(q, SPLIT);
  if (!V.length) return { kind: 'exact', paths: [], crossings: [] };
  if (V.length === 1) {
    const at = component(q, goal);
    const most = Math.max(0, ...(at?.moves ?? []));
    if (at && most < REACH) return { kind: at.boundary ? 'boundary' : 'exact', paths: [], crossings: [], at };
    const { path, extent, crossings } = follow(q, V[0], goal);
    if (extent < REACH) return { kind: 'exact', paths: [], crossings: [] };
    return { kind: 'curve', paths: [path], crossings, moves: at?.moves.map((x) => (x > MOVED * most ? x : 0)) };
  }
  // several directions: self-motions that cross here are met again beside it
  /** @type {number[][][]} */
  const paths = [];
  /** @type {number[][]} */
  const wide = []; // ways to postures that lose several directions, too
  /** @type {number[][]} */
  const crossings = [q];
  let solved = 0;
  for (const way of ways(V)) {
    const there = newton(stepped(q, way, 2 * STRIDE), goal, 12);
    const away = apart(there.q, q);
    if (!(there.missed <= SOLUTION) || !(away > STRIDE / 2 && away < 8 * STRIDE)) continue;
    solved++;
    const beside = lost(there.q, SPLIT / 10).V;
    if (beside.length > 1) wide.push(between(there.q, q));
    if (beside.length !== 1 || [...known, ...paths].some((path) => onPath(there.q, path, goal))) continue;
    const { path, extent, crossings: met } = follow(there.q, beside[0], goal);
    if (!(extent >= REACH) || paths.some((other) => oneCurve(path, other, goal))) continue;
    paths.push(path);
    crossings.push(...met);
  }
  if (wide.length > 0.7 * solved && !paths.length) {
    const mean = decompose(wide);
    if (!(mean.S[1] > 0.1 * mean.S[0])) paths.push(follow(q, mean.V[0], goal).path); // along one of them, the other stays lost
    else return { kind: 'surface', paths: [], crossings, moves: q.map((_, j) => Math.max(0, ...wide.map((way) => Math.abs(way[j]) - STRIDE / 10))) };
  }
  return { kind: paths.length ? 'curve' : solved ? 'exact' : 'boundary', paths, crossings };
}

/** Whether a posture lies on a self-motion. @param {number[]} q @param {number[][]} path @param {Numbers} goal */
function onPath(q, path, goal) {
  for (let k = 0; k < path.length; k++) {
    const p = path[k];
    const away = apart(q, p);
    if (away > STRIDE) {
      k += Math.floor((away - STRIDE) / (1.5 * STRIDE)); // neighbours are no further from each other
      continue;
    }
    if (k + 1 === path.length) return away < 1e-6;
    const way = between(path[k + 1], p);
    const share = Math.min(Math.max(dot(between(q, p), way) / Math.max(dot(way, way), 1e-300), 0), 1);
    if (apart(q, newton(stepped(p, way, share), goal, 4, SPLIT / 10).q) < 1e-4) return true;
  }
  return false;
}

/** Whether two paths follow one self-motion: those through a crossing may leave it by either way.
 * @param {number[][]} a @param {number[][]} b @param {Numbers} goal */
function oneCurve(a, b, goal) {
  const shared = [0.07, 0.31, 0.52, 0.74, 0.93].filter((share) => onPath(a[Math.floor(share * a.length)], b, goal));
  return shared.length > 1;
}
