/* What becomes of a target: solved, left to Python (on an edge), left to Python until it has been read (no rotation to
   rounding, not finite, too large). */
enum { ARM_DONE = 0, ARM_OPEN = 1, ARM_UNREAD = 2 };
#define ARM_CACHES 16000000 /* bytes of joint values that caches may keep */

/* Where the tool is at `near`, of count poses whose joint values stand `step` apart; nan where `near` is outside limits.
   wild: whether an angle is so large that Python has to say. */
static void arm_stand(const double *near, int64_t step, double *point, int *wild, int count)
{
    static const double lowest[ARM_JOINTS] = {@lowest@}, highest[ARM_JOINTS] = {@highest@};
    double q[ARM_JOINTS * ARM_POINTS];
    int legal[ARM_POINTS];
    int i, j;
    for (i = 0; i < count; i++) {
        legal[i] = 1;
        wild[i] = 0;
        for (j = 0; j < ARM_JOINTS; j++) {
            const double value = near[i * step + j];
            q[j * ARM_POINTS + i] = value;
            legal[i] &= (value >= lowest[j]) & (value <= highest[j]);
            wild[i] |= !(fabs(value) <= ARM_WILD);
        }
    }
    arm_point(q, point, count);
    for (i = 0; i < count; i++)
        if (!legal[i])
            point[i] = NAN;
}

/* Which branch is at `near`, modulo whole turns; -1 if none is. */
static int arm_beside(const double *q, const double *near, const double *miss)
{
    static const double close[ARM_JOINTS] = {@close@};
    static const int slides[ARM_JOINTS] = {@slides@};
    int b, j;
    for (b = 0; b < ARM_BRANCHES; b++) {
        int there = miss[b * ARM_LANES] <= @accepted@;
        for (j = 0; there && j < ARM_JOINTS; j++) {
            const double d = q[(b * ARM_JOINTS + j) * ARM_LANES] - near[j * ARM_LANES];
            there = fabs(slides[j] ? d : d - ARM_TURN * rint(d / ARM_TURN)) <= close[j];
        }
        if (there)
            return b;
    }
    return -1;
}

#ifdef __SSE2__
#include <emmintrin.h>
#endif

/* A row of joint values written past the caches, where the results do not fit into them: else all of their memory is read
   before it is written. */
ARM_INLINE void arm_past_caches(double *to, const double *row)
{
    int k = 0;
#ifdef __SSE2__
    for (; k + 2 <= ARM_BRANCHES * ARM_JOINTS; k += 2)
        _mm_stream_pd(to + k, _mm_loadu_pd(row + k));
#endif
    for (; k < ARM_BRANCHES * ARM_JOINTS; k++)
        to[k] = row[k];
}

/* All branches of n targets, in the layout of `armkin.Solutions`; near_step: 0 if one `near` serves all, else the
   number of joints. read: whether the targets have been read; free: zeros, which become 1 where joints are free. Returns
   how many are not done. */
int64_t arm_batch(int64_t n, const double *target, const double *near, int64_t near_step, int64_t read, double *out_q,
    uint8_t *valid, uint8_t *within, int8_t *branch, int8_t *status, uint8_t *free, uint8_t *state)
{
    double goal[ARM_GOAL * ARM_LANES], close[ARM_JOINTS * ARM_LANES];
    double q[ARM_BRANCHES * ARM_JOINTS * ARM_LANES], miss[ARM_BRANCHES * ARM_LANES];
    double point[3 * ARM_POINTS], kept[ARM_BRANCHES * ARM_JOINTS];
    const int far = n * (int64_t)sizeof kept > ARM_CACHES && (uintptr_t)out_q % 16 == 0 && sizeof kept % 16 == 0;
    int inside[ARM_BRANCHES * ARM_LANES], doubt[ARM_LANES], unread[ARM_LANES], wild[ARM_POINTS], at_near[ARM_LANES];
    int meets[ARM_LANES];
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
        if (near_step)
            arm_stand(near + start * near_step, near_step, point, wild, count);
        else if (!start)
            arm_stand(near, 0, point, wild, n < ARM_LANES ? (int)n : ARM_LANES);
        arm_candidates(goal, close, q, miss, doubt, count);
        arm_choose(close, q, inside, count);
        for (b = 0; b < ARM_BRANCHES; b++)
            for (i = 0; i < count; i++)
                doubt[i] |= !(miss[b * ARM_LANES + i] <= @accepted@) & !(miss[b * ARM_LANES + i] > ARM_NEARBY);
        for (i = 0; i < count; i++) {
            int close_by = 1;
            at_near[i] = 1;
            for (j = 0; j < @position@; j++) { /* where the tool is elsewhere, `near` is no solution */
                const double d = fabs(goal[(@first@ + j) * ARM_LANES + i] - point[j * ARM_POINTS + i]);
                at_near[i] &= d <= @room@;
                close_by &= d <= @coarse@;
            }
            doubt[i] |= 2 * (wild[i] | (close_by && !at_near[i] && arm_hides(goal + i)));
            meets[i] = 0;
            if (doubt[i] == 1 && !at_near[i] && (read || !unread[i])) {
                meets[i] = arm_folds(goal + i, q + i, close + i, inside + i, miss + i, free + (start + i) * ARM_JOINTS);
                doubt[i] = meets[i] < 0;
            }
        }
        for (i = 0; i < count; i++)
            if (at_near[i] && !doubt[i]) {
                b = arm_beside(q + i, close + i, miss + i);
                doubt[i] = b < 0; /* it may solve the target all the same */
                for (j = 0; b >= 0 && j < ARM_JOINTS; j++)
                    q[(b * ARM_JOINTS + j) * ARM_LANES + i] = close[j * ARM_LANES + i];
                if (b >= 0)
                    inside[b * ARM_LANES + i] = 1;
            }
        for (i = 0; i < count; i++) {
            const int64_t at = start + i;
            double *row = far ? kept : out_q + at * ARM_BRANCHES * ARM_JOINTS;
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
            status[at] = (int8_t)(place ? meets[i] : 3);
            for (; place < ARM_BRANCHES; place++) {
                for (j = 0; j < ARM_JOINTS; j++)
                    row[place * ARM_JOINTS + j] = NAN;
                is_valid[place] = is_within[place] = 0;
                index[place] = -1;
            }
            if (far)
                arm_past_caches(out_q + at * ARM_BRANCHES * ARM_JOINTS, kept);
        }
    }
#ifdef __SSE2__
    if (far)
        _mm_sfence(); /* before other threads read them */
#endif
    return left;
}

/* One target. block: target, near; then the results: q, and as bytes valid, within, branch, free, status, state. Returns
   its status, or ARM_LEFT if it is left to Python. */
enum { ARM_LEFT = 4 };
int64_t arm_single(double *block)
{
    const double *near = block + ARM_TARGET;
    double *q = block + ARM_TARGET + ARM_JOINTS;
    uint8_t *bytes = (uint8_t *)(q + ARM_BRANCHES * ARM_JOINTS);
    uint8_t *rest = bytes + 3 * ARM_BRANCHES + ARM_JOINTS;
    int j;
    for (j = 0; j < ARM_JOINTS; j++)
        if (!(fabs(near[j]) <= ARM_LARGEST))
            return ARM_LEFT;
    memset(bytes + 3 * ARM_BRANCHES, 0, ARM_JOINTS);
    arm_batch(1, block, near, 0, 0, q, bytes, bytes + ARM_BRANCHES, (int8_t *)bytes + 2 * ARM_BRANCHES, (int8_t *)rest,
        bytes + 3 * ARM_BRANCHES, rest + 1);
    return rest[1] != ARM_DONE ? ARM_LEFT : rest[0];
}
