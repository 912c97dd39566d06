/* Frames are 3 x 4, row by row: a rotation and a translation. */
static void arm_times(const double *a, const double *b, double *out)
{
    int i, j;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 4; j++)
            out[4 * i + j] = a[4 * i] * b[j] + a[4 * i + 1] * b[4 + j] + a[4 * i + 2] * b[8 + j]
                + (j == 3 ? a[4 * i + 3] : 0.0);
}

/* Z(q): a turn about z or a shift along it; the frame after it. */
static void arm_move(const double *a, double q, int slides, double *out)
{
    int i;
    if (slides) {
        for (i = 0; i < 12; i++)
            out[i] = a[i];
        for (i = 0; i < 3; i++)
            out[4 * i + 3] += q * a[4 * i + 2];
    } else {
        const double c = cos(q), s = sin(q);
        for (i = 0; i < 3; i++) {
            const double x = a[4 * i], y = a[4 * i + 1];
            out[4 * i] = c * x + s * y;
            out[4 * i + 1] = c * y - s * x;
            out[4 * i + 2] = a[4 * i + 2];
            out[4 * i + 3] = a[4 * i + 3];
        }
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

/* The fifteen numbers of a frame's z axis, a line: p, l, p.p, p.l, p x l, (p.p) l - 2 (p.l) p, 1. */
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
}

/* The 15 x 15 matrix by which a rigid motion acts on these numbers. */
static void arm_rep(const double *motion, double *out)
{
    double t[3], tR[3], square;
    int i, j;
    for (i = 0; i < 225; i++)
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
    out[15 * 6 + 6] = out[15 * 7 + 7] = out[15 * 14 + 14] = 1;
}

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

/* The twelve equations (4) of `armkin.inverse.elimination.pencil`, 12 x (12 + size). */
static void arm_equations(const arm_pencil *pencil, const double *Y, const double *N, double *out)
{
    const int m = pencil->rows, width = 2 * (12 + pencil->size);
    double moved[ARM_ROWS * 15], rows[ARM_ROWS * 2 * (12 + ARM_MOST)];
    int i, j, k;
    if (pencil->slot == 1) {
        double R[225];
        arm_rep(Y, R);
        for (i = 0; i < m; i++)
            for (j = 0; j < 15; j++) {
                moved[15 * i + j] = 0;
                for (k = 0; k < 15; k++)
                    moved[15 * i + j] += N[15 * i + k] * R[15 * k + j];
            }
        N = moved;
    }
    for (i = 0; i < m; i++) {
        double *row = rows + i * width;
        for (j = 0; j < width; j++)
            row[j] = 0;
        for (k = 0; k < 15; k++)
            arm_subtract(row, pencil->columns + k * width, -N[15 * i + k], 0, width);
    }
    if (!pencil->mix) {
        for (i = 0; i < 12 * (12 + pencil->size); i++)
            out[i] = rows[i];
        return;
    }
    for (i = 0; i < 12; i++)
        for (j = 0; j < width / 2; j++) {
            out[i * (width / 2) + j] = 0;
            for (k = 0; k < 2 * m; k++)
                out[i * (width / 2) + j] += pencil->mix[i * 2 * m + k] * rows[k * (width / 2) + j];
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

/* The joint values for a root x of the pencil; 0 if it is a slide at infinity. */
static int arm_joints_of(const arm_pencil *pencil, const double *E, const double *Y, const arm_ends *ends, double x,
    double *q)
{
    const int r = pencil->r, w = pencil->w, c = 12 + pencil->size, far = fabs(x) > 1;
    const int of_hidden = 2 + pencil->hidden, of_dialytic = 2 + pencil->dialytic;
    const int third = 3 - pencil->hidden - pencil->dialytic;
    const double y = far ? 1 / x : x, scale = (far ? x : 1) / (1 + x * x);
    double A[144], u[12], v[12], middle[3], a[12], b[12], f[15], m[5], part[6];
    double most = 0;
    int i, j, k, row = 0, column = 0;
    for (i = 0; i < 12; i++) { /* the equations at x, divided by x^2 if x is large */
        const double *e = E + i * c;
        for (j = 0; j < 2 * r; j++)
            A[12 * i + j] = far ? e[j] + e[12 + j] * y : e[j] * y + e[12 + j];
        for (j = 0; j < w; j++) {
            const double two = e[2 * r + j], one = e[12 + 2 * r + j], none = e[12 + 2 * r + w + j];
            A[12 * i + 2 * r + j] = far ? two + (one + none * y) * y : (two * y + one) * y + none;
        }
    }
    arm_null_vector(A, u);
    for (i = 0; i < 12; i++) {
        v[i] = 0;
        for (j = 0; j < r; j++) {
            const double a1 = u[j], a2 = u[r + j];
            v[i] += scale * ((a1 * x + a2) * pencil->K_re[i * r + j] - (a1 - a2 * x) * pencil->K_im[i * r + j]);
        }
        for (j = 0; j < w; j++)
            v[i] += pencil->W[i * w + j] * u[2 * r + j];
    }
    for (i = 0; i < 4; i++) { /* v is 4 x 3: its longest row and column are the safest */
        const double size = v[3 * i] * v[3 * i] + v[3 * i + 1] * v[3 * i + 1] + v[3 * i + 2] * v[3 * i + 2];
        if (size > most) {
            most = size;
            row = i;
        }
    }
    most = 0;
    for (j = 0; j < 3; j++) {
        const double size = v[j] * v[j] + v[3 + j] * v[3 + j] + v[6 + j] * v[6 + j] + v[9 + j] * v[9 + j];
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
        middle[pencil->dialytic] = arm_ratio_of(v + column, 4, 3);
    else
        middle[pencil->dialytic] = 2 * atan2(v[9 + column], v[6 + column]);
    if (pencil->slides[2 + third])
        middle[third] = arm_ratio_of(v + 3 * row, 3, 1);
    else {
        const double sign = v[3 * row] < 0 ? -1 : 1;
        middle[third] = atan2(sign * v[3 * row + 2], sign * v[3 * row + 1]);
    }
    for (i = 0; i < 3; i++)
        if (!(fabs(middle[i]) < 1e4))
            return 0;
#define ARM_LINK(i) ((i) == pencil->slot ? Y : pencil->links + 12 * (i))
    for (i = 0; i < 12; i++)
        a[i] = ARM_LINK(1)[i];
    for (k = 0; k < 3; k++) {
        arm_move(a, middle[k], pencil->slides[2 + k], b);
        arm_times(b, ARM_LINK(2 + k), a);
    }
    arm_features(a, f);
    for (i = 0; i < 5; i++) { /* 1, b1, b2, a1, a2 */
        m[i] = 0;
        for (k = 0; k < 15; k++)
            m[i] += ends->recover[15 * i + k] * f[k];
    }
    {
        const double sign = m[0] < 0 ? -1 : 1, one = fabs(m[0]) < 1e-300 ? 1 : m[0];
        double before[12], step[12], sine = 0, cosine = 0;
        part[0] = pencil->slides[0] ? m[3] / one : atan2(sign * m[4], sign * m[3]);
        part[1] = pencil->slides[1] ? m[1] / one : atan2(sign * m[2], sign * m[1]);
        arm_move(ARM_LINK(5), part[0], pencil->slides[0], step);
        arm_times(step, ARM_LINK(0), before);
        arm_move(before, part[1], pencil->slides[1], step);
        for (j = 0; j < 3; j++) { /* step A = Je^-1, a turn by -e about z */
            sine += step[j] * a[4 * j + 1] - step[4 + j] * a[4 * j];
            cosine += step[j] * a[4 * j] + step[4 + j] * a[4 * j + 1];
        }
        part[5] = atan2(sine, cosine);
    }
#undef ARM_LINK
    for (k = 0; k < 3; k++)
        part[2 + k] = middle[k];
    for (k = 0; k < 6; k++)
        q[pencil->order[k]] = pencil->backward ? -part[k] : part[k];
    return 1;
}

/* The chain's last frame and all joints' frames before they move (6 x 12); what is missing to the goal, linear first;
   returns the Frobenius norm of the difference. */
static double arm_missing(const double *q, const double *goal, double *frame, double *joints, double *error)
{
    double moved[12], square = 0;
    int i, j, k;
    for (i = 0; i < 12; i++)
        frame[i] = i % 5 == 0 ? 1 : 0;
    for (k = 0; k < 6; k++) {
        for (i = 0; i < 12; i++)
            joints[12 * k + i] = frame[i];
        arm_move(frame, q[k], arm_loop_slides[k], moved);
        if (k < 5)
            arm_times(moved, arm_loop_links + 12 * k, frame);
    }
    for (i = 0; i < 12; i++) {
        frame[i] = moved[i];
        square += (goal[i] - moved[i]) * (goal[i] - moved[i]);
    }
    for (i = 0; i < 3; i++) {
        const int x = (i + 1) % 3, y = (i + 2) % 3;
        error[i] = goal[4 * i + 3] - frame[4 * i + 3];
        error[3 + i] = 0;
        for (j = 0; j < 3; j++)
            error[3 + i] += 0.5 * (frame[4 * x + j] * goal[4 * y + j] - frame[4 * y + j] * goal[4 * x + j]);
    }
    return sqrt(square);
}

typedef struct {
    double q[6], residual, guess, weakness, key;
} arm_answer;

/* Newton's method, damped by the residual (Levenberg, Marquardt) if `damped`: the best point met. */
static void arm_refine(const double *goal, int steps, int damped, arm_answer *out)
{
    double q[6], inverse[36], last = 0;
    int i, j, k, step;
    for (i = 0; i < 6; i++)
        q[i] = out->q[i];
    out->residual = out->weakness = ARM_INFINITY;
    for (step = 0; step <= steps; step++) {
        double frame[12], joints[72], error[6], move[6], longest = 0;
        const double size = arm_missing(q, goal, frame, joints, error);
        if (step == 0)
            out->guess = size;
        if (size < out->residual) {
            out->residual = size;
            for (i = 0; i < 6; i++)
                out->q[i] = q[i];
        }
        if (step == 0 || (size > 1e-3 * last && size > 1e-14)) {
            double system[96], J[36];
            for (k = 0; k < 6; k++) {
                const double *f = joints + 12 * k;
                for (i = 0; i < 3; i++) {
                    const int x = (i + 1) % 3, y = (i + 2) % 3;
                    const double across = f[4 * x + 2] * (frame[4 * y + 3] - f[4 * y + 3])
                        - f[4 * y + 2] * (frame[4 * x + 3] - f[4 * x + 3]);
                    J[6 * i + k] = arm_loop_slides[k] ? f[4 * i + 2] : across;
                    J[6 * (3 + i) + k] = arm_loop_slides[k] ? 0 : f[4 * i + 2];
                }
            }
            for (i = 0; i < 6; i++)
                for (j = 0; j < 16; j++)
                    system[16 * i + j] = j < 6 ? J[6 * i + j] : (j - 8 == i ? 1 : 0);
            out->weakness = 0;
            if (!arm_reduce(system, 6, 8, 16)) {
                out->weakness = ARM_INFINITY;
                return;
            }
            for (i = 0; i < 6; i++)
                for (j = 0; j < 6; j++) {
                    inverse[6 * i + j] = system[16 * i + 8 + j];
                    out->weakness += inverse[6 * i + j] * inverse[6 * i + j];
                }
            out->weakness = sqrt(out->weakness);
            if (damped && step < steps - 2) {
                const double damping = size * (size < 1 ? size : 1);
                for (i = 0; i < 6; i++)
                    for (j = 0; j < 16; j++) {
                        double sum = i == j ? damping : 0;
                        for (k = 0; k < 6 && j < 6; k++)
                            sum += J[6 * k + i] * J[6 * k + j];
                        system[16 * i + j] = j < 8 || j > 13 ? sum : J[6 * (j - 8) + i];
                    }
                if (!arm_reduce(system, 6, 8, 16))
                    return;
                for (i = 0; i < 6; i++)
                    for (j = 0; j < 6; j++)
                        inverse[6 * i + j] = system[16 * i + 8 + j];
            }
        }
        if (!(size > 1e-14) || step == steps)
            return;
        last = size;
        for (i = 0; i < 6; i++) {
            move[i] = 0;
            for (j = 0; j < 6; j++)
                move[i] += inverse[6 * i + j] * error[j];
            longest = !(fabs(move[i]) <= longest) ? fabs(move[i]) : longest;
        }
        if (!(longest < ARM_INFINITY))
            return;
        for (i = 0; i < 6; i++)
            q[i] += longest > 0.5 ? move[i] * (0.5 / longest) : move[i];
    }
}

/* Turns in (-pi, pi], and the number by which answers are sorted. */
static void arm_sortable(arm_answer *answer)
{
    int k;
    answer->key = 0;
    for (k = 0; k < 6; k++) {
        double *q = &answer->q[k];
        if (!arm_loop_slides[k])
            *q -= ARM_TURN * floor((*q + ARM_PI) / ARM_TURN);
        answer->key += arm_weights[k] * (arm_loop_slides[k] ? *q : cos(*q));
        answer->key += arm_weights[6 + k] * (arm_loop_slides[k] ? 0 : sin(*q));
    }
}

/* One pass over a pose: its answers (`found`, from `count` on), and whether the pass leaves it open; *touching: two
   roots just touch, or just miss each other. */
static int arm_attempt(const double *goal, int pass, arm_answer *found, int *count, int *touching)
{
    const arm_pencil *pencil = &arm_pencils[arm_plan[pass]];
    const double shake = arm_shakes[pass];
    const int careful = pass > 0;
    const int size = pencil->size, lead = 12, c = 12 + size, wide = 12 + ARM_MOST, begin = *count;
    double moved[12], back[12], E[12 * (12 + ARM_MOST)], G[12 * (12 + ARM_MOST)], C[ARM_MOST * ARM_MOST];
    double re[ARM_MOST], im[ARM_MOST], most = 0, hidden[ARM_MOST];
    unsigned char blurred[ARM_MOST], real[ARM_MOST];
    arm_ends ends;
    int i, j, k, open = 0;
    arm_times(arm_shaking + 12 * pass, goal, moved);
    arm_invert(moved, back); /* the pose link closes the loop */
    if (pencil->backward)
        for (i = 0; i < 12; i++)
            back[i] = moved[i];
    if (!arm_eliminate(pencil, back, &ends))
        return 1;
    arm_equations(pencil, back, ends.N, E);
    for (i = 0; i < 12; i++)
        for (j = 0; j < wide; j++)
            G[i * wide + j] = j < c ? E[i * c + j] : 0;
    if (!arm_reduce(G, lead, lead, wide))
        return 1;
    for (i = 0; i < size * ARM_MOST; i++)
        C[i] = 0;
    for (i = 0; i < lead; i++)
        for (j = 0; j < size; j++) {
            C[i * ARM_MOST + j] = -G[i * wide + lead + j];
            most = fabs(G[i * wide + lead + j]) > most ? fabs(G[i * wide + lead + j]) : most;
        }
    for (i = 0; i < size - lead; i++)
        C[(lead + i) * ARM_MOST + 2 * pencil->r + i] = 1;
    if (!(most <= 1e6)) {
        open = 1;
        if (!(most < 1e300))
            return 1;
    }
    arm_balance(C, size);
    arm_hessenberg(C, size);
    if (!arm_eigenvalues(C, size, re, im))
        return 1;
    for (i = 0; i < size; i++) {
        const double tilt = 2 * fabs(im[i]) / (1 + re[i] * re[i] + im[i] * im[i]);
        arm_answer *one = &found[*count];
        int good;
        if (!(im[i] >= 0) || !(tilt < (careful ? 0.3 : 0.02)) || *count >= ARM_ANSWERS)
            continue;
        if (!arm_joints_of(pencil, E, back, &ends, re[i], one->q))
            continue;
        hidden[*count - begin] = one->q[pencil->order[2 + pencil->hidden]];
        arm_refine(goal, careful ? 12 : 4, careful, one);
        good = one->residual < (careful ? 3e-9 : 1e-10);
        if (!good && (tilt < 1e-4 || one->residual < (careful ? 1e-5 : 1e-3)))
            open = 1; /* a complex pair that steps brought near the pose may be a real one, seen through rounding */
        if (good && tilt > 0 && tilt < 1e-4 + 10 * sqrt(shake))
            open = 1; /* a move of the pose may turn two close real roots into such a pair */
        if (good && !(tilt > 0) && one->guess > 1e-3 + 30 * shake)
            open = 1; /* a real root far from the answer it led to may have stood for another one */
        if ((good && tilt > 0 && tilt < 1e-4) || (one->residual > 1e-10 && one->residual < 3e-6))
            *touching = 1;
        if (!good)
            continue;
        blurred[*count - begin] = one->guess > 1e-5 + 10 * shake;
        real[*count - begin] = !(tilt > 0);
        arm_sortable(one);
        ++*count;
    }
    /* Two roots that share the hidden joint: good if both were near an answer at once, and, of real ones, if these are not
       the same. */
    for (j = begin; j < *count; j++)
        for (k = begin; k < j; k++) {
            const int close = fabs(hidden[j - begin] - hidden[k - begin]) < 1e-4;
            const int same = fabs(found[j].key - found[k].key) < 1e-5 && real[j - begin] && real[k - begin];
            if ((close && (blurred[j - begin] || blurred[k - begin])) || same)
                open = 1;
        }
    return open;
}

/* Sort answers by their key and keep one of each set of equal ones; *merged: some were further apart than rounding. */
static int arm_merge(const double *goal, arm_answer *found, int count, int *merged)
{
    unsigned char gone[ARM_ANSWERS];
    int i, j, k, kept = 0;
    for (i = 1; i < count; i++) {
        const arm_answer one = found[i];
        for (j = i; j > 0 && found[j - 1].key > one.key; j--)
            found[j] = found[j - 1];
        found[j] = one;
    }
    for (i = 0; i < count; i++)
        gone[i] = 0;
    for (i = 0; i < count; i++)
        for (j = i + 1; j < count; j++) {
            double step[6], half[6], frame[12], joints[72], error[6], distance = 0, blur, radius, other;
            if (gone[i] || gone[j] || found[j].key - found[i].key > 0.1)
                continue;
            for (k = 0; k < 6; k++) {
                step[k] = found[j].q[k] - found[i].q[k];
                if (!arm_loop_slides[k])
                    step[k] -= ARM_TURN * rint(step[k] / ARM_TURN);
                half[k] = found[i].q[k] + step[k] / 2;
                distance = fabs(step[k]) > distance ? fabs(step[k]) : distance;
            }
            if (!(distance < 1e-2))
                continue;
            blur = 4 * (found[i].residual > found[j].residual ? found[i].residual : found[j].residual);
            radius = 3 * found[i].weakness * found[i].residual;
            other = 3 * found[j].weakness * found[j].residual;
            radius = other > radius ? other : radius;
            if (distance < (radius > 1e-6 ? radius : 1e-6)
                || arm_missing(half, goal, frame, joints, error) < (blur > 1e-13 ? blur : 1e-13)) {
                gone[found[j].residual > found[i].residual ? j : i] = 1;
                if (distance > 1e-8)
                    *merged = 1;
            }
        }
    for (i = 0; i < count; i++)
        if (!gone[i])
            found[kept++] = found[i];
    return kept;
}

/* As of a closed form. goal: twelve numbers, columns x, y, z and the position [mm]. doubt: an answer near a
   singularity, merged answers, touching roots, or a pose that no pass has settled. */
static void arm_candidates(const double *ARM_RESTRICT goal, const double *ARM_RESTRICT near, double *ARM_RESTRICT q,
    double *ARM_RESTRICT miss, int *ARM_RESTRICT doubt, int count)
{
    double target[12], scaled[12], there[12];
    arm_answer found[ARM_ANSWERS];
    int i, j, k, pass, number = 0, open = 1, edge = 0, exact = 0;
    (void)near;
    (void)count;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 4; j++)
            target[4 * i + j] = goal[3 * j + i] / (j == 3 ? ARM_LENGTH : 1);
    arm_times(arm_from_base, target, scaled);
    arm_times(scaled, arm_from_tool, there);
    for (pass = 0; pass < ARM_PASSES && open; pass++)
        open = arm_attempt(there, pass, found, &number, &edge);
    for (i = 0; i < number; i++)
        exact += found[i].residual < 1e-10;
    for (i = k = 0; i < number; i++) /* a closest point stands in for answers only where there are none */
        if (!exact || found[i].residual < 1e-10)
            found[k++] = found[i];
    number = arm_merge(there, found, k, &edge);
    for (i = 0; i < number; i++)
        edge |= !(found[i].weakness <= 1e4);
    *doubt = edge || open || number > ARM_BRANCHES;
    for (i = 0; i < ARM_BRANCHES; i++) {
        miss[i] = i < number ? 0 : ARM_INFINITY;
        for (j = 0; j < ARM_JOINTS; j++)
            q[i * ARM_JOINTS + j] = i < number ? found[i].q[j] * (arm_loop_slides[j] ? ARM_LENGTH : 1) : 0;
        if (i < number)
            miss[i] = found[i].residual * found[i].residual * ARM_RESIDUAL;
    }
}
