/* Pieces of the curves of a target: of which branch, whether a legal interval or a family without one, its ends, the value
   of the best sample and of those beside it, and the posture nearest to `near`, so far. */
typedef struct {
    double a[ARM_PIECES], b[ARM_PIECES], low[ARM_PIECES], at[ARM_PIECES], high[ARM_PIECES];
    double q[ARM_PIECES][ARM_JOINTS], cost[ARM_PIECES];
    int branch[ARM_PIECES], legal[ARM_PIECES];
    int count;
} arm_pieces;

/* Postures of one branch each at values t, at their legal copies: how far from `near`, infinite where the branch is not
   there; which are within limits. */
static void arm_postures(const double *goal, const double *near, const arm_pieces *all, const int *index, int count,
    const double *t, double (*posture)[ARM_JOINTS], double *cost, int *legal)
{
    int start, i, j;
    for (start = 0; start < count; start += ARM_LANES) {
        double q[ARM_JOINTS * ARM_LANES], at[ARM_LANES], motion[ARM_LANES];
        int branch[ARM_LANES], there[ARM_LANES], inside[ARM_LANES];
        const int lanes = count - start < ARM_LANES ? count - start : ARM_LANES;
        for (i = 0; i < ARM_LANES; i++) {
            const int k = start + (i < lanes ? i : 0);
            at[i] = t[k];
            branch[i] = all->branch[index[k]];
            inside[i] = 1;
            motion[i] = 0.0;
        }
        arm_own(goal, branch, at, q, there);
        for (j = 0; j < ARM_JOINTS; j++)
            arm_copies(j, near[j], q + j * ARM_LANES, inside, motion);
        for (i = 0; i < lanes; i++) {
            cost[start + i] = there[i] ? motion[i] : ARM_INFINITY;
            legal[start + i] = inside[i];
            for (j = 0; j < ARM_JOINTS; j++)
                posture[start + i][j] = q[j * ARM_LANES + i];
        }
    }
}

/* How far pieces at values t are from `near`, infinite where they are not legal; better postures are kept. */
static void arm_costs(const double *goal, const double *near, arm_pieces *all, const int *index, int count,
    const double *t, double *cost)
{
    double posture[ARM_PIECES][ARM_JOINTS];
    int legal[ARM_PIECES];
    int i;
    arm_postures(goal, near, all, index, count, t, posture, cost, legal);
    for (i = 0; i < count; i++) {
        if (!legal[i])
            cost[i] = ARM_INFINITY;
        if (cost[i] < all->cost[index[i]]) {
            all->cost[index[i]] = cost[i];
            memcpy(all->q[index[i]], posture[i], sizeof *posture);
        }
    }
}

/* Where branches merge rounding tells whether they are there: the first values inside of such ends at which they are. */
static void arm_try_inside(const double *goal, const double *near, arm_pieces *all, const int *index, int count,
    const double *end, const double *at_end, const double *bound, const double *other)
{
    static const double steps[] = {@inside@};
    double t[ARM_PIECES], cost[ARM_PIECES];
    int tried[ARM_PIECES];
    int i, step, left = 0;
    for (i = 0; i < count; i++)
        if (at_end[i] == ARM_INFINITY && end[i] == bound[index[i]])
            tried[left++] = index[i];
    for (step = 0; step < (int)(sizeof steps / sizeof *steps) && left; step++) {
        const int open = left;
        for (i = 0; i < open; i++) {
            const double from = bound[tried[i]], way = other[tried[i]] - from;
            t[i] = from + copysign(fmin(steps[step], fabs(way)), way);
        }
        arm_costs(goal, near, all, tried, open, t, cost);
        for (i = left = 0; i < open; i++)
            if (cost[i] == ARM_INFINITY)
                tried[left++] = tried[i];
    }
}

/* The postures of pieces nearest to `near`, as `_nearest_postures` in Python finds them. */
static void arm_nearest_postures(const double *goal, const double *near, arm_pieces *all)
{
    const double ratio = 0.6180339887498949;
    double low[ARM_PIECES], high[ARM_PIECES], left[ARM_PIECES], right[ARM_PIECES], t[ARM_PIECES], middle[ARM_PIECES];
    double at_left[ARM_PIECES], at_right[ARM_PIECES], at_new[ARM_PIECES], at_low[ARM_PIECES], at_high[ARM_PIECES];
    double at_ends[2][ARM_PIECES][ARM_JOINTS];
    int open[ARM_PIECES], goes[ARM_PIECES], inside[ARM_PIECES];
    int i, j, k, step, count = 0;
    for (i = 0; i < all->count; i++)
        open[i] = i;
    arm_postures(goal, near, all, open, all->count, all->at, all->q, all->cost, inside);
    for (i = 0; i < all->count; i++)
        if (all->legal[i])
            open[count++] = i;
    for (i = 0; i < count; i++) {
        const int p = open[i];
        const double own = near[ARM_JOINTS - 1];
        const double value = own + rint((all->at[p] - own) / ARM_TURN) * ARM_TURN;
        t[i] = value >= all->a[p] && value <= all->b[p] ? value : all->at[p];
        low[i] = all->a[p];
        high[i] = all->b[p];
        left[i] = all->at[p] + ARM_PROBE * (all->low[p] - all->at[p]);
        right[i] = all->at[p] + ARM_PROBE * (all->high[p] - all->at[p]);
        middle[i] = all->cost[p];
    }
    arm_costs(goal, near, all, open, count, t, at_new);
    arm_costs(goal, near, all, open, count, low, at_low);
    arm_costs(goal, near, all, open, count, high, at_high);
    arm_try_inside(goal, near, all, open, count, low, at_low, all->a, all->b);
    arm_try_inside(goal, near, all, open, count, high, at_high, all->b, all->a);
    arm_costs(goal, near, all, open, count, left, at_left);
    arm_costs(goal, near, all, open, count, right, at_right);
    for (i = k = 0; i < count; i++) /* beside a kink the motion grows both ways */
        if (at_left[i] < middle[i] || at_right[i] < middle[i])
            open[k++] = open[i];
    count = k;
    if (!count)
        return;
    for (i = 0; i < count; i++) {
        low[i] = all->low[open[i]];
        high[i] = all->high[open[i]];
        left[i] = high[i] - ratio * (high[i] - low[i]);
        right[i] = low[i] + ratio * (high[i] - low[i]);
    }
    arm_costs(goal, near, all, open, count, left, at_left);
    arm_costs(goal, near, all, open, count, right, at_right);
    for (step = 0; step < ARM_SECTIONS; step++) {
        for (i = 0; i < count; i++) {
            goes[i] = at_left[i] <= at_right[i];
            if (goes[i])
                high[i] = right[i];
            else
                low[i] = left[i];
            t[i] = goes[i] ? high[i] - ratio * (high[i] - low[i]) : low[i] + ratio * (high[i] - low[i]);
        }
        arm_costs(goal, near, all, open, count, t, at_new);
        for (i = 0; i < count; i++) {
            if (goes[i]) {
                right[i] = left[i];
                at_right[i] = at_left[i];
                left[i] = t[i];
                at_left[i] = at_new[i];
            } else {
                left[i] = right[i];
                at_left[i] = at_right[i];
                right[i] = t[i];
                at_right[i] = at_new[i];
            }
        }
    }
    arm_postures(goal, near, all, open, count, low, at_ends[0], at_low, inside);
    arm_postures(goal, near, all, open, count, high, at_ends[1], at_high, inside);
    for (i = 0; i < count; i++) { /* by a secant where a joint passes its near, by a parabola elsewhere */
        double a = 0.0, b = 0.0, most = 0.0, x, y;
        for (j = 0; j < ARM_JOINTS; j++) {
            const double before = at_ends[0][i][j] - near[j], behind = at_ends[1][i][j] - near[j];
            if (before * behind < 0 && fabs(behind - before) > most) {
                most = fabs(behind - before);
                a = before;
                b = behind;
            }
        }
        right[i] = at_left[i] <= at_right[i] ? left[i] : right[i]; /* the better one */
        at_right[i] = at_left[i] <= at_right[i] ? at_left[i] : at_right[i];
        left[i] = most > 0 ? low[i] + (high[i] - low[i]) * a / (a - b) : low[i];
        x = (right[i] - low[i]) * (at_right[i] - at_high[i]);
        y = (right[i] - high[i]) * (at_right[i] - at_low[i]);
        t[i] = right[i] - 0.5 * ((right[i] - low[i]) * x - (right[i] - high[i]) * y) / (x - y);
        if (!(t[i] > low[i] && t[i] < high[i]))
            t[i] = right[i];
    }
    arm_costs(goal, near, all, open, count, left, at_new);
    arm_costs(goal, near, all, open, count, t, at_new);
}
