const SAMPLES = 360; // of a turn of the redundant joint
const SOLVED = 1e-18; // squared residual of a posture that solves a target
const LEAST = 1e-22; // squared residual up to which a branch goes on to its end, or ten thousand times that of its last sample
const HALVINGS = 36; // of a sample's step: to 1e-12 rad
const SECTIONS = 36; // of the golden section, to 1e-9 rad
const BEND = 0.15; // [rad] that a joint turns between two samples: beside a singular posture it turns more, and there are more samples
const DEPTH = 7; // halvings of a step there
const TURNS = 30; // steps in search of a turning point of the room to the limits
const CLEAR_STEP = Math.PI / 1800; // between postures of an interval that are asked whether they hit something
const RATIO = (Math.sqrt(5) - 1) / 2;
const FULL = 2 * Math.PI;
const STOOD = 1e-6; // motion [rad] of a row that is `near` itself
const LONG = 0.1; // rad, reaches: a family in which a joint moves so far is no boundary

/** @typedef {{t: number, here: boolean, legal: boolean, cost: number, miss: number, q: number[], value: number, room: number}} Node a
 * branch at a value t of the joint, of which `value` is the legal copy; room: to the nearest limit [rad], negative beyond it */
/** @typedef {{branch: number, a: number, b: number, whole: boolean, legal: boolean, at: number, low: number, high: number}} Piece from a to b,
 * with the best node and those beside it */

/** A target's branches along the redundant joint, whose actual value is the parameter t. */
class Follower {
  /** @param {Target} target @param {Numbers} near joint values to stay close to [rad | mm] */
  constructor(target, near) {
    const j = REDUNDANT.joint;
    this.target = target;
    this.near = near;
    this.ratio = ARM.ratio[j];
    this.wanted = near[j] * this.ratio;
    for (let k = 0; k < others.length; k++) others[k] = near[k < j ? k : k + 1];
  }

  /** Finds the branches at a value, of which `node` tells. @param {number} t */
  look(t) {
    OTHERS.ask(moved(this.target, t), others);
  }

  /** A branch where the last look was. @param {number} b @param {number} t @returns {Node} */
  node(b, t) {
    const [value, inside] = copyOf(t, this.wanted);
    const miss = OTHERS.missOf(b);
    if (!(miss <= SOLVED)) return { t, here: false, legal: false, cost: Infinity, miss, q: [], value, room: NaN };
    const { q, inside: othersInside, motion } = OTHERS.stood(b);
    const cost = motion + (Math.abs(value - this.wanted) / this.ratio) * (180 / Math.PI);
    return { t, here: true, legal: inside && othersInside, cost, miss, q, value, room: roomOf(whole(q, value)) };
  }

  /** A branch at a value. @param {number} b @param {number} t */
  at(b, t) {
    this.look(t);
    return this.node(b, t);
  }

  /** The last value with a flag between one that has it and one that has not.
   * @param {number} b @param {'here' | 'legal'} flag @param {number} on @param {number} off */
  edge(b, flag, on, off) {
    const most = Math.max(LEAST, 1e4 * this.at(b, on).miss);
    for (let k = 0; k < HALVINGS; k++) {
      const middle = 0.5 * (on + off);
      const node = this.at(b, middle);
      if (node[flag] && node.miss <= most) on = middle;
      else off = middle;
    }
    return on;
  }

  /** Nodes between two of a branch, so that no joint turns far from one to the next.
   * @param {number} b @param {Node} from @param {Node} to @param {number} [depth] @returns {Node[]} */
  between(b, from, to, depth = DEPTH) {
    if (!depth || from.q.every((x, i) => Math.abs(turned(to.q[i] - x)) < BEND)) return [];
    const middle = this.at(b, 0.5 * (from.t + to.t));
    if (!middle.here) return [];
    return [...this.between(b, from, middle, depth - 1), middle, ...this.between(b, middle, to, depth - 1)];
  }

  /** A node between the k-th and the next, which are both legal or both not, that is not so; undefined where none is expected:
   * the room, if it goes on as on the far sides of both, keeps its sign. @param {number} b @param {Node[]} nodes @param {number} k */
  turningPoint(b, nodes, k) {
    const [before, node, next, after] = [nodes[k - 1], nodes[k], nodes[k + 1], nodes[k + 2]];
    if (!next || node.legal !== next.legal) return undefined;
    const sign = node.legal ? -1 : 1; // the room is sought where it is least, or most
    const width = next.t - node.t;
    const forward = before ? node.room + ((node.room - before.room) / (node.t - before.t)) * width : sign;
    const backward = after ? next.room - ((after.room - next.room) / (after.t - next.t)) * width : sign;
    if (!(sign * forward > 0 && sign * backward > 0)) return undefined;
    let [low, high] = [node.t, next.t];
    for (let i = 0; i < TURNS; i++) {
      const [left, right] = [this.at(b, high - RATIO * (high - low)), this.at(b, low + RATIO * (high - low))];
      const leftwards = sign * left.room >= sign * right.room;
      const best = leftwards ? left : right;
      if (best.here && best.legal !== node.legal) return best;
      if (leftwards) high = right.t;
      else low = left.t;
    }
    return undefined;
  }

  /** The pieces of a family, from its nodes in order: legal intervals, or where there is none the whole of it.
   * @param {number} b @param {Node[]} samples @param {boolean} closed @returns {Piece[]} */
  pieces(b, samples, closed) {
    const fine = samples.flatMap((node, k) => (samples[k + 1] ? [node, ...this.between(b, node, samples[k + 1])] : [node]));
    const nodes = fine.flatMap((node, k) => [node, this.turningPoint(b, fine, k) ?? []].flat());
    const intervals = runs(nodes.map((node) => node.legal));
    const legal = intervals.length > 0;
    return (legal ? intervals : [[0, nodes.length]]).map(([begin, size]) => {
      const end = begin + size - 1;
      const inside = nodes.slice(begin, end + 1);
      const best = begin + inside.reduce((least, node, k) => (node.cost < inside[least].cost ? k : least), 0);
      const a = begin ? this.edge(b, 'legal', nodes[begin].t, nodes[begin - 1].t) : nodes[begin].t;
      const c = end < nodes.length - 1 ? this.edge(b, 'legal', nodes[end].t, nodes[end + 1].t) : nodes[end].t;
      const [low, at, high] = [-1, 0, 1].map((side) => (nodes[best + side] ?? nodes[best]).t);
      return { branch: b, a, b: c, whole: closed && size === nodes.length, legal, at, low: Math.max(low, a), high: Math.min(high, c) };
    });
  }

  /** Where a piece moves the joints least from near. @param {Piece} piece */
  nearest(piece) {
    let [at, least] = [piece.at, Infinity];
    const cost = (/** @type {number} */ t) => {
      const node = this.at(piece.branch, t);
      const value = node.legal ? node.cost : Infinity;
      if (value < least) [at, least] = [t, value];
      return value;
    };
    const own = this.wanted + FULL * Math.round((piece.at - this.wanted) / FULL);
    for (const t of [piece.at, piece.a, piece.b, own]) if (piece.whole || (t >= piece.a && t <= piece.b)) cost(t);
    goldenSection(cost, piece.low, piece.high, SECTIONS);
    return at;
  }

  /** Whether two branches are one posture from end to end. @param {Piece} one @param {Piece} other */
  areOne(one, other) {
    if (one.branch === other.branch || Math.abs(one.a - other.a) > STOOD || Math.abs(one.b - other.b) > STOOD) return false;
    const middle = 0.5 * (one.a + one.b);
    const q = this.at(other.branch, middle).q;
    return this.at(one.branch, middle).q.every((x, i) => Math.abs(turned(x - q[i])) < STOOD);
  }

  /** A piece's row, at a value. @param {Piece} piece @param {number} t @returns {Branch} */
  row(piece, t) {
    const node = this.at(piece.branch, t);
    const row = OTHERS.told(piece.branch);
    const shift = node.value - t;
    const interval = piece.whole ? [-Math.PI, Math.PI] : [piece.a + shift, piece.b + shift];
    row.family = { joint: names[REDUNDANT.joint], interval: interval.map((end) => end / this.ratio) };
    return withRedundant(row, node.value / this.ratio, this.near, node.legal || copyOf(t, this.wanted)[1]);
  }

  /** A piece's row: the nearest posture, of those that hit nothing if there is one. @param {Piece} piece @returns {Branch} */
  nearestRow(piece) {
    if (!piece.legal) return this.row(piece, piece.at);
    let best = this.row(piece, this.nearest(piece));
    if (!KEEPS_OUT || !best.hits?.length) return best;
    let least = Infinity;
    for (let t = piece.a; t < piece.b + CLEAR_STEP; t += CLEAR_STEP) {
      const node = this.at(piece.branch, Math.min(t, piece.b));
      if (!node.legal || !(node.cost < least)) continue;
      const row = this.row(piece, node.t);
      if (!row.hits?.length) [best, least] = [row, node.cost];
    }
    return best;
  }

  /** The rows of all families, and whether a joint moves far along one of them. @param {number} count of samples of a turn */
  families(count) {
    const step = FULL / count;
    const value = (/** @type {number} */ k) => -Math.PI + k * step;
    const samples = Array.from({ length: OTHERS.branch_names.length }, () => /** @type {Node[]} */ ([]));
    for (let k = 0; k < count; k++) {
      this.look(value(k));
      samples.forEach((nodes, b) => nodes.push(this.node(b, value(k))));
    }
    /** @type {Piece[]} */
    const pieces = [];
    let long = false;
    samples.forEach((all, b) => {
      const gap = all.findIndex((node) => !node.here);
      const seam = gap < 0 ? Math.max(0, all.findIndex((node) => !node.legal)) : gap; // where the turn is cut open
      const turn = all.map((_, k) => ({ ...all[(seam + k) % count], t: value(seam + k) }));
      for (const [first, size] of runs(turn.map((node) => node.here))) {
        const nodes = turn.slice(first, first + size);
        const [low, high] = [nodes[0].t, nodes[size - 1].t];
        if (gap < 0) nodes.push({ ...nodes[0], t: low + FULL });
        else {
          nodes.unshift(this.at(b, this.edge(b, 'here', low, low - step)));
          nodes.push(this.at(b, this.edge(b, 'here', high, high + step)));
        }
        long = long || high - low > LONG || travel(nodes) > LONG;
        pieces.push(...this.pieces(b, nodes, gap < 0));
      }
    });
    const distinct = pieces.filter((piece, k) => !pieces.slice(0, k).some((other) => this.areOne(piece, other)));
    return { branches: distinct.map((piece) => this.nearestRow(piece)), long };
  }
}

/**
 * All families of answers, followed along the redundant joint by samples.
 * @param {Target} target @param {Numbers} near joint values to stay close to [rad | mm]
 * @returns {Answer} a row for each legal interval of a family, and for each family that has none
 */
function families(target, near) {
  const follower = new Follower(target, near);
  let { branches, long } = follower.families(SAMPLES);
  if (!branches.length) ({ branches, long } = follower.families(10 * SAMPLES)); // of an all but stretched arm
  const own = heldAnswer(target, near, near[REDUNDANT.joint]);
  const standing = own.branches.find((row) => row.within_limits && row.motion === 0);
  if (standing) {
    const same = branches.find((row) => row.motion < STOOD);
    const value = near[REDUNDANT.joint]; // a family narrower than a sample, or one that touches a limit here
    if (same) Object.assign(same, standing, { family: same.family });
    else branches.push({ ...standing, family: { joint: names[REDUNDANT.joint], interval: [value, value] } });
  }
  const moves = (/** @type {Branch} */ row) =>
    row.joints.reduce((sum, x, k) => sum + Math.abs(x - near[k]) * (ARM.slides[k] ? 1 : 180 / Math.PI), 0);
  branches.sort((a, b) => rank(a) - rank(b) || moves(a) - moves(b));
  return {
    status: standing && own.status === 'singular' ? 'singular' : branches.length ? (long ? 'exact' : 'boundary') : 'unreachable',
    complete: false,
    best: branches.length && rank(branches[0]) === 0 ? 0 : null,
    free_joints: standing && own.status === 'singular' ? own.free_joints : [],
    closest: branches.some((row) => row.within_limits) ? null : nearestPose(target, near),
    branches,
  };
}

/** Asks for a cost ever nearer to its minimum between two values; what is least is the cost's to keep.
 * @param {(t: number) => number} cost @param {number} low @param {number} high
 * @param {number} steps */
function goldenSection(cost, low, high, steps) {
  let [left, right] = [high - RATIO * (high - low), low + RATIO * (high - low)];
  let [atLeft, atRight] = [cost(left), cost(right)];
  for (let k = 0; k < steps; k++) {
    if (atLeft <= atRight) {
      [high, right, atRight] = [right, left, atLeft];
      left = high - RATIO * (high - low);
      atLeft = cost(left);
    } else {
      [low, left, atLeft] = [left, right, atRight];
      right = low + RATIO * (high - low);
      atRight = cost(right);
    }
  }
}

/** The redundant joint's copy nearest to `wanted` and whether it is within limits. @param {number} t @param {number} wanted
 * @returns {[number, boolean]} */
function copyOf(t, wanted) {
  const [low, high] = [ARM.lower[REDUNDANT.joint], ARM.upper[REDUNDANT.joint]];
  const value = OTHERS.nearestCopy(t, wanted, low, high, false);
  return [value, value >= low - 1e-9 && value <= high + 1e-9];
}

/** Runs of flags that are set: first one and length. @param {boolean[]} flags */
function runs(flags) {
  /** @type {number[][]} */
  const out = [];
  flags.forEach((flag, k) => {
    if (flag && !flags[k - 1]) out.push([k, 0]);
    if (flag) out[out.length - 1][1]++;
  });
  return out;
}

/** How far joint values are within their limits, negative beyond them [rad]. @param {number[]} q */
function roomOf(q) {
  let room = FULL;
  for (let j = 0; j < q.length; j++) room = Math.min(room, ARM.upper[j] - q[j], q[j] - ARM.lower[j]);
  return room;
}

/** How far a joint goes along nodes [rad, reaches]. @param {Node[]} nodes */
function travel(nodes) {
  const sums = Array.from(others, () => 0);
  for (let k = 1; k < nodes.length; k++) nodes[k].q.forEach((x, i) => (sums[i] += Math.abs(turned(x - nodes[k - 1].q[i]))));
  return Math.max(...sums);
}

/** An angle less whole turns. @param {number} x */
const turned = (x) => x - FULL * Math.round(x / FULL);

/** Of postures within limits the one that misses least, whatever the redundant joint. @param {Target} target @param {Numbers} near */
function nearestPose(target, near) {
  const j = REDUNDANT.joint;
  const [low, high] = limits[j] ?? [null, null];
  const [from, to] = [low ?? -Math.PI, high ?? Math.PI];
  /** @type {Answer['closest']} */
  let best = null;
  let least = Infinity;
  const cost = (/** @type {number} */ value) => {
    const found = heldAnswer(target, near, value).closest;
    const size = found ? found.distance_mm ** 2 + (((found.angle_deg * Math.PI) / 180) * 0.25 * ARM.reach) ** 2 : Infinity;
    if (size < least) [best, least] = [found, size];
    return size;
  };
  const step = (to - from) / 24;
  let at = from;
  for (let k = 0; k <= 24; k++) {
    const before = least;
    if (cost(from + k * step) < before) at = from + k * step;
  }
  goldenSection(cost, Math.max(from, at - step), Math.min(to, at + step), 30);
  return best;
}
