#define ARM_WORTH 3 /* poses whose roots are found in lockstep: fewer are as quick one by one */

/* A candidate of one of some poses; v: its products, where they are known. */
typedef struct {
    arm_seed seed;
    const double *v;
    double x;
    int lane;
} arm_many_seed;

/* The roots of one pose, by groups. */
typedef struct {
    arm_group group[ARM_MOST];
    double tilt[ARM_MOST];
    int order[ARM_MOST], groups;
} arm_lane_groups;

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

/* Candidates of lane t, whose roots are `solved`; *apart: its groups that were taken apart, after which it points. */
static int arm_seeds_of_lane(const arm_solved *solved, const arm_lane_groups *of, int t, const arm_many_group **apart,
    arm_many_seed *out)
{
    int i, k, count = 0;
    for (i = 0; i < of->groups; i++) {
        const arm_group *group = &of->group[i];
        const arm_many_group *known = group->d ? (*apart)++ : 0;
        const int all = known && known->found >= 0;
        for (k = 0; k < (all ? known->found : group->end - group->from) && count < ARM_MOST; k++) {
            arm_many_seed *one = &out[count++];
            const int root = of->order[group->from + (all ? 0 : k)];
            one->seed.tilt = all ? 0 : of->tilt[root];
            one->seed.root = all ? -1 : root;
            one->x = all ? known->x : solved->re[root];
            one->v = all ? known->v + 16 * k : 0;
            one->lane = t;
        }
    }
    return count;
}

/* Up to ARM_MANY candidates: their joint values, and what steps bring them to. */
static void arm_chase(const arm_pencil *pencil, const arm_many_poses *of, arm_many_seed *seed, arm_answer *done, int count)
{
    arm_flags lane;
    arm_many A[256], x, u[16], v[16], Y[12], goal[12], recover[75], q[6], defect, residual, guess, weakness;
    int i, k, t, known = 1;
    for (t = 0; t < ARM_MANY; t++) {
        const arm_many_seed *one = &seed[t < count ? t : 0];
        lane[t] = one->lane;
        x[t] = one->x;
        known &= one->v != 0;
    }
    for (i = 0; i < 12; i++) {
        goal[i] = arm_take(of->goal[i], lane);
        Y[i] = arm_take(of->Y[i], lane);
    }
    for (i = 0; i < 75; i++)
        recover[i] = arm_take(of->recover[i], lane);
    if (!known) {
        arm_system_lanes(pencil, of->E, lane, x, A);
        arm_null_lanes(A, pencil->wide ? 16 : 12, u);
        arm_vector_lanes(pencil, u, x, v);
    }
    for (t = 0; t < ARM_MANY; t++) {
        const double *own = seed[t < count ? t : 0].v;
        for (i = 0; own && i < (pencil->wide ? 16 : 12); i++)
            v[i][t] = own[i];
    }
    arm_joints_lanes(pencil, v, Y, recover, x, q, &defect);
    for (t = 0; t < count; t++) {
        for (k = 0; k < 6; k++)
            seed[t].seed.q[k] = q[k][t];
        seed[t].seed.defect = defect[t];
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

/* What lanes' roots stand for, and where each lane's candidates begin; v: room for the products of roots that are taken
   apart, which their groups hold. */
static void arm_seeds_of_lanes(const arm_pencil *pencil, const arm_many_poses *of, const arm_solved *solved, int count,
    double *v, arm_many_seed *seed, int *begin)
{
    arm_lane_groups every[ARM_MANY];
    arm_many_group apart[ARM_MANY * ARM_MOST / 2];
    const arm_many_group *next = apart;
    int i, t, shared = 0, seeds = 0;
    for (t = 0; t < count; t++) {
        arm_lane_groups *own = &every[t];
        own->groups = of->lost[t] ? 0 : arm_groups(pencil, solved[t].re, solved[t].im, ARM_MAIN_TILT, pencil->wide,
            own->order, own->tilt, own->group);
        for (i = 0; i < own->groups; i++)
            if (own->group[i].d) {
                arm_many_group *one = &apart[shared++];
                one->lane = t;
                one->d = own->group[i].d;
                one->x = own->group[i].mean;
                one->v = v;
                v += 16 * one->d;
            }
    }
    arm_take_apart(pencil, of->E, apart, shared);
    for (t = 0; t < count; t++) {
        begin[t] = seeds;
        seeds += arm_seeds_of_lane(&solved[t], &every[t], t, &next, seed + seeds);
    }
    begin[count] = seeds;
}

/* The first pass over up to ARM_MANY poses of one kind. */
static void arm_pass_lanes(const arm_pencil *pencil, arm_state **pose, int count)
{
    arm_many_poses of;
    arm_solved solved[ARM_MANY];
    arm_many_seed seed[ARM_MANY * ARM_MOST];
    arm_answer done[ARM_MANY * ARM_MOST];
    double products[16 * ARM_MANY * ARM_MOST];
    int i, j, t, begin[ARM_MANY + 1];
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
    for (t = 0; t < count; t++)
        if (!of.lost[t])
            arm_read_lane(pencil, &of, t, &solved[t]);
    arm_seeds_of_lanes(pencil, &of, solved, count, products, seed, begin);
    for (i = 0; i < begin[count]; i += ARM_MANY)
        arm_chase(pencil, &of, seed + i, done + i, begin[count] - i < ARM_MANY ? begin[count] - i : ARM_MANY);
    for (t = 0; t < count; t++) {
        arm_state *one = pose[t];
        arm_seed kept[ARM_MOST];
        const int from = begin[t];
        if (of.lost[t]) {
            one->open = arm_attempt(one->goal, one->kind, 0, one->found, &one->number, &one->edge);
            continue;
        }
        for (i = j = from; i < begin[t + 1]; i++) {
            if (of.most[t] < ARM_STEADY && done[i].guess > ARM_STRAY_DISTANCE
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
