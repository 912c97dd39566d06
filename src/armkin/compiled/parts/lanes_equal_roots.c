/* Equal roots of one pose that solutions share, to be taken apart: d of them, `found` real ones, -1 where not all are known,
   and the products v of these, rows of sixteen. */
typedef struct {
    int lane, d, found;
    double x, *v;
} arm_many_group;

/* Which of the columns k and later is the longest from row k on; *length: how long. */
static arm_flags arm_longest_lanes(const arm_many *a, int n, int k, arm_many *length)
{
    arm_many most = arm_all(-1);
    arm_flags chosen = (arm_flags){0} + k;
    int i, j;
    for (j = k; j < n; j++) {
        arm_many square = arm_all(0);
        arm_flags more;
        for (i = k; i < n; i++)
            square += a[n * i + j] * a[n * i + j];
        more = (arm_flags)(square > most);
        most = arm_pick(more, square, most);
        chosen = (more & j) | (~more & chosen);
    }
    *length = arm_roots(most);
    return chosen;
}

/* Column k and each lane's chosen one change places. */
static void arm_swap_lanes(arm_many *a, int n, int k, arm_flags chosen, arm_flags *place)
{
    int i, j;
    for (j = k + 1; j < n; j++) {
        const arm_flags swap = (arm_flags)(chosen == j), kept = place[k];
        if (!arm_any(swap))
            continue;
        place[k] = (swap & place[j]) | (~swap & kept);
        place[j] = (swap & kept) | (~swap & place[j]);
        for (i = 0; i < n; i++) {
            const arm_many one = a[n * i + k], other = a[n * i + j];
            a[n * i + k] = arm_pick(swap, other, one);
            a[n * i + j] = arm_pick(swap, one, other);
        }
    }
}

/* Orthonormal rows, sixteen numbers apart, of what n x n matrices take to zero, by reflections with the longest column first;
   the lanes where that has d dimensions. */
static arm_flags arm_null_space_lanes(arm_many *a, int n, int d, arm_many *basis)
{
    arm_many first = arm_all(0), last = first, rest = first;
    arm_flags place[16], good = ~(arm_flags){0};
    int j, k, f, t, round;
    for (k = 0; k < n; k++)
        place[k] = (arm_flags){0} + k;
    for (k = 0; k <= n - d; k++) { /* the last round only asks what is left */
        const arm_flags chosen = arm_longest_lanes(a, n, k, &rest);
        if (k == n - d)
            break;
        first = k == 0 ? rest : first;
        last = rest;
        good &= (arm_flags)(rest > 1e-9 * first);
        arm_swap_lanes(a, n, k, chosen, place);
        arm_reflect_lanes(a, n, k, n);
    }
    good &= (arm_flags)(rest < 1e-3 * last) & (arm_flags)(rest < 1e-5 * first);
    for (f = 0; f < d; f++) {
        arm_many y[16], *out = basis + 16 * f;
        for (j = n - d; j < n; j++)
            y[j] = arm_all(j == n - d + f ? 1 : 0);
        for (k = n - d - 1; k >= 0; k--) {
            arm_many sum = arm_all(0);
            for (j = k + 1; j < n; j++)
                sum += a[n * k + j] * y[j];
            y[k] = -sum / a[n * k + k];
        }
        for (j = 0; j < n; j++)
            for (t = 0; t < ARM_MANY; t++)
                out[place[j][t]][t] = y[j][t];
        for (round = 0; round < 2; round++) {
            arm_many size = arm_all(0);
            for (k = 0; k < f; k++) {
                arm_many along = arm_all(0);
                for (j = 0; j < n; j++)
                    along += out[j] * basis[16 * k + j];
                for (j = 0; j < n; j++)
                    out[j] -= along * basis[16 * k + j];
            }
            for (j = 0; j < n; j++)
                size += out[j] * out[j];
            size = 1 / arm_roots(size);
            for (j = 0; j < n; j++)
                out[j] *= size;
        }
    }
    return good;
}

/* As `arm_quotient`, rows of d; the lanes where it is determined. */
static arm_flags arm_quotient_lanes(const arm_many *low, const arm_many *high, int d, int m, arm_many *out)
{
    const double c = 0.9156396939833165, s = 0.4019999388086255; /* of 0.4137 rad */
    arm_many below[ARM_SHARED * 12], above[ARM_SHARED * 12], system[ARM_SHARED * 2 * ARM_SHARED], most = arm_all(0);
    arm_flags good = ~(arm_flags){0};
    int i, j, k;
    for (i = 0; i < d; i++)
        for (k = 0; k < m; k++) {
            below[12 * i + k] = c * low[12 * i + k] - s * high[12 * i + k];
            above[12 * i + k] = s * low[12 * i + k] + c * high[12 * i + k];
        }
    for (i = 0; i < d; i++)
        for (j = 0; j < 2 * d; j++) {
            const arm_many *other = (j < d ? below : above) + 12 * (j % d);
            arm_many sum = arm_all(0);
            for (k = 0; k < m; k++)
                sum += below[12 * i + k] * other[k];
            system[2 * d * i + j] = sum;
            most = i == j ? arm_larger(sum, most) : most;
        }
    for (k = 0; k < d; k++) { /* positive definite: the diagonal's pivots do */
        const arm_many pivot = system[2 * d * k + k], over = 1 / pivot;
        good &= (arm_flags)(pivot > 1e-8 * most);
        for (i = k + 1; i < d; i++) {
            const arm_many factor = system[2 * d * i + k] * over;
            for (j = k; j < 2 * d; j++)
                system[2 * d * i + j] -= factor * system[2 * d * k + j];
        }
    }
    arm_solve_lanes(system, d, d, 2 * d, 2 * d);
    for (i = 0; i < d; i++)
        for (j = 0; j < d; j++)
            out[d * i + j] = system[2 * d * i + d + j];
    return good;
}

/* The mixtures' (c^3, c^2 s, c s^2) and (c^2 s, c s^2, s^3) of one joint, of a row of four, `step` apart. */
static void arm_powers_lanes(const arm_many *v, int step, arm_many *low, arm_many *high, int apart)
{
    const arm_many a = v[0] / 4, b = v[step] / 4, c = v[2 * step] / 4, e = v[3 * step] / 4;
    low[0] = a + 3 * c;
    low[apart] = high[0] = b + e;
    low[2 * apart] = high[apart] = c - a;
    high[2 * apart] = 3 * e - b;
}

/* As `arm_products`: weights[b], rows of d, of the product b of mixtures v, and which lanes have it as a real one; the lanes
   where every product is known. */
static arm_flags arm_products_lanes(const arm_many *v, int d, int three, arm_many *weights, arm_flags *real)
{
    arm_many low[ARM_SHARED * 12], high[ARM_SHARED * 12], along[64], second[64];
    arm_many M[(ARM_SHARED + 1) * (ARM_SHARED + 1)], re[ARM_SHARED], im[ARM_SHARED];
    arm_flags good;
    int b, i, j, k;
    for (b = 0; b < d; b++)
        for (k = 0; k < three; k++)
            arm_powers_lanes(v + 16 * b + k, three, low + 12 * b + k, high + 12 * b + k, three);
    good = arm_quotient_lanes(low, high, d, 3 * three, along);
    for (b = 0; b < d; b++)
        for (k = 0; k < 4; k++) {
            const arm_many *row = v + 16 * b + three * k;
            arm_many *one = low + 12 * b + k, *other = high + 12 * b + k;
            if (three == 4)
                arm_powers_lanes(row, 1, one, other, 4);
            else { /* (1 + cos, sin) and (sin, 1 - cos): the tangent of half the angle leads from one to the other */
                one[0] = row[0] + row[1];
                one[4] = other[0] = row[2];
                other[4] = row[0] - row[1];
            }
        }
    good &= arm_quotient_lanes(low, high, d, three == 3 ? 8 : 12, second);
    for (i = 0; i < (d + 1) * (d + 1); i++)
        M[i] = arm_all(0);
    for (i = 0; i < d; i++)
        for (j = 0; j < d; j++) {
            along[d * i + j] += 0.618 * second[d * i + j]; /* those that have the first joint alike differ by the second */
            M[(d + 1) * i + j] = (arm_many)((arm_flags)along[d * i + j] & good); /* no lane keeps others waiting */
        }
    arm_balance_lanes(M, d);
    arm_hessenberg_lanes(M, d);
    good &= ~arm_eigenvalues_lanes(M, d, re, im);
    for (i = 0; i < d; i++) {
        const arm_many slant = arm_size(im[i]) / (1 + re[i] * re[i] + im[i] * im[i]);
        good &= ~((arm_flags)(slant > 0) & (arm_flags)(slant < ARM_UPRIGHT));
        for (j = 0; j < i; j++) {
            const arm_many x = re[i] - re[j], y = im[i] - im[j];
            good &= (arm_flags)(x * x + y * y > ARM_UPRIGHT * ARM_UPRIGHT);
        }
    }
    for (b = 0; b < d; b++) {
        arm_many A[64];
        real[b] = (arm_flags)(im[b] == 0);
        for (i = 0; i < d; i++)
            for (j = 0; j < d; j++)
                A[d * i + j] = along[d * i + j] - (i == j ? re[b] : arm_all(0));
        arm_null_lanes(A, d, weights + ARM_SHARED * b);
    }
    return good;
}

/* As `arm_shared`, of up to ARM_MANY groups of d roots each. */
static void arm_shared_lanes(const arm_pencil *pencil, const arm_many *E, arm_many_group **group, int count, int d)
{
    const int p = pencil->wide ? 16 : 12;
    arm_many x, A[256], basis[ARM_SHARED * 16], v[ARM_SHARED * 16], weights[ARM_SHARED * ARM_SHARED];
    arm_flags lane, good, real[ARM_SHARED];
    int b, i, k, t;
    for (t = 0; t < ARM_MANY; t++) {
        lane[t] = group[t < count ? t : 0]->lane;
        x[t] = group[t < count ? t : 0]->x;
    }
    arm_system_lanes(pencil, E, lane, x, A);
    good = arm_null_space_lanes(A, p, d, basis);
    for (b = 0; b < d; b++)
        arm_vector_lanes(pencil, basis + 16 * b, x, v + 16 * b);
    good &= arm_products_lanes(v, d, p / 4, weights, real);
    for (t = 0; t < count; t++)
        group[t]->found = good[t] ? 0 : -1;
    for (b = 0; b < d; b++) {
        arm_many one[16];
        for (i = 0; i < p; i++) {
            one[i] = arm_all(0);
            for (k = 0; k < d; k++)
                one[i] += weights[ARM_SHARED * b + k] * v[16 * k + i];
        }
        for (t = 0; t < count; t++)
            if (good[t] && real[b][t]) {
                double *out = group[t]->v + 16 * group[t]->found++;
                for (i = 0; i < p; i++)
                    out[i] = one[i][t];
            }
    }
}

/* The same of any number of groups. */
static void arm_take_apart(const arm_pencil *pencil, const arm_many *E, arm_many_group *group, int count)
{
    int d, i;
    for (d = 2; d <= ARM_SHARED; d++) {
        arm_many_group *some[ARM_MANY];
        int number = 0;
        for (i = 0; i < count; i++) {
            if (group[i].d == d)
                some[number++] = &group[i];
            if (number == ARM_MANY || (number && i == count - 1)) {
                arm_shared_lanes(pencil, E, some, number, d);
                number = 0;
            }
        }
    }
}
