/* Poses (count, 4, 4) as columns of lanes; unread: a rotation that is off by more than rounding. */
static void arm_gather(const double *target, double *goal, int *unread, int count)
{
    int i, k;
    for (i = 0; i < count; i++)
        for (k = 0; k < 12; k++)
            goal[k * ARM_LANES + i] = target[16 * i + 4 * (k % 3) + k / 3];
    for (i = 0; i < count; i++) {
        const double *g = goal + i;
#define ARM_G(k) g[(k) * ARM_LANES]
        const double off_x = ARM_G(0) * ARM_G(0) + ARM_G(1) * ARM_G(1) + ARM_G(2) * ARM_G(2) - 1.0;
        const double off_z = ARM_G(6) * ARM_G(6) + ARM_G(7) * ARM_G(7) + ARM_G(8) * ARM_G(8) - 1.0;
        const double cross = ARM_G(0) * ARM_G(6) + ARM_G(1) * ARM_G(7) + ARM_G(2) * ARM_G(8);
        const double y0 = ARM_G(7) * ARM_G(2) - ARM_G(8) * ARM_G(1) - ARM_G(3);
        const double y1 = ARM_G(8) * ARM_G(0) - ARM_G(6) * ARM_G(2) - ARM_G(4);
        const double y2 = ARM_G(6) * ARM_G(1) - ARM_G(7) * ARM_G(0) - ARM_G(5);
        unread[i] = !(fabs(off_x) <= ARM_ROUNDED) | !(fabs(off_z) <= ARM_ROUNDED) | !(fabs(cross) <= ARM_ROUNDED)
            | !(fabs(y0) <= ARM_ROUNDED) | !(fabs(y1) <= ARM_ROUNDED) | !(fabs(y2) <= ARM_ROUNDED)
            | !(fabs(ARM_G(9)) <= ARM_FARTHEST) | !(fabs(ARM_G(10)) <= ARM_FARTHEST) | !(fabs(ARM_G(11)) <= ARM_FARTHEST);
#undef ARM_G
    }
}

/* Whether a rotation is of whole numbers, so that it does not show whether its target is rounded. */
ARM_INLINE int arm_hides(const double *goal)
{
    int k, whole = 1;
    for (k = 0; k < 9; k++)
        whole &= fabs(goal[k * ARM_LANES] - rint(goal[k * ARM_LANES])) <= ARM_ROUNDED;
    return whole;
}
