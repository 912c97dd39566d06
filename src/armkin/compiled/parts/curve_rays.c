/* What cubics do not join is traced through the slab between two planes, step by step. */
enum { ARM_RAYS = 512, ARM_PASSED = 4096 };

/* A half on its way through a slab. */
typedef struct {
    int half, slab, goal, alive; /* goal: the half that it comes to, -1: none */
    double middle, half_width; /* of the slab [rad] */
    double step, longest; /* length of the next step, of any [rad] */
    double q[ARM_WIDTH], tangent[ARM_WIDTH]; /* where it is */
} arm_ray;

typedef struct {
    arm_ray ray[ARM_RAYS];
    int rays, passed, before; /* before: nodes as a step began */
    int owner[ARM_PASSED]; /* whose each point is */
    double q[ARM_PASSED][ARM_WIDTH], tangent[ARM_PASSED][ARM_WIDTH]; /* points that rays pass, as they come */
} arm_tracing;

/* The node on a plane that is at q; one that is none yet becomes one. */
static int arm_node_on_plane(arm_curves *f, const double *q, const double *tangent, int plane, int before)
{
    int m;
    for (m = before - 1; m >= 0; m--)
        if (f->plane[m] == plane && arm_distance(f->q[m], q) < ARM_SAME_SEED)
            return m;
    for (m = before; m < f->nodes; m++)
        if (f->plane[m] == plane && arm_distance(f->q[m], q) < ARM_SAME_SEED)
            return m;
    return arm_add_node(f, q, tangent, plane);
}

/* A ray in a slab, counted round the turn. */
static void arm_enter_slab(const arm_curves *f, arm_ray *ray, int slab)
{
    double low, high;
    ray->slab = slab < 0 ? slab + f->planes : slab % f->planes;
    low = f->value[ray->slab];
    high = f->value[(ray->slab + 1) % f->planes];
    ray->half_width = 0.5 * (high - low < 0 ? high - low + ARM_TURN : high - low);
    ray->middle = low + ray->half_width;
}

/* The nodes that some rays, which leave their slabs by a step to points, come to. Where there is none the step is too long,
   or the curve turns back beside the plane: then short steps pass that. */
static void arm_cross_planes(arm_curves *f, const arm_tracing *work, arm_ray *const *ray, int count, const arm_points *begin,
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
    for (i = 0; i < count; i++) {
        const int above = depth[i] > 0, plane = (ray[i]->slab + above) % f->planes;
        double q[ARM_WIDTH], tangent[ARM_WIDTH] = {0};
        if (!leaves[i])
            continue;
        arm_get(crossing.q, q, i);
        arm_get(crossing.tangent, tangent, i);
        if (crossing.step[i] < ARM_PAIR_STEP && arm_distance(q, f->q[ray[i]->half >> 1]) >= ARM_SAME_SEED)
            ray[i]->goal = 2 * arm_node_on_plane(f, q, tangent, plane, work->before) + above;
        else if (ray[i]->step < ARM_TOUCHING)
            arm_enter_slab(f, ray[i], ray[i]->slab + (above ? 1 : -1));
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
        arm_cross_planes(f, work, ray, count, &begin, &points, leaves);
    for (i = 0; i < count; i++) {
        if (leaves[i] && ray[i]->goal < 0)
            valid[i] = ray[i]->step < ARM_TOUCHING;
        if (valid[i] && ray[i]->goal < 0) {
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
        ray[i]->step = valid[i] ? fmin(1.5 * ray[i]->step, ray[i]->longest) : 0.5 * ray[i]->step;
        ray[i]->alive = ray[i]->goal < 0 && ray[i]->step > ARM_SHORTEST_ARC;
    }
}

/* One more ray, where its half begins. */
static void arm_begin_ray(arm_curves *f, arm_tracing *work, int half)
{
    arm_ray *ray = &work->ray[work->rays];
    const double sign = 1 - 2 * (half & 1);
    int i;
    if (work->rays == ARM_RAYS) {
        f->lost = 1;
        return;
    }
    work->rays++;
    ray->half = half;
    ray->goal = -1;
    ray->alive = 1;
    arm_enter_slab(f, ray, arm_slab(f, half));
    ray->longest = ARM_RAY_STEP;
    for (i = 0; i < f->traces[half]; i++)
        ray->longest *= ARM_STEP_SHARE;
    ray->step = ray->longest;
    memset(ray->tangent, 0, sizeof ray->tangent);
    memcpy(ray->q, f->q[half >> 1], sizeof ray->q);
    for (i = 0; i < ARM_JOINTS; i++)
        ray->tangent[i] = sign * f->tangent[half >> 1][i];
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

/* Rays from `first` on as near to their curves as short steps need, among those that are followed. */
static int arm_add_rays(const arm_curves *f, arm_tracing *work, int first, arm_ray **ray, int alive)
{
    int begin;
    for (begin = first; begin < work->rays; begin += ARM_MANY)
        arm_settle_rays(f, work->ray + begin, arm_few(work->rays - begin));
    for (; first < work->rays; first++)
        ray[alive++] = &work->ray[first];
    return alive;
}

/* Whether a ray comes to a half. */
static int arm_is_goal(const arm_tracing *work, int half)
{
    int i;
    for (i = 0; i < work->rays && work->ray[i].goal != half; i++)
        ;
    return i < work->rays;
}

/* All rays followed to where they leave their slabs, and from there, where no node was, on. */
static void arm_follow_rays(arm_curves *f, arm_tracing *work)
{
    arm_ray *ray[ARM_RAYS];
    int begin, i, k, alive = arm_add_rays(f, work, 0, ray, 0);
    work->passed = 0;
    for (k = 0; k < ARM_TRIES && alive && !f->lost; k++) {
        const int rays = work->rays;
        work->before = f->nodes;
        for (begin = 0; begin < alive && !f->lost; begin += ARM_MANY)
            arm_advance(f, work, ray + begin, arm_few(alive - begin));
        for (i = 0, begin = alive, alive = 0; i < begin; i++)
            if (ray[i]->alive)
                ray[alive++] = ray[i];
        for (i = 2 * work->before; i < 2 * f->nodes && !f->lost; i++)
            if (!arm_is_goal(work, i))
                arm_begin_ray(f, work, i);
        alive = arm_add_rays(f, work, rays, ray, alive);
    }
}

/* Whether the arc of ray i is kept: it is traced from both of its ends, and no other one contradicts it. */
static int arm_keeps_ray(const arm_curves *f, const arm_tracing *work, int i)
{
    const int goal = work->ray[i].goal, half = work->ray[i].half;
    int k;
    if (goal < 0 || f->partner[goal] >= 0 || goal == half)
        return 0;
    for (k = 0; k < work->rays; k++) {
        const arm_ray *other = &work->ray[k];
        if (k != i && other->goal == goal)
            return 0;
        if (other->half == goal && (k <= i || (other->goal >= 0 && other->goal != half)))
            return 0;
    }
    return 1;
}

/* Open halves, traced and joined to what they come to. */
static void arm_trace(arm_curves *f, arm_tracing *work, arm_joining *joining, const int *half, int count)
{
    int added[ARM_PASSED], kept[ARM_RAYS], i, k, links = 0;
    work->rays = 0;
    for (i = 0; i < count && !f->lost; i++)
        if (f->traces[half[i]] < ARM_TRACES)
            arm_begin_ray(f, work, half[i]);
    if (!f->lost)
        arm_follow_rays(f, work);
    if (f->lost)
        return;
    for (i = 0; i < work->rays; i++) {
        const int goal = work->ray[i].goal;
        uint8_t *traces = &f->traces[work->ray[i].half];
        *traces = goal < 0 || f->partner[goal] >= 0 ? ARM_TRACES : *traces + 1;
        kept[i] = arm_keeps_ray(f, work, i);
    }
    for (k = 0; k < work->passed; k++)
        added[k] = kept[work->owner[k]] ? arm_add_node(f, work->q[k], work->tangent[k], -1) : -1;
    for (i = 0; i < work->rays && !f->lost; i++) {
        int last = work->ray[i].half;
        if (!kept[i])
            continue;
        for (k = 0; k <= work->passed && links < ARM_NODES; k++)
            if (k == work->passed || work->owner[k] == i) {
                const int next = k < work->passed ? 2 * added[k] + 1 : work->ray[i].goal;
                joining->level[links] = (arm_link){last, next, links};
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
            left += f->traces[half[i]] < ARM_TRACES;
        if (!left || f->lost)
            break;
        arm_trace(f, tracing, joining, half, count);
    }
}
