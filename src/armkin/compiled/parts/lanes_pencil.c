/* What one pass says of some poses: the pose links Y, what removes the end joints and gives them back (as `arm_ends`, rows of
   fifteen), and the equations; open: of a pose whose pencil is nearly singular, lost: of one that takes the plain way. */
typedef struct {
    arm_many goal[12], Y[12], N[ARM_ROWS * 15], recover[5 * 15], E[ARM_PRODUCTS * (ARM_PRODUCTS + ARM_MOST)];
    arm_many re[ARM_MOST], im[ARM_MOST], most;
    arm_flags open, lost;
} arm_many_poses;

/* As `arm_rep`, rows of fifteen. */
static void arm_rep_lanes(const arm_many *motion, arm_many *out)
{
    arm_many t[3], tR[3], square;
    int i, j;
    for (i = 0; i < 225; i++)
        out[i] = arm_all(0);
    for (i = 0; i < 3; i++)
        t[i] = motion[4 * i + 3];
    square = t[0] * t[0] + t[1] * t[1] + t[2] * t[2];
    for (j = 0; j < 3; j++)
        tR[j] = t[0] * motion[j] + t[1] * motion[4 + j] + t[2] * motion[8 + j];
    for (i = 0; i < 3; i++) {
        for (j = 0; j < 3; j++) {
            const arm_many R = motion[4 * i + j];
            const arm_many across = t[(i + 1) % 3] * motion[4 * ((i + 2) % 3) + j]
                - t[(i + 2) % 3] * motion[4 * ((i + 1) % 3) + j];
            out[15 * i + j] = out[15 * (3 + i) + 3 + j] = out[15 * (8 + i) + 8 + j] = out[15 * (11 + i) + 11 + j] = R;
            out[15 * (8 + i) + 3 + j] = across;
            out[15 * (11 + i) + 8 + j] = -2 * across;
            out[15 * (11 + i) + 3 + j] = square * R - 2 * t[i] * tR[j];
        }
        out[15 * i + 14] = t[i];
        out[15 * 6 + i] = 2 * tR[i];
        out[15 * 7 + 3 + i] = tR[i];
        out[15 * (11 + i) + 7] = -2 * t[i];
    }
    out[15 * 6 + 14] = square;
    out[15 * 6 + 6] = out[15 * 7 + 7] = out[15 * 14 + 14] = arm_all(1);
}

/* As `arm_features`. */
static void arm_features_lanes(const arm_many *frame, arm_many *out)
{
    const arm_many p[3] = {frame[3], frame[7], frame[11]}, l[3] = {frame[2], frame[6], frame[10]};
    const arm_many square = p[0] * p[0] + p[1] * p[1] + p[2] * p[2], along = p[0] * l[0] + p[1] * l[1] + p[2] * l[2];
    int i;
    for (i = 0; i < 3; i++) {
        out[i] = p[i];
        out[3 + i] = l[i];
        out[8 + i] = p[(i + 1) % 3] * l[(i + 2) % 3] - p[(i + 2) % 3] * l[(i + 1) % 3];
        out[11 + i] = square * l[i] - 2 * along * p[i];
    }
    out[6] = square;
    out[7] = along;
    out[14] = arm_all(1);
}

/* As `arm_eliminate`. */
static void arm_eliminate_lanes(const arm_pencil *pencil, arm_many_poses *of)
{
    static const unsigned char first[9] = {1, 1, 2, 2, 0, 1, 2, 0, 0}, second[9] = {1, 2, 1, 2, 0, 0, 0, 1, 2};
    arm_many back[12], a[15 * 24];
    int i, j, k;
    if (pencil->slot == 1) {
        arm_many R[225];
        arm_rep_lanes(of->Y, R);
        for (i = 0; i < pencil->rows; i++)
            for (j = 0; j < 15; j++) {
                arm_many sum = arm_all(0);
                for (k = 0; k < 15; k++)
                    sum += pencil->N[16 * i + k] * R[15 * k + j];
                of->N[15 * i + j] = sum;
            }
        for (i = 0; i < 5; i++)
            for (j = 0; j < 15; j++)
                of->recover[15 * i + j] = arm_all(pencil->recover[16 * i + j]);
        return;
    }
    for (i = 0; i < 3; i++) {
        for (j = 0; j < 3; j++)
            back[4 * i + j] = of->Y[4 * j + i];
        back[4 * i + 3] = -(of->Y[i] * of->Y[3] + of->Y[4 + i] * of->Y[7] + of->Y[8 + i] * of->Y[11]);
    }
    for (i = 0; i < 15 * 24; i++)
        a[i] = arm_all(i % 24 == 9 + i / 24 ? 1 : 0);
    if (pencil->slot == 5) {
        arm_many f[15];
        arm_features_lanes(back, f);
        for (k = 0; k < 15; k++)
            for (j = 0; j < 9; j++)
                for (i = 0; i < 15; i++)
                    a[24 * i + j] += f[k] * pencil->first[9 * 16 * k + 16 * j + i];
    } else {
        arm_many R[225], turned[15 * 3];
        arm_rep_lanes(back, R);
        for (i = 0; i < 15; i++)
            for (j = 0; j < 3; j++) {
                arm_many sum = arm_all(0);
                for (k = 0; k < 15; k++)
                    sum += R[15 * i + k] * pencil->second[4 * k + j];
                turned[3 * i + j] = sum;
            }
        for (j = 0; j < 9; j++)
            for (k = 0; k < 15; k++)
                for (i = 0; i < 15; i++) {
                    const double share = pencil->first[16 * (15 * first[j] + k) + i];
                    if (share < 0 || share > 0)
                        a[24 * i + j] += turned[3 * k + second[j]] * share;
                }
    }
    arm_triangle_lanes(a, 15, 9, 24);
    for (i = 0; i < 6; i++)
        for (j = 0; j < 15; j++)
            of->N[15 * i + j] = a[24 * (9 + i) + 9 + j];
    arm_solve_lanes(a + 24 * 4 + 4, 5, 5, 20, 24);
    for (i = 0; i < 5; i++)
        for (j = 0; j < 15; j++)
            of->recover[15 * i + j] = a[24 * (4 + i) + 9 + j];
}

/* As `arm_equations`, of N that is moved. */
static void arm_equations_lanes(const arm_pencil *pencil, arm_many_poses *of)
{
    const int m = pencil->rows, p = pencil->wide ? 16 : 12, factors = pencil->wide ? 4 : 2, c = p + pencil->size;
    const int width = factors * c;
    arm_many mixed[ARM_ROWS * ARM_WIDTH], *rows = pencil->mix ? mixed : of->E;
    int i, j, k;
    for (j = 0; j < width; j++) {
        arm_many sum[ARM_ROWS];
        for (i = 0; i < ARM_ROWS; i++)
            sum[i] = arm_all(0);
        for (k = 0; k < 15; k++) {
            const double share = pencil->columns[k * width + j];
            if (share < 0 || share > 0)
                for (i = 0; i < m; i++)
                    sum[i] += share * of->N[15 * i + k];
        }
        for (i = 0; i < m; i++)
            rows[i * width + j] = sum[i];
    }
    if (!pencil->mix)
        return;
    for (i = 0; i < p * c; i++)
        of->E[i] = arm_all(0);
    for (i = 0; i < p; i++)
        for (k = 0; k < factors * m; k++) {
            const double share = pencil->mix[i * factors * m + k];
            for (j = 0; j < c && (share < 0 || share > 0); j++)
                of->E[i * c + j] += share * mixed[k * c + j];
        }
}

/* The roots of some poses' pencils. */
static void arm_roots_lanes(const arm_pencil *pencil, arm_many_poses *of)
{
    const int size = pencil->size, p = pencil->wide ? 16 : 12, c = p + size, row = size + 1;
    arm_many G[ARM_PRODUCTS * (ARM_PRODUCTS + ARM_MOST)], C[(ARM_MOST + 1) * (ARM_MOST + 1)];
    int i, j;
    arm_eliminate_lanes(pencil, of);
    arm_equations_lanes(pencil, of);
    for (i = 0; i < p * c; i++)
        G[i] = of->E[i];
    arm_triangle_lanes(G, p, p, c);
    of->open = of->lost = (arm_flags){0};
    for (i = 0; i < p; i++)
        of->open |= ~(arm_flags)(arm_size(G[i * c + i]) > 1e-11);
    arm_solve_lanes(G, p, p, c, c);
    for (i = 0; i < row * row; i++)
        C[i] = arm_all(0);
    of->most = arm_all(0);
    for (i = 0; i < p; i++)
        for (j = 0; j < size; j++) {
            const arm_many one = arm_size(G[i * c + p + j]);
            C[i * row + j] = -G[i * c + p + j];
            of->most = arm_pick((arm_flags)(one <= of->most), of->most, one);
        }
    for (i = 0; i < size - p; i++)
        C[(p + i) * row + 2 * pencil->r + i] = arm_all(1);
    of->lost = ~(arm_flags)(of->most < 1e300);
    of->open |= ~(arm_flags)(of->most <= 1e6);
    for (i = 0; i < row * row; i++) /* no lane keeps others waiting */
        C[i] = (arm_many)((arm_flags)C[i] & ~of->lost);
    arm_balance_lanes(C, size);
    arm_hessenberg_lanes(C, size);
    of->lost |= arm_eigenvalues_lanes(C, size, of->re, of->im);
}
