/* Keep-outs: the arm's capsules, what stands around it, and how far apart they are. */
enum {
    ARM_SEGMENTS = @segments@,
    ARM_MOVING = @moving_count@,       /* segments that are held against obstacles */
    ARM_OBSTACLES = @obstacle_count@,
    ARM_CROSSINGS = @crossing_count@,  /* segments of two bodies that are held against each other */
    ARM_SOLID = @solid@                /* bodies that are held against obstacles */
};
static const arm_real arm_thick[ARM_SEGMENTS] = {@thick@};
static const int arm_moving[] = {@moving@}; /* a segment, and its body's place among those */
static const int arm_kind[] = {@kinds@};
static const arm_real arm_obstacle[][15] = {
    @obstacles@};
static const int arm_crossing[][3] = {@crossings@}; /* a segment, another, and their pair */

/* Squared distance of two segments: both feet of the common normal, or the nearest end. */
static arm_real arm_between(const arm_real *a, const arm_real *b, const arm_real *c, const arm_real *d)
{
    arm_real u[3], v[3], w[3], uu = 0, vv = 0, uv = 0, uw = 0, vw = 0, spread, s[5], t[5], least;
    int k, i, count = 4;
    for (k = 0; k < 3; k++) {
        u[k] = b[k] - a[k];
        v[k] = d[k] - c[k];
        w[k] = a[k] - c[k];
        uu += u[k] * u[k];
        vv += v[k] * v[k];
        uv += u[k] * v[k];
        uw += u[k] * w[k];
        vw += v[k] * w[k];
    }
    s[0] = 0;
    t[0] = vv > 0 ? vw / vv : 0;
    s[1] = 1;
    t[1] = vv > 0 ? (vw + uv) / vv : 0;
    t[2] = 0;
    s[2] = uu > 0 ? -uw / uu : 0;
    t[3] = 1;
    s[3] = uu > 0 ? (uv - uw) / uu : 0;
    spread = uu * vv - uv * uv;
    if (spread > 0) {
        s[4] = (uv * vw - vv * uw) / spread;
        t[4] = (uu * vw - uv * uw) / spread;
        if (s[4] > 0 && s[4] < 1 && t[4] > 0 && t[4] < 1)
            count = 5;
    }
    least = ARM_INFINITY;
    for (i = 0; i < count; i++) {
        arm_real sum = 0;
        s[i] = s[i] < 0 ? 0 : s[i] > 1 ? 1 : s[i];
        t[i] = t[i] < 0 ? 0 : t[i] > 1 ? 1 : t[i];
        for (k = 0; k < 3; k++) {
            const arm_real off = w[k] + s[i] * u[k] - t[i] * v[k];
            sum += off * off;
        }
        least = sum < least ? sum : least;
    }
    return least;
}

/* Half the derivative of the squared distance to a box along p + t w, and that distance. */
static arm_real arm_slope_of_box(const arm_real *p, const arm_real *w, const arm_real *half, arm_real t, arm_real *squared)
{
    arm_real slope = 0;
    int k;
    *squared = 0;
    for (k = 0; k < 3; k++) {
        const arm_real x = p[k] + t * w[k], beyond = x > half[k] ? x - half[k] : x < -half[k] ? x + half[k] : 0;
        slope += beyond * w[k];
        *squared += beyond * beyond;
    }
    return slope;
}

/* Least signed distance of a segment to a box: centre, axes as rows, half edges. */
static arm_real arm_to_box(const arm_real *a, const arm_real *b, const arm_real *box)
{
    const arm_real *half = box + 12;
    arm_real p[3], w[3], at[6], by[6], low = 0, high = 1, slope_low, slope_high, squared, t, deepest;
    int i, j, k;
    for (k = 0; k < 3; k++) {
        p[k] = w[k] = 0;
        for (j = 0; j < 3; j++) {
            p[k] += box[3 + 3 * k + j] * (a[j] - box[j]);
            w[k] += box[3 + 3 * k + j] * (b[j] - a[j]);
        }
    }
    slope_low = arm_slope_of_box(p, w, half, 0, &squared);
    slope_high = arm_slope_of_box(p, w, half, 1, &squared);
    if (slope_low >= 0) {
        t = 0;
    } else if (slope_high <= 0) {
        t = 1;
    } else {
        for (k = 0; k < 3; k++)
            for (i = -1; i <= 1; i += 2) {
                arm_real slope, ignored;
                if (w[k] == 0)
                    continue;
                t = ((arm_real)i * half[k] - p[k]) / w[k];
                if (!(t > low && t < high))
                    continue;
                slope = arm_slope_of_box(p, w, half, t, &ignored);
                if (slope <= 0) {
                    low = t;
                    slope_low = slope;
                }
                if (slope >= 0) {
                    high = t;
                    slope_high = slope;
                }
            }
        t = slope_high > slope_low ? low - slope_low * (high - low) / (slope_high - slope_low) : low;
    }
    arm_slope_of_box(p, w, half, t, &squared);
    if (squared > 0)
        return ARM_SQRT(squared);
    for (k = 0; k < 3; k++) { /* inside: the greatest of six lines is least at an end, or where two of them meet */
        at[k] = p[k] - half[k];
        by[k] = w[k];
        at[3 + k] = -p[k] - half[k];
        by[3 + k] = -w[k];
    }
    deepest = 0;
    for (i = 0; i < 6; i++)
        for (j = i; j < 6; j++) {
            arm_real worst = -ARM_INFINITY;
            if (i == j)
                t = i < 2 ? (arm_real)i : 0;
            else if (by[i] != by[j])
                t = (at[j] - at[i]) / (by[i] - by[j]);
            else
                continue;
            t = t < 0 ? 0 : t > 1 ? 1 : t;
            for (k = 0; k < 6; k++)
                worst = at[k] + t * by[k] > worst ? at[k] + t * by[k] : worst;
            deepest = worst < deepest ? worst : deepest;
        }
    return deepest;
}

/* How far a segment is from an obstacle at most so that it matters: less than `least`. */
static int arm_is_near(const arm_real *a, const arm_real *b, const arm_real *c, arm_real radius, arm_real least)
{
    arm_real off = 0, half = 0;
    int k;
    for (k = 0; k < 3; k++) {
        const arm_real middle = (a[k] + b[k]) / 2 - c[k], way = (b[k] - a[k]) / 2;
        off += middle * middle;
        half += way * way;
    }
    least += radius + ARM_SQRT(half);
    return least > 0 && off < least * least;
}

/* Least clearance of ends (segments x 2 x 3), and its pair. */
static arm_real arm_least(const arm_real *ends, int *pair)
{
    arm_real least = ARM_INFINITY;
    int i, j, k;
    *pair = -1;
    for (k = 0; k < ARM_OBSTACLES; k++) {
        const arm_real *shape = arm_obstacle[k];
        for (i = 0; i < ARM_MOVING; i++) {
            const int segment = arm_moving[2 * i];
            const arm_real *a = ends + 6 * segment, *b = a + 3;
            arm_real apart, far;
            if (arm_kind[k] == 0) {
                apart = (a[2] < b[2] ? a[2] : b[2]) - shape[0];
            } else if (arm_kind[k] == 1) {
                far = ARM_SQRT(shape[12] * shape[12] + shape[13] * shape[13] + shape[14] * shape[14]);
                if (!arm_is_near(a, b, shape, far + arm_thick[segment], least + @clearance@))
                    continue;
                apart = arm_to_box(a, b, shape);
            } else {
                apart = ARM_SQRT(arm_between(a, b, shape, shape + 3)) - shape[6];
            }
            apart -= arm_thick[segment] + @clearance@;
            if (apart < least) {
                least = apart;
                *pair = k * ARM_SOLID + arm_moving[2 * i + 1];
            }
        }
    }
    for (i = 0; i < ARM_CROSSINGS; i++) {
        const int one = arm_crossing[i][0], other = arm_crossing[i][1];
        const arm_real *a = ends + 6 * one, *c = ends + 6 * other;
        const arm_real thick = arm_thick[one] + arm_thick[other] + @clearance@, most = least + thick;
        arm_real apart;
        if (least < ARM_INFINITY) { /* too far to matter: by the middles and half lengths */
            arm_real middle[3], half = 0;
            for (j = 0; j < 3; j++) {
                const arm_real way = (c[3 + j] - c[j]) / 2;
                middle[j] = (c[j] + c[3 + j]) / 2;
                half += way * way;
            }
            if (!arm_is_near(a, a + 3, middle, ARM_SQRT(half), most))
                continue;
        }
        apart = ARM_SQRT(arm_between(a, a + 3, c, c + 3)) - thick;
        if (apart < least) {
            least = apart;
            *pair = arm_crossing[i][2];
        }
    }
    return least;
}
