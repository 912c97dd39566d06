/* Targets on an edge whose branches stand alone, meet in pairs, or lie on self-motions whose ends are found:
   armkin.inverse.singular.local_structure and chains, for one target, where one direction is lost and no joint is free. All
   others are left to Python. */
enum { ARM_NODES = @nodes_count@ };

/* x: the joints' ways in powers of t / span, within low <= t <= high; t goes along v. span_ratio: times as long a span is likely
   to hold. only_ahead: the span begins at t = 0. least_way, most_way: how far the joints' ways go. motion: whether it is a
   self-motion, moves: of which joints, uncrossed: no other curve crosses it, partial: Python does not follow it to its ends, on:
   which other branches lie on further curves of it. */
typedef struct {
    double v[ARM_JOINTS], w[ARM_JOINTS], x[ARM_NODES][ARM_JOINTS], low, high, span, span_ratio, sigma, second, miss;
    double least_way[ARM_JOINTS], most_way[ARM_JOINTS];
    int weak, turns, motion, only_ahead, moves[ARM_JOINTS], uncrossed, partial, on[ARM_BRANCHES];
} arm_branch;

#if @sums@
/* Weights of the joints in the sums that a target prescribes, and offsets. */
static const double arm_sums[@sums@][ARM_JOINTS + 1] = {@weights@};
#endif

/* What a pose (16 numbers) at joint values q misses of a target: lengths in reaches, then sums of joints or
   the rotation vector [rad]. */
ARM_SELDOM static void arm_residual(const double *T, const double *goal, const double *q, double *r)
{
    int k;
    (void)q;
    for (k = 0; k < @position@; k++)
        r[k] = (goal[(@first@ + k) * ARM_LANES] - T[(4 * k + 3) * ARM_POINTS]) / @reach@;
#if @sums@
    for (k = 0; k < @sums@; k++) {
        double angle = goal[(@position@ + k) * ARM_LANES] - arm_sums[k][ARM_JOINTS];
        int j;
        for (j = 0; j < ARM_JOINTS; j++)
            angle -= arm_sums[k][j] * q[j * ARM_POINTS];
        r[@position@ + k] = angle - ARM_TURN * rint(angle / ARM_TURN);
    }
#endif
#if @full@
    {
        double C[3][3], sine = 0.0, cosine;
        int i, j;
        for (i = 0; i < 3; i++)
            for (j = 0; j < 3; j++)
                for (C[i][j] = 0.0, k = 0; k < 3; k++)
                    C[i][j] += T[(4 * i + k) * ARM_POINTS] * goal[(3 * k + j) * ARM_LANES];
        for (k = 0; k < 3; k++) {
            i = (k + 1) % 3, j = (k + 2) % 3;
            r[3 + k] = 0.5 * (C[i][j] - C[j][i]);
            sine += r[3 + k] * r[3 + k];
        }
        sine = sqrt(sine), cosine = 0.5 * (C[0][0] + C[1][1] + C[2][2] - 1.0);
        if (sine > 1e-8) /* below, the angle is its sine to the last digit */
            for (k = 3; k < 6; k++)
                r[k] *= atan2(sine, cosine) / sine;
    }
#endif
}

/* An entry of the Jacobian, lengths in reaches; slope: as `arm_slope` leaves it. */
ARM_SELDOM static double arm_entry(const double *slope, int k, int j)
{
    static const double unit[ARM_JOINTS] = {@unit@};
#if @sums@
    if (k >= @position@)
        return arm_sums[k - @position@][j] * unit[j];
#endif
    return slope[(k * ARM_JOINTS + j) * ARM_POINTS] * unit[j] / (k < @position@ ? @reach@ : 1.0);
}

/* One-sided Jacobi rotations (Hestenes 1958) of a Jacobian as `arm_slope` leaves it: rows of U and V are its left and right
   vectors, the two of the smallest singular values S last. */
ARM_SELDOM static void arm_singular_values(const double *slope, double A[ARM_JOINTS][ARM_JOINTS],
    double V[ARM_JOINTS][ARM_JOINTS], double *S)
{
    int a, b, k, place, sweep, turned = 1;
    double swap;
    for (a = 0; a < ARM_JOINTS; a++)
        for (b = 0; b < ARM_JOINTS; b++)
            V[a][b] = a == b, A[a][b] = arm_entry(slope, b, a);
    for (sweep = 0; turned && sweep < 40; sweep++)
        for (turned = 0, a = 0; a < ARM_JOINTS; a++)
            for (b = a + 1; b < ARM_JOINTS; b++) {
                double x = 0.0, y = 0.0, xy = 0.0, t, c, s;
                for (k = 0; k < ARM_JOINTS; k++)
                    x += A[a][k] * A[a][k], y += A[b][k] * A[b][k], xy += A[a][k] * A[b][k];
                if (!(fabs(xy) > 1e-15 * sqrt(x * y)))
                    continue;
                turned = 1;
                t = (y - x) / (2.0 * xy);
                t = (t < 0.0 ? -1.0 : 1.0) / (fabs(t) + sqrt(1.0 + t * t));
                c = 1.0 / sqrt(1.0 + t * t), s = c * t;
                for (k = 0; k < ARM_JOINTS; k++) {
                    const double p = A[a][k], q = A[b][k], e = V[a][k], f = V[b][k];
                    A[a][k] = c * p - s * q, A[b][k] = s * p + c * q;
                    V[a][k] = c * e - s * f, V[b][k] = s * e + c * f;
                }
            }
    for (a = 0; a < ARM_JOINTS; a++) {
        for (S[a] = 0.0, k = 0; k < ARM_JOINTS; k++)
            S[a] += A[a][k] * A[a][k];
        S[a] = sqrt(S[a]);
    }
    for (place = ARM_JOINTS - 1; place >= ARM_JOINTS - 2; place--) {
        for (a = 0, k = 1; k <= place; k++)
            a = S[k] < S[a] ? k : a;
        swap = S[a], S[a] = S[place], S[place] = swap;
        for (k = 0; k < ARM_JOINTS; k++) {
            swap = A[a][k], A[a][k] = A[place][k], A[place][k] = swap;
            swap = V[a][k], V[a][k] = V[place][k], V[place][k] = swap;
        }
    }
    for (a = 0; a < ARM_JOINTS; a++)
        for (k = 0; k < ARM_JOINTS; k++)
            A[a][k] /= S[a];
}

/* A posture's way f = r - r(q + away), both ways, along the columns of U. */
ARM_SELDOM static void arm_both_ways(const double *q, const double *goal, const double *r, double U[ARM_JOINTS][ARM_JOINTS],
    double away[2][ARM_JOINTS], double f[2][ARM_JOINTS])
{
    static const double unit[ARM_JOINTS] = {@unit@};
    double at[ARM_JOINTS * ARM_POINTS], T[16 * ARM_POINTS], missed[ARM_JOINTS];
    int i, j, k;
    for (i = 0; i < 2; i++)
        for (j = 0; j < ARM_JOINTS; j++)
            at[j * ARM_POINTS + i] = q[j * ARM_POINTS] + away[i][j] * unit[j];
    arm_pose(at, T, 2);
    for (i = 0; i < 2; i++) {
        arm_residual(T + i, goal, at + i, missed);
        for (j = 0; j < ARM_JOINTS; j++)
            for (f[i][j] = 0.0, k = 0; k < ARM_JOINTS; k++)
                f[i][j] += (r[k] - missed[k]) * U[j][k];
    }
}

/* Whether the curvature tells what a weak posture is; `_second_order` has the same names. U, S, V: the last is the lost. */
ARM_SELDOM static int arm_second_order(const double *q, const double *goal, const double *r, double U[ARM_JOINTS][ARM_JOINTS],
    double V[ARM_JOINTS][ARM_JOINTS], const double *S, arm_branch *out)
{
    const int last = ARM_JOINTS - 1;
    const double sigma = S[last], second = S[last - 1];
    double away[2][ARM_JOINTS], f[2][ARM_JOINTS], correction[2][ARM_JOINTS] = {{0.0}}, second_derivative[ARM_JOINTS];
    double b, bend, h, longest = 0.0, w_squared = 0.0, exit_distance, other_exit, last_offset = INFINITY;
    int i, j, k, step, has_turn, decided = 0;
    for (j = 0; j < ARM_JOINTS; j++) {
        out->v[j] = V[last][j];
        longest = fmax(longest, fabs(out->v[j]));
        away[0][j] = @way@ * out->v[j], away[1][j] = -away[0][j];
    }
    memset(out->x, 0, sizeof out->x);
    out->span = 1.2 * @wide@ / longest;
    arm_both_ways(q, goal, r, U, away, f);
    for (k = 0; k < ARM_JOINTS; k++)
        second_derivative[k] = (f[0][k] + f[1][k]) / (@way@ * @way@);
    for (j = 0; j < ARM_JOINTS; j++) {
        for (out->w[j] = 0.0, k = 0; k < last; k++)
            out->w[j] -= V[k][j] * second_derivative[k] / S[k];
        w_squared += out->w[j] * out->w[j];
    }
    b = second_derivative[last], bend = fmax(fabs(b), @tiny@);
    has_turn = sigma * sigma < 2.0 * @solution@ * bend;
    h = has_turn ? 4.0 * sqrt(@solution@ / bend) : 2.0 * @solution@ / sigma;
    /* where |g| is SOLUTION first with the sign of b; other_exit: where against it, or beyond the turn */
    exit_distance = 2.0 * @solution@ / (sigma + sqrt(sigma * sigma + 2.0 * @solution@ * bend));
    other_exit = sigma + sqrt(fmax(sigma * sigma - 2.0 * @solution@ * bend, 0.0));
    other_exit = has_turn ? exit_distance + 2.0 * sigma / bend : 2.0 * @solution@ / other_exit;
    out->low = b > 0.0 ? -other_exit : -exit_distance, out->high = b > 0.0 ? exit_distance : other_exit;
    for (step = 0; h <= @series@ && second * h > 4.0 * @solution@ && !decided && step < @back@; step++) {
        double across[2] = {0.0, 0.0}, correction_squared[2] = {0.0, 0.0}, offset, cubic, quartic, change;
        for (i = 0; i < 2; i++)
            for (j = 0; j < ARM_JOINTS; j++) {
                away[i][j] = 0.5 * h * h * out->w[j] + (i ? -h : h) * out->v[j] + correction[i][j];
                correction_squared[i] += correction[i][j] * correction[i][j];
            }
        arm_both_ways(q, goal, r, U, away, f);
        for (i = 0; i < 2; i++)
            for (k = 0; k < last; k++)
                across[i] += f[i][k] * f[i][k];
        offset = sqrt(fmax(across[0], across[1])) / second;
        cubic = fabs(0.5 * (f[0][last] - f[1][last]) - sigma * h);
        quartic = fabs(0.5 * (f[0][last] + f[1][last]) - 0.5 * b * h * h) + ARM_JOINTS * h * offset;
        change = (6.0 * cubic + 12.0 * quartic) / (h * h);
        if (0.5 * h * h * sqrt(w_squared) + sqrt(fmax(correction_squared[0], correction_squared[1])) + offset < 0.1 * h) {
            out->turns = has_turn && change < 0.2 * bend && sigma * sigma < 2.0 * @solution@ * (bend - change);
            decided = out->turns || (!has_turn && sigma * sigma > 2.0 * @solution@ * (bend + change));
        }
        if (!(offset < 0.5 * last_offset))
            break;
        for (last_offset = offset, i = 0; i < 2; i++)
            for (j = 0; j < ARM_JOINTS; j++)
                for (k = 0; k < last; k++)
                    correction[i][j] -= V[k][j] * f[i][k] / S[k];
    }
    for (j = 0; j < ARM_JOINTS; j++)
        out->x[1][j] = out->v[j] * out->span, out->x[2][j] = 0.5 * out->w[j] * out->span * out->span;
    return decided;
}

/* Whether a posture that far away [rad, reaches] lies on a weak branch's component: `members` in Python. */
static int arm_member(const arm_branch *one, const double *way)
{
    const double slack = 4.0 * @solution@ / one->second;
    double t = 0.0, s;
    int j, k;
    for (j = 0; j < ARM_JOINTS; j++)
        t += way[j] * one->v[j];
    if (!(t >= one->low - slack && t <= one->high + slack))
        return 0;
    s = fmax(fmin(t / one->span, 1.0), -1.0);
    for (j = 0; j < ARM_JOINTS; j++) {
        double x = 0.0;
        for (k = ARM_NODES - 1; k >= 0; k--)
            x = x * s + one->x[k][j];
        if (!(fabs(way[j] - x) <= 4.0 * @smooth@ * one->span + slack))
            return 0;
    }
    return 1;
}

/* The way from one posture to another [rad, reaches], modulo whole turns, and how far the joint goes that goes farthest. */
ARM_SELDOM static double arm_way(const double *to, const double *from, double *way)
{
    static const double unit[ARM_JOINTS] = {@unit@};
    static const int slides[ARM_JOINTS] = {@slides@};
    double away = 0.0;
    int j;
    for (j = 0; j < ARM_JOINTS; j++) {
        way[j] = to[j * ARM_POINTS] - from[j * ARM_POINTS];
        way[j] = slides[j] ? way[j] / unit[j] : way[j] - ARM_TURN * rint(way[j] / ARM_TURN);
        away = fmax(away, fabs(way[j]));
    }
    return away;
}

@followed@/* Whether the branch at + self is told; slope: its `arm_slope`, T: its pose; at: all count branches. */
ARM_SELDOM static int arm_told(const double *at, int count, int self, const double *goal, const double *T, const double *slope,
    arm_branch *out)
{
    double A[ARM_JOINTS][ARM_JOINTS], V[ARM_JOINTS][ARM_JOINTS], S[ARM_JOINTS], r[ARM_JOINTS];
    int k, last = ARM_JOINTS - 1;
    arm_residual(T, goal, at + self, r);
    for (out->miss = 0.0, k = 0; k < ARM_JOINTS; k++)
        out->miss += r[k] * r[k];
    out->miss = sqrt(out->miss);
    memset(out->on, 0, sizeof out->on);
    if (!(out->miss < @closed@)) /* a branch that misses by more wants a correction */
        return 0;
    arm_singular_values(slope, A, V, S);
    out->turns = out->motion = out->partial = out->only_ahead = 0;
    out->weak = S[last] < @folded@, out->sigma = S[last], out->second = S[last - 1];
    if (!out->weak)
        return 1;
    if (!(S[last - 1] > @lost@)) /* two directions are lost */
        return 0;
    if (@sums@ && !(S[last] > @solution@)) /* where sums of joints are taken off, rounding parts a double root another way */
        return 0;
    return arm_second_order(at + self, goal, r, A, V, S, out) || arm_followed(at, count, self, goal, A[last], out);
}

/* How far joint values are from `near`, modulo whole turns [rad, reaches]. */
ARM_SELDOM static double arm_motion(const double *q, const double *near)
{
    static const double unit[ARM_JOINTS] = {@unit@};
    static const int slides[ARM_JOINTS] = {@slides@};
    double sum = 0.0;
    int j;
    for (j = 0; j < ARM_JOINTS; j++) {
        const double d = q[j * ARM_POINTS] - near[j * ARM_LANES];
        sum += fabs(slides[j] ? d / unit[j] : d - ARM_TURN * rint(d / ARM_TURN));
    }
    return sum;
}

@twins@/* Whether a posture close to its target shows that this is out of reach there: `beyond_folds`, if not at once then after steps
   along what is not lost. q: moved by these. */
ARM_SELDOM static int arm_beyond(double *q, const double *goal)
{
    static const double unit[ARM_JOINTS] = {@unit@};
    const int last = ARM_JOINTS - 1;
    double A[ARM_JOINTS][ARM_JOINTS], V[ARM_JOINTS][ARM_JOINTS], S[ARM_JOINTS], r[ARM_JOINTS], away[2][ARM_JOINTS];
    double T[16 * ARM_POINTS], slope[6 * ARM_JOINTS * ARM_POINTS], f[2][ARM_JOINTS], along[ARM_JOINTS];
    int j, k, step;
    for (step = 0; step < @back@; step++) {
        double bend, rest = 0.0;
        arm_pose(q, T, 1);
        arm_slope(q, slope, 1);
        arm_residual(T, goal, q, r);
        arm_singular_values(slope, A, V, S);
        if (!(S[last - 1] > @high@ && S[last] < @lost@ && S[last] > 0.0))
            return 0;
        for (k = 0; k < ARM_JOINTS; k++) {
            for (along[k] = 0.0, j = 0; j < ARM_JOINTS; j++)
                along[k] += A[k][j] * r[j];
            rest += k < last ? along[k] * along[k] : 0.0;
            away[0][k] = @way@ * V[last][k], away[1][k] = -away[0][k];
        }
        arm_both_ways(q, goal, r, A, away, f);
        bend = -(f[0][last] + f[1][last]) / (@way@ * @way@);
        rest = sqrt(rest) / S[last - 1];
        if (fabs(bend) > @bent@ && along[last] * bend > 0.0 && fabs(along[last]) > 10.0 * @solution@ && rest < @way@
            && 100.0 * rest * rest < fabs(along[last]))
            return 1;
        for (j = 0; j < ARM_JOINTS; j++)
            for (k = 0; k < last; k++)
                q[j * ARM_POINTS] += V[k][j] * along[k] / S[k] * unit[j];
    }
    return 0;
}

/* A target on an edge: its status, 0 if all of its branches are isolated, 1 if some meet, 2 if some are on self-motions, whose
   joints are then free; -1 if that is left open. miss: infinite of what is one with a branch that is kept; inside: which
   branches are within limits. */
ARM_SELDOM static int arm_folds(const double *goal, const double *q, const double *near, const int *inside, double *miss,
    uint8_t *free)
{
    static const double unit[ARM_JOINTS] = {@unit@}, lowest[ARM_JOINTS] = {@lowest@}, highest[ARM_JOINTS] = {@highest@};
    double at[ARM_JOINTS * ARM_POINTS], T[16 * ARM_POINTS], slope[6 * ARM_JOINTS * ARM_POINTS];
    arm_branch one[ARM_BRANCHES];
    int which[ARM_BRANCHES], twin[ARM_BRANCHES], count = 0, status = 0, legal = 0, at_limit = 0, a, b, j;
    for (b = 0; b < ARM_BRANCHES; b++) {
        const double off = miss[b * ARM_LANES];
        if (!(off < @seed@ * @seed@))
            continue;
        for (j = 0; j < ARM_JOINTS; j++)
            at[j * ARM_POINTS + count] = q[(b * ARM_JOINTS + j) * ARM_LANES];
        if (off <= @accepted@)
            which[count++] = b;
        else if (!arm_beyond(at + count, goal)) /* a correction may make a branch of it */
            return -1;
    }
    if (!count)
        return -1;
    arm_pose(at, T, count);
    arm_slope(at, slope, count);
    for (a = 0; a < count; a++) {
        if (!arm_told(at, count, a, goal, T + a, slope + a, one + a))
            return -1;
        if (one[a].motion && !(one[a].uncrossed && one[a].second > @high@ && @motions@))
            return -1;
        status = one[a].motion ? 2 : status > one[a].turns ? status : one[a].turns;
    }
    if (!arm_twins(goal, one, at, count, twin))
        return -1;
    for (a = 0; a < count; a++)
        if ((b = twin[a]) > a) { /* the first is listed, of a self-motion the one closer to `near` */
            const double first = arm_motion(at + a, near), second = arm_motion(at + b, near);
            miss[which[one[a].motion && first > second ? a : b] * ARM_LANES] = INFINITY;
        }
    for (b = 0; status && b < ARM_BRANCHES; b++) {
        int limit = miss[b * ARM_LANES] <= @accepted@;
        legal |= limit && inside[b * ARM_LANES];
        for (j = 0; j < ARM_JOINTS; j++) {
            const double value = q[(b * ARM_JOINTS + j) * ARM_LANES];
            limit &= value >= lowest[j] - @same@ * unit[j] && value <= highest[j] + @same@ * unit[j];
        }
        at_limit |= limit;
    }
    if (at_limit && !legal) /* another posture, as close to its target, may be within limits */
        return -1;
    for (a = 0; status == 2 && a < count; a++)
        for (j = 0; j < ARM_JOINTS; j++)
            free[j] |= one[a].motion && one[a].moves[j];
    return status;
}
