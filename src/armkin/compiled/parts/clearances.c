/* Least clearances, and the numbers of their pairs, of up to ARM_LANES joint values. */
static void arm_clearance(const double *q, double *found, int count)
{
    double of_all[6 * ARM_SEGMENTS * ARM_LANES], ends[6 * ARM_SEGMENTS];
    int i, j, pair;
    arm_ends(q, of_all, count);
    for (i = 0; i < count; i++) {
        for (j = 0; j < 6 * ARM_SEGMENTS; j++)
            ends[j] = of_all[j * ARM_LANES + i];
        found[i] = arm_least(ends, &pair);
        found[ARM_LANES + i] = pair;
    }
}
