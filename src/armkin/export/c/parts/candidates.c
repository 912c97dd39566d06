/* As of a closed form, for up to ARM_LANES poses. goal: twelve numbers, columns x, y, z and the position [mm]. doubt: 1 for
   an answer near a singularity, merged answers or touching roots; 2 (or 3) for a double root, no exact answer, or a pose
   that no pass has settled. */
static void arm_candidates(const double *ARM_RESTRICT goal, const double *ARM_RESTRICT near, double *ARM_RESTRICT q,
    double *ARM_RESTRICT miss, int *ARM_RESTRICT doubt, int count)
{
    arm_state state[ARM_LANES];
    int i, j, k, lane;
    (void)near;
    for (lane = 0; lane < count; lane++) {
        double target[12], scaled[12];
        for (i = 0; i < 3; i++)
            for (j = 0; j < 4; j++)
                target[4 * i + j] = goal[(3 * j + i) * ARM_LANES + lane] / (j == 3 ? ARM_LENGTH : 1);
        arm_times(arm_from_base, target, scaled);
        arm_times(scaled, arm_from_tool, state[lane].goal);
        state[lane].kind = arm_kind(state[lane].goal);
        state[lane].number = state[lane].edge = 0;
    }
    arm_first_pass(state, count);
    for (lane = 0; lane < count; lane++) {
        arm_state *one = &state[lane];
        arm_answer *found = one->found;
        int pass, number, exact = 0;
        for (pass = 1; pass < ARM_PASSES && one->open; pass++) {
            one->edge |= arm_shakes[pass] > 0; /* a singular posture may be missing where the target had to be moved */
            one->open = arm_attempt(one->goal, one->kind, pass, found, &one->number, &one->edge);
        }
        for (i = 0; i < one->number; i++)
            exact += found[i].residual < ARM_ELIMINATED;
        for (i = number = 0; i < one->number; i++) /* a closest point stands in for answers only where there are none */
            if (!exact || found[i].residual < ARM_ELIMINATED)
                found[number++] = found[i];
        number = arm_merge(one->goal, found, number, &one->edge);
        doubt[lane] = one->open || number > ARM_BRANCHES || (number && !exact) ? 2 : one->edge;
        for (i = 0; i < number; i++)
            doubt[lane] |= !(found[i].weakness <= ARM_ILL_INVERSE) + 2 * !(found[i].weakness * ARM_DOUBLE_VALUE <= 1);
        for (i = 0; i < ARM_BRANCHES; i++) {
            for (j = 0; j < ARM_JOINTS; j++) {
                k = (i * ARM_JOINTS + j) * ARM_LANES + lane;
                q[k] = i < number ? found[i].q[j] * (arm_loop_slides[j] ? ARM_LENGTH : 1) : 0;
            }
            miss[i * ARM_LANES + lane]
                = i < number ? found[i].residual * found[i].residual * ARM_RESIDUAL : ARM_INFINITY;
        }
    }
}
