/* Targets (count, ARM_TARGET) as columns of lanes; unread: not finite or too large, an axis whose length is not one. */
static void arm_gather(const double *target, double *goal, int *unread, int count)
{
    static const double most[ARM_TARGET] = {@most@};
    int i, k;
    for (i = 0; i < count; i++) {
        unread[i] = 0;
        for (k = 0; k < ARM_TARGET; k++) {
            goal[k * ARM_LANES + i] = target[ARM_TARGET * i + k];
            unread[i] |= !(fabs(goal[k * ARM_LANES + i]) <= most[k]);
        }
#if @axis@
        const double *a = target + ARM_TARGET * i + 3;
        unread[i] |= !(fabs(a[0] * a[0] + a[1] * a[1] + a[2] * a[2] - 1.0) <= ARM_ROUNDED);
#endif
    }
}

/* No rotation hides how a target is rounded. */
ARM_INLINE int arm_hides(const double *goal)
{
    (void)goal;
    return 0;
}
