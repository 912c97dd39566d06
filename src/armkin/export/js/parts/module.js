/** Names of all branches that a target may have. */
export const branch_names = ARM.names;

const OUTSIDE = 2 ** 52; // above every rank of a row within limits

/** @type {number[]} */
const ranks = []; // of the branches of one answer: motions in degrees and mm,
/** @type {number[]} */
const places = []; // and which ones they are

/** Whether a row hits nothing. @param {Branch} row */
const free = (row) => !row.hits?.length;

/** Rows within limits and free of hits first, then those that hit, then by motion; of equal ones the first branch. @param {Branch[]} rows */
function sort(rows) {
  let least = Infinity;
  for (let k = 0; k < rows.length; k++) least = Math.min(least, ranks[k]);
  for (let k = 0; k < rows.length; k++) {
    const row = rows[k];
    const group = row.within_limits ? (KEEPS_OUT && !free(row) ? OUTSIDE / 2 : 0) : OUTSIDE;
    const rank = rint((ranks[k] - least) * EQUAL) * 256 + places[k] + group;
    let at = k;
    for (; at > 0 && ranks[at - 1] >= rank; at--) {
      rows[at] = rows[at - 1];
      ranks[at] = ranks[at - 1];
    }
    rows[at] = row;
    ranks[at] = rank;
  }
}

/** Puts a branch at an answer's end. @param {Branch[]} branches @param {Branch} row @param {number} rank @param {number} place */
function put(branches, row, rank, place) {
  ranks[branches.length] = rank;
  places[branches.length] = place;
  branches.push(row);
}

/**
 * All branches that reach a target.
 * @param {Target} target @TARGET@
 * @param {ArrayLike<number>} [near] joint values to stay close to [rad | mm], by default home
 * @returns {Answer} branches within limits and free of hits first, then by motion from `near`; joints and motion [rad | mm]
 */
export function ik(target, near = home) {
  const goal = goalNumbers;
  const close = closeTo;
  const rounding = read(target);
  actual(near, close);
  for (let j = 0; j < ARM.joints; j++) if (!Number.isFinite(close[j])) throw new RangeError('near holds a value that is not finite');
  const edge = doubted(goal, close);
  const stands = solvesIt(close, goal, rounding);
  /** @type {Branch[]} */
  const branches = [];
  let status = /** @type {Status} */ ('exact');
  let complete = true;
  /** @type {string[]} */
  let loose = [];
  if (CLOSED_FORM && !edge && !stands) {
    for (let b = 0; b < ARM.branches; b++) {
      if (!(allMisses[b] <= SOLUTION * SOLUTION)) continue;
      const q = legal(candidate(b), close);
      put(branches, branchOf(q, b, goal, true), copyMotion[0], b);
    }
    if (!branches.length) status = 'unreachable';
  } else {
    const told = solutions(goal, close, edge);
    const found = told.rows.map((row) => placed(row, close, goal));
    if (stands) stay(found, close, goal, rounding);
    for (const { row, rank, branch } of found) put(branches, row, rank, branch);
    status = told.status === 'unreachable' && found.length ? 'boundary' : told.status;
    complete = told.complete;
    loose = told.free.map((j) => names[j]);
  }
  sort(branches);
  const inside = branches.length > 0 && branches[0].within_limits;
  const best = inside && free(branches[0]) ? 0 : null;
  let nearby = null;
  if (!inside) {
    const { q, distance, angle } = closest(goal, close, branches.map((row) => actual(row.joints)));
    const joints = q.map((x, j) => x / ARM.ratio[j]);
    nearby = { joints, position_mm: fk(joints).slice(0, 3).map((row) => row[3]), distance_mm: distance, angle_deg: angle * DEGREES };
  }
  return {
    status,
    complete,
    best,
    free_joints: loose,
    closest: nearby,
    branches,
  };
}
