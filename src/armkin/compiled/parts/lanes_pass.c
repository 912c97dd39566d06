#define ARM_WORTH 3 /* poses whose roots are found in lockstep: fewer are as quick one by one */

/* A candidate of one of some poses. */
typedef struct {
    arm_seed seed;
    double x;
    int lane, known; /* known: joint values have been found */
} arm_many_seed;

/* What one pass says of lane t. */
static void arm_read_lane(const arm_pencil *pencil, const arm_many_poses *of, int t, arm_solved *out)
{
    int i;
    for (i = 0; i < pencil->size; i++) {
        out->re[i] = of->re[i][t];
        out->im[i] = of->im[i][t];
    }
    out->most = of->most[t];
    out->open = of->open[t] != 0;
}

/* The equations there, too. */
static void arm_read_equations(const arm_pencil *pencil, const arm_many_poses *of, int t, arm_solved *out)
{
    const int p = pencil->wide ? 16 : 12;
    int i;
    for (i = 0; i < p * (p + pencil->size); i++)
        out->E[i] = of->E[i][t];
    for (i = 0; i < 12; i++)
        out->Y[i] = of->Y[i][t];
    for (i = 0; i < 80; i++)
        out->ends.recover[i] = i % 16 < 15 ? of->recover[15 * (i / 16) + i % 16][t] : 0;
}

/* The same the other way round. */
static void arm_write_lane(const arm_pencil *pencil, const arm_solved *from, int t, arm_many_poses *of)
{
    const int p = pencil->wide ? 16 : 12;
    int i;
    for (i = 0; i < pencil->size; i++) {
        of->re[i][t] = from->re[i];
        of->im[i][t] = from->im[i];
    }
    of->most[t] = from->most;
    of->open[t] = -from->open;
    for (i = 0; i < p * (p + pencil->size); i++)
        of->E[i][t] = from->E[i];
    for (i = 0; i < 75; i++)
        of->recover[i][t] = from->ends.recover[16 * (i / 15) + i % 15];
}

/* Candidates of lane t, of roots `solved`: those that are taken apart are known. */
static int arm_seeds_of_lane(const arm_pencil *pencil, const arm_many_poses *of, int t, arm_solved *solved,
    arm_many_seed *out)
{
    double tilt[ARM_MOST];
    int order[ARM_MOST], i, j, k, groups, count = 0, whole = 0;
    arm_group group[ARM_MOST];
    groups = arm_groups(pencil, solved->re, solved->im, ARM_MAIN_TILT, pencil->wide, order, tilt, group);
    for (i = 0; i < groups; i++) {
        int found = -1;
        if (group[i].d && count + group[i].d <= ARM_MOST) {
            arm_seed apart[ARM_SHARED];
            if (!whole++)
                arm_read_equations(pencil, of, t, solved);
            found = arm_shared(pencil, solved->E, solved->Y, &solved->ends, group[i].mean, group[i].d, apart);
            for (j = 0; j < found; j++) {
                out[count + j].seed = apart[j];
                out[count + j].lane = t;
                out[count + j].known = 1;
            }
        }
        if (found >= 0) {
            count += found;
            continue;
        }
        for (k = group[i].from; k < group[i].end && count < ARM_MOST; k++) {
            arm_many_seed *one = &out[count++];
            one->seed.tilt = tilt[order[k]];
            one->seed.root = order[k];
            one->x = solved->re[order[k]];
            one->lane = t;
            one->known = 0;
        }
    }
    return count;
}

/* Up to ARM_MANY candidates: their joint values, and what steps bring them to. */
static void arm_chase(const arm_pencil *pencil, const arm_many_poses *of, arm_many_seed *seed, arm_answer *done, int count)
{
    arm_flags lane;
    arm_many x, u[16], v[16], Y[12], goal[12], recover[75], q[6] = {arm_all(0)}, defect = arm_all(0), residual, guess, weakness;
    int i, k, t, known = 1;
    for (t = 0; t < ARM_MANY; t++) {
        const arm_many_seed *one = &seed[t < count ? t : 0];
        lane[t] = one->lane;
        x[t] = one->known ? 1 : one->x;
        known &= one->known;
    }
    for (i = 0; i < 12; i++)
        goal[i] = arm_take(of->goal[i], lane);
    if (!known) {
        for (i = 0; i < 12; i++)
            Y[i] = arm_take(of->Y[i], lane);
        for (i = 0; i < 75; i++)
            recover[i] = arm_take(of->recover[i], lane);
        arm_null_lanes(pencil, of->E, lane, x, u);
        arm_vector_lanes(pencil, u, x, v);
        arm_joints_lanes(pencil, v, Y, recover, x, q, &defect);
    }
    for (t = 0; t < ARM_MANY; t++) {
        arm_many_seed *one = &seed[t < count ? t : 0];
        for (k = 0; k < 6; k++)
            if (one->known)
                q[k][t] = one->seed.q[k];
            else if (t < count)
                one->seed.q[k] = q[k][t];
        if (!one->known && t < count)
            one->seed.defect = defect[t];
    }
    arm_refine_lanes(goal, 4, q, &residual, &guess, &weakness);
    for (t = 0; t < count; t++) {
        for (k = 0; k < 6; k++)
            done[t].q[k] = q[k][t];
        done[t].residual = residual[t];
        done[t].guess = guess[t];
        done[t].weakness = weakness[t];
    }
}

/* The first pass over up to ARM_MANY poses of one kind. */
static void arm_pass_lanes(const arm_pencil *pencil, arm_state **pose, int count)
{
    arm_many_poses of;
    arm_solved solved[ARM_MANY];
    arm_many_seed seed[ARM_MANY * ARM_MOST];
    arm_answer done[ARM_MANY * ARM_MOST];
    int i, j, t, seeds = 0, begin[ARM_MANY + 1];
    for (t = 0; t < ARM_MANY; t++) {
        const double *goal = pose[t < count ? t : 0]->goal;
        double back[12];
        arm_invert(goal, back); /* the pose link closes the loop */
        for (i = 0; i < 12; i++) {
            of.goal[i][t] = goal[i];
            of.Y[i][t] = pencil->backward ? goal[i] : back[i];
        }
    }
    if (count >= ARM_WORTH)
        arm_roots_lanes(pencil, &of);
    else
        for (t = 0; t < count; t++) {
            of.lost[t] = -!arm_solve(pencil, pose[t]->goal, 0, &solved[t]);
            if (!of.lost[t])
                arm_write_lane(pencil, &solved[t], t, &of);
        }
    for (t = 0; t < count; t++) {
        begin[t] = seeds;
        if (of.lost[t])
            continue;
        arm_read_lane(pencil, &of, t, &solved[t]);
        seeds += arm_seeds_of_lane(pencil, &of, t, &solved[t], seed + seeds);
    }
    begin[count] = seeds;
    for (i = 0; i < seeds; i += ARM_MANY)
        arm_chase(pencil, &of, seed + i, done + i, seeds - i < ARM_MANY ? seeds - i : ARM_MANY);
    for (t = 0; t < count; t++) {
        arm_state *one = pose[t];
        arm_seed kept[ARM_MOST];
        const int from = begin[t];
        if (of.lost[t]) {
            one->open = arm_attempt(one->goal, one->kind, 0, one->found, &one->number, &one->edge);
            continue;
        }
        for (i = j = from; i < begin[t + 1]; i++) {
            if (of.most[t] < ARM_STEADY && done[i].guess > ARM_STRAY
                && arm_may_be_empty(&seed[i].seed, solved[t].re, solved[t].im, pencil->size))
                continue;
            kept[j - from] = seed[i].seed;
            done[j++] = done[i];
        }
        one->open = solved[t].open
            | arm_judge(pencil, 0, kept, done + from, j - from, one->found, &one->number, &one->edge);
    }
}

/* The first pass over some poses, those of a kind in lockstep. */
static void arm_first_pass(arm_state *state, int count)
{
    int i, kind;
    for (kind = 0; kind < 3; kind++) {
        arm_state *pose[ARM_MANY];
        int number = 0;
        for (i = 0; i < count; i++) {
            if (state[i].kind == kind)
                pose[number++] = &state[i];
            if (number == ARM_MANY || (number && i == count - 1)) {
                arm_pass_lanes(&arm_pencils[arm_plan[kind * ARM_PASSES]], pose, number);
                number = 0;
            }
        }
    }
}
