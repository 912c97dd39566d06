/* What cubics do not join is traced through the slab between two planes, step by step. */
enum { ARM_RAYS = 512, ARM_PASSED = 4096 };

/* A half on its way through a slab. */
typedef struct {
    int half, slab, end, alive; /* end: the plane that it comes to, -1 where it is lost */
    double middle, half_width, step; /* of the slab [rad]; length of the next step [rad] */
    double q[ARM_WIDTH], tangent[ARM_WIDTH]; /* where it is; at last on that plane */
} arm_ray;

typedef struct {
    arm_ray ray[ARM_RAYS];
    int owner[ARM_PASSED], goal[ARM_RAYS]; /* whose each point is; the half that each ray comes to, -1: none */
    double q[ARM_PASSED][ARM_WIDTH], tangent[ARM_PASSED][ARM_WIDTH]; /* points that rays pass, as they come */
    int passed;
} arm_tracing;

/* The plane that some rays cross by a step to points, and their crossings there. */
static void arm_cross_planes(const arm_curves *f, arm_ray *const *ray, int count, const arm_points *begin,
    const arm_points *points, arm_flags leaves)
{
    arm_points crossing;
    arm_many middle, half_width, depth, begin_depth, to, share;
    int i, j;
    for (i = 0; i < ARM_MANY; i++) {
        middle[i] = ray[i < count ? i : 0]->middle;
        half_width[i] = ray[i < count ? i : 0]->half_width;
    }
    depth = arm_wrapped(points->q[ARM_GUIDE] - middle);
    begin_depth = arm_wrapped(begin->q[ARM_GUIDE] - middle);
    to = arm_pick((arm_flags)(depth > 0), half_width, -half_width);
    share = arm_larger(arm_less((to - begin_depth) / (depth - begin_depth), arm_all(1)), arm_all(0));
    for (j = 0; j < ARM_JOINTS; j++)
        crossing.q[j] = begin->q[j] + share * arm_wrapped(points->q[j] - begin->q[j]);
    crossing.q[ARM_GUIDE] = middle + to;
    arm_hold(crossing.tangent, ARM_GUIDE);
    arm_onto_curves(f->goal, &crossing, ARM_PAIR_STEP, ARM_NEWTON, 0);
    for (i = 0; i < count; i++)
        if (leaves[i] && crossing.step[i] < ARM_PAIR_STEP) {
            double q[ARM_WIDTH];
            arm_get(crossing.q, q, i);
            if (arm_distance(q, f->q[ray[i]->half >> 1]) < ARM_SAME_SEED) /* where it began */
                continue;
            ray[i]->end = (ray[i]->slab + (depth[i] > 0)) % f->planes;
            arm_get(crossing.q, ray[i]->q, i);
            arm_get(crossing.tangent, ray[i]->tangent, i);
        }
}

/* Up to ARM_MANY rays go on by one step each. */
static void arm_advance(arm_curves *f, arm_tracing *work, arm_ray *const *ray, int count)
{
    arm_points begin, points;
    arm_ways ways;
    arm_many step, middle, half_width, chosen[ARM_JOINTS], drift = arm_all(0), depth, begin_depth;
    arm_flags valid, leaves;
    int i, j;
    for (i = 0; i < ARM_MANY; i++) {
        const arm_ray *one = ray[i < count ? i : 0];
        arm_put(one->q, begin.q, i);
        arm_put(one->tangent, begin.tangent, i);
        step[i] = one->step;
        middle[i] = one->middle;
        half_width[i] = one->half_width;
    }
    for (j = 0; j < ARM_JOINTS; j++) {
        points.q[j] = begin.q[j] + step * begin.tangent[j];
        points.tangent[j] = begin.tangent[j];
    }
    arm_onto_curves(f->goal, &points, ARM_PAIR_STEP, ARM_NEWTON, 0);
    arm_ways_between(&begin, &points, &ways);
    for (j = 0; j < ARM_JOINTS; j++) {
        const arm_many off = ways.chord[j] - step * begin.tangent[j];
        drift += off * off;
    }
    arm_on_ways(&ways, arm_all(0.5), chosen);
    valid = (arm_flags)(points.step < ARM_PAIR_STEP) & (arm_flags)(arm_roots(drift) < ARM_SIDE_SHARE * step)
        & arm_follows(f->goal, chosen);
    depth = arm_wrapped(points.q[ARM_GUIDE] - middle);
    begin_depth = arm_wrapped(begin.q[ARM_GUIDE] - middle);
    leaves = valid & (arm_flags)(arm_size(depth) >= half_width) & (arm_flags)(arm_size(depth - begin_depth) > ARM_TINY);
    if (arm_any(leaves))
        arm_cross_planes(f, ray, count, &begin, &points, leaves);
    for (i = 0; i < count; i++) {
        if (leaves[i] && ray[i]->end < 0) /* the step is too long */
            leaves[i] = valid[i] = 0;
        if (valid[i] && !leaves[i]) {
            if (work->passed == ARM_PASSED) {
                f->lost = 1;
                return;
            }
            arm_get(points.q, ray[i]->q, i);
            arm_get(points.tangent, ray[i]->tangent, i);
            memcpy(work->q[work->passed], ray[i]->q, sizeof ray[i]->q);
            memcpy(work->tangent[work->passed], ray[i]->tangent, sizeof ray[i]->q);
            work->owner[work->passed++] = (int)(ray[i] - work->ray);
        }
        ray[i]->step = valid[i] ? fmin(1.5 * ray[i]->step, ARM_RAY_STEP) : 0.5 * ray[i]->step;
        ray[i]->alive = !leaves[i] && ray[i]->step > ARM_SHORTEST_ARC;
    }
}

/* A ray where it begins. */
static void arm_begin_ray(const arm_curves *f, arm_ray *ray)
{
    const double low = f->value[ray->slab], high = f->value[(ray->slab + 1) % f->planes];
    const double sign = 1 - 2 * (ray->half & 1);
    int j;
    ray->half_width = 0.5 * (high - low < 0 ? high - low + ARM_TURN : high - low);
    ray->middle = low + ray->half_width;
    ray->step = ARM_RAY_STEP;
    ray->end = -1;
    ray->alive = 1;
    memset(ray->tangent, 0, sizeof ray->tangent);
    memcpy(ray->q, f->q[ray->half >> 1], sizeof ray->q);
    for (j = 0; j < ARM_JOINTS; j++)
        ray->tangent[j] = sign * f->tangent[ray->half >> 1][j];
}

/* Up to ARM_MANY rays moved as near to their curves as short steps need. */
static void arm_settle_rays(const arm_curves *f, arm_ray *ray, int count)
{
    arm_points points;
    int i;
    for (i = 0; i < ARM_MANY; i++) {
        arm_put(ray[i < count ? i : 0].q, points.q, i);
        arm_put(ray[i < count ? i : 0].tangent, points.tangent, i);
    }
    arm_onto_curves(f->goal, &points, ARM_PAIR_STEP, ARM_NEWTON, 0);
    for (i = 0; i < count; i++) {
        arm_get(points.q, ray[i].q, i);
        arm_get(points.tangent, ray[i].tangent, i);
    }
}

/* All rays followed to where they leave their slabs. */
static void arm_follow_rays(arm_curves *f, arm_tracing *work, int count)
{
    arm_ray *ray[ARM_RAYS];
    int begin, i, k, alive = count;
    for (i = 0; i < count; i++) {
        ray[i] = &work->ray[i];
        arm_begin_ray(f, ray[i]);
    }
    for (begin = 0; begin < count; begin += ARM_MANY)
        arm_settle_rays(f, work->ray + begin, arm_few(count - begin));
    work->passed = 0;
    for (k = 0; k < ARM_TRIES && alive && !f->lost; k++) {
        for (begin = 0; begin < alive; begin += ARM_MANY)
            arm_advance(f, work, ray + begin, arm_few(alive - begin));
        for (i = 0, begin = alive, alive = 0; i < begin; i++)
            if (ray[i]->alive)
                ray[alive++] = ray[i];
    }
}

/* The node on a plane that a ray has come to; one that is none yet becomes one. */
static int arm_node_on_plane(arm_curves *f, const arm_ray *ray, int before)
{
    int m;
    for (m = before - 1; m >= 0; m--)
        if (f->plane[m] == ray->end && arm_distance(f->q[m], ray->q) < ARM_SAME_SEED)
            return m;
    for (m = before; m < f->nodes; m++)
        if (f->plane[m] == ray->end && arm_distance(f->q[m], ray->q) < ARM_SAME_SEED)
            return m;
    return arm_add_node(f, ray->q, ray->tangent, ray->end);
}

/* Whether the arc of ray i is kept: it is traced from both of its ends, and may come to where another one came, or whose own
   arc leads elsewhere. */
static int arm_keeps_ray(const arm_curves *f, const arm_tracing *work, int i, int count)
{
    const int goal = work->goal[i], half = work->ray[i].half;
    int k;
    if (goal < 0 || f->partner[goal] >= 0 || goal == half)
        return 0;
    for (k = 0; k < count; k++) {
        if (work->goal[k] == goal && k < i)
            return 0;
        if (work->ray[k].half == goal && (k <= i || (work->goal[k] >= 0 && work->goal[k] != half)))
            return 0;
    }
    return 1;
}

/* Open halves that have not been traced yet, traced and joined to what they come to. */
static void arm_trace(arm_curves *f, arm_tracing *work, arm_joining *joining, const int *half, int count)
{
    int added[ARM_PASSED], kept[ARM_RAYS], i, k, rays = 0, before, links = 0;
    for (i = 0; i < count; i++)
        if (!f->traced[half[i]]) {
            if (rays == ARM_RAYS) {
                f->lost = 1;
                return;
            }
            f->traced[half[i]] = 1;
            work->ray[rays].slab = arm_slab(f, half[i]);
            work->ray[rays++].half = half[i];
        }
    arm_follow_rays(f, work, rays);
    for (i = 0, before = f->nodes; i < rays && !f->lost; i++) {
        const arm_ray *ray = &work->ray[i];
        work->goal[i] = ray->end < 0 ? -1 : 2 * arm_node_on_plane(f, ray, before) + (ray->end != ray->slab);
    }
    if (f->lost)
        return;
    for (i = 0; i < rays; i++)
        kept[i] = arm_keeps_ray(f, work, i, rays);
    for (k = 0; k < work->passed; k++)
        added[k] = kept[work->owner[k]] ? arm_add_node(f, work->q[k], work->tangent[k], -1) : -1;
    for (i = 0; i < rays && !f->lost; i++) {
        int last = work->ray[i].half;
        if (!kept[i])
            continue;
        for (k = 0; k <= work->passed && links < ARM_NODES; k++)
            if (k == work->passed || work->owner[k] == i) {
                joining->level[links] = (arm_link){last, k < work->passed ? 2 * added[k] + 1 : work->goal[i], links};
                links++;
                last = k < work->passed ? 2 * added[k] : last;
            }
    }
    if (links >= ARM_NODES)
        f->lost = 1;
    if (!f->lost)
        arm_join(f, joining, links);
}

/* All curves that answers on planes, or `postures`, are on. */
static void arm_join_curves(arm_curves *f, arm_joining *joining, arm_tracing *tracing, arm_start *start)
{
    int half[ARM_NODES / 2], count, i, round, left;
    arm_start_curves(f, start);
    if (!f->lost)
        arm_join_branches(f, joining);
    for (round = 0; round < ARM_ROUNDS && !f->lost; round++) {
        count = arm_open_halves(f, half, ARM_NODES / 2, 1);
        if (!f->lost)
            arm_join_pairs(f, joining, half, count);
        if (!f->lost)
            count = arm_open_halves(f, half, ARM_NODES / 2, 0);
        for (i = left = 0; i < count; i++)
            left += !f->traced[half[i]];
        if (!left || f->lost)
            break;
        arm_trace(f, tracing, joining, half, count);
    }
}
