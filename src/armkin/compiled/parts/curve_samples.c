/* Halves that are joined as curves, and samples of these, at which limits and the redundant joint's sense are asked: the
   code of `armkin.inverse.redundant.traced_families`, in three files. */

/* What is behind a node: nothing, postures beyond limits, legal ones. */
enum { ARM_END, ARM_BEYOND, ARM_LEGAL };
enum { ARM_CURVES = 127, ARM_POINTS_ROOM = ARM_NODES, ARM_CHANGES = 2048, ARM_PIECES = 128 };

static const double arm_lower[ARM_JOINTS] = {@lower@}, arm_upper[ARM_JOINTS] = {@upper@};

/* The way from a point of a curve to the next one. */
typedef struct {
    double q[ARM_WIDTH], chord[ARM_WIDTH], begin[ARM_WIDTH], end[ARM_WIDTH];
} arm_way;

/* A sample of a curve, or where a limit is crossed or the joint turns back. */
typedef struct {
    double share, value, cost; /* of the way from its point; the redundant joint [rad]; motion from near [deg] */
    int point, change; /* which change it is, -1: none */
    uint8_t fits, inside; /* whether its copy nearest to near, and it is within limits */
    uint8_t up, behind; /* whether the joint grows behind it; ARM_END, ARM_BEYOND or ARM_LEGAL */
} arm_sample;

/* Where a limit is crossed, or the joint turns back, between two samples. */
typedef struct {
    int sample, turns;
    double share, q[ARM_WIDTH];
} arm_change;

/* As `interval_pieces.Pieces`: parameters count the points of all curves. */
typedef struct {
    int curve, legal;
    double a, b, low, at, high, start[ARM_WIDTH];
} arm_piece;

/* The curves in their order, their points and samples. */
typedef struct {
    int curves, first[ARM_CURVES + 1], closed[ARM_CURVES], half[ARM_POINTS_ROOM];
    arm_way way[ARM_POINTS_ROOM];
    double tangent[ARM_POINTS_ROOM][ARM_WIDTH];
    arm_sample sample[ARM_PARTS * ARM_POINTS_ROOM];
    int changes, change_at[ARM_PARTS * ARM_POINTS_ROOM][2]; /* of each sample the crossing and the turn, -1: none */
    arm_change change[ARM_CHANGES];
    arm_sample node[ARM_PARTS * ARM_POINTS_ROOM + ARM_CHANGES + 1];
    int pieces, empties; /* with legal postures, without */
    arm_piece piece[ARM_PIECES], empty[ARM_PIECES];
    double nearest[ARM_PIECES][ARM_WIDTH];
    uint8_t used[2 * ARM_NODES];
} arm_pieces;

/* Halves that are joined, as curves, each in one of its two senses and as numpy orders them. */
static void arm_chain(arm_curves *f, arm_pieces *w)
{
    int last[ARM_CURVES], begin[ARM_CURVES], closed[ARM_CURVES], order[ARM_CURVES], count = 0, h, i, k, points = 0;
    memset(w->used, 0, (size_t)f->nodes * 2);
    for (k = 0; k < 2 * f->nodes; k++) /* two arcs may come to one half */
        f->lost |= f->partner[k] >= 0 && f->partner[f->partner[k]] != k;
    for (k = 0; k < 4 * f->nodes && !f->lost; k++) { /* open curves, then rings */
        int ring = k >= 2 * f->nodes, alone;
        const int start = ring ? k - 2 * f->nodes : k;
        if (w->used[start] || (!ring && f->partner[start ^ 1] >= 0))
            continue;
        for (h = start; f->partner[h] >= 0 && (f->partner[h] ^ 1) != start; h = f->partner[h] ^ 1)
            w->used[h] = w->used[h ^ 1] = 1;
        w->used[h] = w->used[h ^ 1] = 1;
        alone = h == start && f->partner[h] < 0;
        if (alone && f->plane[h >> 1] < 0) /* the middle of a way that failed */
            continue;
        if (count == ARM_CURVES) {
            f->lost = 1;
            return;
        }
        begin[count] = start;
        if (!ring && (start ^ 1) < h) { /* the other sense ends at a lesser half */
            begin[count] = h ^ 1;
            h = start ^ 1;
        }
        closed[count] = ring;
        last[count] = h;
        for (i = count++; i && last[order[i - 1]] > h; i--)
            order[i] = order[i - 1];
        order[i] = count - 1;
    }
    w->curves = count;
    for (i = 0; i < count; i++) {
        w->first[i] = points;
        w->closed[i] = closed[order[i]];
        for (h = begin[order[i]];; h = f->partner[h] ^ 1) {
            w->half[points++] = h;
            if (h == last[order[i]])
                break;
        }
    }
    w->first[count] = points;
}

ARM_INLINE int arm_after(const arm_pieces *w, int curve, int point)
{
    return point + 1 < w->first[curve + 1] ? point + 1 : w->closed[curve] ? w->first[curve] : point;
}

/* Whether joint j stops somewhere. */
ARM_INLINE int arm_stops(int j)
{
    return arm_upper[j] - arm_lower[j] < ARM_TURN;
}

/* How far joint j is from the middle of its limits, and how far from the nearer limit, negative beyond. */
ARM_INLINE arm_many arm_room_of(arm_many q, int j, arm_many *offset)
{
    *offset = arm_wrapped(q - 0.5 * (arm_lower[j] + arm_upper[j]));
    return 0.5 * (arm_upper[j] - arm_lower[j]) - arm_size(*offset);
}

/* How far within the limits postures are, negative beyond them; at most a turn. */
static arm_many arm_margin(const arm_ways *ways, arm_many u)
{
    arm_many room = arm_all(ARM_TURN), offset;
    int j;
    for (j = 0; j < ARM_JOINTS; j++)
        if (arm_stops(j))
            room = arm_less(room, arm_room_of(arm_on_way(ways, u, j), j, &offset));
    return room;
}

ARM_INLINE arm_many arm_floors(arm_many a)
{
    const arm_many whole = arm_whole(a);
    return arm_pick((arm_flags)(whole > a), whole - 1, whole);
}

/* Every joint at its legal copy nearest to near, and which postures are within limits. */
static arm_flags arm_copies(const double *near, arm_many *q)
{
    arm_flags inside = (arm_flags)(q[0] == q[0]);
    int j, t;
    for (j = 0; j < ARM_JOINTS; j++) {
        const double low = arm_lower[j] - ARM_SLACK, high = arm_upper[j] + ARM_SLACK;
        const arm_many value = arm_wrapped(q[j]);
        if (low > -ARM_PI && high < ARM_PI) {
            q[j] = value;
            inside &= (arm_flags)(value >= low) & (arm_flags)(value <= high);
        } else if (arm_lower[j] <= near[j] - ARM_PI && arm_upper[j] >= near[j] + ARM_PI)
            q[j] = value + ARM_TURN * arm_floors((near[j] + (ARM_PI + ARM_SLACK) - value) / ARM_TURN);
        else
            for (t = 0; t < ARM_MANY; t++) {
                int fits = 1;
                q[j][t] = arm_copy(value[t], near[j], arm_lower[j], arm_upper[j], &fits);
                inside[t] &= -fits;
            }
    }
    return inside;
}

/* Motion from near [deg]. */
ARM_INLINE arm_many arm_motion(const double *near, const arm_many *q)
{
    arm_many sum = arm_size(q[0] - near[0]) * (180 / ARM_PI);
    int j;
    for (j = 1; j < ARM_JOINTS; j++)
        sum += arm_size(q[j] - near[j]) * (180 / ARM_PI);
    return sum;
}

ARM_INLINE void arm_put_way(const arm_way *way, arm_ways *ways, int t)
{
    arm_put(way->q, ways->q, t);
    arm_put(way->chord, ways->chord, t);
    arm_put(way->begin, ways->begin, t);
    arm_put(way->end, ways->end, t);
}

/* The ways of all curves, and samples of them; whether no joint moves far along any. */
static int arm_sample_curves(const arm_curves *f, arm_pieces *w)
{
    double extent[ARM_JOINTS], most = 0;
    int curve, begin, i, j, part;
    for (curve = 0; curve < w->curves; curve++) {
        memset(extent, 0, sizeof extent);
        for (begin = w->first[curve]; begin < w->first[curve + 1]; begin += ARM_MANY) {
            const int end = w->first[curve + 1];
            const int number = arm_few(end - begin);
            arm_points here, next;
            arm_ways ways;
            for (i = 0; i < ARM_MANY; i++) {
                const int point = begin + (i < number ? i : 0);
                arm_put_half(f, w->half[point], &here, i);
                arm_put_half(f, w->half[arm_after(w, curve, point)], &next, i);
            }
            arm_ways_between(&here, &next, &ways);
            for (i = 0; i < number; i++) {
                arm_way *way = &w->way[begin + i];
                arm_get(ways.q, way->q, i);
                arm_get(ways.chord, way->chord, i);
                arm_get(ways.begin, way->begin, i);
                arm_get(ways.end, way->end, i);
                arm_get(here.tangent, w->tangent[begin + i], i);
                for (j = 0; j < ARM_JOINTS; j++)
                    extent[j] += fabs(way->chord[j]);
            }
            for (part = 0; part < ARM_PARTS; part++) {
                const arm_many u = arm_all(part / (double)ARM_PARTS);
                const arm_many room = arm_margin(&ways, u), slope = arm_way_slope(&ways, u, ARM_REDUNDANT);
                arm_many q[ARM_JOINTS], value, cost;
                arm_flags fits;
                arm_on_ways(&ways, u, q);
                value = q[ARM_REDUNDANT];
                fits = arm_copies(f->near, q);
                cost = arm_motion(f->near, q);
                for (i = 0; i < number; i++) {
                    arm_sample *one = &w->sample[ARM_PARTS * (begin + i) + part];
                    one->share = u[i];
                    one->value = value[i];
                    one->cost = cost[i];
                    one->point = begin + i;
                    one->change = -1;
                    one->fits = fits[i] != 0;
                    one->up = slope[i] > 0;
                    one->inside = room[i] >= -ARM_SLACK;
                    one->behind = one->inside ? ARM_LEGAL : ARM_BEYOND;
                    if (arm_after(w, curve, begin + i) == begin + i)
                        one->behind = ARM_END;
                }
            }
        }
        for (j = 0; j < ARM_JOINTS; j++)
            most = fmax(most, 0.5 * extent[j]);
    }
    return most > 0 && most < ARM_REACH;
}
