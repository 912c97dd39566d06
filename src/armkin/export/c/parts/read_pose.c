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
