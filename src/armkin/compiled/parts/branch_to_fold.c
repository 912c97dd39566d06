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
    arm_residual(T, goal, q, ARM_POINTS, r);
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
   `_polynomials`. */
ARM_SELDOM static int arm_polynomials(const double *q, const double *goal, const double *u, const double *w, arm_branch *out,
    double *g)
{
    static const double unit[ARM_JOINTS] = {@unit@}, node[ARM_NODES] = {@nodes@};
    static const double fit[ARM_NODES][ARM_NODES] = {@fit@}, last[2][ARM_NODES] = {@last@};
    double away[ARM_NODES][ARM_JOINTS + 1], at[ARM_JOINTS * ARM_POINTS], T[16 * ARM_POINTS], slope[6 * ARM_JOINTS * ARM_POINTS];
    double regular[ARM_NODES], steepest = 0.0;
    int i, j, k, round, there[ARM_NODES] = {0}, open = ARM_NODES;
    for (i = 0; i < ARM_NODES; i++)
        for (j = 0; j < ARM_JOINTS; j++) {
            const double t = node[i] * out->span;
            away[i][j] = t * out->v[j] + 0.5 * t * t * w[j];
        }
    for (round = 0; open && round < @iterations@; round++) {
        for (i = 0; i < ARM_NODES; i++)
            for (j = 0; j < ARM_JOINTS; j++)
                at[j * ARM_POINTS + i] = q[j * ARM_LANES] + away[i][j] * unit[j];
        arm_pose(at, T, ARM_NODES);
        arm_slope(at, slope, ARM_NODES);
        for (i = 0; i < ARM_NODES; i++) {
            const double t = node[i] * out->span;
            if (there[i])
                continue;
            there[i] = arm_to_curve(T + i, slope + i, goal, at + i, u, out->v, t, away[i], &away[i][ARM_JOINTS], regular + i)
                < @arrived@;
            open -= there[i];
            for (j = 0; j < ARM_JOINTS; j++)
                if (!(fabs(away[i][j]) < 3.0 * fabs(t)))
                    return 0;
        }
    }
    for (j = 0; j <= ARM_JOINTS; j++) {
        const double most = j < ARM_JOINTS ? @smooth@ * out->span : 0.01 * @solution@;
        for (k = 0; k < 2; k++) {
            double c = 0.0;
            for (i = 0; i < ARM_NODES; i++)
                c += last[k][i] * away[i][j];
            if (open || !(fabs(c) < most)) /* the polynomials are exact on the span if their last coefficients are small */
                return 0;
        }
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
    for (out->alone = 1, i = 0; i + 1 < ARM_NODES; i++) /* no other curve crosses: the Jacobian is singular at no place */
        out->alone &= regular[i] + regular[i + 1] > 2.0 * steepest * (node[i] - node[i + 1]);
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

/* What the polynomials tell: 1 if the component ends both ways within the span, 0 if not, -1 if it is a self-motion that
   does not; `_decide`. */
ARM_SELDOM static int arm_decided(const double *g, arm_branch *out)
{
    static const double point[@points_count@] = {@points@};
    double ends[2] = {1.0, 1.0}, rise[@fine@], steepest = 0.0, extent[ARM_JOINTS], widest = 0.0;
    int i, j, k, way, over[2] = {0, 0};
    for (way = 0; way < 2; way++)
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
        double least = INFINITY, most = -INFINITY;
        for (i = 0; i < @fine@; i++) {
            const double x = arm_value(&out->x[0][j], ARM_JOINTS, -ends[0] + i * (ends[0] + ends[1]) / (@fine@ - 1), 0);
            least = fmin(least, x), most = fmax(most, x);
        }
        extent[j] = most - least, widest = fmax(widest, extent[j]);
    }
    for (j = 0; j < ARM_JOINTS; j++)
        out->moves[j] = widest >= @wide@ && extent[j] > @moved@ * widest;
    out->motion = widest >= @wide@;
    for (i = 0; i < @fine@; i++) {
        arm_value(g, 1, -ends[0] + i * (ends[0] + ends[1]) / (@fine@ - 1), rise + i);
        steepest = fabs(rise[i]) > fabs(steepest) ? rise[i] : steepest;
    }
    for (out->turns = 0, i = 0; i < @fine@; i++)
        out->turns |= (steepest < 0.0 ? -rise[i] : rise[i]) / out->span <= @solution@;
    out->low = -ends[0] * out->span, out->high = ends[1] * out->span;
    out->turns &= !out->motion;
    return over[0] && over[1] ? 1 : -out->motion;
}

/* A branch that the curvature does not tell: followed first twice as far as that lets it go, then as `local_structure` does. */
ARM_SELDOM static int arm_followed(const double *q, const double *goal, const double *u, arm_branch *out)
{
    static const double straight[ARM_JOINTS] = {0.0};
    const double whole = out->span, ends = 2.0 * fmax(-out->low, out->high);
    int tries, longer = 0, near = ends > 0.0 && 2.0 * ends < whole && out->second > @high@;
    out->span = near ? ends : whole;
    for (tries = 0; tries < @shrinks@ + 2 + longer; tries++) {
        double g[ARM_NODES];
        const int on = arm_polynomials(q, goal, u, near ? out->w : straight, out, g);
        const int told = on ? arm_decided(g, out) : 0;
        if (told < 0 && longer < @longer@) { /* Python goes on with further curves */
            near = 0, longer++, out->span *= 2.0;
            continue;
        }
        if (told || longer)
            return told > 0;
        if (!(out->second > @high@) || !(near || !on))
            return 0;
        out->span = near ? whole : out->span / @shrink@;
        near = 0;
    }
    return 0;
}
