const char *const arm_pairs[][2] = {
    @pairs@};

int arm_free(const arm_real *q, arm_real *clearance, int *pair)
{
    arm_real ends[6 * ARM_SEGMENTS];
    int nearest;
    arm_real least;
    arm_ends(q, ends, 1);
    least = arm_least(ends, &nearest);
    if (clearance)
        *clearance = least;
    if (pair)
        *pair = nearest;
    return least >= 0;
}
