
/* The redundant joint is held where `near` has it: its motion is undone in the target, the others reach what is left. */
static void arm_candidates(const double *ARM_RESTRICT goal, const double *ARM_RESTRICT near, double *ARM_RESTRICT q,
    double *ARM_RESTRICT miss, int *ARM_RESTRICT doubt, int count)
{
    double others[@goal@ * ARM_LANES], found[ARM_BRANCHES * @others@ * ARM_LANES];
    int i, j, b;
    for (i = 0; i < count; i++) {
        @lines@
    }
    arm_other_candidates(others, near, found, miss, doubt, count);
    for (b = 0; b < ARM_BRANCHES; b++)
        for (j = 0; j <= @others@; j++)
            for (i = 0; i < count; i++)
                q[(b * (@others@ + 1) + j) * ARM_LANES + i] = j == @held@
                    ? near[@held@ * ARM_LANES + i]
                    : found[(b * @others@ + j - (j > @held@)) * ARM_LANES + i];
}
