/* Frames are 3 x 4, row by row: a rotation and a translation. */
ARM_INLINE void arm_times(const double *a, const double *b, double *out)
{
    int i, j;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 4; j++)
            out[4 * i + j] = a[4 * i] * b[j] + a[4 * i + 1] * b[4 + j] + a[4 * i + 2] * b[8 + j]
                + (j == 3 ? a[4 * i + 3] : 0.0);
}

/* Z(q): a shift by q along z, or a turn about it with this cosine and sine; the frame after it. */
ARM_INLINE void arm_move(const double *a, int slides, double q, double c, double s, double *out)
{
    int i;
    for (i = 0; i < 3; i++) {
        const double x = a[4 * i], y = a[4 * i + 1];
        out[4 * i] = slides ? x : c * x + s * y;
        out[4 * i + 1] = slides ? y : c * y - s * x;
        out[4 * i + 2] = a[4 * i + 2];
        out[4 * i + 3] = slides ? a[4 * i + 3] + q * a[4 * i + 2] : a[4 * i + 3];
    }
}

static void arm_invert(const double *a, double *out)
{
    int i, j;
    for (i = 0; i < 3; i++) {
        for (j = 0; j < 3; j++)
            out[4 * i + j] = a[4 * j + i];
        out[4 * i + 3] = -(a[i] * a[3] + a[4 + i] * a[7] + a[8 + i] * a[11]);
    }
}

/* The fifteen numbers of a frame's z axis, a line: p, l, p.p, p.l, p x l, (p.p) l - 2 (p.l) p, 1; and a zero: rows of
   fifteen are kept sixteen apart, by fours. */
static void arm_features(const double *frame, double *out)
{
    const double p[3] = {frame[3], frame[7], frame[11]}, l[3] = {frame[2], frame[6], frame[10]};
    const double square = p[0] * p[0] + p[1] * p[1] + p[2] * p[2], along = p[0] * l[0] + p[1] * l[1] + p[2] * l[2];
    int i;
    for (i = 0; i < 3; i++) {
        out[i] = p[i];
        out[3 + i] = l[i];
        out[8 + i] = p[(i + 1) % 3] * l[(i + 2) % 3] - p[(i + 2) % 3] * l[(i + 1) % 3];
        out[11 + i] = square * l[i] - 2 * along * p[i];
    }
    out[6] = square;
    out[7] = along;
    out[14] = 1;
    out[15] = 0;
}

/* The 15 x 15 matrix by which a rigid motion acts on these numbers; a last column of zeros. */
static void arm_rep(const double *motion, double *out)
{
    double t[3], tR[3], square;
    int i, j;
    for (i = 0; i < 240; i++)
        out[i] = 0;
    for (i = 0; i < 3; i++)
        t[i] = motion[4 * i + 3];
    square = t[0] * t[0] + t[1] * t[1] + t[2] * t[2];
    for (j = 0; j < 3; j++)
        tR[j] = t[0] * motion[j] + t[1] * motion[4 + j] + t[2] * motion[8 + j];
    for (i = 0; i < 3; i++) {
        for (j = 0; j < 3; j++) {
            const double R = motion[4 * i + j];
            const double across = t[(i + 1) % 3] * motion[4 * ((i + 2) % 3) + j]
                - t[(i + 2) % 3] * motion[4 * ((i + 1) % 3) + j];
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

