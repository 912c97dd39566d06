static const arm_real arm_lower[ARM_JOINTS] = {@lower@};
static const arm_real arm_upper[ARM_JOINTS] = {@upper@};
static const unsigned char arm_slides[ARM_JOINTS] = {@slides@};

/* Whether two branches are one: no joint differs by more than ARM_SAME. */
static int arm_same(const arm_real *a, const arm_real *b)
{
    int j;
    for (j = 0; j < ARM_JOINTS; j++) {
        arm_real d = a[j] - b[j];
        if (!arm_slides[j])
            d -= ARM_TURN * ARM_RINT(d / ARM_TURN);
        if (ARM_ABS(d) > ARM_SAME)
            return 0;
    }
    return 1;
}

int arm_ik(const arm_real *target, const arm_real *near, arm_solution *out, int *edge)
{
    arm_real goal[ARM_GOAL], q[ARM_BRANCHES * ARM_JOINTS], miss[ARM_BRANCHES]@close@;
    int b, j, k, count = 0;
    *edge = 0;
    if (!arm_read(target, goal))
        return -1;
@actual_near@    arm_candidates(goal, near, q, miss, edge, 1);
    for (b = 0; b < ARM_BRANCHES; b++)
        *edge |= !(miss[b] <= ARM_ACCEPTED) & !(miss[b] > ARM_NEARBY);
    for (b = 0; b < ARM_BRANCHES; b++) {
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
            again |= arm_same(one->q, out[k].q);
        if (again)
            continue;
        one->branch = b;
        one->within_limits = inside;
        one->residual = ARM_SQRT(miss[b]);
        count++;
    }
    return count;
}

int arm_best(const arm_solution *found, int count, const arm_real *near)
{
    int b, j, best = -1;
    arm_real least = 0;
    for (b = 0; b < count; b++) {
        arm_real motion = 0;
        for (j = 0; j < ARM_JOINTS; j++)
            motion += ARM_ABS(found[b].q[j] - near[j]) * (arm_slides[j] ? 1 : (arm_real)180 / ARM_PI);
        if (found[b].within_limits && (best < 0 || motion < least)) {
            best = b;
            least = motion;
        }
    }
    return best;
}
