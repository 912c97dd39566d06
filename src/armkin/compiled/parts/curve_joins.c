/* Answers on planes, joined to curves: the code of `armkin.inverse.redundant.traced_curves`. */
typedef struct {
    int a, b, pair; /* halves that are joined; the pair of halves whose way this is a part of */
} arm_link;

/* A way whose middle misses: the middle, the chord's direction and the way's size. */
typedef struct {
    arm_link link;
    double q[ARM_WIDTH], along[ARM_WIDTH], size;
} arm_gap;

/* Room for the work on one target; links that are valid, those of a level and of the next; which pairs failed. */
typedef struct {
    arm_link kept[ARM_NODES], level[ARM_NODES], next[ARM_NODES];
    arm_gap gap[ARM_NODES];
    uint8_t failed[ARM_NODES];
} arm_joining;

/* Lane t of points: the node that a half leaves, its tangent along it. */
ARM_INLINE void arm_put_half(const arm_curves *f, int half, arm_points *points, int t)
{
    const double sign = 1 - 2 * (half & 1);
    int j;
    for (j = 0; j < ARM_JOINTS; j++) {
        points->q[j][t] = f->q[half >> 1][j];
        points->tangent[j][t] = sign * f->tangent[half >> 1][j];
    }
}

/* One level of joining: links whose cubics do are kept, pairs that cannot be joined fail, what is left becomes gaps. */
static int arm_join_level(const arm_curves *f, arm_joining *work, int count, int *kept)
{
    int begin, i, j, gaps = 0;
    for (begin = 0; begin < count; begin += ARM_MANY) {
        const int number = arm_few(count - begin);
        const arm_link *link = work->level + begin;
        arm_points first, last;
        arm_ways ways;
        arm_many size, middle[ARM_JOINTS];
        arm_flags failing, valid;
        for (i = 0; i < ARM_MANY; i++) {
            arm_put_half(f, link[i < number ? i : 0].a, &first, i);
            arm_put_half(f, link[i < number ? i : 0].b ^ 1, &last, i);
        }
        arm_ways_between(&first, &last, &ways);
        size = arm_roots(arm_dot(ways.chord, ways.chord));
        failing = (arm_flags)(arm_dot(ways.chord, first.tangent) < 0);
        failing |= (arm_flags)(arm_dot(ways.chord, last.tangent) < 0) | (arm_flags)(size > ARM_ARC_LENGTH);
        arm_on_ways(&ways, arm_all(0.5), middle);
        valid = arm_follows(f->goal, middle) & ~failing;
        for (i = 0; i < number; i++) {
            if (valid[i])
                work->kept[(*kept)++] = link[i];
            else if (failing[i])
                work->failed[link[i].pair] = 1;
            else {
                arm_gap *gap = &work->gap[gaps++];
                gap->link = link[i];
                gap->size = size[i];
                for (j = 0; j < ARM_JOINTS; j++) {
                    gap->q[j] = middle[j][i];
                    gap->along[j] = ways.chord[j][i] / size[i];
                }
            }
        }
    }
    return gaps;
}

/* The middles of gaps, moved onto their curve, become nodes, with a link on each side. */
static int arm_halve(arm_curves *f, arm_joining *work, int gaps)
{
    int begin, i, count = 0, halved = 0;
    for (begin = 0; begin < gaps; begin += ARM_MANY) {
        const int number = arm_few(gaps - begin);
        arm_points points;
        arm_many middle[ARM_JOINTS], drift;
        for (i = 0; i < ARM_MANY; i++) {
            const arm_gap *gap = &work->gap[begin + (i < number ? i : 0)];
            arm_put(gap->q, points.q, i);
            arm_put(gap->along, points.tangent, i);
        }
        memcpy(middle, points.q, sizeof middle);
        arm_onto_curves(f->goal, &points, ARM_SAME_SEED, ARM_NEWTON, 0);
        drift = arm_apart(points.q, middle);
        for (i = 0; i < number; i++) {
            const arm_gap *gap = &work->gap[begin + i];
            double q[ARM_WIDTH] = {0}, tangent[ARM_WIDTH] = {0};
            int m;
            if (!(points.step[i] < ARM_SAME_SEED && drift[i] < ARM_SIDE_SHARE * gap->size)) {
                work->failed[gap->link.pair] = 1;
                continue;
            }
            arm_get(points.q, q, i);
            arm_get(points.tangent, tangent, i);
            m = arm_add_node(f, q, tangent, -1);
            work->next[halved] = gap->link;
            work->next[halved].b = 2 * m + 1;
            work->gap[halved++].link = (arm_link){2 * m, gap->link.b, gap->link.pair};
        }
    }
    if (2 * halved > ARM_NODES) {
        f->lost = 1;
        return 0;
    }
    memcpy(work->level, work->next, sizeof *work->level * (size_t)halved);
    for (i = 0, count = halved; i < halved; i++)
        work->level[count++] = work->gap[i].link;
    return count;
}

/* Halves a and b of the links in `level` joined by cubics, of which each must do. */
static void arm_join(arm_curves *f, arm_joining *work, int count)
{
    int i, k, kept = 0, gaps;
    memset(work->failed, 0, (size_t)count);
    for (k = 0; k <= ARM_HALVINGS && count; k++) {
        gaps = arm_join_level(f, work, count, &kept);
        for (i = 0, count = 0; i < gaps; i++)
            if (!work->failed[work->gap[i].link.pair])
                work->gap[count++] = work->gap[i];
        if (k == ARM_HALVINGS)
            for (i = 0; i < count; i++)
                work->failed[work->gap[i].link.pair] = 1;
        else
            count = arm_halve(f, work, count);
        if (kept + count > ARM_NODES)
            f->lost = 1;
        if (f->lost)
            return;
    }
    for (i = 0; i < kept; i++)
        if (!work->failed[work->kept[i].pair]) {
            f->partner[work->kept[i].a] = work->kept[i].b;
            f->partner[work->kept[i].b] = work->kept[i].a;
        }
}

/* In which slab between two planes a half is: the plane below it. */
ARM_INLINE int arm_slab(const arm_curves *f, int half)
{
    const int plane = f->plane[half >> 1] - (half & 1);
    return plane < 0 ? plane + f->planes : plane;
}

/* Answers of the same branch on planes that follow. */
static void arm_join_branches(arm_curves *f, arm_joining *work)
{
    int b, k, count = 0;
    for (k = 0; k < f->planes; k++)
        for (b = 0; b < ARM_BRANCHES; b++) {
            const int first = f->grid[k][b], last = f->grid[(k + 1) % f->planes][b];
            if (first >= 0 && last >= 0) {
                work->level[count] = (arm_link){2 * first, 2 * last + 1, count};
                count++;
            }
        }
    arm_join(f, work, count);
}

/* Halves that are joined to none, of nodes on planes, at most `room`; slab after slab, or as they are numbered. */
static int arm_open_halves(arm_curves *f, int *half, int room, int by_slab)
{
    int i, k, count = 0;
    for (k = 0; k < 2 * f->nodes; k++) {
        if (f->partner[k] >= 0 || f->plane[k >> 1] < 0)
            continue;
        if (count == room) {
            f->lost = 1;
            break;
        }
        for (i = count++; by_slab && i && arm_slab(f, half[i - 1]) > arm_slab(f, k); i--)
            half[i] = half[i - 1];
        half[i] = k;
    }
    return count;
}

/* What a short cubic between two halves costs; infinite where none is. */
static double arm_join_cost(const arm_curves *f, int a, int b)
{
    const double *p = f->q[a >> 1], *q = f->q[b >> 1], *s = f->tangent[a >> 1], *t = f->tangent[b >> 1];
    const double from = 1 - 2 * (a & 1), to = 1 - 2 * (b & 1);
    double square = 0, advance = 0;
    int j;
    for (j = 0; j < ARM_JOINTS; j++) {
        const double chord = arm_wrap(q[j] - p[j]);
        square += chord * chord;
        advance += chord * (from * s[j] - to * t[j]);
    }
    return advance <= 0 ? ARM_INFINITY : 2 * sqrt(square) - 0.5 * advance;
}

/* Open halves of a slab, each with the one that a short cubic leads to, and which leads to it. */
static void arm_join_pairs(arm_curves *f, arm_joining *work, const int *half, int count)
{
    int nearest[ARM_NODES / 2], begin, end, i, k, pairs = 0;
    for (begin = 0; begin < count; begin = end) {
        for (end = begin + 1; end < count && arm_slab(f, half[end]) == arm_slab(f, half[begin]); end++)
            ;
        for (i = begin; i < end; i++) {
            double least = ARM_INFINITY;
            nearest[i] = -1;
            for (k = begin; k < end; k++) {
                const double cost = k == i ? ARM_INFINITY : arm_join_cost(f, half[i], half[k]);
                if (cost < least) {
                    least = cost;
                    nearest[i] = k;
                }
            }
        }
        for (i = begin; i < end; i++)
            if (nearest[i] > i && nearest[nearest[i]] == i) {
                work->level[pairs] = (arm_link){half[i], half[nearest[i]], pairs};
                pairs++;
            }
    }
    arm_join(f, work, pairs);
}
