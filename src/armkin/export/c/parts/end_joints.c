/* What a pose says of the two end joints: N, six rows that remove them, and what gives them back: five rows, or the
   reflections of an orthogonal triangularisation and its last triangle. */
typedef struct {
    double N[ARM_ROWS * 15], recover[5 * 15];
} arm_ends;

static int arm_eliminate(const arm_pencil *pencil, const double *Y, arm_ends *out)
{
    static const unsigned char first[9] = {1, 1, 2, 2, 0, 1, 2, 0, 0}, second[9] = {1, 2, 1, 2, 0, 0, 0, 1, 2};
    double back[12], Q[9 * 15], basis[11 * 15], system[5 * 24];
    int i, j, k;
    if (pencil->slot == 1) {
        for (i = 0; i < pencil->rows * 15; i++)
            out->N[i] = pencil->N[i];
        for (i = 0; i < 75; i++)
            out->recover[i] = pencil->recover[i];
        return 1;
    }
    arm_invert(Y, back);
    if (pencil->slot == 5) {
        double f[15];
        arm_features(back, f);
        for (i = 0; i < 9 * 15; i++) {
            Q[i] = 0;
            for (k = 0; k < 15; k++)
                Q[i] += pencil->first[15 * i + k] * f[k];
        }
    } else {
        double R[225], turned[45];
        arm_rep(back, R);
        for (i = 0; i < 45; i++) {
            turned[i] = 0;
            for (k = 0; k < 15; k++)
                turned[i] += R[15 * (i / 3) + k] * pencil->second[3 * k + i % 3];
        }
        for (j = 0; j < 9; j++)
            for (i = 0; i < 15; i++) {
                Q[15 * j + i] = 0;
                for (k = 0; k < 15; k++)
                    Q[15 * j + i] += pencil->first[15 * (15 * first[j] + i) + k] * turned[3 * k + second[j]];
            }
    }
    /* Q's nine columns stand as rows. Reflections turn them into a triangle; the same reflections, backwards, turn the
       last eleven unit vectors into rows of the orthonormal basis. */
    {
        double v[9][15], factor[9];
        for (j = 0; j < 9; j++) {
            double size = 0, *column = Q + 15 * j;
            for (i = j; i < 15; i++)
                size += column[i] * column[i];
            size = sqrt(size);
            if (!(size > 0))
                return 0;
            if (column[j] > 0)
                size = -size;
            factor[j] = 1 / (size * (size - column[j]));
            for (i = 0; i < 15; i++)
                v[j][i] = i < j ? 0 : column[i];
            v[j][j] -= size;
            for (k = j; k < 9; k++) {
                double along = 0;
                for (i = j; i < 15; i++)
                    along += v[j][i] * Q[15 * k + i];
                along *= factor[j];
                for (i = j; i < 15; i++)
                    Q[15 * k + i] -= along * v[j][i];
            }
        }
        for (k = 0; k < 11; k++) {
            double *row = basis + 15 * k;
            for (i = 0; i < 15; i++)
                row[i] = i == 4 + k ? 1 : 0;
            for (j = 8; j >= 0; j--) {
                double along = 0;
                for (i = j; i < 15; i++)
                    along += v[j][i] * row[i];
                along *= factor[j];
                for (i = j; i < 15; i++)
                    row[i] -= along * v[j][i];
            }
        }
    }
    for (i = 0; i < 6 * 15; i++)
        out->N[i] = basis[5 * 15 + i];
    for (i = 0; i < 5; i++)
        for (j = 0; j < 24; j++)
            system[24 * i + j] = j < 5 ? Q[15 * (4 + j) + 4 + i] : (j < 8 || j == 23 ? 0 : basis[15 * i + j - 8]);
    if (!arm_reduce(system, 5, 8, 24))
        return 0;
    for (i = 0; i < 5; i++)
        for (j = 0; j < 15; j++)
            out->recover[15 * i + j] = system[24 * i + 8 + j];
    return 1;
}

