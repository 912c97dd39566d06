/* The columns x, y, z and the position of a target; its rotation is made orthonormal. 0: it is none, or not
   finite. */
static int arm_read(const arm_real *target, arm_real *goal)
{
    int i, j, round;
    for (i = 0; i < 12; i++)
        goal[i] = target[4 * (i % 3) + i / 3];
    for (i = 9; i < 12; i++)
        if (!(ARM_ABS(goal[i]) <= ARM_LARGEST))
            return 0;
    for (round = 0; round < 3; round++) { /* R (3 - R^T R) / 2, which squares the distance from a rotation */
        arm_real s[3][3], R[9];
        for (i = 0; i < 3; i++)
            for (j = 0; j < 3; j++) {
                const arm_real *u = &goal[3 * i], *v = &goal[3 * j];
                const arm_real off = u[0] * v[0] + u[1] * v[1] + u[2] * v[2] - (i == j ? 1 : 0);
                if (!(ARM_ABS(off) <= ARM_ROTATION))
                    return 0;
                s[i][j] = (i == j ? 1 : 0) - off / 2;
            }
        for (i = 0; i < 9; i++)
            R[i] = goal[i % 3] * s[0][i / 3] + goal[3 + i % 3] * s[1][i / 3] + goal[6 + i % 3] * s[2][i / 3];
        for (i = 0; i < 9; i++)
            goal[i] = R[i];
    }
    return goal[0] * (goal[4] * goal[8] - goal[5] * goal[7]) - goal[1] * (goal[3] * goal[8] - goal[5] * goal[6])
        + goal[2] * (goal[3] * goal[7] - goal[4] * goal[6]) > 0;
}

/* The square of what `near` may miss a target by, whose rotation tells how it was rounded: by how far it is from
   orthonormal, and by the last digit of its entries (those below 1e-4 have few), or that they have single precision. */
static arm_real arm_most(const arm_real *target)
{
    arm_real defect = 0, half = 0, unit = (arm_real)1e5, missed;
    int i, j, digits, single = 1, here = 0;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) {
            const arm_real *u = target + i, *v = target + j;
            const arm_real off = ARM_ABS(u[0] * v[0] + u[4] * v[4] + u[8] * v[8] - (i == j ? 1 : 0));
            defect = off > defect ? off : defect;
            single &= (arm_real)(float)u[4 * j] == u[4 * j];
        }
    if (!(defect > ARM_ROUNDED))
        return ARM_SOLUTION;
    for (digits = 5; digits < 12 && !single && !here; digits++, unit *= 10) {
        for (here = 1, i = 0; i < 9; i++) {
            const arm_real x = ARM_ABS(target[4 * (i / 3) + i % 3]);
            arm_real scaled = x < 1 ? x * unit : x * unit / 10;
            for (j = 0; j < 3 && scaled < unit / 10; j++)
                scaled *= 10;
            here &= x < (arm_real)1e-4 || ARM_ABS(scaled - ARM_RINT(scaled)) <= 2 * ARM_DECIMAL * scaled;
        }
        half = here ? (arm_real)0.5 / unit : 0;
    }
    half = single ? ARM_FLOAT : half;
    missed = ARM_SQRT(ARM_SOLUTION) + (4 * defect > 12 * half ? 4 * defect : 12 * half);
    return missed * missed;
}
