// Frames are 3 x 4, row by row: a rotation and a translation.

/** @param {Numbers} a @param {Numbers} b @param {Float64Array} out another array than a and b */
function times(a, b, out) {
  for (let i = 0; i < 12; i += 4)
    for (let j = 0; j < 4; j++)
      out[i + j] = a[i] * b[j] + a[i + 1] * b[4 + j] + a[i + 2] * b[8 + j] + (j === 3 ? a[i + 3] : 0);
}

/** Z(q): a shift by q along z, or a turn about it; the frame after it.
 * @param {Numbers} a @param {boolean} slides @param {number} q @param {Float64Array} out */
function move(a, slides, q, out) {
  const c = slides ? 1 : Math.cos(q);
  const s = slides ? 0 : Math.sin(q);
  for (let i = 0; i < 12; i += 4) {
    const x = a[i];
    const y = a[i + 1];
    out[i] = c * x + s * y;
    out[i + 1] = c * y - s * x;
    out[i + 2] = a[i + 2];
    out[i + 3] = slides ? a[i + 3] + q * a[i + 2] : a[i + 3];
  }
}

/** @param {Numbers} a @param {Float64Array} out */
function invert(a, out) {
  for (let i = 0; i < 3; i++) {
    for (let j = 0; j < 3; j++) out[4 * i + j] = a[4 * j + i];
    out[4 * i + 3] = -(a[i] * a[3] + a[4 + i] * a[7] + a[8 + i] * a[11]);
  }
}

/** The fifteen numbers of a frame's z axis, a line: p, l, p.p, p.l, p x l, (p.p) l - 2 (p.l) p, 1; rows of fifteen are
 * kept sixteen apart. @param {Numbers} frame @param {Float64Array} out */
function features(frame, out) {
  const p = [frame[3], frame[7], frame[11]];
  const l = [frame[2], frame[6], frame[10]];
  const square = dot(p, p);
  const along = dot(p, l);
  const across = cross(p, l);
  for (let i = 0; i < 3; i++) {
    out[i] = p[i];
    out[3 + i] = l[i];
    out[8 + i] = across[i];
    out[11 + i] = square * l[i] - 2 * along * p[i];
  }
  out[6] = square;
  out[7] = along;
  out[14] = 1;
  out[15] = 0;
}

/** The 15 x 15 matrix by which a rigid motion acts on these numbers. @param {Numbers} motion @param {Float64Array} out */
function representation(motion, out) {
  out.fill(0);
  const t = [motion[3], motion[7], motion[11]];
  const square = dot(t, t);
  const tR = [0, 1, 2].map((j) => t[0] * motion[j] + t[1] * motion[4 + j] + t[2] * motion[8 + j]);
  for (let i = 0; i < 3; i++) {
    const [x, y] = [(i + 1) % 3, (i + 2) % 3];
    for (let j = 0; j < 3; j++) {
      const R = motion[4 * i + j];
      const across = t[x] * motion[4 * y + j] - t[y] * motion[4 * x + j];
      out[16 * i + j] = out[16 * (3 + i) + 3 + j] = out[16 * (8 + i) + 8 + j] = out[16 * (11 + i) + 11 + j] = R;
      out[16 * (8 + i) + 3 + j] = across;
      out[16 * (11 + i) + 8 + j] = -2 * across;
      out[16 * (11 + i) + 3 + j] = square * R - 2 * t[i] * tR[j];
    }
    out[16 * i + 14] = t[i];
    out[16 * 6 + i] = 2 * tR[i];
    out[16 * 7 + 3 + i] = tR[i];
    out[16 * (11 + i) + 7] = -2 * t[i];
  }
  out[16 * 6 + 14] = square;
  out[16 * 6 + 6] = out[16 * 7 + 7] = out[16 * 14 + 14] = 1;
}
