/* Postures of one target in lanes, moved onto the curves of its answers, and cubics between such points: the code of
   `armkin.inverse.redundant.curve_points`. All joints are revolute; goal: columns x, y, z and the position [mm]. */
#define ARM_UNROLL _Pragma("GCC unroll 16") /* loops over rows and columns become straight lines */
enum { ARM_ROWS = ARM_JOINTS, ARM_ROW = ARM_JOINTS + 2 }; /* the chain's equations and one more; their right sides */

/* Postures q [rad] with unit tangents of their curves, and the sizes of the last steps there. */
typedef struct {
    arm_many q[ARM_JOINTS], tangent[ARM_JOINTS], step;
} arm_points;

/* Cubics from postures q along their chords, with the derivatives at both ends. */
typedef struct {
    arm_many q[ARM_JOINTS], chord[ARM_JOINTS], begin[ARM_JOINTS], end[ARM_JOINTS];
} arm_ways;

/* How many of those that are left fit into lanes. */
ARM_INLINE int arm_few(int left)
{
    return left < ARM_MANY ? left : ARM_MANY;
}

ARM_INLINE arm_many arm_wrapped(arm_many angle)
{
    return angle - ARM_TURN * arm_whole(angle * (1 / ARM_TURN));
}

ARM_INLINE arm_many arm_less(arm_many a, arm_many b)
{
    return arm_pick((arm_flags)(a < b), a, b);
}

ARM_INLINE arm_many arm_dot(const arm_many *a, const arm_many *b)
{
    arm_many sum = a[0] * b[0];
    int j;
    for (j = 1; j < ARM_JOINTS; j++)
        sum += a[j] * b[j];
    return sum;
}

/* The largest difference of joints modulo whole turns. */
ARM_INLINE arm_many arm_apart(const arm_many *a, const arm_many *b)
{
    arm_many most = arm_size(arm_wrapped(a[0] - b[0]));
    int j;
    for (j = 1; j < ARM_JOINTS; j++)
        most = arm_larger(most, arm_size(arm_wrapped(a[j] - b[j])));
    return most;
}

/* Differences of poses T, row by row, to the goal: r, lengths in reaches, then the turn's axes times their sines;
   returns the trace of the turn. */
ARM_INLINE arm_many arm_differences(const double *goal, const arm_many *T, arm_many *r)
{
    arm_many C[9];
    int i, j;
    for (i = 0; i < 3; i++) {
        r[i] = (goal[9 + i] - T[4 * i + 3]) * (1 / ARM_REACH_LENGTH);
        for (j = 0; j < 3; j++)
            C[3 * i + j] = T[4 * i] * goal[j] + T[4 * i + 1] * goal[3 + j] + T[4 * i + 2] * goal[6 + j];
    }
    r[3] = 0.5 * (C[5] - C[7]);
    r[4] = 0.5 * (C[6] - C[2]);
    r[5] = 0.5 * (C[1] - C[3]);
    return C[0] + C[4] + C[8];
}

/* Squared sizes of the residuals, lengths in reaches; infinite where the tool is turned far. */
static arm_many arm_misses(const double *goal, const arm_many *q)
{
    arm_many c[ARM_JOINTS], s[ARM_JOINTS], T[12], r[6], trace, sum;
    int i;
    for (i = 0; i < ARM_JOINTS; i++)
        arm_turn_lanes(q[i], &c[i], &s[i]);
    arm_tip_lanes(c, s, T);
    trace = arm_differences(goal, T, r);
    sum = r[0] * r[0];
    for (i = 1; i < 6; i++)
        sum += r[i] * r[i];
    return arm_pick((arm_flags)(trace > 1), sum, arm_all(ARM_INFINITY));
}

/* Rows of the chain's Jacobian, lengths in reaches, with the residual and zero as right sides. */
static void arm_equations(const double *goal, const arm_many *q, arm_many *a)
{
    arm_many c[ARM_JOINTS], s[ARM_JOINTS], T[12], J[6 * ARM_JOINTS], r[6], trace;
    arm_flags far;
    int i, j;
    for (i = 0; i < ARM_JOINTS; i++)
        arm_turn_lanes(q[i], &c[i], &s[i]);
    arm_slope_lanes(c, s, T, J);
    trace = arm_differences(goal, T, r);
    far = (arm_flags)(trace < 3 - ARM_SMALL_TURN);
    if (arm_any(far)) {
        const arm_many sine = arm_roots(r[3] * r[3] + r[4] * r[4] + r[5] * r[5]);
        const arm_many angle = arm_angle_lanes(sine, 0.5 * (trace - 1)) / arm_larger(sine, arm_all(ARM_TINY));
        const arm_many factor = arm_pick(far, angle, arm_all(1));
        for (i = 3; i < 6; i++)
            r[i] *= factor;
    }
    for (i = 0; i < 6; i++) {
        for (j = 0; j < ARM_JOINTS; j++)
            a[i * ARM_ROW + j] = i < 3 ? J[i * ARM_JOINTS + j] * (1 / ARM_REACH_LENGTH) : J[i * ARM_JOINTS + j];
        a[i * ARM_ROW + ARM_JOINTS] = r[i];
        a[i * ARM_ROW + ARM_JOINTS + 1] = arm_all(0);
    }
}

/* Reflections (Householder) that turn the rows' first columns into a triangle, then the right sides into solutions: as
   `arm_triangle_lanes`, but of a size that compilers know, with sums that do not wait for each other. */
static void arm_solve_rows(arm_many *a)
{
    int i, j, k;
    ARM_UNROLL for (k = 0; k < ARM_ROWS - 1; k++) {
        arm_many square = arm_all(0), along[ARM_ROW], first = a[k * ARM_ROW + k], size, factor;
        ARM_UNROLL for (i = k; i < ARM_ROWS; i++)
            square += a[i * ARM_ROW + k] * a[i * ARM_ROW + k];
        size = arm_roots(square);
        size = arm_pick((arm_flags)(first > 0), -size, size);
        factor = arm_pick((arm_flags)(square > 0), 1 / (size * (size - first)), arm_all(0));
        a[k * ARM_ROW + k] = first - size;
        ARM_UNROLL for (j = k + 1; j < ARM_ROW; j++)
            along[j] = a[k * ARM_ROW + k] * a[k * ARM_ROW + j];
        ARM_UNROLL for (i = k + 1; i < ARM_ROWS; i++)
            ARM_UNROLL for (j = k + 1; j < ARM_ROW; j++)
                along[j] += a[i * ARM_ROW + k] * a[i * ARM_ROW + j];
        ARM_UNROLL for (j = k + 1; j < ARM_ROW; j++)
            along[j] *= factor;
        ARM_UNROLL for (i = k; i < ARM_ROWS; i++)
            ARM_UNROLL for (j = k + 1; j < ARM_ROW; j++)
                a[i * ARM_ROW + j] -= along[j] * a[i * ARM_ROW + k];
        a[k * ARM_ROW + k] = size;
    }
    ARM_UNROLL for (k = ARM_ROWS - 1; k >= 0; k--) {
        const arm_many over = 1 / a[k * ARM_ROW + k];
        ARM_UNROLL for (j = ARM_JOINTS; j < ARM_ROW; j++) {
            const arm_many x = a[k * ARM_ROW + j] *= over;
            ARM_UNROLL for (i = 0; i < k; i++)
                a[i * ARM_ROW + j] -= x * a[i * ARM_ROW + k];
        }
    }
}

/* Points moved onto the curves of their target across their tangents, or joints that are held, by Newton's method; least:
   whether by steps of least norm. tolerance: size of a step that is the last one. */
static void arm_onto_curves(const double *goal, arm_points *points, double tolerance, int steps, int least)
{
    arm_flags active = (arm_flags)(arm_all(0) == 0);
    arm_many last[ARM_JOINTS];
    int j, k;
    memcpy(last, points->tangent, sizeof last);
    points->step = arm_all(ARM_INFINITY);
    for (k = 0; k < steps && arm_any(active); k++) {
        arm_many a[ARM_ROWS * ARM_ROW], x[ARM_JOINTS], y[ARM_JOINTS], longest = arm_all(0), sum = arm_all(0), size, share;
        arm_equations(goal, points->q, a);
        for (j = 0; j < ARM_JOINTS; j++)
            a[6 * ARM_ROW + j] = last[j];
        a[6 * ARM_ROW + ARM_JOINTS] = arm_all(0);
        a[6 * ARM_ROW + ARM_JOINTS + 1] = arm_all(1);
        arm_solve_rows(a);
        for (j = 0; j < ARM_JOINTS; j++) {
            x[j] = a[j * ARM_ROW + ARM_JOINTS];
            y[j] = a[j * ARM_ROW + ARM_JOINTS + 1];
        }
        size = 1 / arm_roots(arm_dot(y, y));
        for (j = 0; j < ARM_JOINTS; j++)
            y[j] *= size;
        if (least) {
            const arm_many along = arm_dot(x, y);
            for (j = 0; j < ARM_JOINTS; j++)
                x[j] -= along * y[j];
        }
        for (j = 0; j < ARM_JOINTS; j++) {
            longest = arm_larger(longest, arm_size(x[j]));
            sum += x[j];
        }
        share = arm_less(arm_all(1), ARM_NEWTON_STEP / arm_larger(longest, arm_all(ARM_NEWTON_STEP)));
        for (j = 0; j < ARM_JOINTS; j++) {
            points->q[j] = arm_pick(active, points->q[j] + x[j] * share, points->q[j]);
            points->tangent[j] = arm_pick(active, y[j], points->tangent[j]);
        }
        points->step = arm_pick(active, arm_pick((arm_flags)(sum - sum == 0), longest, arm_all(ARM_INFINITY)), points->step);
        active &= ~(arm_flags)(points->step < tolerance);
    }
}

/* Cubics between points, which follow an arc of a circle to the sixth order. */
static void arm_ways_between(const arm_points *a, const arm_points *b, arm_ways *ways)
{
    arm_many cosine = arm_larger(arm_dot(a->tangent, b->tangent), arm_all(-1)), size;
    int j;
    for (j = 0; j < ARM_JOINTS; j++) {
        ways->q[j] = a->q[j];
        ways->chord[j] = arm_wrapped(b->q[j] - a->q[j]);
    }
    size = 2 * arm_roots(arm_dot(ways->chord, ways->chord)) / (1 + arm_roots(0.5 * (1 + cosine)));
    for (j = 0; j < ARM_JOINTS; j++) {
        ways->begin[j] = size * a->tangent[j];
        ways->end[j] = size * b->tangent[j];
    }
}

/* Joint j at shares u of the ways. */
ARM_INLINE arm_many arm_on_way(const arm_ways *ways, arm_many u, int j)
{
    return ways->q[j] + ways->chord[j] * (u * u * (3 - 2 * u))
        + (ways->begin[j] * (1 - u) - ways->end[j] * u) * (u * (1 - u));
}

ARM_INLINE void arm_on_ways(const arm_ways *ways, arm_many u, arm_many *q)
{
    int j;
    for (j = 0; j < ARM_JOINTS; j++)
        q[j] = arm_on_way(ways, u, j);
}

/* The derivative of joint j by the share. */
ARM_INLINE arm_many arm_way_slope(const arm_ways *ways, arm_many u, int j)
{
    return 6 * u * (1 - u) * ways->chord[j] + ways->begin[j] * (1 - u) * (1 - 3 * u) + ways->end[j] * u * (3 * u - 2);
}

/* Which ways lie on the curves of their target, as their middles q tell. */
ARM_INLINE arm_flags arm_follows(const double *goal, const arm_many *q)
{
    return (arm_flags)(arm_misses(goal, q) < ARM_MID_MISS * ARM_MID_MISS);
}
