/** @typedef {{q: Float64Array, residual: number, guess: number, weakness: number, key: number}} Root */

const chainFrame = new Float64Array(12);
const chainJoints = new Float64Array(72);
const chainMoved = new Float64Array(12);
const chainError = new Float64Array(6);

/** What joint values miss of a pose: the Frobenius norm; what is missing, linear first, is left in `chainError`, the frames in
 * `chainFrame` and `chainJoints`. @param {Numbers} q @param {Numbers} goal */
function missing(q, goal) {
  for (let i = 0; i < 12; i++) chainFrame[i] = i % 5 === 0 ? 1 : 0;
  for (let k = 0; k < 6; k++) {
    chainJoints.set(chainFrame, 12 * k);
    move(chainFrame, LOOP.slides[k], q[k], chainMoved);
    if (k < 5) times(chainMoved, LOOP.links[k], chainFrame);
  }
  chainFrame.set(chainMoved);
  let square = 0;
  for (let i = 0; i < 12; i++) square += (goal[i] - chainFrame[i]) ** 2;
  for (let i = 0; i < 3; i++) {
    const [x, y] = [4 * ((i + 1) % 3), 4 * ((i + 2) % 3)];
    chainError[i] = goal[4 * i + 3] - chainFrame[4 * i + 3];
    chainError[3 + i] = 0;
    for (let j = 0; j < 3; j++) chainError[3 + i] += 0.5 * (chainFrame[x + j] * goal[y + j] - chainFrame[y + j] * goal[x + j]);
  }
  return Math.sqrt(square);
}

const jacobian6 = new Float64Array(36);
const system6 = new Float64Array(72);

/** The inverse of the chain's Jacobian where `missing` was last, in the right half of system6; false where it has none. */
function invertJacobian() {
  for (let k = 0; k < 6; k++)
    for (let i = 0; i < 3; i++) {
      const f = 12 * k;
      const [x, y] = [4 * ((i + 1) % 3), 4 * ((i + 2) % 3)];
      const across =
        chainJoints[f + x + 2] * (chainFrame[y + 3] - chainJoints[f + y + 3]) -
        chainJoints[f + y + 2] * (chainFrame[x + 3] - chainJoints[f + x + 3]);
      jacobian6[6 * i + k] = LOOP.slides[k] ? chainJoints[f + 4 * i + 2] : across;
      jacobian6[6 * (3 + i) + k] = LOOP.slides[k] ? 0 : chainJoints[f + 4 * i + 2];
    }
  for (let i = 0; i < 6; i++)
    for (let j = 0; j < 12; j++) system6[12 * i + j] = j < 6 ? jacobian6[6 * i + j] : j - 6 === i ? 1 : 0;
  return reduce(system6, 6, 6, 12);
}

/** Newton's method, damped by the residual (Levenberg, Marquardt) if asked: the best point met.
 * @param {Float64Array} start @param {Numbers} goal @param {number} steps @param {boolean} damped @returns {Root} */
function refine(start, goal, steps, damped) {
  const most = damped ? steps : steps + 3; // undamped: three steps more on a slow way to an answer
  const out = { q: start, residual: Infinity, guess: 0, weakness: Infinity, key: 0 };
  const q = Float64Array.from(start);
  const inverse = new Float64Array(36);
  let last = 0;
  for (let step = 0; step <= most; step++) {
    const size = missing(q, goal);
    if (step === 0) out.guess = size;
    if (size < out.residual) [out.residual, out.q] = [size, q.slice()];
    if (step === 0 || (size > 1e-3 * last && size > 1e-14)) {
      if (!invertJacobian()) {
        out.weakness = Infinity;
        return out;
      }
      let square = 0;
      for (let i = 0; i < 6; i++)
        for (let j = 0; j < 6; j++) {
          inverse[6 * i + j] = system6[12 * i + 6 + j];
          square += inverse[6 * i + j] ** 2;
        }
      out.weakness = Math.sqrt(square);
      if (damped && step < steps - 2) {
        for (let i = 0; i < 6; i++)
          for (let j = 0; j < 6; j++) {
            let sum = i === j ? size * Math.min(size, 1) : 0;
            for (let k = 0; k < 6; k++) sum += jacobian6[6 * k + i] * jacobian6[6 * k + j];
            system6[12 * i + j] = sum;
            system6[12 * i + 6 + j] = jacobian6[6 * j + i];
          }
        if (!reduce(system6, 6, 6, 12)) return out;
        for (let i = 0; i < 6; i++) for (let j = 0; j < 6; j++) inverse[6 * i + j] = system6[12 * i + 6 + j];
      }
    }
    if (!(size > 1e-14) || step === most || (step >= steps && !(size > 1e-13 && size < 1e-3))) return out;
    last = size;
    const by = [0, 0, 0, 0, 0, 0];
    for (let i = 0; i < 6; i++) for (let j = 0; j < 6; j++) by[i] += inverse[6 * i + j] * chainError[j];
    const longest = Math.max(...by.map(Math.abs));
    if (!(longest < Infinity)) return out;
    for (let i = 0; i < 6; i++) q[i] += longest > 0.5 ? by[i] * (0.5 / longest) : by[i];
  }
  return out;
}

/** Turns in [-pi, pi), and the number by which answers are sorted. @param {Root} found */
function sortable(found) {
  found.key = 0;
  for (let k = 0; k < 6; k++) {
    if (!LOOP.slides[k]) found.q[k] -= TURN * Math.floor((found.q[k] + Math.PI) / TURN);
    found.key += LOOP.weights[k] * (LOOP.slides[k] ? found.q[k] : Math.cos(found.q[k]));
    found.key += LOOP.weights[6 + k] * (LOOP.slides[k] ? 0 : Math.sin(found.q[k]));
  }
}

/** The largest difference of two answers, turns the short way round. @param {Numbers} a @param {Numbers} b */
function apart6(a, b) {
  let most = 0;
  for (let k = 0; k < 6; k++) most = Math.max(most, Math.abs(less(a[k], b[k], LOOP.slides[k])));
  return most;
}

/** Whether a candidate whose vector is no product stands for nothing: its root is simple, or all solutions of it are known, and
 * it is far from the pose. @param {Seed} seed @param {Float64Array} goal @param {Float64Array} re @param {Float64Array} im */
function standsForNothing({ q, root: i }, goal, re, im) {
  const size = i < 0 ? 0 : 1 + re[i] ** 2 + im[i] ** 2;
  for (let j = 0; j < re.length && i >= 0; j++) {
    const away = (re[i] - re[j]) ** 2 + (im[i] - im[j]) ** 2;
    if (j !== i && !(4 * away > 1e-6 * size * (1 + re[j] ** 2 + im[j] ** 2))) return false;
  }
  return missing(q, goal) > 1e-3;
}

/** What a pose of the loop's chain makes of axes 6 and 1: all but parallel 1, meeting 2, else 0. @param {Numbers} frame */
function kindOf(frame) {
  if (LOOP.slides[0] || LOOP.slides[5]) return 0;
  const sine = Math.hypot(frame[2], frame[6]);
  if (sine < LOOP.beside) return 1;
  return Math.abs(frame[3] * frame[6] - frame[7] * frame[2]) < LOOP.beside * sine ? 2 : 0;
}

/** One pass over a pose: its answers, whether the pass leaves it open, and whether two roots touch or just miss each other.
 * @param {Float64Array} goal @param {number} kind @param {number} pass @param {Root[]} found answers are put behind these */
function attempt(goal, kind, pass, found) {
  const pencil = PENCILS[LOOP.plan[kind][pass]];
  const shake = LOOP.shakes[pass];
  const careful = pass > 0;
  const joint = pencil.order[2 + pencil.hidden];
  const pair = 1e-4 + 10 * Math.sqrt(shake); // tilt below which a complex root may be one of two real ones
  const size = pencil.size;
  const lead = pencil.products;
  const c = lead + size;
  let [open, touching, weakest] = [false, false, 0];
  let back = new Float64Array(12);
  const moved = new Float64Array(12);
  times(LOOP.shaking[pass], goal, moved);
  invert(moved, back); // the pose link closes the loop
  if (pencil.backward) back = moved;
  const ends = eliminate(pencil, back);
  if (!ends) return { open: true, touching };
  const E = equations(pencil, back, ends.N);
  const G = Float64Array.from(E);
  if (!reduce(G, lead, lead, c)) return { open: true, touching };
  const C = new Float64Array(size * size);
  let most = 0;
  for (let i = 0; i < lead; i++) {
    for (let j = 0; j < size; j++) {
      C[i * size + j] = -G[i * c + lead + j];
      most = Math.max(most, Math.abs(G[i * c + lead + j]));
    }
    open = open || !(Math.abs(G[i * c + i]) > 1e-11); // of a singular pencil the rest may vanish on both sides
  }
  for (let i = 0; i < size - lead; i++) C[(lead + i) * size + 2 * pencil.r + i] = 1;
  if (!(most <= 1e6)) open = true;
  if (!(most < 1e300)) return { open, touching };
  const [re, im] = [new Float64Array(size), new Float64Array(size)];
  balance(C, size);
  hessenberg(C, size);
  if (!eigenvalues(C, size, re, im)) return { open: true, touching };
  /** @type {{one: Root, hidden: number, own: boolean, stands: boolean, blurred: boolean, real: boolean}[]} */
  const here = [];
  const part = (careful || pencil.wide) && !(pencil.slides[2] || pencil.slides[3] || pencil.slides[4]);
  for (const seed of seedsOf(pencil, E, back, ends, re, im, careful ? 0.3 : 0.02, part)) {
    const { q, tilt } = seed;
    if (seed.defect > 1e-5 && !(shake > 0) && most < 1e5 && standsForNothing(seed, goal, re, im)) continue;
    const one = refine(q, goal, careful ? 12 : 4, careful);
    const good = one.residual < (careful ? 3e-9 : 1e-10);
    // a complex pair that steps brought near the pose may be a real one, seen through rounding
    const close = careful ? one.residual < 1e-5 && tilt < Math.max(pair, 1e-3) : one.residual < 1e-3;
    if (!good && (tilt < 1e-4 || close)) open = true;
    // a move of the pose may turn two close real roots into such a pair
    if (good && tilt > 0 && tilt < pair) open = true;
    if ((good && tilt > 0 && tilt < 1e-4) || (one.residual > 1e-10 && one.residual < 3e-6)) touching = true;
    if (!good) continue;
    weakest = Math.max(weakest, one.weakness);
    const own = Math.abs(less(one.q[joint], q[joint], LOOP.slides[joint])) < 1e-6;
    here.push({ one, hidden: q[joint], own, stands: tilt < pair, blurred: one.guess > 1e-5 + 10 * shake, real: !(tilt > 0) });
    sortable(one);
    found.push(one);
  }
  // A real root far from the answer it led to may have stood for another one; not if it has the answer's value of the hidden
  // joint: around a value there are no more solutions than roots, and no two roots may have led to one answer.
  for (const root of here) {
    root.own = root.own && !(shake > 0) && weakest < 1e3;
    if (root.real && root.one.guess > 1e-3 + 30 * shake && !root.own) open = true;
  }
  here.forEach((a, j) => {
    for (const b of here.slice(0, j)) {
      const shared = a.stands && b.stands && (a.blurred || b.blurred) && !(a.own && b.own);
      if (shared && Math.abs(a.hidden - b.hidden) < 1e-4) open = true;
      if (a.real && b.real && Math.abs(a.one.key - b.one.key) < 1e-5 && apart6(a.one.q, b.one.q) < 1e-2) open = true;
    }
  });
  return { open, touching };
}

/** One of each set of equal answers; whether some were further apart than rounding. @param {Float64Array} goal @param {Root[]} found */
function merge(goal, found) {
  found.sort((a, b) => a.key - b.key);
  const gone = new Set();
  let merged = false;
  found.forEach((a, i) => {
    for (const b of found.slice(i + 1)) {
      if (gone.has(a) || gone.has(b) || b.key - a.key > 0.1) continue;
      const distance = apart6(b.q, a.q);
      if (!(distance < 1e-2)) continue;
      const half = a.q.map((x, k) => x + less(b.q[k], x, LOOP.slides[k]) / 2);
      const blur = 4 * Math.max(a.residual, b.residual);
      const radius = 3 * Math.max(a.weakness * a.residual, b.weakness * b.residual);
      if (distance < Math.max(radius, 1e-6) || missing(half, goal) < Math.max(blur, 1e-13)) {
        gone.add(b.residual > a.residual ? b : a);
        merged = merged || distance > 1e-8;
      }
    }
  });
  return { kept: found.filter((one) => !gone.has(one)), merged };
}

/** As of a closed form. Doubt: an answer near a singularity, merged answers, touching roots, or a pose that no pass settled.
 * @param {Numbers} goal columns x, y, z and the position [mm] @param {Numbers} near @param {Float64Array} q @param {Float64Array} miss
 * @param {number} [passes] at most, of those that may prove an answer complete: the target is not moved; by default all */
function candidatesOfPose(goal, near, q, miss, passes) {
  const target = new Float64Array(12);
  const scaled = new Float64Array(12);
  const there = new Float64Array(12);
  for (let i = 0; i < 3; i++) for (let j = 0; j < 4; j++) target[4 * i + j] = goal[3 * j + i] / (j === 3 ? LOOP.length : 1);
  times(LOOP.fromBase, target, scaled);
  times(scaled, LOOP.fromTool, there);
  /** @type {Root[]} */
  let found = [];
  let [open, edge] = [true, false];
  const kind = kindOf(there);
  const most = passes === undefined ? LOOP.shakes.length : Math.min(passes, LOOP.shakes.filter((shake) => shake === 0).length);
  for (let pass = 0; pass < most && open; pass++) {
    edge = edge || LOOP.shakes[pass] > 0; // a singular posture may be missing where the target had to be moved
    const told = attempt(there, kind, pass, found);
    open = told.open;
    edge = edge || told.touching;
  }
  const exact = found.filter((one) => one.residual < 1e-10);
  if (exact.length) found = exact; // a closest point stands in for answers only where there are none
  const { kept, merged } = merge(there, found);
  edge = edge || merged || kept.some((one) => !(one.weakness <= 1e4)) || kept.length > ARM.branches;
  miss.fill(Infinity);
  kept.slice(0, ARM.branches).forEach((one, b) => {
    miss[b] = one.residual ** 2 * LOOP.residual;
    for (let j = 0; j < ARM.joints; j++) q[b * ARM.joints + j] = one.q[j] * (LOOP.slides[j] ? LOOP.length : 1);
  });
  return edge || open;
}
