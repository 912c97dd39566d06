const TURN = 2 * Math.PI;
const SLACK = 1e-9; // rad or mm: a joint this far outside still counts as on its limit
const EQUAL = 1e6; // parts of a degree or mm: motions that differ by less are equal

/** The nearest whole number, of two the even one. @param {number} x */
const rint = (x) => (Math.abs(x) < 4503599627370496 ? x + 6755399441055744 - 6755399441055744 : x);

/** @param {number} size @param {number} sign */
const copysign = (size, sign) => (sign < 0 || Object.is(sign, -0) ? -Math.abs(size) : Math.abs(size));

/** A joint value less another, turns the short way round. @param {number} a @param {number} b @param {boolean} slides */
const less = (a, b, slides) => (slides ? a - b : a - b - TURN * rint((a - b) / TURN));

/** The largest difference of two postures [rad, reaches], modulo whole turns. @param {Numbers} a @param {Numbers} b */
function apart(a, b) {
  let most = 0;
  for (let j = 0; j < ARM.joints; j++) most = Math.max(most, Math.abs(less(a[j], b[j], ARM.slides[j])) / ARM.unit[j]);
  return most;
}

/**
 * The copy of a joint value, whole turns away, that is within limits and nearest; of two that are half a turn from
 * `near` the one above it. Where no copy is within limits, the principal value.
 * @param {number} value @param {number} near @param {number} lower @param {number} upper @param {boolean} slides
 * @returns {number}
 */
function nearestCopy(value, near, lower, upper, slides) {
  if (slides) return value;
  const low = lower - SLACK;
  const high = upper + SLACK;
  value -= TURN * rint(value / TURN);
  const principal = value < SLACK - Math.PI ? value + TURN : value;
  if (lower >= -Math.PI && upper <= Math.PI) {
    if (!(low <= -Math.PI || high >= Math.PI) || !(principal > Math.PI - SLACK)) return principal;
    const legal = low <= principal && principal <= high;
    const other = principal - TURN;
    const nearer = Math.abs(other - near) < Math.abs(principal - near) - SLACK;
    return low <= other && other <= high && (!legal || nearer) ? other : principal;
  }
  const moved = near === 0 ? principal : value + TURN * Math.floor((near + Math.PI + SLACK - value) / TURN);
  if (low <= moved && moved <= high) return moved;
  const best = moved < low ? moved + TURN * Math.ceil((low - moved) / TURN) : moved - TURN * Math.ceil((moved - high) / TURN);
  return low <= best && best <= high ? best : principal;
}
