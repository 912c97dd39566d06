/* What becomes of a target: solved, left to Python (on an edge), left to Python until it has been read (no rotation to
   rounding, not finite, too large). */
enum { ARM_DONE = 0, ARM_OPEN = 1, ARM_UNREAD = 2 };

/* Whether a branch at `near` is outside limits or a whole turn away from there: `near` may solve the target, too. */
static int arm_beside(const double *q, const double *near, int inside)
{
    int j, there = inside;
    for (j = 0; j < ARM_JOINTS; j++) {
        const double d = q[j * ARM_LANES] - near[j * ARM_LANES];
        there &= fabs(d) < @beside@;
        if (!(fabs(d - ARM_TURN * rint(d / ARM_TURN)) < @beside@)) /* of a slide, too: Python decides */
            return 0;
    }
    return !there;
}

/* All branches of n targets, in the layout of `armkin.Solutions`; near_step: 0 if one `near` serves all, else the
   number of joints. read: whether the targets have been read. Returns how many are not done. */
int64_t arm_batch(int64_t n, const double *target, const double *near, int64_t near_step, int64_t read, double *out_q,
    uint8_t *valid, uint8_t *within, int8_t *branch, int8_t *status, uint8_t *state)
{
    double goal[ARM_GOAL * ARM_LANES], close[ARM_JOINTS * ARM_LANES];
    double q[ARM_BRANCHES * ARM_JOINTS * ARM_LANES], miss[ARM_BRANCHES * ARM_LANES];
    int inside[ARM_BRANCHES * ARM_LANES], doubt[ARM_LANES], unread[ARM_LANES],
        limit[ARM_LANES];
    int64_t start, left = 0;
    int i, j, b;
    for (i = 0; i < ARM_LANES; i++)
        for (j = 0; j < ARM_JOINTS; j++)
            close[j * ARM_LANES + i] = near[j];
    for (start = 0; start < n; start += ARM_LANES) {
        const int count = n - start < ARM_LANES ? (int)(n - start) : ARM_LANES;
        arm_gather(target + start * ARM_TARGET, goal, unread, count);
        if (near_step)
            for (i = 0; i < count; i++)
                for (j = 0; j < ARM_JOINTS; j++)
                    close[j * ARM_LANES + i] = near[(start + i) * near_step + j];
        if (near_step || !start)
            for (i = 0; i < ARM_LANES; i++)
                limit[i] = arm_on_limit(close + i);
        arm_candidates(goal, close, q, miss, doubt, count);
        arm_choose(close, q, inside, count);
        for (b = 0; b < ARM_BRANCHES; b++)
            for (i = 0; i < count; i++)
                doubt[i] |= !(miss[b * ARM_LANES + i] <= @accepted@) & !(miss[b * ARM_LANES + i] > ARM_NEARBY);
        for (b = 0; b < ARM_BRANCHES; b++)
            for (i = 0; i < count; i++)
                if (limit[i] && !doubt[i])
                    doubt[i] = arm_beside(q + b * ARM_JOINTS * ARM_LANES + i, close + i, inside[b * ARM_LANES + i]);
        for (i = 0; i < count; i++) {
            const int64_t at = start + i;
            double *row = out_q + at * ARM_BRANCHES * ARM_JOINTS;
            uint8_t *is_valid = valid + at * ARM_BRANCHES, *is_within = within + at * ARM_BRANCHES;
            int8_t *index = branch + at * ARM_BRANCHES;
            int place = 0;
            state[at] = (uint8_t)(unread[i] && !read ? ARM_UNREAD : doubt[i] ? ARM_OPEN : ARM_DONE);
            if (state[at] != ARM_DONE) {
                left++;
                continue;
            }
            for (b = 0; b < ARM_BRANCHES; b++) {
                if (!(miss[b * ARM_LANES + i] <= @accepted@))
                    continue;
                for (j = 0; j < ARM_JOINTS; j++)
                    row[place * ARM_JOINTS + j] = q[(b * ARM_JOINTS + j) * ARM_LANES + i];
                is_valid[place] = 1;
                is_within[place] = (uint8_t)inside[b * ARM_LANES + i];
                index[place] = (int8_t)@index@;
                place++;
            }
            status[at] = place ? 0 : 3;
            for (; place < ARM_BRANCHES; place++) {
                for (j = 0; j < ARM_JOINTS; j++)
                    row[place * ARM_JOINTS + j] = NAN;
                is_valid[place] = is_within[place] = 0;
                index[place] = -1;
            }
        }
    }
    return left;
}

/* One target. block: target, near; then the results: q, and as bytes valid, within, branch, free (left alone), status,
   state. Returns 0 if it is solved, 1 if it is and no branch reaches it, 2 if it is left to Python. */
int64_t arm_single(double *block)
{
    const double *near = block + ARM_TARGET;
    double *q = block + ARM_TARGET + ARM_JOINTS;
    uint8_t *bytes = (uint8_t *)(q + ARM_BRANCHES * ARM_JOINTS);
    uint8_t *rest = bytes + 3 * ARM_BRANCHES + ARM_JOINTS;
    int j;
    for (j = 0; j < ARM_JOINTS; j++)
        if (!(fabs(near[j]) <= ARM_LARGEST))
            return 2;
    arm_batch(1, block, near, 0, 0, q, bytes, bytes + ARM_BRANCHES, (int8_t *)bytes + 2 * ARM_BRANCHES, (int8_t *)rest,
        rest + 1);
    return rest[1] != ARM_DONE ? 2 : rest[0] != 0;
}
