/* Families of targets of an arm with one joint more than they ask for, the last one: as `armkin.inverse.redundant`, by the
   closed form of the others, followed along that joint from place to place where anything can change. */

#include <float.h>

#define ARM_TOLD @accepted@ /* squared residual of a branch that is there */
#define ARM_REACH @reach@ /* rad */
#define ARM_BESIDE @beside@ /* rad, from a place to the samples on its sides */
#define ARM_BESIDE_CROSSING @crossing@ /* rad */
#define ARM_PROBE @probe@ /* share of the way to the next sample */
#define ARM_SAME_END @same_end@ /* rad */
#define ARM_MOVED_ROOT @moved_root@ /* rad by which rounding may move a root */
#define ARM_SAFE @safe@ /* safety factor on the rounding that polynomials show */
enum {
    ARM_WAYS = @branches@, /* branches of the others */
    ARM_COLUMNS = @columns@, ARM_MISSES = @misses@, /* distinct values of joints, and residuals, of these branches */
    ARM_EVEN = @even@, /* even samples of a turn */
    ARM_SECTIONS = @sections@, /* steps of the golden section */
    ARM_PLACES = 128, ARM_PIECES = 64, /* of a target, at most; with more it is left to Python */
    ARM_SAMPLES = ARM_EVEN + 2 * ARM_PLACES + ARM_LANES,
    ARM_EQUATIONS = @polynomials@, ARM_DEGREE = @degree@, /* polynomials of a target */
    ARM_TAIL = @tail@, ARM_TERMS = @terms@, ARM_CELLS = @cells@, ARM_HALVINGS = @halvings@, ARM_NEWTON = @newton@,
    ARM_SAMPLED = 2 * (ARM_DEGREE + ARM_TAIL) + 1, /* where each is asked */
    ARM_ANGLES = (ARM_SAMPLED + 7) / 8 * 8, ARM_ORDERS = (ARM_DEGREE + ARM_TAIL + 8) / 8 * 8, /* the same, for vectors */
    ARM_ROOTS = 256 /* roots of a target, at most */
};
enum { ARM_KNOWN = 0, ARM_LEFT = 1 }; /* what becomes of a target: answered, or left to Python */

static const double arm_least[ARM_JOINTS] = {@lower@}, arm_most[ARM_JOINTS] = {@upper@};
static const int arm_joint_of[ARM_COLUMNS] = {@joint_of@};
static const int arm_column[ARM_WAYS][ARM_JOINTS] = {@column@}, arm_missed[ARM_WAYS] = {@missed@};

/* Cosine and sine. Coefficients: S. L. Moshier, Cephes Mathematical Library (sin.c). */
ARM_INLINE void arm_circle(double q, double *cosine, double *sine)
{
    const double k = rint(q * 0.6366197723675814);
    const double r = ((q - k * 1.570796310901641845703125) - k * 1.589325471229585673428e-8)
        - k * 6.12323399573676588614e-17;
    const double z = r * r;
    const double s = r + r * z * (((((1.58962301576546568060e-10 * z - 2.50507477628578072866e-8) * z
        + 2.75573136213857242213e-6) * z - 1.98412698295895385996e-4) * z + 8.33333333332211858878e-3) * z
        - 1.66666666666666307295e-1);
    const double c = 1.0 - z / 2 + z * z * (((((-1.13585365213876817300e-11 * z + 2.08757008419747316778e-9) * z
        - 2.75573141792967388112e-7) * z + 2.48015872888517045348e-5) * z - 1.38888888888730564116e-3) * z
        + 4.16666666666665929218e-2);
    const double half = rint(k / 2), odd = k - 2 * half;
    const double sign = 1 - 2 * fabs(half - 2 * rint(half / 2));
    const double across = odd * sign, along = (1 - fabs(odd)) * sign;
    *cosine = along * c - across * s;
    *sine = along * s + across * c;
}

@others@
@roots@
@roots_wide@
/* A number of [0, turn) that differs by whole turns. */
ARM_INLINE double arm_turned(double x)
{
    return x - ARM_TURN * floor(x / ARM_TURN);
}

ARM_INLINE double arm_wrapped(double x)
{
    return x - ARM_TURN * rint(x / ARM_TURN);
}

/* Values of a joint at their nearest legal copies, which of them are within limits, and how far they are from `near`,
   added [deg]. */
ARM_INLINE void arm_copies(int j, double near, double *ARM_RESTRICT value, int *ARM_RESTRICT inside,
    double *ARM_RESTRICT motion)
{
    const double lower = arm_least[j], upper = arm_most[j];
    int i;
    for (i = 0; i < ARM_LANES; i++) {
        const double copy = arm_copy(arm_wrapped(value[i]), near, lower, upper, inside + i);
        motion[i] += fabs(copy - near) * (180.0 / ARM_PI);
        value[i] = copy;
    }
}

/* What stands of all samples: which branches are there, and legal, as bits; how far they are from `near`, infinite where
   they are not there. */
typedef struct {
    double t[ARM_SAMPLES], cost[ARM_WAYS][ARM_SAMPLES];
    uint32_t there[ARM_SAMPLES], legal[ARM_SAMPLES];
    int count;
} arm_samples;

static void arm_sample(const double *goal, const double *near, arm_samples *all)
{
    double value[ARM_COLUMNS * ARM_LANES], miss[ARM_MISSES * ARM_LANES], motion[ARM_COLUMNS * ARM_LANES];
    int inside[ARM_COLUMNS * ARM_LANES];
    int start, i, j, b, k;
    for (start = 0; start < all->count; start += ARM_LANES) {
        uint32_t there[ARM_LANES] = {0}, legal[ARM_LANES] = {0};
        arm_others(goal, all->t + start, value, miss);
        for (k = 0; k < ARM_COLUMNS; k++) {
            for (i = 0; i < ARM_LANES; i++) {
                inside[k * ARM_LANES + i] = 1;
                motion[k * ARM_LANES + i] = 0.0;
            }
            arm_copies(arm_joint_of[k], near[arm_joint_of[k]], value + k * ARM_LANES, inside + k * ARM_LANES,
                motion + k * ARM_LANES);
        }
        for (b = 0; b < ARM_WAYS; b++) {
            const double *missed = miss + arm_missed[b] * ARM_LANES;
            double cost[ARM_LANES] = {0.0};
            int fits[ARM_LANES];
            for (i = 0; i < ARM_LANES; i++)
                fits[i] = 1;
            for (j = 0; j < ARM_JOINTS; j++) {
                const int at = arm_column[b][j] * ARM_LANES;
                for (i = 0; i < ARM_LANES; i++) {
                    cost[i] += motion[at + i];
                    fits[i] &= inside[at + i];
                }
            }
            for (i = 0; i < ARM_LANES; i++) {
                const int is_there = missed[i] <= ARM_TOLD;
                all->cost[b][start + i] = is_there ? cost[i] : ARM_INFINITY;
                there[i] |= (uint32_t)is_there << b;
                legal[i] |= (uint32_t)(is_there & fits[i]) << b;
            }
        }
        memcpy(all->there + start, there, sizeof there);
        memcpy(all->legal + start, legal, sizeof legal);
    }
}

/* Pieces of the curves of a target: of which branch, whether a legal interval or a family without one, its ends, the value
   of the best sample and of those beside it, and the posture nearest to `near`, so far. */
typedef struct {
    double a[ARM_PIECES], b[ARM_PIECES], low[ARM_PIECES], at[ARM_PIECES], high[ARM_PIECES];
    double q[ARM_PIECES][ARM_JOINTS], cost[ARM_PIECES];
    int branch[ARM_PIECES], legal[ARM_PIECES];
    int count;
} arm_pieces;

/* One branch each at values t, as its formula has it; which are there. */
static void arm_own(const double *goal, const int *branch, const double *t, double *q, int *there)
{
    double value[ARM_COLUMNS * ARM_LANES], miss[ARM_MISSES * ARM_LANES];
    int i, j;
    arm_others(goal, t, value, miss);
    for (i = 0; i < ARM_LANES; i++) {
        const int *column = arm_column[branch[i]];
        for (j = 0; j < ARM_JOINTS; j++)
            q[j * ARM_LANES + i] = value[column[j] * ARM_LANES + i];
        there[i] = miss[arm_missed[branch[i]] * ARM_LANES + i] <= ARM_TOLD;
    }
}

/* How far one branch each is within the limits, negative beyond them [rad]; not a number where it is not there. */
static void arm_rooms(const double *goal, const int *branch, const double *t, double *room)
{
    double q[ARM_JOINTS * ARM_LANES];
    int there[ARM_LANES];
    int i, j;
    arm_own(goal, branch, t, q, there);
    for (i = 0; i < ARM_LANES; i++)
        room[i] = there[i] ? ARM_TURN : NAN;
    for (j = 0; j < ARM_JOINTS; j++) {
        const double lower = arm_least[j], upper = arm_most[j];
        if (!(upper - lower < ARM_TURN))
            continue;
        for (i = 0; i < ARM_LANES; i++) {
            const double left = 0.5 * (upper - lower) - fabs(arm_wrapped(q[j * ARM_LANES + i] - 0.5 * (lower + upper)));
            room[i] = left < room[i] ? left : room[i];
        }
    }
}

/* How far pieces at values t are from `near`, infinite where they are not legal; better ones are kept, or the first. */
static void arm_costs(const double *goal, const double *near, arm_pieces *all, const int *index, int count,
    const double *t, double *cost, int first)
{
    int start, i, j;
    for (start = 0; start < count; start += ARM_LANES) {
        double q[ARM_JOINTS * ARM_LANES], at[ARM_LANES], motion[ARM_LANES];
        int branch[ARM_LANES], there[ARM_LANES], inside[ARM_LANES];
        const int lanes = count - start < ARM_LANES ? count - start : ARM_LANES;
        for (i = 0; i < ARM_LANES; i++) {
            const int k = start + (i < lanes ? i : 0);
            at[i] = t[k];
            branch[i] = all->branch[index[k]];
            inside[i] = 1;
            motion[i] = 0.0;
        }
        arm_own(goal, branch, at, q, there);
        for (j = 0; j < ARM_JOINTS; j++)
            arm_copies(j, near[j], q + j * ARM_LANES, inside, motion);
        for (i = 0; i < lanes; i++) {
            const int p = index[start + i];
            cost[start + i] = (first || (there[i] & inside[i])) ? motion[i] : ARM_INFINITY;
            if (first || cost[start + i] < all->cost[p]) {
                all->cost[p] = cost[start + i];
                for (j = 0; j < ARM_JOINTS; j++)
                    all->q[p][j] = q[j * ARM_LANES + i];
            }
        }
    }
}

/* The postures of one branch each as `arm_costs` has them, their joints' ways from `near`. */
static void arm_ways(const double *goal, const double *near, const arm_pieces *all, const int *index, int count,
    const double *t, double (*way)[ARM_JOINTS], double *cost)
{
    int start, i, j;
    for (start = 0; start < count; start += ARM_LANES) {
        double q[ARM_JOINTS * ARM_LANES], at[ARM_LANES], motion[ARM_LANES];
        int branch[ARM_LANES], there[ARM_LANES], inside[ARM_LANES];
        const int lanes = count - start < ARM_LANES ? count - start : ARM_LANES;
        for (i = 0; i < ARM_LANES; i++) {
            const int k = start + (i < lanes ? i : 0);
            at[i] = t[k];
            branch[i] = all->branch[index[k]];
            motion[i] = 0.0;
        }
        arm_own(goal, branch, at, q, there);
        for (j = 0; j < ARM_JOINTS; j++)
            arm_copies(j, near[j], q + j * ARM_LANES, inside, motion);
        for (i = 0; i < lanes; i++) {
            cost[start + i] = there[i] ? motion[i] : ARM_INFINITY;
            for (j = 0; j < ARM_JOINTS; j++)
                way[start + i][j] = there[i] ? q[j * ARM_LANES + i] - near[j] : NAN;
        }
    }
}

/* Where branches merge rounding tells whether they are there: the first values inside of such ends at which they are. */
static void arm_try_inside(const double *goal, const double *near, arm_pieces *all, const int *index, int count,
    const double *end, const double *at_end, const double *bound, const double *other)
{
    static const double steps[] = {@inside@};
    double t[ARM_PIECES], cost[ARM_PIECES];
    int tried[ARM_PIECES];
    int i, step, left = 0;
    for (i = 0; i < count; i++)
        if (at_end[i] == ARM_INFINITY && end[i] == bound[index[i]])
            tried[left++] = index[i];
    for (step = 0; step < (int)(sizeof steps / sizeof *steps) && left; step++) {
        const int open = left;
        for (i = 0; i < open; i++) {
            const double from = bound[tried[i]], way = other[tried[i]] - from;
            t[i] = from + copysign(fmin(steps[step], fabs(way)), way);
        }
        arm_costs(goal, near, all, tried, open, t, cost, 0);
        for (i = left = 0; i < open; i++)
            if (cost[i] == ARM_INFINITY)
                tried[left++] = tried[i];
    }
}

/* The postures of pieces nearest to `near`, as `_nearest_postures` in Python finds them. */
static void arm_nearest_postures(const double *goal, const double *near, arm_pieces *all)
{
    const double ratio = 0.6180339887498949;
    double low[ARM_PIECES], high[ARM_PIECES], left[ARM_PIECES], right[ARM_PIECES], t[ARM_PIECES], middle[ARM_PIECES];
    double at_left[ARM_PIECES], at_right[ARM_PIECES], at_new[ARM_PIECES], at_low[ARM_PIECES], at_high[ARM_PIECES];
    double from_low[ARM_PIECES][ARM_JOINTS], from_high[ARM_PIECES][ARM_JOINTS];
    int open[ARM_PIECES], goes[ARM_PIECES];
    int i, j, k, step, count = 0;
    for (i = 0; i < all->count; i++)
        open[i] = i;
    arm_costs(goal, near, all, open, all->count, all->at, at_new, 1);
    for (i = 0; i < all->count; i++)
        if (all->legal[i])
            open[count++] = i;
    for (i = 0; i < count; i++) {
        const int p = open[i];
        const double own = near[ARM_JOINTS - 1];
        const double value = own + rint((all->at[p] - own) / ARM_TURN) * ARM_TURN;
        t[i] = value >= all->a[p] && value <= all->b[p] ? value : all->at[p];
        low[i] = all->low[p];
        high[i] = all->high[p];
        left[i] = all->at[p] + ARM_PROBE * (low[i] - all->at[p]);
        right[i] = all->at[p] + ARM_PROBE * (high[i] - all->at[p]);
        middle[i] = all->cost[p];
    }
    arm_costs(goal, near, all, open, count, t, at_new, 0);
    arm_costs(goal, near, all, open, count, low, at_low, 0);
    arm_costs(goal, near, all, open, count, high, at_high, 0);
    arm_try_inside(goal, near, all, open, count, low, at_low, all->a, all->b);
    arm_try_inside(goal, near, all, open, count, high, at_high, all->b, all->a);
    arm_costs(goal, near, all, open, count, left, at_left, 0);
    arm_costs(goal, near, all, open, count, right, at_right, 0);
    for (i = k = 0; i < count; i++) /* beside a kink the motion grows both ways */
        if (at_left[i] < middle[i] || at_right[i] < middle[i])
            open[k++] = open[i];
    count = k;
    if (!count)
        return;
    for (i = 0; i < count; i++) {
        low[i] = all->low[open[i]];
        high[i] = all->high[open[i]];
        left[i] = high[i] - ratio * (high[i] - low[i]);
        right[i] = low[i] + ratio * (high[i] - low[i]);
    }
    arm_costs(goal, near, all, open, count, left, at_left, 0);
    arm_costs(goal, near, all, open, count, right, at_right, 0);
    for (step = 0; step < ARM_SECTIONS; step++) {
        for (i = 0; i < count; i++) {
            goes[i] = at_left[i] <= at_right[i];
            if (goes[i])
                high[i] = right[i];
            else
                low[i] = left[i];
            t[i] = goes[i] ? high[i] - ratio * (high[i] - low[i]) : low[i] + ratio * (high[i] - low[i]);
        }
        arm_costs(goal, near, all, open, count, t, at_new, 0);
        for (i = 0; i < count; i++) {
            if (goes[i]) {
                right[i] = left[i];
                at_right[i] = at_left[i];
                left[i] = t[i];
                at_left[i] = at_new[i];
            } else {
                left[i] = right[i];
                at_left[i] = at_right[i];
                right[i] = t[i];
                at_right[i] = at_new[i];
            }
        }
    }
    arm_ways(goal, near, all, open, count, low, from_low, at_low);
    arm_ways(goal, near, all, open, count, high, from_high, at_high);
    for (i = 0; i < count; i++) { /* by a secant where a joint passes its near, by a parabola elsewhere */
        double a = from_low[i][0], b = from_high[i][0], most = -1.0, x, y;
        for (j = 0; j < ARM_JOINTS; j++) {
            const double passes = from_low[i][j] * from_high[i][j] < 0 ? fabs(from_high[i][j] - from_low[i][j]) : 0.0;
            if (passes > most) {
                most = passes;
                a = from_low[i][j];
                b = from_high[i][j];
            }
        }
        right[i] = at_left[i] <= at_right[i] ? left[i] : right[i]; /* the better one */
        at_right[i] = at_left[i] <= at_right[i] ? at_left[i] : at_right[i];
        left[i] = a * b < 0 ? low[i] + (high[i] - low[i]) * a / (a - b) : low[i];
        x = (right[i] - low[i]) * (at_right[i] - at_high[i]);
        y = (right[i] - high[i]) * (at_right[i] - at_low[i]);
        t[i] = right[i] - 0.5 * ((right[i] - low[i]) * x - (right[i] - high[i]) * y) / (x - y);
        if (!(t[i] > low[i] && t[i] < high[i]))
            t[i] = right[i];
    }
    arm_costs(goal, near, all, open, count, left, at_new, 0);
    arm_costs(goal, near, all, open, count, t, at_new, 0);
}

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

/* All pieces of a target, legal ones first; 0 if it is left to Python. */
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
        return 0;
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
                    return 0;
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
    if (any && !wide) /* no joint may move by much: Python tells */
        return 0;
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
    return 1;
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
   piece its branch, whether it is legal, its ends and its posture, for up to `room` of them. Returns how many targets there
   was room for. */
int64_t arm_families(int64_t n, const double *target, const double *frame, const double *near, int64_t near_step,
    int64_t room, uint8_t *state, int64_t *count, int64_t *branch, uint8_t *legal, double *interval, double *q)
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
        count[at] = 0;
        state[at] = ARM_LEFT;
        memset(open, 1, sizeof open);
        places = arm_turn_roots(&tables, frame + 12 * at, ARM_MOVED_ROOT, open, root, 0);
        if (arm_is_any(open)) {
            if (!prepared++)
                arm_prepare_wide(&tables_wide);
            places = arm_turn_roots_wide(&tables_wide, frame + 12 * at, ARM_INFINITY, open, root, places);
        }
        places = arm_is_any(open) ? -1 : arm_places(root, places, place);
        if (wild || places < 0 || !arm_followed(goal, close, place, places, &all))
            continue;
        if (used + all.count > room)
            return at;
        state[at] = ARM_KNOWN;
        count[at] = all.count;
        for (i = 0; i < all.count; i++, used++) {
            branch[used] = all.branch[i];
            legal[used] = (uint8_t)all.legal[i];
            interval[2 * used] = all.a[i];
            interval[2 * used + 1] = all.b[i];
            for (j = 0; j < ARM_JOINTS; j++)
                q[ARM_JOINTS * used + j] = all.q[i][j];
        }
    }
    return n;
}
