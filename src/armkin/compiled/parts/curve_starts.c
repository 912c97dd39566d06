/* Nodes of a target's curves on planes, values of the guide's joint: the code of `armkin.inverse.redundant.curve_starts`.
   Half 2 m of a curve leaves node m along its tangent, which raises the guide's joint on a plane, 2 m + 1 against it. */
enum {
    ARM_NODES = 4096,
    ARM_EXTRA = 320, /* planes through answers between the others */
    ARM_ALL_PLANES = ARM_PLANES + ARM_EXTRA,
    ARM_STARTS = (ARM_BRANCHES + 1) * ARM_ALL_PLANES,
    ARM_WIDTH = 8 /* numbers of a posture in memory */
};

/* The curves of one target as they are found. */
typedef struct {
    const double *goal, *near;
    int lost; /* whether something is odd: the target is left to Python */
    int planes, nodes, postures;
    double value[ARM_ALL_PLANES]; /* of the guide's joint, ascending */
    int grid[ARM_ALL_PLANES][ARM_BRANCHES]; /* the answer's node, -1 where there is none */
    double posture[ARM_EXTRA][ARM_WIDTH]; /* answers, each of which has a plane */
    double q[ARM_NODES][ARM_WIDTH], tangent[ARM_NODES][ARM_WIDTH];
    int plane[ARM_NODES], partner[2 * ARM_NODES]; /* -1: on none; the half that each is joined to, -1: none yet */
    uint8_t traces[2 * ARM_NODES]; /* of each half; ARM_TRACES where another one would be the same */
} arm_curves;

/* A posture that is near an answer: on which plane, as which branch. */
typedef struct {
    int plane, branch;
    double q[ARM_WIDTH];
} arm_start;

ARM_INLINE double arm_wrap(double angle)
{
    return angle - ARM_TURN * rint(angle * (1 / ARM_TURN));
}

/* Lane t of some numbers, written and read. */
ARM_INLINE void arm_put(const double *from, arm_many *to, int t)
{
    int j;
    for (j = 0; j < ARM_JOINTS; j++)
        to[j][t] = from[j];
}

ARM_INLINE void arm_get(const arm_many *from, double *to, int t)
{
    int j;
    for (j = 0; j < ARM_JOINTS; j++)
        to[j] = from[j][t];
}

/* Directions in which joint j alone moves. */
ARM_INLINE void arm_hold(arm_many *direction, int j)
{
    int i;
    for (i = 0; i < ARM_JOINTS; i++)
        direction[i] = arm_all(i == j);
}

/* The largest difference of joints modulo whole turns, or one that is too large. */
static double arm_distance(const double *a, const double *b)
{
    double most = 0;
    int j;
    for (j = 0; j < ARM_JOINTS && most < ARM_REACH; j++) {
        const double apart = fabs(arm_wrap(a[j] - b[j]));
        most = apart > most ? apart : most;
    }
    return most;
}

/* A further node: its number; the target is lost where there is no room. */
static int arm_add_node(arm_curves *f, const double *q, const double *tangent, int plane)
{
    const int m = f->nodes;
    if (m == ARM_NODES) {
        f->lost = 1;
        return m - 1;
    }
    memcpy(f->q[m], q, ARM_WIDTH * sizeof *q);
    memcpy(f->tangent[m], tangent, ARM_WIDTH * sizeof *q);
    f->plane[m] = plane;
    f->partner[2 * m] = f->partner[2 * m + 1] = -1;
    f->traces[2 * m] = f->traces[2 * m + 1] = 0;
    return f->nodes++;
}

/* Branches of the nearly equal arm at up to ARM_MANY values of the guide's joint, and what they miss. */
static void arm_branches_at(const double *goal, const double *value, int count, arm_many *q, arm_many *defect)
{
    arm_many t, c, s;
    int b, i;
    for (i = 0; i < ARM_MANY; i++)
        t[i] = value[i < count ? i : 0];
    arm_turn_lanes(t, &c, &s);
    arm_guide_lanes(goal, c, s, q, defect);
    for (b = 0; b < ARM_BRANCHES; b++) {
        q[b * ARM_JOINTS + ARM_GUIDE] = t;
        defect[b] = arm_roots(defect[b]);
    }
}

/* Whether answers may be between the second of four values that follow and the third alone, of a short curve, as what
   branches miss there tells. */
static int arm_turns_back(double (*missed)[ARM_BRANCHES])
{
    int b;
    for (b = 0; b < ARM_BRANCHES; b++) {
        const double first = missed[1][b], last = missed[2][b];
        if (first > ARM_ACCEPTED_DEFECT && last > ARM_ACCEPTED_DEFECT && missed[0][b] > ARM_ACCEPTED_DEFECT
            && missed[3][b] > ARM_ACCEPTED_DEFECT && first + (first - missed[0][b]) < 0
            && last - (missed[3][b] - last) < 0)
            return 1;
    }
    return 0;
}

/* Rows of a, ARM_JOINTS and a right side long, turned among each other until they are orthogonal: one-sided Jacobi
   rotations (Hestenes 1958). */
static void arm_rotate_rows(arm_many *a)
{
    int i, j, k, sweep;
    for (sweep = 0; sweep < ARM_SWEEPS; sweep++)
        for (i = 0; i < 5; i++)
            for (j = i + 1; j < 6; j++) {
                arm_many *p = a + i * ARM_ROW, *q = a + j * ARM_ROW;
                const arm_many across = arm_dot(p, q);
                const arm_flags turned = (arm_flags)(across != 0);
                const arm_many zeta = (arm_dot(q, q) - arm_dot(p, p)) / (2 * arm_pick(turned, across, arm_all(1)));
                const arm_many size = 1 / (arm_size(zeta) + arm_roots(1 + zeta * zeta));
                const arm_many t = arm_pick(turned, arm_pick((arm_flags)(zeta < 0), -size, size), arm_all(0));
                const arm_many c = 1 / arm_roots(1 + t * t), s = c * t;
                for (k = 0; k <= ARM_JOINTS; k++) {
                    const arm_many first = p[k];
                    p[k] = c * first - s * q[k];
                    q[k] = s * first + c * q[k];
                }
            }
}

/* Postures moved onto their target by steps of least norm, without singular values below a tenth of what is missed:
   `newton.correct`. They become the best ones that were met; returns what these miss. */
static arm_many arm_correct(const double *goal, arm_many *q)
{
    arm_flags active = (arm_flags)(q[0] == q[0]);
    arm_many best[ARM_JOINTS], least = arm_all(ARM_INFINITY);
    int i, j, k;
    memcpy(best, q, sizeof best);
    for (k = 0; k <= ARM_CORRECTIONS && arm_any(active); k++) {
        arm_many a[ARM_ROWS * ARM_ROW], step[ARM_JOINTS], size = arm_all(0), longest = arm_all(0), cutoff;
        arm_flags better;
        arm_equations(goal, q, a);
        for (i = 0; i < 6; i++)
            size += a[i * ARM_ROW + ARM_JOINTS] * a[i * ARM_ROW + ARM_JOINTS];
        size = arm_roots(size);
        better = active & (arm_flags)(size < least);
        active &= (arm_flags)(size > ARM_ROUNDING) & (arm_flags)(size < ARM_INFINITY)
            & ((arm_flags)(size > ARM_CONVERGING) | (arm_flags)(size < 0.5 * least));
        least = arm_pick(better, size, least);
        arm_rotate_rows(a);
        cutoff = arm_larger(0.1 * size, arm_all(ARM_LEFT_OUT_VALUE));
        for (j = 0; j < ARM_JOINTS; j++) {
            best[j] = arm_pick(better, q[j], best[j]);
            step[j] = arm_all(0);
        }
        for (i = 0; i < 6; i++) {
            const arm_many *row = a + i * ARM_ROW, square = arm_dot(row, row);
            const arm_flags strong = (arm_flags)(square > cutoff * cutoff);
            const arm_many gain = arm_pick(strong, row[ARM_JOINTS] / arm_pick(strong, square, arm_all(1)), arm_all(0));
            for (j = 0; j < ARM_JOINTS; j++)
                step[j] += gain * row[j];
        }
        for (j = 0; j < ARM_JOINTS; j++)
            longest = arm_larger(longest, arm_size(step[j]));
        longest = arm_less(arm_all(1), ARM_NEWTON_STEP / arm_larger(longest, arm_all(ARM_TINY)));
        for (j = 0; j < ARM_JOINTS; j++)
            q[j] = arm_pick(active, q[j] + longest * step[j], q[j]);
    }
    memcpy(q, best, sizeof best);
    return least;
}

/* Adds the answers between value k and the next that the best value between them leads to; where several are exact, the
   one in their middle. */
static void arm_answers_between(arm_curves *f, const double *value, int k)
{
    enum { BETWEEN = ARM_WAY_PARTS - 1, BLOCKS = (BETWEEN + ARM_MANY - 1) / ARM_MANY };
    arm_many every[BLOCKS][ARM_JOINTS * ARM_BRANCHES], defects[BLOCKS][ARM_BRANCHES], *best, *best_defect;
    double between[BLOCKS * ARM_MANY], own[BETWEEN], least = ARM_INFINITY;
    const int first = f->postures;
    int b, i, j, lane, equal = 0;
    for (i = 0; i < BLOCKS * ARM_MANY; i++)
        between[i] = value[k] + ARM_TURN / ARM_PLANES * (1 + i) / ARM_WAY_PARTS;
    for (i = 0; i < BLOCKS; i++)
        arm_branches_at(f->goal, between + i * ARM_MANY, ARM_MANY, every[i], defects[i]);
    for (i = 0; i < BETWEEN; i++) {
        own[i] = ARM_INFINITY;
        for (b = 0; b < ARM_BRANCHES; b++) {
            const double defect = defects[i / ARM_MANY][b][i % ARM_MANY];
            own[i] = defect < own[i] ? defect : own[i];
        }
        own[i] = own[i] > ARM_ACCEPTED_DEFECT ? own[i] : ARM_ACCEPTED_DEFECT;
        equal = own[i] < least ? 1 : equal + (own[i] == least);
        least = own[i] < least ? own[i] : least;
    }
    for (i = 0, j = equal / 2; i < BETWEEN - 1 && (own[i] != least || j-- > 0); i++)
        ;
    lane = i % ARM_MANY;
    best = every[i / ARM_MANY];
    best_defect = defects[i / ARM_MANY];
    for (b = 0; least < ARM_NEAR_DEFECT && b < ARM_BRANCHES; b += ARM_MANY) {
        const int count = ARM_BRANCHES - b < ARM_MANY ? ARM_BRANCHES - b : ARM_MANY;
        arm_many q[ARM_JOINTS], size;
        for (i = 0; i < ARM_MANY; i++)
            for (j = 0; j < ARM_JOINTS; j++)
                q[j][i] = best[(b + (i < count ? i : 0)) * ARM_JOINTS + j][lane];
        size = arm_correct(f->goal, q);
        for (i = 0; i < count; i++) {
            double posture[ARM_WIDTH] = {0};
            if (!(best_defect[b + i][lane] < ARM_NEAR_DEFECT && size[i] < ARM_SAME_SEED))
                continue;
            arm_get(q, posture, i);
            for (j = first; j < f->postures && arm_distance(f->posture[j], posture) >= ARM_SAME_SEED; j++)
                ;
            if (j < f->postures)
                continue;
            if (f->postures == ARM_EXTRA)
                f->lost = 1;
            else
                memcpy(f->posture[f->postures++], posture, sizeof posture);
        }
    }
}

/* The candidates of one block of planes, in the order of planes and branches, that are near answers. */
static int arm_block_starts(const arm_many *q, const arm_many *defect, const int *plane, int count, arm_start *start)
{
    int b, i, number = 0;
    for (i = 0; i < count; i++)
        for (b = 0; b < ARM_BRANCHES; b++)
            if (defect[b][i] < ARM_NEAR_DEFECT) {
                start[number].plane = plane[i];
                start[number].branch = b;
                arm_get(q + b * ARM_JOINTS, start[number++].q, i);
            }
    return number;
}

/* The starts moved along their planes onto answers, which become nodes, each once. */
static void arm_answers_on_planes(arm_curves *f, const arm_start *start, int count)
{
    int begin, i, j, m;
    static const double none[ARM_WIDTH];
    for (begin = 0; begin < count; begin += ARM_MANY) {
        const int number = arm_few(count - begin);
        arm_points points;
        for (i = 0; i < ARM_MANY; i++)
            arm_put(start[begin + (i < number ? i : 0)].q, points.q, i);
        arm_hold(points.tangent, ARM_GUIDE);
        arm_onto_curves(f->goal, &points, ARM_SAME_SEED, ARM_NEWTON, 0);
        for (i = 0; i < number; i++) {
            const arm_start *one = &start[begin + i];
            double q[ARM_WIDTH] = {0};
            if (!(points.step[i] < ARM_SAME_SEED))
                continue;
            arm_get(points.q, q, i);
            for (j = 0; j < ARM_BRANCHES; j++) {
                m = f->grid[one->plane][j];
                if (m >= 0 && arm_distance(f->q[m], q) < ARM_SAME_SEED)
                    break;
            }
            if (j < ARM_BRANCHES)
                continue;
            m = arm_add_node(f, q, none, one->plane);
            for (j = 0; j < ARM_JOINTS; j++)
                f->tangent[m][j] = points.tangent[j][i];
            if (one->branch < ARM_BRANCHES)
                f->grid[one->plane][one->branch] = m;
        }
    }
}

/* All planes and the answers on them; of each of `postures` a plane. */
static void arm_start_curves(arm_curves *f, arm_start *start)
{
    double value[ARM_ALL_PLANES], missed[ARM_PLANES + 3][ARM_BRANCHES]; /* round the turn */
    int place[ARM_ALL_PLANES], b, i, k, begin, starts = 0, given = f->postures;
    double given_postures[ARM_EXTRA][ARM_WIDTH];
    memcpy(given_postures, f->posture, sizeof f->posture[0] * (size_t)given);
    f->postures = 0;
    f->nodes = 0;
    for (k = 0; k < ARM_PLANES; k++)
        value[k] = -ARM_PI + (k + 0.5) * (ARM_TURN / ARM_PLANES);
    for (begin = 0; begin < ARM_PLANES; begin += ARM_MANY) {
        arm_many q[ARM_JOINTS * ARM_BRANCHES], defect[ARM_BRANCHES];
        const int count = arm_few(ARM_PLANES - begin);
        for (i = 0; i < count; i++)
            place[begin + i] = begin + i;
        arm_branches_at(f->goal, value + begin, count, q, defect);
        starts += arm_block_starts(q, defect, place + begin, count, start + starts);
        for (i = 0; i < count; i++)
            for (b = 0; b < ARM_BRANCHES; b++)
                missed[begin + i + 1][b] = defect[b][i];
    }
    memcpy(missed[0], missed[ARM_PLANES], sizeof *missed);
    memcpy(missed[ARM_PLANES + 1], missed[1], 2 * sizeof *missed);
    for (k = 0; k < ARM_PLANES; k++)
        if (arm_turns_back(missed + k))
            arm_answers_between(f, value, k);
    f->lost |= f->postures + given > ARM_EXTRA;
    for (i = 0; i < given && f->postures < ARM_EXTRA; i++)
        memcpy(f->posture[f->postures++], given_postures[i], sizeof given_postures[i]);
    f->planes = ARM_PLANES + f->postures;
    for (i = 0; i < f->postures; i++)
        value[ARM_PLANES + i] = arm_wrap(f->posture[i][ARM_GUIDE]);
    for (begin = ARM_PLANES; begin < f->planes; begin += ARM_MANY) {
        arm_many q[ARM_JOINTS * ARM_BRANCHES], defect[ARM_BRANCHES];
        const int count = arm_few(f->planes - begin);
        for (i = 0; i < count; i++)
            place[begin + i] = begin + i;
        arm_branches_at(f->goal, value + begin, count, q, defect);
        starts += arm_block_starts(q, defect, place + begin, count, start + starts);
    }
    for (i = 0; i < f->postures; i++) {
        start[starts].plane = ARM_PLANES + i;
        start[starts].branch = ARM_BRANCHES;
        memcpy(start[starts++].q, f->posture[i], sizeof f->posture[i]);
    }
    for (k = 0; k < f->planes; k++) {
        for (place[k] = f->postures ? 0 : k, i = 0; i < f->planes && f->postures; i++) /* how many planes are below */
            place[k] += value[i] < value[k] || (value[i] == value[k] && i < k);
        f->value[place[k]] = value[k];
        for (b = 0; b < ARM_BRANCHES; b++)
            f->grid[k][b] = -1;
    }
    for (i = 0; i < starts; i++)
        start[i].plane = place[start[i].plane];
    arm_answers_on_planes(f, start, starts);
}
