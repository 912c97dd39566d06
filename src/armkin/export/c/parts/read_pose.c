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

/* By how much a position may be off that has three decimals or six digits, and eleven at most, or is of floats [mm]: half a
   unit of the largest coordinate's last digit, in each coordinate. */
static arm_real arm_last_place(const arm_real *target)
{
    arm_real largest = 0, half = 0;
    int i, digits = 6, typed = 1, single = 1;
    for (i = 0; i < 3; i++) {
        const arm_real x = ARM_ABS(target[4 * i + 3]);
        arm_real scale = 1;
        int own = 6;
        if (x < (arm_real)1e-9)
            continue;
        single &= (arm_real)(float)x == x;
        while (x * scale < (arm_real)1e5)
            scale *= 10;
        typed &= ARM_ABS(100 * x - ARM_RINT(100 * x)) <= 100 * ARM_DECIMAL * x
            && ARM_ABS(x * scale / 10 - ARM_RINT(x * scale / 10)) <= ARM_DECIMAL * x * scale;
        half = x > largest ? (arm_real)0.5 / scale : half;
        largest = x > largest ? x : largest;
        for (; own < 12 && ARM_ABS(x * scale - ARM_RINT(x * scale)) > ARM_DECIMAL * x * scale; own++)
            scale *= 10;
        digits = own > digits ? own : digits;
    }
    if (typed || (digits == 12 && !single))
        return 0;
    half = digits == 12 ? ARM_FLOAT * largest : half;
    for (; digits > 6 && digits < 12; digits--)
        half /= 10;
    return ARM_SQRT((arm_real)3) * half;
}

/* The square of what `near` may miss a target by, whose rotation tells how it was rounded: by how far it is from
   orthonormal, and by the last digit of its entries (those below 1e-4 have few), or that they have single precision. One of whole numbers
   shows nothing: there the position tells. */
static arm_real arm_most(const arm_real *target)
{
    arm_real defect = 0, half = 0, unit = (arm_real)1e5, missed;
    int i, j, digits, single = 1, whole = 1, here = 0;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) {
            const arm_real *u = target + i, *v = target + j;
            const arm_real off = ARM_ABS(u[0] * v[0] + u[4] * v[4] + u[8] * v[8] - (i == j ? 1 : 0));
            defect = off > defect ? off : defect;
            single &= (arm_real)(float)u[4 * j] == u[4 * j];
            whole &= ARM_ABS(u[4 * j] - ARM_RINT(u[4 * j])) <= ARM_ROUNDED;
        }
    if (!(defect > ARM_ROUNDED)) {
        missed = ARM_SQRT(ARM_SOLUTION) + (whole ? arm_last_place(target) / @reach@ : 0);
        return missed * missed;
    }
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
