/* The postures of pieces that move the joints least from `near`: the code of `armkin.inverse.redundant.families`. */

/* Up to ARM_MANY pieces: the ways and points of a parameter each. */
static void arm_at(const arm_curves *f, const arm_pieces *w, const int *piece, int count, arm_many parameter, arm_many *q,
    arm_many *cost, arm_flags *legal)
{
    arm_ways ways;
    arm_many tangent[ARM_JOINTS], share;
    arm_points points;
    int i;
    for (i = 0; i < ARM_MANY; i++) {
        const int t = i < count ? i : 0, curve = w->piece[piece[t]].curve;
        int point = (int)parameter[t];
        share[i] = parameter[t] - point;
        if (point >= w->first[curve + 1])
            point -= w->first[curve + 1] - w->first[curve];
        arm_put_way(&w->way[point], &ways, i);
        arm_put(w->tangent[point], tangent, i);
    }
    arm_between(f->goal, &ways, tangent, share, ARM_REACH, &points);
    *legal = arm_copies(f->near, points.q) & (arm_flags)(points.step < ARM_REACH);
    *cost = arm_pick(*legal, arm_motion(f->near, points.q), arm_all(ARM_INFINITY));
    memcpy(q, points.q, sizeof points.q);
}

/* The best postures so far of up to ARM_MANY legal pieces, and their motion. */
typedef struct {
    const int *piece;
    int count;
    arm_many q[ARM_JOINTS], least;
} arm_best;

/* Motion at a parameter each, infinite where that is not legal; better postures are kept. */
static arm_many arm_cost(const arm_curves *f, const arm_pieces *w, arm_best *best, arm_many parameter, arm_many *q)
{
    arm_many cost;
    arm_flags legal, better;
    int j;
    arm_at(f, w, best->piece, best->count, parameter, q, &cost, &legal);
    better = (arm_flags)(cost < best->least);
    best->least = arm_pick(better, cost, best->least);
    for (j = 0; j < ARM_JOINTS; j++)
        best->q[j] = arm_pick(better, q[j], best->q[j]);
    return cost;
}

/* Golden section between low and high, then where a joint stands as near has it, by a secant; by a parabola. */
static void arm_search(const arm_curves *f, const arm_pieces *w, arm_best *best, arm_many low, arm_many high)
{
    const double ratio = 0.6180339887498949;
    arm_many left = high - ratio * (high - low), right = low + ratio * (high - low);
    arm_many q[ARM_JOINTS], end[ARM_JOINTS], most = arm_all(0), trial;
    arm_many at_left = arm_cost(f, w, best, left, q), at_right = arm_cost(f, w, best, right, q);
    arm_many at_low, at_high, middle, value, a, b;
    arm_flags legal, inner;
    int j, k;
    for (k = 0; k < ARM_STEPS; k++) {
        const arm_flags go = (arm_flags)(at_left <= at_right);
        arm_many at_new;
        low = arm_pick(go, low, left);
        high = arm_pick(go, right, high);
        trial = arm_pick(go, high - ratio * (high - low), low + ratio * (high - low));
        at_new = arm_cost(f, w, best, trial, q);
        value = arm_pick(go, at_new, at_right); /* of the place on the left */
        at_right = arm_pick(go, at_left, at_new);
        at_left = value;
        value = arm_pick(go, trial, right);
        right = arm_pick(go, left, trial);
        left = value;
    }
    middle = arm_pick((arm_flags)(at_left <= at_right), left, right);
    value = arm_less(at_left, at_right);
    arm_at(f, w, best->piece, best->count, low, q, &trial, &legal);
    arm_at(f, w, best->piece, best->count, high, end, &trial, &legal);
    at_low = arm_motion(f->near, q);
    at_high = arm_motion(f->near, end);
    trial = low;
    for (j = 0; j < ARM_JOINTS; j++) {
        const arm_many from = q[j] - f->near[j], to = end[j] - f->near[j];
        const arm_flags passes = (arm_flags)(from * to < 0) & (arm_flags)(arm_size(to - from) > most);
        const arm_many span = arm_pick((arm_flags)(from == to), arm_all(1), from - to);
        trial = arm_pick(passes, low + (high - low) * from / span, trial);
        most = arm_pick(passes, arm_size(to - from), most);
    }
    arm_cost(f, w, best, trial, q);
    a = (middle - low) * (value - at_high);
    b = (middle - high) * (value - at_low);
    trial = middle - 0.5 * ((middle - low) * a - (middle - high) * b) / (a - b);
    inner = (arm_flags)(trial > low) & (arm_flags)(trial < high);
    arm_cost(f, w, best, arm_pick(inner, trial, middle), q);
}

/* Some pieces' postures as lanes, and back. */
static void arm_best_of(const arm_pieces *w, const int *piece, int count, const double *near, arm_best *best)
{
    int i;
    best->piece = piece;
    best->count = count;
    for (i = 0; i < ARM_MANY; i++)
        arm_put(w->nearest[piece[i < count ? i : 0]], best->q, i);
    best->least = arm_motion(near, best->q);
}

static void arm_keep_best(arm_pieces *w, const arm_best *best)
{
    int i;
    for (i = 0; i < best->count; i++)
        arm_get(best->q, w->nearest[best->piece[i]], i);
}

/* Of each of some pieces, the parameters of its best node and of those beside it. */
static void arm_parameters(const arm_pieces *w, const int *piece, int count, arm_many *low, arm_many *at, arm_many *high)
{
    int i;
    for (i = 0; i < ARM_MANY; i++) {
        const arm_piece *one = &w->piece[piece[i < count ? i : 0]];
        (*low)[i] = one->low;
        (*at)[i] = one->at;
        (*high)[i] = one->high;
    }
}

/* The pieces' best nodes, on their curves. */
static void arm_begin_nearest(const arm_curves *f, arm_pieces *w, const int *piece)
{
    int begin, i;
    for (begin = 0; begin < w->pieces; begin += ARM_MANY) {
        const int count = arm_few(w->pieces - begin);
        arm_many low, at, high, cost, q[ARM_JOINTS];
        arm_flags legal;
        arm_parameters(w, piece + begin, count, &low, &at, &high);
        arm_at(f, w, piece + begin, count, at, q, &cost, &legal);
        for (i = 0; i < count; i++) {
            const arm_piece *one = &w->piece[begin + i];
            memcpy(w->nearest[begin + i], one->start, sizeof one->start);
            if (one->low < one->at && one->at < one->high && (legal[i] || !one->legal))
                arm_get(q, w->nearest[begin + i], i);
        }
    }
}

/* The postures of all pieces nearest to near; of those without a legal posture, of their samples. */
static void arm_find_nearest(const arm_curves *f, arm_pieces *w)
{
    int piece[ARM_PIECES], search[ARM_PIECES], begin, i, k, legal = 0, searches = 0;
    for (i = 0; i < w->pieces; i++) {
        piece[i] = i;
        legal += w->piece[i].legal; /* which stand before the others */
    }
    arm_begin_nearest(f, w, piece);
    for (begin = 0; begin < legal; begin += ARM_MANY) {
        arm_best best;
        arm_many low, at, high, least, side, q[ARM_JOINTS];
        arm_best_of(w, piece + begin, arm_few(legal - begin), f->near, &best);
        arm_parameters(w, piece + begin, best.count, &low, &at, &high);
        least = best.least;
        side = arm_cost(f, w, &best, at + ARM_PROBE_SHARE * (low - at), q);
        side = arm_less(side, arm_cost(f, w, &best, at + ARM_PROBE_SHARE * (high - at), q));
        arm_keep_best(w, &best);
        for (i = 0; i < best.count; i++)
            if (side[i] < least[i]) /* else the motion grows both ways: at a kink or limit */
                search[searches++] = begin + i;
    }
    for (begin = 0; begin < searches; begin += ARM_MANY) {
        arm_best best;
        arm_many low, at, high;
        arm_best_of(w, search + begin, arm_few(searches - begin), f->near, &best);
        arm_parameters(w, search + begin, best.count, &low, &at, &high);
        arm_search(f, w, &best, low, high);
        arm_keep_best(w, &best);
    }
    for (begin = 0; begin < w->pieces; begin += ARM_MANY) { /* what is left of their residual */
        arm_best best;
        arm_points points;
        arm_best_of(w, piece + begin, arm_few(w->pieces - begin), f->near, &best);
        memcpy(points.q, best.q, sizeof best.q);
        for (i = 0; i < best.count; i++) {
            const arm_piece *one = &w->piece[begin + i];
            int point = (int)one->at;
            if (point >= w->first[one->curve + 1])
                point -= w->first[one->curve + 1] - w->first[one->curve];
            arm_put(w->tangent[point], points.tangent, i);
        }
        for (; i < ARM_MANY; i++)
            for (k = 0; k < ARM_JOINTS; k++)
                points.tangent[k][i] = points.tangent[k][0];
        arm_onto_curves(f->goal, &points, ARM_PAIR_STEP, ARM_LAST, 1);
        memcpy(best.q, points.q, sizeof best.q);
        arm_keep_best(w, &best);
    }
}

/* All pieces of the curves: legal ones, then those without a legal posture. */
static void arm_find_pieces(arm_curves *f, arm_pieces *w)
{
    int curve;
    arm_find_changes(f, w);
    w->pieces = w->empties = 0;
    for (curve = 0; curve < w->curves && !f->lost; curve++) {
        const int count = arm_nodes_of_curve(f, w, curve);
        arm_add_runs(f, w, curve, count, 1);
        arm_add_runs(f, w, curve, count, 0);
    }
    if (f->lost)
        return;
    memcpy(w->piece + w->pieces, w->empty, sizeof *w->empty * (size_t)w->empties);
    w->pieces += w->empties;
    arm_find_nearest(f, w);
}
