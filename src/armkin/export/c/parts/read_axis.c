/* The target's numbers, its axis of length one. 0: one of them is not finite, or the axis has no length. */
static int arm_read(const arm_real *target, arm_real *goal)
{
    arm_real length;
    int i;
    for (i = 0; i < ARM_TARGET; i++) {
        goal[i] = target[i];
        if (!(ARM_ABS(goal[i]) <= ARM_LARGEST))
            return 0;
    }
    length = ARM_SQRT(goal[3] * goal[3] + goal[4] * goal[4] + goal[5] * goal[5]);
    if (!(length > ARM_SAME))
        return 0;
    for (i = 3; i < 6; i++)
        goal[i] /= length;
    return 1;
}
