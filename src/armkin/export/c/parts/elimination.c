/* A joint value less another, turns the short way round. */
static double arm_less(double a, double b, int slides)
{
    return slides ? a - b : a - b - ARM_TURN * rint((a - b) / ARM_TURN);
}

/* The largest difference of two postures' joint values, modulo whole turns. */
static double arm_apart(const double *a, const double *b)
{
    double most = 0;
    int k;
    for (k = 0; k < 6; k++) {
        const double step = fabs(arm_less(a[k], b[k], arm_loop_slides[k]));
        most = step > most ? step : most;
    }
    return most;
}

/* Whether a candidate's vector says that it stands for nothing where it is far from the pose: the vector is no product, and its
   root is simple, or all solutions of it are known. */
static int arm_may_be_empty(const arm_seed *seed, const double *re, const double *im, int size)
{
    const int i = seed->root;
    int j;
    if (!(seed->defect > ARM_NO_PRODUCT))
        return 0;
    for (j = 0; j < size && i >= 0; j++) {
        const double a = 1 + re[i] * re[i] + im[i] * im[i], b = 1 + re[j] * re[j] + im[j] * im[j];
        const double x = re[i] - re[j], y = im[i] - im[j];
        if (j != i && !(4 * (x * x + y * y) > ARM_LONE_DISTANCE * ARM_LONE_DISTANCE * a * b))
            return 0;
    }
    return 1;
}

/* What a pass makes of its candidates and of what steps brought them to: its answers (`found`, from `count` on), and whether
   it leaves the pose open; *touching: two roots just touch, or just miss each other. */
static int arm_judge(const arm_pencil *pencil, int pass, const arm_seed *seed, const arm_answer *done, int seeds,
    arm_answer *found, int *count, int *touching)
{
    const double shake = arm_shakes[pass];
    const int careful = pass > 0, joint = pencil->order[2 + pencil->hidden], begin = *count;
    const double pair = ARM_PAIRED_PART + 10 * sqrt(shake); /* tilt below which a complex root may be one of two real ones */
    double weakest = 0, hidden[ARM_MOST];
    unsigned char own[ARM_MOST], stands[ARM_MOST], blurred[ARM_MOST], real[ARM_MOST];
    int i, j, k, open = 0;
    for (i = 0; i < seeds && *count < ARM_ANSWERS; i++) {
        const double tilt = seed[i].tilt;
        arm_answer *one = &found[*count];
        int good;
        *one = done[i];
        hidden[*count - begin] = seed[i].q[joint];
        good = one->residual < (careful ? ARM_GRAZING : ARM_ELIMINATED);
        if (!good && (tilt < ARM_UPRIGHT || (careful ? one->residual < ARM_CLOSE_RESIDUAL
                    && tilt < (pair > ARM_STRAY_DISTANCE ? pair : ARM_STRAY_DISTANCE) : one->residual < ARM_STRAY_DISTANCE)))
            open = 1; /* a complex pair that steps brought near the pose may be a real one, seen through rounding */
        if (good && tilt > 0 && tilt < pair)
            open = 1; /* a move of the pose may turn two close real roots into such a pair */
        if ((good && tilt > 0 && tilt < ARM_UPRIGHT) || (one->residual > ARM_ELIMINATED && one->residual < 3e-6))
            *touching = 1;
        if (!good)
            continue;
        weakest = one->weakness > weakest ? one->weakness : weakest;
        own[*count - begin] = fabs(arm_less(one->q[joint], hidden[*count - begin], arm_loop_slides[joint]))
            < ARM_OWN_ROOT;
        stands[*count - begin] = tilt < pair; /* of others damped steps bring many to an answer that has its own root */
        blurred[*count - begin] = one->guess > ARM_BLURRED_ROOT + 10 * shake;
        real[*count - begin] = !(tilt > 0);
        arm_sortable(one);
        ++*count;
    }
    /* A real root far from the answer it led to may have stood for another one. It has not if it has the answer's value of
       the hidden joint: around a value there are no more solutions than roots, and no two roots may have led to one answer.
       Near singularities roots are too far off to say so. */
    for (j = begin; j < *count; j++) {
        own[j - begin] &= !(shake > 0) && weakest < ARM_REGULAR;
        if (real[j - begin] && found[j].guess > ARM_STRAY_DISTANCE + 30 * shake && !own[j - begin])
            open = 1;
    }
    /* Two roots that share the hidden joint: good if both were near an answer at once, and, of real ones, if these are not
       the same. */
    for (j = begin; j < *count; j++)
        for (k = begin; k < j; k++) {
            const int one = j - begin, other = k - begin;
            if (stands[one] && stands[other] && (blurred[one] || blurred[other]) && !(own[one] && own[other])
                && fabs(hidden[one] - hidden[other]) < ARM_SAME_ROOT)
                open = 1;
            if (real[one] && real[other] && fabs(found[j].key - found[k].key) < ARM_SAME_KEY
                && arm_apart(found[j].q, found[k].q) < ARM_EXAMINED_DISTANCE)
                open = 1;
        }
    return open;
}

/* A pencil at a pose: the pose link, what is known of the end joints, the equations, and their roots; the largest entry of
   the matrix whose eigenvalues these are, and whether that leaves the pose open. */
typedef struct {
    double Y[12], E[ARM_PRODUCTS * (ARM_PRODUCTS + ARM_MOST)], re[ARM_MOST], im[ARM_MOST], most;
    arm_ends ends;
    int open;
} arm_solved;

/* The roots of a pencil at a pose; 0 if it is singular. */
static int arm_solve(const arm_pencil *pencil, const double *goal, int pass, arm_solved *out)
{
    const int size = pencil->size, lead = pencil->wide ? 16 : 12, c = lead + size, length = ARM_PRODUCTS + ARM_MOST;
    const int row = size <= 16 ? 16 : ARM_MOST; /* numbers in a row of C */
    double moved[12], G[ARM_PRODUCTS * (ARM_PRODUCTS + ARM_MOST)], C[ARM_MOST * ARM_MOST], most = 0;
    int i, j;
    arm_times(arm_shaking + 12 * pass, goal, moved);
    arm_invert(moved, out->Y); /* the pose link closes the loop */
    if (pencil->backward)
        for (i = 0; i < 12; i++)
            out->Y[i] = moved[i];
    if (!arm_eliminate(pencil, out->Y, &out->ends))
        return 0;
    arm_equations(pencil, out->Y, out->ends.N, out->E);
    for (i = 0; i < lead; i++)
        for (j = 0; j < length; j++)
            G[i * length + j] = j < c ? out->E[i * c + j] : 0;
    if (!(pencil->wide ? arm_reduce(G, 16, 16, ARM_PRODUCTS + ARM_MOST) : arm_reduce(G, 12, 12, ARM_PRODUCTS + ARM_MOST)))
        return 0;
    for (i = 0; i < size * row; i++)
        C[i] = 0;
    for (i = 0; i < lead; i++)
        for (j = 0; j < size; j++) {
            C[i * row + j] = -G[i * length + lead + j];
            most = fabs(G[i * length + lead + j]) > most ? fabs(G[i * length + lead + j]) : most;
        }
    for (i = 0; i < size - lead; i++)
        C[(lead + i) * row + 2 * pencil->r + i] = 1;
    out->most = most;
    out->open = !(most <= 1e6);
    for (i = 0; i < lead; i++) /* of a singular pencil the rest may vanish on both sides: its pivots tell */
        out->open |= !(fabs(G[i * length + i]) > 1e-11);
    if (!(most < 1e300))
        return 0;
    return row == 16 ? arm_roots_of(C, size, 16, out->re, out->im) : arm_roots_of(C, size, ARM_MOST, out->re, out->im);
}

/* One pass over a pose: its answers (`found`, from `count` on), and whether the pass leaves it open; *touching: see
   `arm_judge`. */
static int arm_attempt(const double *goal, int kind, int pass, arm_answer *found, int *count, int *touching)
{
    const arm_pencil *pencil = &arm_pencils[arm_plan[kind * ARM_PASSES + pass]];
    const int careful = pass > 0;
    arm_solved of;
    arm_seed seed[ARM_MOST];
    arm_answer done[ARM_MOST];
    int i, k, seeds, kept = 0;
    if (!arm_solve(pencil, goal, pass, &of))
        return 1;
    seeds = arm_seeds(pencil, of.E, of.Y, &of.ends, of.re, of.im, careful ? ARM_LATER_TILT : ARM_MAIN_TILT,
        (careful || pencil->wide) && !(pencil->slides[2] || pencil->slides[3] || pencil->slides[4]), seed);
    for (i = 0; i < seeds; i++) {
        double frame[12], joints[72], error[6];
        if (!(arm_shakes[pass] > 0) && of.most < ARM_STEADY && arm_may_be_empty(seed + i, of.re, of.im, pencil->size)
            && arm_missing(seed[i].q, goal, frame, joints, error) > ARM_STRAY_DISTANCE)
            continue;
        seed[kept] = seed[i];
        for (k = 0; k < 6; k++)
            done[kept].q[k] = seed[i].q[k];
        arm_refine(goal, careful ? 12 : 4, careful, &done[kept++]);
    }
    return of.open | arm_judge(pencil, pass, seed, done, kept, found, count, touching);
}

/* Sort answers by their key and keep one of each set of equal ones; *merged: some were further apart than rounding. */
static int arm_merge(const double *goal, arm_answer *found, int count, int *merged)
{
    unsigned char gone[ARM_ANSWERS];
    int i, j, k, kept = 0;
    for (i = 1; i < count; i++) {
        const arm_answer one = found[i];
        for (j = i; j > 0 && found[j - 1].key > one.key; j--)
            found[j] = found[j - 1];
        found[j] = one;
    }
    for (i = 0; i < count; i++)
        gone[i] = 0;
    for (i = 0; i < count; i++)
        for (j = i + 1; j < count; j++) {
            double step[6], half[6], frame[12], joints[72], error[6], distance = 0, blur, radius, other;
            if (gone[i] || gone[j] || found[j].key - found[i].key > 0.1)
                continue;
            for (k = 0; k < 6; k++) {
                step[k] = arm_less(found[j].q[k], found[i].q[k], arm_loop_slides[k]);
                half[k] = found[i].q[k] + step[k] / 2;
                distance = fabs(step[k]) > distance ? fabs(step[k]) : distance;
            }
            if (!(distance < ARM_EXAMINED_DISTANCE))
                continue;
            blur = 4 * (found[i].residual > found[j].residual ? found[i].residual : found[j].residual);
            radius = 3 * found[i].weakness * found[i].residual;
            other = 3 * found[j].weakness * found[j].residual;
            radius = other > radius ? other : radius;
            if (distance < (radius > 1e-6 ? radius : 1e-6)
                || arm_missing(half, goal, frame, joints, error) < (blur > 1e-13 ? blur : 1e-13)) {
                gone[found[j].residual > found[i].residual ? j : i] = 1;
                if (distance > 1e-8)
                    *merged = 1;
            }
        }
    for (i = 0; i < count; i++)
        if (!gone[i])
            found[kept++] = found[i];
    return kept;
}

/* What a pose of the loop's chain makes of axes 6 and 1: all but parallel 1, meeting 2, else 0. */
static int arm_kind(const double *frame)
{
    const double sine = frame[2] * frame[2] + frame[6] * frame[6], apart = frame[3] * frame[6] - frame[7] * frame[2];
    if (arm_loop_slides[0] || arm_loop_slides[5])
        return 0;
    return sine < ARM_BESIDE * ARM_BESIDE ? 1 : apart * apart < ARM_BESIDE * ARM_BESIDE * sine ? 2 : 0;
}

/* A pose, in the loop's chain, and what passes have found of it. */
typedef struct {
    double goal[12];
    arm_answer found[ARM_ANSWERS];
    int kind, number, open, edge;
} arm_state;
