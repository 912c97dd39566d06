static const arm_real arm_lower[ARM_JOINTS] = {@lower@};
static const arm_real arm_upper[ARM_JOINTS] = {@upper@};
static const unsigned char arm_slides[ARM_JOINTS] = {@slides@};

/* The largest difference of two postures' joint values, modulo whole turns. */
static arm_real arm_away(const arm_real *a, const arm_real *b)
{
    arm_real most = 0;
    int j;
    for (j = 0; j < ARM_JOINTS; j++) {
        arm_real d = a[j] - b[j];
        if (!arm_slides[j])
            d -= ARM_TURN * ARM_RINT(d / ARM_TURN);
        most = ARM_ABS(d) <= most ? most : ARM_ABS(d);
    }
    return most;
}

/* What joint values, as arm_fk takes them, miss a target by: squared, lengths in reaches. */
static arm_real arm_missed(const arm_real *q, const arm_real *goal)
{
    arm_real T[16], off, sum = 0;
    int i;
    arm_pose(q, T, 1);
    for (i = 0; i < @position@; i++) {
        off = (T[4 * i + 3] - goal[@first@ + i]) / @reach@;
        sum += off * off;
    }
@orientation@    return sum;
}

/* `near`, if it is within limits and solves the target, takes the place of the branch that it is one with, or becomes one:
   the arm that stands there stays. near: actual joint values, stand: the same as arm_fk takes them; most: what it may
   miss, for rounding, squared. Returns how many branches there are. */
static int arm_stay(const arm_real *near, const arm_real *stand, const arm_real *goal, const arm_real *q, arm_solution *out,
    int count, arm_real most)
{
    arm_real between[ARM_JOINTS], missed, least = ARM_INFINITY;
    int b, j, k, index = 0, at = -1;
    for (j = 0; j < ARM_JOINTS; j++)
        if (!(near[j] >= arm_lower[j] - ARM_SLACK && near[j] <= arm_upper[j] + ARM_SLACK))
            return count;
    missed = arm_missed(stand, goal);
    if (!(missed <= most))
        return count;
    for (k = 0; k < count; k++) {
        const arm_real away = arm_away(out[k].q, stand);
        if (away < least) {
            least = away;
            at = k;
        }
    }
    for (j = 0; at >= 0 && j < ARM_JOINTS; j++) {
        arm_real step = out[at].q[j] - stand[j];
        if (!arm_slides[j])
            step -= ARM_TURN * ARM_RINT(step / ARM_TURN);
        between[j] = stand[j] + step / 2;
    }
    if (at >= 0 && (count == ARM_BRANCHES || (least <= ARM_CLOSE_BY && arm_missed(between, goal) <= most)))
        index = out[at].branch;
    else { /* another one: named after the nearest that is not listed */
        for (b = 0, least = ARM_INFINITY; b < ARM_BRANCHES; b++) {
            const arm_real away = arm_away(q + b * ARM_JOINTS, near);
            int listed = 0;
            for (k = 0; k < count; k++)
                listed |= out[k].branch == b;
            if (!listed && (at < 0 || !(away >= least))) {
                least = away;
                index = b;
                at = count;
            }
        }
        at = count++;
    }
    for (j = 0; j < ARM_JOINTS; j++)
        out[at].q[j] = stand[j];
    out[at].branch = index;
    out[at].within_limits = 1;
    out[at].residual = ARM_SQRT(missed);
    return count;
}

int arm_ik(const arm_real *target, const arm_real *near, arm_solution *out, int *edge)
{
    const arm_real *const stand = near;
    arm_real goal[ARM_GOAL], q[ARM_BRANCHES * ARM_JOINTS], miss[ARM_BRANCHES]@close@;
    int b, j, k, count = 0;
    *edge = 0;
    if (!arm_read(target, goal))
        return -1;
@actual_near@    arm_candidates(goal, near, q, miss, edge, 1);
    for (b = 0; b < ARM_BRANCHES; b++)
        *edge |= !(miss[b] <= ARM_ACCEPTED) & !(miss[b] > ARM_NEARBY);
    *edge = *edge != 0;
@other_held_values@    for (b = 0; b < ARM_BRANCHES; b++) {
        arm_solution *one = &out[count];
        int inside = 1, again = 0;
        if (!(miss[b] <= ARM_SOLUTION))
            continue;
        for (j = 0; j < ARM_JOINTS; j++) {
            const arm_real value = q[b * ARM_JOINTS + j];
            if (arm_slides[j])
                inside &= (value >= arm_lower[j] - ARM_SLACK) & (value <= arm_upper[j] + ARM_SLACK);
            one->q[j] = arm_slides[j] ? value : arm_copy(value, near[j], arm_lower[j], arm_upper[j], &inside);
        }
@commanded@        for (k = 0; *edge && k < count; k++) /* two that have merged are one */
            again |= arm_away(one->q, out[k].q) <= ARM_SAME;
        if (again)
            continue;
        one->branch = b;
        one->within_limits = inside;
        one->residual = ARM_SQRT(miss[b]);
        count++;
    }
    return arm_stay(near, stand, goal, q, out, count, @most@);
}

int arm_best(const arm_solution *found, int count, const arm_real *near)
{
    int b, j, best = -1;
    arm_real least = 0;
    for (b = 0; b < count; b++) {
        arm_real motion = 0;
        for (j = 0; j < ARM_JOINTS; j++)
            motion += ARM_ABS(found[b].q[j] - near[j]) * (arm_slides[j] ? 1 : (arm_real)180 / ARM_PI);
        if (found[b].within_limits && (best < 0 || motion < least - ARM_EQUAL)) { /* of equal ones the first */
            best = b;
            least = motion;
        }
    }
    return best;
}
