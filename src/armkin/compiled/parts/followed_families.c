/* Families of targets, followed along the redundant joint from place to place where anything can change. */

/* Samples evenly over the turn and on both sides of all places, which are sorted. */
static void arm_spread(const double *place, int places, arm_samples *all)
{
    double extra[2 * ARM_PLACES];
    int i, k, count = 0;
    for (i = 0; i < places; i++) {
        const double below = place[i] - (i ? place[i - 1] : place[places - 1] - ARM_TURN);
        const double above = (i + 1 < places ? place[i + 1] : place[0] + ARM_TURN) - place[i];
        const double sides[2] = {place[i] - fmin(below / 3, ARM_BESIDE), place[i] + fmin(above / 3, ARM_BESIDE)};
        int side;
        for (side = 0; side < 2; side++) {
            const double t = arm_turned(sides[side] + ARM_PI) - ARM_PI;
            for (k = count++; k && extra[k - 1] > t; k--)
                extra[k] = extra[k - 1];
            extra[k] = t;
        }
    }
    for (i = k = 0; i < ARM_EVEN; i++) {
        const double t = -ARM_PI + (i + 0.5) * (ARM_TURN / ARM_EVEN);
        for (; k < count && extra[k] < t; k++)
            all->t[i + k] = extra[k];
        all->t[i + k] = t;
    }
    for (; k < count; k++)
        all->t[i + k] = extra[k];
    all->count = ARM_EVEN + count;
    for (i = all->count; i < all->count + ARM_LANES; i++) /* lanes without a sample */
        all->t[i] = 0.0;
}

/* Where bits of samples change: behind which sample, and the first place between it and the next, infinite without one. */
typedef struct {
    int count, k[2 * ARM_PLACES];
    double place[2 * ARM_PLACES];
} arm_changes;

/* 0 if there are too many, or one is at no place. */
static int arm_changed(const arm_samples *all, const uint32_t *bits, const double *place, int places, arm_changes *found)
{
    const int K = all->count;
    int k, v;
    found->count = 0;
    for (k = 0; k < K; k++) {
        const int next = k + 1 < K ? k + 1 : 0;
        const double width = all->t[next] + (next ? 0.0 : ARM_TURN) - all->t[k];
        double nearest = ARM_INFINITY;
        if (bits[k] == bits[next])
            continue;
        for (v = 0; v < places; v++) {
            const double distance = arm_turned(place[v] - all->t[k]);
            if (distance <= width && distance < nearest)
                nearest = distance;
        }
        if (found->count == 2 * ARM_PLACES || !(nearest <= width))
            return 0;
        found->k[found->count] = k;
        found->place[found->count++] = all->t[k] + nearest;
    }
    return 1;
}

/* Runs of samples at which a branch's bit is set, in the order of their first samples: `ends` of each are the changes
   before and behind it, -1 for a whole turn. Returns how many. */
static int arm_runs(const uint32_t *bits, int K, int branch, const arm_changes *found, int (*ends)[2])
{
    int i, runs = 0, begin = -1, last = -1, own = 0;
    for (i = 0; i < found->count; i++) {
        const int k = found->k[i], next = k + 1 < K ? k + 1 : 0;
        const int before = bits[k] >> branch & 1;
        if (before == (int)(bits[next] >> branch & 1))
            continue;
        own++;
        if (!before)
            begin = i;
        else if (begin < 0)
            last = i; /* of a run that goes round the end */
        else {
            ends[runs][0] = begin;
            ends[runs++][1] = i;
            begin = -1;
        }
    }
    if (!own) {
        if (!(bits[0] >> branch & 1))
            return 0;
        ends[0][0] = ends[0][1] = -1;
        return 1;
    }
    if (begin >= 0) {
        const int whole = found->k[begin] == K - 1; /* its first sample is the first of all */
        for (i = runs; whole && i > 0; i--)
            memcpy(ends[i], ends[i - 1], sizeof *ends);
        ends[whole ? 0 : runs][0] = begin;
        ends[whole ? 0 : runs][1] = last;
        runs++;
    }
    return runs;
}

/* The value of the joint at a sample, whole turns on beyond the last one. */
ARM_INLINE double arm_value_at(const arm_samples *all, int k)
{
    const int K = all->count;
    return k < 0 ? all->t[k + K] - ARM_TURN : k < K ? all->t[k] : all->t[k - K] + ARM_TURN;
}

/* Places of a limit known but for the rounding of their polynomials: a secant step in the joints. */
static void arm_cross(const double *goal, const int *branch, double *value, int count)
{
    int start, i;
    for (start = 0; start < count; start += ARM_LANES) {
        const int lanes = count - start < ARM_LANES ? count - start : ARM_LANES;
        double at[ARM_LANES], beside[ARM_LANES], room[ARM_LANES], room_beside[ARM_LANES];
        int own[ARM_LANES];
        for (i = 0; i < ARM_LANES; i++) {
            const int k = start + (i < lanes ? i : 0);
            own[i] = branch[k];
            at[i] = value[k];
            beside[i] = value[k] + ARM_BESIDE_CROSSING;
        }
        arm_rooms(goal, own, at, room);
        arm_rooms(goal, own, beside, room_beside);
        for (i = 0; i < lanes; i++) {
            const double step = room[i] * ARM_BESIDE_CROSSING / (room[i] - room_beside[i]);
            if (fabs(step) < ARM_BESIDE_CROSSING)
                value[start + i] += step;
        }
    }
}

/* Whether no joint moves by ARM_REACH along any branch there and back. */
static int arm_is_short(const double *goal, const arm_samples *all)
{
    double value[ARM_COLUMNS * ARM_LANES], miss[ARM_MISSES * ARM_LANES], travel[ARM_WAYS][ARM_JOINTS] = {{0.0}};
    double last[ARM_COLUMNS], first[ARM_COLUMNS];
    int b, j, k, most = 1;
    for (k = 0; k <= all->count; k++) {
        const int sample = k < all->count ? k : 0, before = k ? k - 1 : 0, lane = k % ARM_LANES;
        double now[ARM_COLUMNS];
        if (lane == 0 && k < all->count)
            arm_others(goal, all->t + k, value, miss);
        for (j = 0; j < ARM_COLUMNS; j++)
            now[j] = k < all->count ? value[j * ARM_LANES + lane] : first[j];
        if (!k)
            memcpy(first, now, sizeof now);
        for (b = 0; b < ARM_WAYS && k; b++)
            for (j = 0; j < ARM_JOINTS; j++)
                if ((all->there[before] & all->there[sample]) >> b & 1)
                    travel[b][j] += fabs(arm_wrapped(now[arm_column[b][j]] - last[arm_column[b][j]]));
        memcpy(last, now, sizeof now);
    }
    for (b = 0; b < ARM_WAYS; b++)
        for (j = 0; j < ARM_JOINTS; j++)
            most &= 2.0 * travel[b][j] < ARM_REACH;
    return most;
}

/* All pieces of a target, legal ones first: what becomes of it. */
static int arm_followed(const double *goal, const double *near, const double *place, int places, arm_pieces *all)
{
    static const int both[2] = {1, 0};
    arm_samples samples;
    arm_changes crossings, ends;
    int runs[ARM_PLACES + 1][2], crossed[2 * ARM_PIECES], cut[ARM_PIECES];
    double crossing[2 * ARM_PIECES], end[ARM_PIECES][2], first_value[ARM_PIECES], last_value[ARM_PIECES];
    int b, i, k, side, kind, K, count, any = 0, wide = 0, refined = 0;
    int refined_at[2 * ARM_PIECES];
    all->count = 0;
    arm_spread(place, places, &samples);
    arm_sample(goal, near, &samples);
    K = samples.count;
    if (!arm_changed(&samples, samples.legal, place, places, &crossings)
        || !arm_changed(&samples, samples.there, place, places, &ends))
        return ARM_LEFT;
    for (kind = 0; kind < 2; kind++) {
        const int legal = both[kind];
        const uint32_t *bits = legal ? samples.legal : samples.there;
        const arm_changes *changes = legal ? &crossings : &ends;
        for (b = 0; b < ARM_WAYS; b++) {
            count = arm_runs(bits, K, b, changes, runs);
            for (i = 0; i < count; i++) {
                const int whole = runs[i][0] < 0, p = all->count;
                const int first = whole ? 0 : (changes->k[runs[i][0]] + 1) % K;
                const int length = whole ? K : (changes->k[runs[i][1]] - first + K) % K + 1;
                int best = first, holds = 0;
                if (!legal) {
                    any = 1;
                    wide |= arm_value_at(&samples, first + length - 1) - arm_value_at(&samples, first) > ARM_REACH;
                    for (k = first; k < first + length; k++)
                        holds |= samples.legal[k < K ? k : k - K] >> b & 1;
                    if (holds)
                        continue;
                }
                if (p == ARM_PIECES)
                    return ARM_LEFT;
                for (k = first; k < first + length; k++)
                    if (samples.cost[b][k < K ? k : k - K] < samples.cost[b][best < K ? best : best - K])
                        best = k;
                all->count++;
                all->branch[p] = b;
                all->legal[p] = legal;
                all->low[p] = arm_value_at(&samples, best - 1);
                all->at[p] = arm_value_at(&samples, best);
                all->high[p] = arm_value_at(&samples, best + 1);
                cut[p] = !whole;
                first_value[p] = arm_value_at(&samples, first);
                last_value[p] = arm_value_at(&samples, first + length - 1);
                for (side = 0; side < 2 && !whole; side++) {
                    const int change = runs[i][side], before = changes->k[change], next = (before + 1) % K;
                    end[p][side] = changes->place[change];
                    if (legal && (samples.there[before] & samples.there[next]) >> b & 1) {
                        refined_at[refined] = 2 * p + side;
                        crossed[refined] = b;
                        crossing[refined++] = end[p][side];
                    }
                }
            }
        }
    }
    arm_cross(goal, crossed, crossing, refined);
    for (i = 0; i < refined; i++)
        end[refined_at[i] / 2][refined_at[i] % 2] = crossing[i];
    for (i = 0; i < all->count; i++) {
        all->a[i] = -ARM_PI;
        all->b[i] = ARM_PI;
        if (!cut[i])
            continue;
        all->a[i] = fmin(first_value[i] - arm_wrapped(first_value[i] - end[i][0]), all->at[i]);
        all->b[i] = fmax(last_value[i] + arm_wrapped(end[i][1] - last_value[i]), all->at[i]);
        all->low[i] = fmin(fmax(all->low[i], all->a[i]), all->b[i]);
        all->high[i] = fmin(fmax(all->high[i], all->a[i]), all->b[i]);
    }
    arm_nearest_postures(goal, near, all);
    return any && !wide && arm_is_short(goal, &samples) ? ARM_SHORT : ARM_KNOWN;
}

/* Places at which something may change, from the roots of all polynomials and the joint's own limits: sorted, each once. */
static int arm_places(double *root, int count, double *place)
{
    const double lower = arm_least[ARM_JOINTS - 1], upper = arm_most[ARM_JOINTS - 1];
    double last = -ARM_INFINITY;
    int i, k, places = 0;
    if (upper - lower < ARM_TURN) {
        root[count++] = lower;
        root[count++] = upper;
    }
    for (i = 0; i < count; i++) {
        const double value = arm_turned(root[i] + ARM_PI) - ARM_PI;
        for (k = i; k && root[k - 1] > value; k--)
            root[k] = root[k - 1];
        root[k] = value;
    }
    for (i = 0; i < count; last = root[i++])
        if (root[i] - last > ARM_SAME_END) {
            if (places == ARM_PLACES)
                return -1;
            place[places++] = root[i];
        }
    return places;
}

ARM_INLINE int arm_is_any(const uint8_t *open)
{
    int f, any = 0;
    for (f = 0; f < ARM_EQUATIONS; f++)
        any |= open[f];
    return any;
}

/* Families of n targets, poses row by row. frame: the same as the frame behind the last joint, its rotation row by row and
   the shoulder seen there. near: as of `arm_batch`. Pieces stand one after the other: count of each target, then of each
   piece its branch, whether it is legal, its ends and its posture; there is room for ARM_PIECES of each target. */
void arm_families(int64_t n, const double *target, const double *frame, const double *near, int64_t near_step,
    uint8_t *state, int64_t *count, int64_t *branch, uint8_t *legal, double *interval, double *q)
{
    arm_tables tables;
    arm_tables_wide tables_wide;
    arm_pieces all;
    int64_t at, used = 0;
    int i, j, prepared = 0;
    arm_prepare(&tables);
    for (at = 0; at < n; at++) {
        double goal[12], close[ARM_JOINTS], root[ARM_ROOTS + 2], place[ARM_PLACES];
        uint8_t open[ARM_EQUATIONS];
        int places, wild = 0;
        for (i = 0; i < 3; i++)
            for (j = 0; j < 4; j++)
                goal[3 * j + i] = target[16 * at + 4 * i + j];
        for (j = 0; j < ARM_JOINTS; j++) {
            close[j] = near[at * near_step + j];
            wild |= !(fabs(close[j]) <= ARM_WILD);
        }
        memset(open, 1, sizeof open);
        places = arm_turn_roots(&tables, frame + 12 * at, ARM_MOVED_ROOT, open, root, 0);
        if (arm_is_any(open)) {
            if (!prepared++)
                arm_prepare_wide(&tables_wide);
            places = arm_turn_roots_wide(&tables_wide, frame + 12 * at, ARM_INFINITY, open, root, places);
        }
        places = arm_is_any(open) ? -1 : arm_places(root, places, place);
        count[at] = 0;
        state[at] = (uint8_t)(wild || places < 0 ? ARM_LEFT : arm_followed(goal, close, place, places, &all));
        if (state[at] == ARM_LEFT)
            continue;
        count[at] = all.count;
        for (i = 0; i < all.count; i++, used++) {
            branch[used] = all.branch[i];
            legal[used] = (uint8_t)all.legal[i];
            interval[2 * used] = all.a[i];
            interval[2 * used + 1] = all.b[i];
            memcpy(q + ARM_JOINTS * used, all.q[i], sizeof all.q[i]);
        }
    }
}
