/** Finds the branches of a target, which `stood` tells of. @param {Target} target @param {Numbers} near joint values to stay close to */
function ask(target, near) {
  read(target);
  actual(near, closeTo);
  doubted(goalNumbers, closeTo);
}

/** What a branch misses, squared. @param {number} b */
const missOf = (b) => allMisses[b];

/** A branch at its nearest legal copy: joints, whether within limits, motion in degrees and mm. @param {number} b */
function stood(b) {
  const q = legal(candidate(b), closeTo);
  return { q, inside: copyInside, motion: copyMotion[0] };
}

/** What is told of a branch. @param {number} b @returns {Branch} */
const told = (b) => branchOf(legal(candidate(b), closeTo), b, goalNumbers, true);
