/* The inverse of a matrix bordered by one row and column, by Gauss and Jordan with pivots; 0 if there is none. */
ARM_SELDOM static int arm_inverse(double M[ARM_JOINTS + 1][2 * (ARM_JOINTS + 1)])
{
    const int size = ARM_JOINTS + 1;
    int i, j, k;
    for (k = 0; k < size; k++) {
        int pivot = k;
        for (i = k + 1; i < size; i++)
            pivot = fabs(M[i][k]) > fabs(M[pivot][k]) ? i : pivot;
        if (!(fabs(M[pivot][k]) > 0.0))
            return 0;
        for (j = 0; j < 2 * size; j++) {
            const double swap = M[k][j];
            M[k][j] = M[pivot][j], M[pivot][j] = swap;
        }
        for (i = 0; i < size; i++) {
            const double factor = M[i][k] / M[k][k];
            for (j = k; i != k && j < 2 * size; j++)
                M[i][j] -= factor * M[k][j];
        }
        for (j = 2 * size - 1; j >= k; j--)
            M[k][j] /= M[k][k];
    }
    return 1;
}

/* A Newton step of a node at t towards the curve, on the Jacobian bordered by u and v; g: the residual that is left along u,
   regular: how far that Jacobian is from singular, at least. Returns how long the step is, infinite where there is none. */
ARM_SELDOM static double arm_to_curve(const double *T, const double *slope, const double *goal, const double *q, const double *u,
    const double *v, double t, double *away, double *g, double *regular)
{
    const int n = ARM_JOINTS, size = ARM_JOINTS + 1;
    double M[ARM_JOINTS + 1][2 * (ARM_JOINTS + 1)] = {{0.0}}, r[ARM_JOINTS + 1];
    double longest = 0.0, across = 0.0, left = 0.0, norm = 0.0;
    int j, k;
    arm_residual(T, goal, q, r);
    for (r[n] = t, k = 0; k < n; k++) {
        r[n] -= v[k] * away[k];
        M[k][n] = u[k], M[n][k] = v[k];
        for (j = 0; j < n; j++)
            M[k][j] = arm_entry(slope, k, j);
    }
    for (k = 0; k < size; k++)
        M[k][size + k] = 1.0;
    if (!arm_inverse(M))
        return INFINITY;
    for (j = 0; j < n; j++) {
        double step = 0.0;
        for (k = 0; k < size; k++)
            step += M[j][size + k] * r[k];
        away[j] += step;
        longest = fmax(longest, fabs(step));
        across += M[n][size + j] * M[n][size + j];
    }
    for (k = 0; k < size; k++) {
        left += M[n][size + k] * r[k];
        for (j = 0; j < size; j++)
            norm += M[j][size + k] * M[j][size + k];
    }
    *g = left / sqrt(across), *regular = 1.0 / sqrt(norm);
    return longest;
}

/* Joints' ways x and the residual g along u, polynomials in t / span, of a branch whose curve stays at hand as far as span:
   `_fit_polynomials`. */
ARM_SELDOM static int arm_polynomials(const double *q, const double *goal, const double *u, const double *w, arm_branch *out,
    double *g)
{
    static const double unit[ARM_JOINTS] = {@unit@}, nodes[2][ARM_NODES] = {@nodes@}, gains[2] = {@gains@};
    static const double fits[2][ARM_NODES][ARM_NODES] = {@fit@}, last[2][ARM_NODES] = {@last@};
    double away[ARM_NODES][ARM_JOINTS + 1], at[ARM_JOINTS * ARM_POINTS], T[16 * ARM_POINTS], slope[6 * ARM_JOINTS * ARM_POINTS];
    double regular[ARM_NODES], before[ARM_NODES] = {0.0}, step, steepest = 0.0, off = 0.0;
    const double *node = nodes[out->only_ahead], (*fit)[ARM_NODES] = fits[out->only_ahead];
    int i, j, k, round, there[ARM_NODES] = {0}, open = ARM_NODES;
    for (i = 0; i < ARM_NODES; i++)
        for (j = 0; j < ARM_JOINTS; j++) {
            const double t = node[i] * out->span;
            away[i][j] = t * out->v[j] + 0.5 * t * t * w[j];
        }
    for (round = 0; open && round < @iterations@; round++) {
        for (i = 0; i < ARM_NODES; i++)
            for (j = 0; j < ARM_JOINTS; j++)
                at[j * ARM_POINTS + i] = q[j * ARM_POINTS] + away[i][j] * unit[j];
        arm_pose(at, T, ARM_NODES);
        arm_slope(at, slope, ARM_NODES);
        for (i = 0; i < ARM_NODES; i++) {
            const double t = node[i] * out->span;
            if (there[i])
                continue;
            step = arm_to_curve(T + i, slope + i, goal, at + i, u, out->v, t, away[i], &away[i][ARM_JOINTS], regular + i);
            /* the next step is about as many times smaller than this as this one's square than the last one's */
            there[i] = step < @arrived@ || step * step * step < @error@ * before[i] * before[i];
            if (!(step < (round ? 0.5 * before[i] : out->span))) /* it leads to no curve, or to another one */
                return 0;
            open -= there[i], before[i] = step;
            for (j = 0; j < ARM_JOINTS; j++)
                if (!(fabs(away[i][j]) < 3.0 * fabs(t)))
                    return 0;
        }
    }
    if (open)
        return 0;
    for (j = 0; j <= ARM_JOINTS; j++) {
        const double most = j < ARM_JOINTS ? @smooth@ * out->span : 0.01 * @solution@;
        for (k = 0; k < 2; k++) {
            double c = 0.0;
            for (i = 0; i < ARM_NODES; i++)
                c += last[k][i] * away[i][j];
            off = fmax(off, fabs(c) / most);
        }
    }
    out->span_ratio = gains[out->only_ahead] * fmin(0.9 * pow(off, 1.0 / (2 - ARM_NODES)), @longest@) - @nearer@;
    if (!(off < 1.0)) /* the polynomials are exact on the span if their last coefficients are small */
        return 0;
    for (j = 0; j <= ARM_JOINTS; j++) {
        for (k = 0; k < ARM_NODES; k++) {
            double c = 0.0;
            for (i = 0; i < ARM_NODES; i++)
                c += fit[k][i] * away[i][j];
            *(j < ARM_JOINTS ? &out->x[k][j] : g + k) = c;
        }
        /* where another curve is near, that may be the one which Newton's method found */
        if (j < ARM_JOINTS && !(fabs(out->x[0][j]) <= 4.0 * (@smooth@ * out->span + @solution@ / out->second)))
            return 0;
    }
    for (i = 0; i + 1 < ARM_NODES; i++)
        steepest = fmax(steepest, fabs(regular[i + 1] - regular[i]) / (node[i] - node[i + 1]));
    for (out->uncrossed = 1, i = 0; i + 1 < ARM_NODES; i++) /* no other curve crosses: the Jacobian is singular at no place */
        out->uncrossed &= regular[i] + regular[i + 1] > 2.0 * steepest * (node[i] - node[i + 1]);
    return 1;
}

/* A polynomial and its slope. */
ARM_SELDOM static double arm_value(const double *g, int step, double s, double *slope)
{
    double value = 0.0, rise = 0.0;
    int k;
    for (k = ARM_NODES - 1; k >= 0; k--)
        rise = rise * s + value, value = value * s + g[k * step];
    if (slope)
        *slope = rise;
    return value;
}

/* Which joints move along a component whose ends are far enough apart, and how far the one that goes farthest does. */
ARM_SELDOM static double arm_mark_moves(arm_branch *out)
{
    double widest = 0.0;
    int j;
    for (j = 0; j < ARM_JOINTS; j++)
        widest = fmax(widest, out->most_way[j] - out->least_way[j]);
    for (j = 0; j < ARM_JOINTS; j++)
        out->moves[j] = widest >= @wide@ && out->most_way[j] - out->least_way[j] > @moved@ * widest;
    return widest;
}

/* What the polynomials tell, and whether the component ends both ways within the span: `_decide`. */
ARM_SELDOM static int arm_decided(const double *g, arm_branch *out)
{
    static const double point[@points_count@] = {@points@};
    double ends[2] = {!out->only_ahead, 1.0}, rise[@fine@], steepest = 0.0;
    int i, j, k, way, over[2] = {0, 0};
    for (way = out->only_ahead; way < 2; way++)
        for (i = 1; !over[way] && i < @points_count@; i++)
            if (fabs(arm_value(g, 1, way ? point[i] : -point[i], 0)) > @solution@) {
                double low = point[i - 1], high = point[i];
                for (over[way] = 1, k = 0; k < 20; k++) {
                    const double middle = 0.5 * (low + high);
                    *(fabs(arm_value(g, 1, way ? middle : -middle, 0)) > @solution@ ? &high : &low) = middle;
                }
                ends[way] = low;
            }
    for (j = 0; j < ARM_JOINTS; j++) {
        out->least_way[j] = INFINITY, out->most_way[j] = -INFINITY;
        for (i = 0; i < @fine@; i++) {
            const double x = arm_value(&out->x[0][j], ARM_JOINTS, -ends[0] + i * (ends[0] + ends[1]) / (@fine@ - 1), 0);
            out->least_way[j] = fmin(out->least_way[j], x), out->most_way[j] = fmax(out->most_way[j], x);
        }
    }
    out->motion = arm_mark_moves(out) >= @wide@;
    for (i = 0; i < @fine@; i++) {
        arm_value(g, 1, -ends[0] + i * (ends[0] + ends[1]) / (@fine@ - 1), rise + i);
        steepest = fabs(rise[i]) > fabs(steepest) ? rise[i] : steepest;
    }
    for (out->turns = 0, i = 0; i < @fine@; i++)
        out->turns |= (steepest < 0.0 ? -rise[i] : rise[i]) / out->span <= @solution@;
    out->low = -ends[0] * out->span, out->high = ends[1] * out->span;
    out->turns &= !out->motion;
    return over[0] && over[1];
}

/* Where a branch's curve leaves its span, that way: q, and the way there. 0 if it ends before. */
ARM_SELDOM static int arm_leaves(const arm_branch *one, const double *from, int way, double *q, double *ahead)
{
    static const double unit[ARM_JOINTS] = {@unit@};
    int j;
    for (j = 0; j < ARM_JOINTS; j++) {
        const double end = arm_value(&one->x[0][j], ARM_JOINTS, way, 0);
        q[j * ARM_POINTS] = from[j * ARM_POINTS] + end * unit[j];
        ahead[j] = end - arm_value(&one->x[0][j], ARM_JOINTS, 0.9 * way, 0);
    }
    return (way > 0 ? one->high : -one->low) >= one->span;
}

/* A further curve of branch self's component, begun at q where the one before left its span, and what it adds to out, which began
   at `at`. other: where the other side is, 0 where that has ended. 1 if the component ends on it, 2 if it closes, as the two sides
   meet, 0 if it goes on, -1 if nothing more can be told of it. */
ARM_SELDOM static int arm_link(const double *goal, const double *at, int count, int self, const double *other, double *q,
    double *ahead, double *span, arm_branch *out)
{
    static const double straight[ARM_JOINTS] = {0.0};
    double T[16 * ARM_POINTS], slope[6 * ARM_JOINTS * ARM_POINTS], g[ARM_NODES], way[ARM_JOINTS], sense = 0.0;
    double A[ARM_JOINTS][ARM_JOINTS], V[ARM_JOINTS][ARM_JOINTS], S[ARM_JOINTS];
    const int last = ARM_JOINTS - 1;
    arm_branch link;
    int b, j, met, good;
    arm_pose(q, T, 1);
    arm_slope(q, slope, 1);
    arm_singular_values(slope, A, V, S);
    link.span = *span, link.second = S[last - 1], link.only_ahead = 1;
    if (!(link.second > @high@) || !(S[last] > 0.0))
        return -1;
    for (j = 0; j < ARM_JOINTS; j++)
        sense += V[last][j] * ahead[j];
    for (j = 0; j < ARM_JOINTS; j++)
        link.v[j] = sense < 0.0 ? -V[last][j] : V[last][j];
    good = arm_polynomials(q, goal, A[last], straight, &link, g);
    *span *= good ? link.span_ratio : @shorter@;
    if (!good)
        return 0;
    arm_decided(g, &link);
    for (b = 0; b < count; b++) {
        arm_way(at + b, q, way);
        if (b == self || !arm_member(&link, way))
            continue;
        if (out->partial && !out->on[b]) /* Python may list both */
            return -1;
        out->on[b] = 1;
    }
    met = other && (arm_way(other, q, way), arm_member(&link, way));
    arm_way(at + self, q, way);
    for (j = 0; j < ARM_JOINTS; j++)
        out->least_way[j] = fmin(out->least_way[j], link.least_way[j] - way[j]),
        out->most_way[j] = fmax(out->most_way[j], link.most_way[j] - way[j]);
    out->uncrossed &= link.uncrossed, out->turns |= link.turns;
    good = arm_leaves(&link, q, 1, q, ahead);
    return met ? 2 : !good;
}

/* A component that leaves its span, followed both ways in turn until it ends, or closes; farther if it is known that it is a
   self-motion: `chains.follow`. 1 if both of its ends are known. */
ARM_SELDOM static int arm_chained(const double *goal, const double *at, int count, int self, arm_branch *out)
{
    double q[2][ARM_JOINTS * ARM_POINTS], ahead[2][ARM_JOINTS], span[2];
    int links, side, ended[2];
    for (side = 0; side < 2; side++) {
        span[side] = out->span_ratio * out->span;
        ended[side] = !arm_leaves(out, at + self, side ? -1 : 1, q[side], ahead[side]);
    }
    for (links = 1; links <= (out->motion ? @links@ : @few_links@) && !(ended[0] && ended[1]); links++) {
        for (side = 0; side < 2; side++) {
            if (!ended[side])
                ended[side] = arm_link(goal, at, count, self, ended[!side] ? 0 : q[!side], q[side], ahead[side], span + side, out);
            if (ended[side] < 0)
                return 0;
            ended[!side] |= ended[side] == 2;
        }
        if (!out->motion) {
            out->motion = arm_mark_moves(out) >= @wide@;
            out->partial = out->motion && !(ended[0] && ended[1]);
        }
    }
    if (!out->partial)
        arm_mark_moves(out);
    out->turns &= !out->motion;
    return ended[0] && ended[1];
}

/* A branch that the curvature does not tell: followed first twice as far as that lets it go, then as `local_structure` does. */
ARM_SELDOM static int arm_followed(const double *at, int count, int self, const double *goal, const double *u, arm_branch *out)
{
    static const double straight[ARM_JOINTS] = {0.0};
    const double whole = out->span, ends = 2.0 * fmax(-out->low, out->high);
    double grown = 0.0, bend;
    int k, tries, near = ends > 0.0 && 2.0 * ends < whole && out->second > @high@;
    out->span = near ? ends : whole;
    for (tries = 0; tries < @shrinks@ + 2; tries++) {
        double g[ARM_NODES];
        const int on = arm_polynomials(at + self, goal, u, near ? out->w : straight, out, g);
        if (on && arm_decided(g, out))
            return 1;
        if (!(out->second > @high@))
            return 0;
        if (on && (out->motion || !near)) {
            for (k = 0; k < ARM_NODES; k++)
                grown += fabs(g[k]);
            return (!out->motion || grown > @closed@) && arm_chained(goal, at, count, self, out);
        }
        bend = @bend@ * out->second;
        out->span = near ? whole : 2.0 * bend < out->span ? bend : out->span / @shrink@;
        near = 0;
    }
    return 0;
}
