/* The p equations (4) of `armkin.inverse.elimination.pencil`, p x (p + size); p = 12, 16 of a wide role. */
static void arm_equations(const arm_pencil *pencil, const double *Y, const double *N, double *out)
{
    const int m = pencil->rows, p = pencil->wide ? 16 : 12, factors = pencil->wide ? 4 : 2, c = p + pencil->size;
    const int width = factors * c;
    double moved[ARM_ROWS * 16], rows[ARM_ROWS * ARM_WIDTH];
    int i, j, k;
    if (pencil->slot == 1) {
        double R[15 * 16];
        arm_rep(Y, R);
        for (i = 0; i < m * 16; i++)
            moved[i] = 0;
        for (i = 0; i < m; i++)
            for (k = 0; k < 15; k++)
                arm_subtract(moved + 16 * i, R + 16 * k, -N[16 * i + k], 0, 16);
        N = moved;
    }
    for (i = 0; i < m; i++) {
        double *row = rows + i * width;
        for (j = 0; j < width; j++)
            row[j] = 0;
        for (k = 0; k < 15; k++)
            arm_subtract(row, pencil->columns + k * width, -N[16 * i + k], 0, width);
    }
    if (!pencil->mix) {
        for (i = 0; i < p * c; i++)
            out[i] = rows[i];
        return;
    }
    for (i = 0; i < p * c; i++)
        out[i] = 0;
    for (i = 0; i < p; i++)
        for (k = 0; k < factors * m; k++) {
            const double share = pencil->mix[i * factors * m + k], *row = rows + k * c;
            if (share < 0 || share > 0)
                for (j = 0; j < c; j++)
                    out[i * c + j] += share * row[j];
        }
}

/* q from multiples of 1, q, q^2, ...: the least-squares quotient of neighbours. */
static double arm_ratio_of(const double *power, int count, int step)
{
    double above = 0, below = 0;
    int i;
    for (i = 0; i + 1 < count; i++) {
        above += power[i * step] * power[(i + 1) * step];
        below += power[i * step] * power[i * step];
    }
    return above / (below > 1e-300 ? below : 1e-300);
}

/* (cos 3f, sin 3f, cos f, sin f) of f = q / 2. */
static void arm_half_powers(double q, double *out)
{
    double angle[8] = {0, 0, 0, 0, 0, 0, 0, 0}, cosine[8], sine[8];
    angle[0] = 1.5 * q;
    angle[1] = 0.5 * q;
    arm_turns(angle, cosine, sine);
    out[0] = cosine[0];
    out[1] = sine[0];
    out[2] = cosine[1];
    out[3] = sine[1];
}

/* The equations at x, p x p, divided by x^2 if x is large. */
static void arm_system_at(const arm_pencil *pencil, const double *E, double x, double *A)
{
    const int r = pencil->r, w = pencil->w, p = pencil->wide ? 16 : 12, c = p + pencil->size, far = fabs(x) > 1;
    const double y = far ? 1 / x : x;
    int i, j;
    for (i = 0; i < p; i++) {
        const double *e = E + i * c;
        for (j = 0; j < 2 * r; j++)
            A[p * i + j] = far ? e[j] + e[p + j] * y : e[j] * y + e[p + j];
        for (j = 0; j < w; j++) {
            const double two = e[2 * r + j], one = e[p + 2 * r + j], none = e[p + 2 * r + w + j];
            A[p * i + 2 * r + j] = far ? two + (one + none * y) * y : (two * y + one) * y + none;
        }
    }
}

/* The products v, p numbers, of a root x and what the equations there take to zero. */
static void arm_vector(const arm_pencil *pencil, const double *u, double x, double *v)
{
    const int r = pencil->r, w = pencil->w, p = pencil->wide ? 16 : 12;
    const double scale = (fabs(x) > 1 ? x : 1) / (1 + x * x);
    int i, j;
    for (i = 0; i < p; i++) {
        v[i] = 0;
        for (j = 0; j < r; j++) {
            const double a1 = u[j], a2 = u[r + j];
            v[i] += scale * ((a1 * x + a2) * pencil->K_re[i * r + j] - (a1 - a2 * x) * pencil->K_im[i * r + j]);
        }
        for (j = 0; j < w; j++)
            v[i] += pencil->W[i * w + j] * u[2 * r + j];
    }
}

/* The joint values for a root x of the pencil and its products v; 0 if it is a slide at infinity. *defect: the squared sine
   between v and the product that a solution's is; 0 where slides move. */
static int arm_joints_from(const arm_pencil *pencil, const double *v, const double *Y, const arm_ends *ends, double x,
    double *q, double *defect)
{
    const int p = pencil->wide ? 16 : 12, three = p / 4;
    const int of_hidden = 2 + pencil->hidden, of_dialytic = 2 + pencil->dialytic;
    const int third = 3 - pencil->hidden - pencil->dialytic;
    double middle[3], a[12], b[12], f[16], m[5], part[8], cosine[8], sine[8];
    double most = 0, whole = 0;
    int i, j, k, row = 0, column = 0;
    for (i = 0; i < 4; i++) { /* v is 4 x 3, 4 x 4 of a wide role: its longest row and column are the safest */
        double size = 0;
        for (j = 0; j < three; j++)
            size += v[three * i + j] * v[three * i + j];
        whole += size;
        if (size > most) {
            most = size;
            row = i;
        }
    }
    most = 0;
    for (j = 0; j < three; j++) {
        double size = 0;
        for (i = 0; i < 4; i++)
            size += v[three * i + j] * v[three * i + j];
        if (size > most) {
            most = size;
            column = j;
        }
    }
    if (pencil->slides[of_hidden])
        middle[pencil->hidden] = pencil->psi + 1 / (fabs(x) < 1e-100 ? 1e-100 : x);
    else
        middle[pencil->hidden] = pencil->psi + 2 * atan(x);
    if (pencil->slides[of_dialytic])
        middle[pencil->dialytic] = arm_ratio_of(v + column, 4, three);
    else
        middle[pencil->dialytic] = 2 * atan2(v[3 * three + column], v[2 * three + column]);
    if (pencil->slides[2 + third])
        middle[third] = arm_ratio_of(v + three * row, three, 1);
    else if (pencil->wide)
        middle[third] = 2 * atan2(v[4 * row + 3], v[4 * row + 2]);
    else {
        const double sign = v[3 * row] < 0 ? -1 : 1;
        middle[third] = atan2(sign * v[3 * row + 2], sign * v[3 * row + 1]);
    }
    for (i = 0; i < 3; i++)
        if (!(fabs(middle[i]) < ARM_INFINITE_SLIDE))
            return 0;
    for (i = 0; i < 8; i++)
        part[i] = i < 3 ? middle[i] : 0;
    arm_turns(part, cosine, sine);
    *defect = 0;
    if (!pencil->slides[of_dialytic] && !pencil->slides[2 + third]) {
        double first[4], second[4], along = 0;
        arm_half_powers(middle[pencil->dialytic], first);
        arm_half_powers(middle[third], second);
        if (!pencil->wide) {
            second[0] = 1;
            second[1] = cosine[third];
            second[2] = sine[third];
        }
        for (i = 0; i < 4; i++)
            for (j = 0; j < three; j++)
                along += v[three * i + j] * first[i] * second[j];
        *defect = 1 - along * along / (4 * (whole > 1e-300 ? whole : 1e-300));
    }
#define ARM_LINK(i) ((i) == pencil->slot ? Y : pencil->links + 12 * (i))
    for (i = 0; i < 12; i++)
        a[i] = ARM_LINK(1)[i];
    for (k = 0; k < 3; k++) {
        arm_move(a, pencil->slides[2 + k], middle[k], cosine[k], sine[k], b);
        arm_times(b, ARM_LINK(2 + k), a);
    }
    arm_features(a, f);
    for (i = 0; i < 5; i++) /* 1, b1, b2, a1, a2 */
        m[i] = arm_along(ends->recover + 16 * i, f, 0, 16);
    {
        const double sign = m[0] < 0 ? -1 : 1, one = fabs(m[0]) < 1e-300 ? 1 : m[0];
        double before[12], step[12], across = 0, along = 0;
        part[0] = pencil->slides[0] ? m[3] / one : atan2(sign * m[4], sign * m[3]);
        part[1] = pencil->slides[1] ? m[1] / one : atan2(sign * m[2], sign * m[1]);
        arm_turns(part, cosine, sine);
        arm_move(ARM_LINK(5), pencil->slides[0], part[0], cosine[0], sine[0], step);
        arm_times(step, ARM_LINK(0), before);
        arm_move(before, pencil->slides[1], part[1], cosine[1], sine[1], step);
        for (j = 0; j < 3; j++) { /* step A = Je^-1, a turn by -e about z */
            across += step[j] * a[4 * j + 1] - step[4 + j] * a[4 * j];
            along += step[j] * a[4 * j] + step[4 + j] * a[4 * j + 1];
        }
        part[5] = atan2(across, along);
    }
#undef ARM_LINK
    for (k = 0; k < 3; k++)
        part[2 + k] = middle[k];
    for (k = 0; k < 6; k++)
        q[pencil->order[k]] = pencil->backward ? -part[k] : part[k];
    return 1;
}

/* The same of a root's own vector. */
static int arm_joints_of(const arm_pencil *pencil, const double *E, const double *Y, const arm_ends *ends, double x,
    double *q, double *defect)
{
    double A[256], u[16], v[16];
    arm_system_at(pencil, E, x, A);
    if (pencil->wide)
        arm_null_vector(A, u, 16);
    else
        arm_null_vector(A, u, 12);
    arm_vector(pencil, u, x, v);
    return arm_joints_from(pencil, v, Y, ends, x, q, defect);
}
