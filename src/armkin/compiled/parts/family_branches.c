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
    ARM_PLACES = 128, ARM_PIECES = @pieces@, /* of a target, at most; with more it is left to Python */
    ARM_SAMPLES = ARM_EVEN + 2 * ARM_PLACES + ARM_LANES,
    ARM_EQUATIONS = @polynomials@, ARM_DEGREE = @degree@, /* polynomials of a target */
    ARM_TAIL = @tail@, ARM_TERMS = @terms@, ARM_CELLS = @cells@, ARM_HALVINGS = @halvings@, ARM_NEWTON = @newton@,
    ARM_SAMPLED = 2 * (ARM_DEGREE + ARM_TAIL) + 1, /* where each is asked */
    ARM_ANGLES = (ARM_SAMPLED + 7) / 8 * 8, ARM_ORDERS = (ARM_DEGREE + ARM_TAIL + 8) / 8 * 8, /* the same, for vectors */
    ARM_ROOTS = 256 /* roots of a target, at most */
};
/* What becomes of a target: answered, answered by postures between which no joint moves much, or left to Python. */
enum { ARM_KNOWN = 0, ARM_SHORT = 1, ARM_LEFT = 2 };

static const double arm_least[ARM_JOINTS] = {@lower@}, arm_most[ARM_JOINTS] = {@upper@};
static const int arm_joint_of[ARM_COLUMNS] = {@joint_of@};
static const int arm_column[ARM_WAYS][ARM_JOINTS] = {@column@}, arm_missed[ARM_WAYS] = {@missed@};

@turns@
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
