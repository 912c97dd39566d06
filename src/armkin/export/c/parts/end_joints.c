/* What a pose says of the two end joints: N, six rows that remove them, and what gives them back: five rows, or the
   reflections of an orthogonal triangularisation and its last triangle. */
typedef struct {
    double N[ARM_ROWS * 16], recover[5 * 16];
} arm_ends;

static int arm_eliminate(const arm_pencil *pencil, const double *Y, arm_ends *out)
{
    static const unsigned char first[9] = {1, 1, 2, 2, 0, 1, 2, 0, 0}, second[9] = {1, 2, 1, 2, 0, 0, 0, 1, 2};
    double back[12], Q[9 * 16], mirror[9 * 16], factor[9], basis[11 * 16], system[5 * 24];
    int i, j, k;
    if (pencil->slot == 1) {
        for (i = 0; i < pencil->rows * 16; i++)
            out->N[i] = pencil->N[i];
        for (i = 0; i < 80; i++)
            out->recover[i] = pencil->recover[i];
        return 1;
    }
    arm_invert(Y, back);
    for (i = 0; i < 9 * 16; i++)
        Q[i] = 0;
    if (pencil->slot == 5) {
        double f[16];
        arm_features(back, f);
        for (k = 0; k < 15; k++)
            arm_subtract(Q, pencil->first + 9 * 16 * k, -f[k], 0, 9 * 16);
    } else {
        double R[15 * 16], turned[15 * 4];
        arm_rep(back, R);
        for (i = 0; i < 60; i++)
            turned[i] = 0;
        for (i = 0; i < 15; i++)
            for (k = 0; k < 15; k++)
                arm_subtract(turned + 4 * i, pencil->second + 4 * k, -R[16 * i + k], 0, 4);
        for (j = 0; j < 9; j++)
            for (k = 0; k < 15; k++)
                arm_subtract(Q + 16 * j, pencil->first + 16 * (15 * first[j] + k), -turned[4 * k + second[j]], 0, 16);
    }
    /* Q's nine columns stand as rows, sixteen numbers each with a zero behind. Reflections turn them into a triangle; the
       same reflections, backwards, turn the last eleven unit vectors into rows of the orthonormal basis. */
    for (j = 0; j < 9; j++) {
        double size = 0, *column = Q + 16 * j, *v = mirror + 16 * j;
        for (i = 0; i < 16; i++)
            v[i] = i < j ? 0 : column[i];
        size = sqrt(arm_along(v, v, j & ~3, 16));
        if (!(size > 0))
            return 0;
        size = column[j] > 0 ? -size : size;
        factor[j] = 1 / (size * (size - column[j]));
        v[j] -= size;
        for (k = j; k < 9; k++)
            arm_subtract(Q + 16 * k, v, factor[j] * arm_along(v, Q + 16 * k, j & ~3, 16), j, 16);
    }
    for (k = 0; k < 11; k++) {
        double *row = basis + 16 * k;
        for (i = 0; i < 16; i++)
            row[i] = i == 4 + k ? 1 : 0;
        for (j = 8; j >= 0; j--)
            arm_subtract(row, mirror + 16 * j, factor[j] * arm_along(mirror + 16 * j, row, j & ~3, 16), j, 16);
    }
    for (i = 0; i < 6 * 16; i++)
        out->N[i] = basis[5 * 16 + i];
    for (i = 0; i < 5; i++)
        for (j = 0; j < 24; j++)
            system[24 * i + j] = j < 5 ? Q[16 * (4 + j) + 4 + i] : j < 8 ? 0 : basis[16 * i + j - 8];
    if (!arm_reduce(system, 5, 8, 24))
        return 0;
    for (i = 0; i < 5; i++)
        for (j = 0; j < 16; j++)
            out->recover[16 * i + j] = system[24 * i + 8 + j];
    return 1;
}
