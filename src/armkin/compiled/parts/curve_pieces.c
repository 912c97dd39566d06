/* Pieces of curves along which the redundant joint is monotone: legal ones, and those without a legal posture. */

/* A change as a node behind its sample. */
static void arm_change_node(const arm_curves *f, const arm_pieces *w, int change, const arm_sample *sample, arm_sample *node)
{
    const arm_change *one = &w->change[change];
    arm_many q[ARM_JOINTS];
    int j;
    *node = *sample;
    for (j = 0; j < ARM_JOINTS; j++)
        q[j] = arm_all(one->q[j]);
    node->share = one->share;
    node->value = one->q[ARM_REDUNDANT];
    node->change = change;
    node->fits = arm_copies(f->near, q)[0] != 0;
    node->cost = arm_motion(f->near, q)[0];
}

/* The nodes of one curve: samples with the changes between them; how many. */
static int arm_nodes_of_curve(const arm_curves *f, arm_pieces *w, int curve)
{
    int count = 0, k, kind;
    for (k = ARM_PARTS * w->first[curve]; k < ARM_PARTS * w->first[curve + 1]; k++) {
        const int *at = w->change_at[k];
        arm_sample *last = &w->node[count++];
        int first;
        *last = w->sample[k];
        if (at[0] < 0 && at[1] < 0)
            continue;
        first = at[0] >= 0 && at[1] >= 0 && w->change[at[1]].share < w->change[at[0]].share;
        for (kind = 0; kind < 2; kind++) {
            const int change = at[kind ^ first];
            if (change < 0)
                continue;
            arm_change_node(f, w, change, last, &w->node[count]);
            last = &w->node[count++];
            if (w->change[change].turns)
                last->up = !last->up;
            else
                last->behind = last->behind == ARM_LEGAL ? ARM_BEYOND : ARM_LEGAL;
        }
    }
    return count;
}

/* The posture of a node at its legal copy nearest to near. */
static void arm_posture_of_node(const arm_curves *f, const arm_pieces *w, const arm_sample *node, double *out)
{
    const arm_way *way = &w->way[node->point];
    arm_ways ways;
    arm_many q[ARM_JOINTS];
    int j, t;
    for (t = 0; t < ARM_MANY; t++)
        arm_put_way(way, &ways, t);
    arm_on_ways(&ways, arm_all(node->share), q);
    for (j = 0; node->change >= 0 && j < ARM_JOINTS; j++)
        q[j] = arm_all(w->change[node->change].q[j]);
    arm_copies(f->near, q);
    arm_get(q, out, 0);
}

/* Node k of a curve, counted round its end, and its parameter. */
ARM_INLINE double arm_parameter(const arm_pieces *w, int curve, int count, int k)
{
    const arm_sample *node = &w->node[k < count ? k : k - count];
    return node->point + node->share + (k < count ? 0 : w->first[curve + 1] - w->first[curve]);
}

/* A run of nodes of a curve as a piece. */
static void arm_add_piece(arm_curves *f, arm_pieces *w, int curve, int count, int first, int length, int legal)
{
    arm_piece *piece = legal ? &w->piece[w->pieces] : &w->empty[w->empties];
    double least = ARM_INFINITY, value = w->node[first].value, end = value, last = value;
    int best = 0, k, i;
    if (w->pieces + w->empties == ARM_PIECES) {
        f->lost = 1;
        return;
    }
    *(legal ? &w->pieces : &w->empties) += 1;
    for (k = 0, i = first; k <= length; k++) {
        const arm_sample *node = &w->node[i];
        if (node->cost < least && (node->fits || !legal)) {
            least = node->cost;
            best = k;
        }
        end += arm_wrap(node->value - last);
        last = node->value;
        i = i + 1 == count ? 0 : i + 1;
    }
    piece->curve = curve;
    piece->legal = legal;
    piece->a = value < end ? value : end;
    piece->b = length == count ? piece->a + ARM_TURN : value < end ? end : value;
    piece->low = arm_parameter(w, curve, count, first + (best ? best - 1 : 0));
    piece->at = arm_parameter(w, curve, count, first + best);
    piece->high = arm_parameter(w, curve, count, first + (best < length ? best + 1 : length));
    arm_posture_of_node(f, w, &w->node[(first + best) % count], piece->start);
}

/* Whether a run of one kind goes on behind a node: legal ones, or the curve. */
ARM_INLINE int arm_goes_on(const arm_sample *node, int legal)
{
    return node->behind >= (legal ? ARM_LEGAL : ARM_BEYOND);
}

/* Runs of a curve's nodes along which the joint does not turn back: legal ones, or those that hold no legal node. */
static void arm_add_runs(arm_curves *f, arm_pieces *w, int curve, int count, int legal)
{
    int k, whole = 1;
    for (k = 0; k < count && !legal && w->node[k].behind != ARM_BEYOND; k++)
        ;
    if (k == count)
        return;
    for (k = 0; k < count && whole; k++)
        whole = arm_goes_on(&w->node[k], legal) && w->node[k].up == w->node[0].up;
    for (k = 0; k < count && !f->lost; k++) {
        const arm_sample *node = &w->node[k], *before = &w->node[k ? k - 1 : count - 1];
        int length = 0, holds = 0, i = k;
        if (!arm_goes_on(node, legal) || (!(whole && !k) && node->up == before->up && arm_goes_on(before, legal)))
            continue;
        do {
            before = &w->node[i];
            holds |= before->behind == ARM_LEGAL;
            length++;
            i = i + 1 == count ? 0 : i + 1;
            node = &w->node[i];
        } while (length < count && arm_goes_on(node, legal) && node->up == before->up);
        if (legal || !holds)
            arm_add_piece(f, w, curve, count, k, length, legal);
        if (i > k)
            k = i - 1; /* a run begins where this one ends, at the earliest */
        else
            break;
    }
}
