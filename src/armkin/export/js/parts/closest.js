/**
 * The posture within limits that misses a target least: the squared distance plus the squared angle times the square of
 * a quarter of the reach. Projected Levenberg-Marquardt from `near`, home, branches that are outside and a fixed spread,
 * in two rounds: all starts some steps, then the best to the end; of equal ones the nearest to `near`.
 * @param {Numbers} goal @param {Numbers} near @param {number[][]} others
 */
function closest(goal, near, others) {
  const low = ARM.lower.map((x, j) => (Number.isFinite(x) ? x : ARM.home[j] - Math.PI * ARM.unit[j]));
  const high = ARM.upper.map((x, j) => (Number.isFinite(x) ? x : ARM.home[j] + Math.PI * ARM.unit[j]));
  const starts = [Array.from(near), ARM.home, ...others];
  for (let k = 1; k <= 16; k++)
    starts.push(low.map((x, j) => x + (high[j] - x) * ((k * Math.sqrt(2 + 3 * j + j * j)) % 1)));
  const found = starts.map((start) => descend(start.map((x, j) => Math.min(Math.max(x, ARM.lower[j]), ARM.upper[j])), goal, 1e-2, 12));
  found.sort((a, b) => a.cost - b.cost);
  const last = found.slice(0, 4).map((one) => {
    const { q, cost } = descend(one.q, goal, one.damping, 500);
    return { q, cost, moved: q.reduce((sum, x, j) => sum + Math.abs(x - near[j]) / ARM.unit[j], 0) };
  });
  const least = Math.min(...last.map((one) => one.cost));
  const equal = last.filter((one) => one.cost <= least * (1 + 1e-9) + 1e-18);
  const best = equal.reduce((a, b) => (b.moved < a.moved ? b : a));
  misses(best.q, goal);
  return { q: best.q, distance: off2[0] * ARM.reach, angle: off2[1] };
}

/** A descent within limits. @param {number[]} q @param {Numbers} goal @param {number} damping @param {number} steps */
function descend(q, goal, damping, steps) {
  const n = ARM.joints;
  const system = new Float64Array(n * (n + 1));
  const weighed = (/** @type {Numbers} */ at) => residual(at, goal).map((x, i) => (i < ARM.position ? x : x / 4));
  let r = weighed(q);
  let cost = dot(r, r);
  for (let step = 0; step < steps && damping < 1e8; step++) {
    const J = slope(q);
    for (let i = ARM.position; i < J.length; i++) for (let j = 0; j < n; j++) J[i][j] /= 4;
    const downhill = q.map((_, j) => J.reduce((sum, row, i) => sum + row[j] * r[i], 0));
    const held = q.map((x, j) => (x <= ARM.lower[j] && downhill[j] < 0) || (x >= ARM.upper[j] && downhill[j] > 0));
    let [better, longest, gained] = [false, 0, 0];
    while (!better && damping < 1e8) {
      for (let i = 0; i < n; i++) {
        for (let j = 0; j < n; j++) {
          let sum = i === j ? damping : 0;
          if (!held[i] && !held[j]) for (const row of J) sum += row[i] * row[j];
          system[i * (n + 1) + j] = sum;
        }
        system[i * (n + 1) + n] = held[i] ? 0 : downhill[i];
      }
      reduce(system, n, n, n + 1);
      longest = 0;
      for (let j = 0; j < n; j++) longest = Math.max(longest, Math.abs(system[j * (n + 1) + n]));
      const scale = Math.min(1, 0.5 / Math.max(longest, 1e-300));
      const trial = q.map((x, j) => Math.min(Math.max(x + scale * system[j * (n + 1) + n] * ARM.unit[j], ARM.lower[j]), ARM.upper[j]));
      const then = weighed(trial);
      const now = dot(then, then);
      better = now < cost;
      gained = cost - now;
      if (better) [q, r, cost, damping] = [trial, then, now, Math.max(damping / 5, 1e-12)];
      else damping *= 6;
      if (longest < 1e-12) return { q, cost, damping };
    }
    if (gained <= 1e-15 * Math.max(cost, 1e-30) && longest < 1e-9) break;
  }
  return { q, cost, damping };
}
