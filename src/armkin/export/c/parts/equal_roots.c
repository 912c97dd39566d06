/* Solutions that share the hidden joint: their root is multiple, its vectors are any mixtures of theirs, and are taken apart
   as in `armkin.inverse.elimination.equal_roots`. */
#define ARM_SHARED 8 /* solutions that one root may stand for */

/* A candidate: joint values of the loop, its imaginary part as an angle, the defect of its vector; root: which one it is of,
   -1 of a multiple one all of whose solutions are known. */
typedef struct {
    double q[6], tilt, defect;
    int root;
} arm_seed;

/* Orthonormal rows, sixteen numbers apart, of what an n x n matrix takes to zero; 0 if that has not d dimensions. */
static int arm_null_space(double *a, int n, int d, double *basis)
{
    int place[16], i, j, k, f;
    double first = 0, last = 0, rest = 0;
    for (k = 0; k < n; k++)
        place[k] = k;
    for (k = 0; k <= n - d; k++) { /* complete pivots: the last round only asks what is left */
        int row = k, column = k;
        double most = 0;
        for (i = k; i < n; i++)
            for (j = k; j < n; j++)
                if (fabs(a[n * i + j]) > most) {
                    most = fabs(a[n * i + j]);
                    row = i;
                    column = j;
                }
        first = k == 0 ? most : first;
        if (k == n - d) {
            rest = most;
            break;
        }
        last = most;
        if (!(most > 1e-9 * first))
            return 0;
        for (j = 0; j < n; j++) {
            const double kept = a[n * k + j];
            a[n * k + j] = a[n * row + j];
            a[n * row + j] = kept;
        }
        for (i = 0; i < n; i++) {
            const double kept = a[n * i + k];
            a[n * i + k] = a[n * i + column];
            a[n * i + column] = kept;
        }
        i = place[k];
        place[k] = place[column];
        place[column] = i;
        for (i = k + 1; i < n; i++) {
            const double factor = a[n * i + k] / a[n * k + k];
            for (j = k; j < n; j++)
                a[n * i + j] -= factor * a[n * k + j];
        }
    }
    if (!(rest < 1e-3 * last && rest < 1e-5 * first))
        return 0;
    for (f = 0; f < d; f++) {
        double y[16], size = 0, *out = basis + 16 * f;
        int round;
        for (j = n - d; j < n; j++)
            y[j] = j == n - d + f ? 1 : 0;
        for (k = n - d - 1; k >= 0; k--) {
            double sum = 0;
            for (j = k + 1; j < n; j++)
                sum += a[n * k + j] * y[j];
            y[k] = -sum / a[n * k + k];
        }
        for (j = 0; j < n; j++)
            out[place[j]] = y[j];
        for (j = n; j < 16; j++)
            out[j] = 0;
        for (round = 0; round < 2; round++) {
            for (k = 0; k < f; k++)
                arm_subtract(out, basis + 16 * k, arm_along(out, basis + 16 * k, 0, 16), 0, 16);
            size = sqrt(arm_along(out, out, 0, 16));
            for (j = 0; j < 16; j++)
                out[j] /= size;
        }
    }
    return 1;
}

/* The transpose of X, d x d in rows of eight, of high = X low for mixtures' rows of m numbers, twelve apart, turned so that no
   joint stands where its tangent is infinite; 0 if it is not determined. */
static int arm_quotient(const double *low, const double *high, int d, int m, double *out)
{
    const double c = 0.9156396939833165, s = 0.4019999388086255; /* of 0.4137 rad */
    double below[ARM_SHARED * 12], above[ARM_SHARED * 12], system[ARM_SHARED * 16], most = 0;
    int i, j, k;
    for (i = 0; i < d; i++)
        for (k = 0; k < m; k++) {
            below[12 * i + k] = c * low[12 * i + k] - s * high[12 * i + k];
            above[12 * i + k] = s * low[12 * i + k] + c * high[12 * i + k];
        }
    for (i = 0; i < ARM_SHARED; i++)
        for (j = 0; j < 16; j++) {
            double sum = i >= d || j % 8 >= d ? (i == j ? 1 : 0) : 0;
            for (k = 0; k < m && i < d && j % 8 < d; k++)
                sum += below[12 * i + k] * (j < 8 ? below : above)[12 * (j % 8) + k];
            system[16 * i + j] = sum;
            most = i == j && i < d && sum > most ? sum : most;
        }
    if (!arm_reduce(system, ARM_SHARED, 8, 16))
        return 0;
    for (i = 0; i < d; i++)
        if (!(fabs(system[16 * i + i]) > 1e-8 * most))
            return 0;
    for (i = 0; i < d; i++)
        for (j = 0; j < d; j++)
            out[8 * i + j] = system[16 * i + 8 + j];
    return 1;
}

/* Weights, rows of sixteen, of the real products among mixtures v, d x (4 x three); how many, or -1 where not every product
   among them is known. */
static int arm_products(const double *v, int d, int three, double *weights)
{
    static const double cubic[16] = {0.25, 0, 0.75, 0, 0, 0.25, 0, 0.25, -0.25, 0, 0.25, 0, 0, -0.25, 0, 0.75};
    double low[ARM_SHARED * 12], high[ARM_SHARED * 12], along[64], second[64], M[ARM_SHARED * 16], re[16], im[16];
    int b, i, j, k, count = 0;
    for (b = 0; b < d; b++)
        for (i = 0; i < 4; i++)
            for (k = 0; k < three; k++) {
                double sum = 0;
                for (j = 0; j < 4; j++)
                    sum += cubic[4 * i + j] * v[16 * b + three * j + k];
                if (i < 3)
                    low[12 * b + three * i + k] = sum;
                if (i > 0)
                    high[12 * b + three * (i - 1) + k] = sum;
            }
    if (!arm_quotient(low, high, d, 3 * three, along))
        return -1;
    for (b = 0; b < d; b++)
        for (k = 0; k < 4; k++) {
            const double *row = v + 16 * b + three * k;
            if (three == 3) { /* (1 + cos, sin) and (sin, 1 - cos): the tangent of half the angle leads from one to the other */
                low[12 * b + k] = row[0] + row[1];
                low[12 * b + 4 + k] = high[12 * b + k] = row[2];
                high[12 * b + 4 + k] = row[0] - row[1];
            } else
                for (i = 0; i < 4; i++) {
                    double sum = 0;
                    for (j = 0; j < 4; j++)
                        sum += cubic[4 * i + j] * row[j];
                    if (i < 3)
                        low[12 * b + 4 * i + k] = sum;
                    if (i > 0)
                        high[12 * b + 4 * (i - 1) + k] = sum;
                }
        }
    if (!arm_quotient(low, high, d, three == 3 ? 8 : 12, second))
        return -1;
    for (i = 0; i < d; i++)
        for (j = 0; j < d; j++) {
            along[8 * i + j] += 0.618 * second[8 * i + j]; /* those that have the first joint alike differ by the second */
            M[16 * i + j] = along[8 * i + j];
        }
    if (!arm_roots_of(M, d, 16, re, im))
        return -1;
    for (i = 0; i < d; i++) {
        const double slant = fabs(im[i]) / (1 + re[i] * re[i] + im[i] * im[i]);
        if (slant > 0 && slant < ARM_UPRIGHT)
            return -1;
        for (j = 0; j < i; j++)
            if (!(hypot(re[i] - re[j], im[i] - im[j]) > ARM_UPRIGHT))
                return -1;
    }
    for (b = 0; b < d; b++) {
        double A[64];
        if (im[b] > 0 || im[b] < 0)
            continue;
        for (i = 0; i < 8; i++)
            for (j = 0; j < 8; j++)
                A[8 * i + j] = i < d && j < d ? along[8 * i + j] - (i == j ? re[b] : 0) : i == j ? 1 : 0;
        arm_null_vector(A, weights + 16 * count++, 8);
    }
    return count;
}

/* Candidates of a root x that d solutions share; how many are real, or -1 where they are not all known. */
static int arm_shared(const arm_pencil *pencil, const double *E, const double *Y, const arm_ends *ends, double x, int d,
    arm_seed *out)
{
    const int p = pencil->wide ? 16 : 12;
    double A[256], basis[ARM_SHARED * 16], v[ARM_SHARED * 16], weights[ARM_SHARED * 16];
    int b, i, k, count, kept = 0;
    arm_system_at(pencil, E, x, A);
    if (!arm_null_space(A, p, d, basis))
        return -1;
    for (b = 0; b < d; b++)
        arm_vector(pencil, basis + 16 * b, x, v + 16 * b);
    count = arm_products(v, d, p / 4, weights);
    for (b = 0; b < count; b++) {
        double one[16];
        for (i = 0; i < p; i++) {
            one[i] = 0;
            for (k = 0; k < d; k++)
                one[i] += weights[16 * b + k] * v[16 * k + i];
        }
        out[kept].tilt = 0;
        out[kept].root = -1;
        kept += arm_joints_from(pencil, one, Y, ends, x, out[kept].q, &out[kept].defect);
    }
    return count < 0 ? -1 : kept;
}

/* Roots that are equal, from `from` to `end` of the order; of those that solutions share, where they may be taken apart:
   d: how many these are, else 0; mean: their root. */
typedef struct {
    int from, end, d;
    double mean;
} arm_group;

/* The roots (re, im) of a pencil with a tilt below `most`, in order, by groups; part: equal ones may be taken apart. */
static int arm_groups(const arm_pencil *pencil, const double *re, const double *im, double most, int part, int *order,
    double *tilt, arm_group *out)
{
    int i, j, roots = 0, count = 0;
    double angle[ARM_MOST];
    for (i = 0; i < pencil->size; i++) {
        tilt[i] = 2 * fabs(im[i]) / (1 + re[i] * re[i] + im[i] * im[i]);
        if (!(im[i] >= 0) || !(tilt[i] < most))
            continue;
        angle[i] = 2 * atan(re[i]);
        for (j = roots++; j > 0 && angle[order[j - 1]] > angle[i]; j--)
            order[j] = order[j - 1];
        order[j] = i;
    }
    for (i = 0; i < roots; i = j) {
        double mean = 0;
        int d = 0;
        for (j = i; j < roots && (j == i || angle[order[j]] - angle[order[j - 1]] < ARM_EQUAL_ROOTS); j++) {
            const int both = tilt[order[j]] > 0 && tilt[order[j]] < ARM_EQUAL_ROOTS ? 2 : 1; /* rounding made a pair of some */
            d += both;
            mean += both * re[order[j]];
        }
        out[count].from = i;
        out[count].end = j;
        out[count].d = part && d > 1 && d <= ARM_SHARED
                && (i == 0 || angle[order[i]] - angle[order[i - 1]] > ARM_TWIN_ROOTS)
                && (j == roots || angle[order[j]] - angle[order[j - 1]] > ARM_TWIN_ROOTS)
            ? d : 0;
        out[count++].mean = mean / d;
    }
    return count;
}

/* All candidates of a pencil whose roots are (re, im), those with a tilt below `most`; part: roots are taken apart that several
   solutions share. */
static int arm_seeds(const arm_pencil *pencil, const double *E, const double *Y, const arm_ends *ends, const double *re,
    const double *im, double most, int part, arm_seed *out)
{
    int order[ARM_MOST], i, k, groups, count = 0;
    double tilt[ARM_MOST];
    arm_group group[ARM_MOST];
    groups = arm_groups(pencil, re, im, most, part, order, tilt, group);
    for (i = 0; i < groups; i++) {
        int found = -1;
        if (group[i].d && count + group[i].d <= ARM_MOST)
            found = arm_shared(pencil, E, Y, ends, group[i].mean, group[i].d, out + count);
        if (found >= 0) {
            count += found;
            continue;
        }
        for (k = group[i].from; k < group[i].end && count < ARM_MOST; k++) {
            arm_seed *one = &out[count];
            one->tilt = tilt[order[k]];
            one->root = order[k];
            count += arm_joints_of(pencil, E, Y, ends, re[order[k]], one->q, &one->defect);
        }
    }
    return count;
}
