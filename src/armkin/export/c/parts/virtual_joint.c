
/* A pose whose z axis is the one wanted; the joint that would turn about it is dropped. */
static void arm_candidates(const double *ARM_RESTRICT axis, const double *ARM_RESTRICT near, double *ARM_RESTRICT q,
    double *ARM_RESTRICT miss, int *ARM_RESTRICT doubt, int count)
{
    double goal[12 * ARM_LANES];
    int i;
    for (i = 0; i < count; i++) {
        @lines@
    }
    arm_six_candidates(goal, near, q, miss, doubt, count);
}
