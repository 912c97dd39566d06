/* The target's numbers. 0: one of them is not finite. */
static int arm_read(const arm_real *target, arm_real *goal)
{
    int i;
    for (i = 0; i < ARM_TARGET; i++) {
        goal[i] = target[i];
        if (!(ARM_ABS(goal[i]) <= ARM_LARGEST))
            return 0;
    }
    return 1;
}
