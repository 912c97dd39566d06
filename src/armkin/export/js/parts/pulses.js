
/** Whole pulses of every motor, halves away from zero. @param {ArrayLike<number>} q [rad | mm] @returns {number[]} */
export function pulses(q) {
  actual(q); // as many as joints
  return MOTORS.gain.map((row, m) => {
    let [exact, size] = [MOTORS.bias[m], 0];
    row.forEach((gain, j) => {
      exact += (q[j] - home[j]) * gain;
      size += (Math.abs(q[j]) + Math.abs(home[j])) * Math.abs(gain);
    });
    if (!(Math.abs(exact) <= 2 ** 53)) throw new RangeError('joint values must be finite, and at most 2^53 pulses');
    const whole = Math.floor(Math.abs(exact) + (0.5 + 1e-9 + 4 * Number.EPSILON * size));
    return exact < 0 ? -whole : whole;
  });
}

/** Joint values where the motors stand at these pulses [rad | mm]. @param {ArrayLike<number>} p @returns {number[]} */
export function joints(p) {
  if (p?.length !== MOTORS.bias.length) throw new RangeError(`${ARM.name} has ${MOTORS.bias.length} motors, got ${p?.length ?? 'no'} pulses`);
  return MOTORS.inverse.map((row, j) => home[j] + row.reduce((sum, x, m) => sum + x * (p[m] - MOTORS.bias[m]), 0));
}
