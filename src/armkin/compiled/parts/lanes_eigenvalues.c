/* Similarity transformations that make rows and columns about equally long, as `arm_balance`. Matrices stand in rows of n + 1. */
static void arm_balance_lanes(arm_many *a, int n)
{
    const int row = n + 1;
    int i, j, done = 0, round;
    for (round = 0; round < 20 && !done; round++) {
        done = 1;
        for (i = 0; i < n; i++) {
            arm_many c = arm_all(0), r = arm_all(0), f, over;
            arm_flags change;
            for (j = 0; j < n; j++)
                if (j != i) {
                    c += arm_size(a[j * row + i]);
                    r += arm_size(a[i * row + j]);
                }
            /* the power of two next to the root of r / c, by its exponent */
            f = (arm_many)(((((arm_flags)(r / c)) >> 53) + 512) << 52);
            change = (arm_flags)(c > 0) & (arm_flags)(r > 0) & (arm_flags)(c * f + r / f < 0.95 * (c + r));
            if (!arm_any(change))
                continue;
            done = 0;
            f = arm_pick(change, f, arm_all(1));
            over = 1 / f;
            for (j = 0; j < n; j++)
                a[i * row + j] *= over;
            for (j = 0; j < n; j++)
                a[j * row + i] *= f;
        }
    }
}

/* To upper Hessenberg form by reflections. */
static void arm_hessenberg_lanes(arm_many *a, int n)
{
    const int row = n + 1;
    arm_many v[ARM_MOST];
    int i, j, m;
    for (m = 1; m < n - 1; m++) {
        arm_many square = arm_all(0), size, first = a[m * row + m - 1], factor;
        for (i = m; i < n; i++) {
            v[i] = a[i * row + m - 1];
            square += v[i] * v[i];
            a[i * row + m - 1] = arm_all(0);
        }
        size = arm_roots(square);
        size = arm_pick((arm_flags)(first > 0), -size, size);
        factor = arm_pick((arm_flags)(square > 0), 1 / (size * (size - first)), arm_all(0));
        v[m] = first - size;
        a[m * row + m - 1] = size;
        for (j = m; j < n; j++) {
            arm_many along = arm_all(0);
            for (i = m; i < n; i++)
                along += v[i] * a[i * row + j];
            along *= factor;
            for (i = m; i < n; i++)
                a[i * row + j] -= along * v[i];
        }
        for (i = 0; i < n; i++) {
            arm_many along = arm_all(0);
            for (j = m; j < n; j++)
                along += v[j] * a[i * row + j];
            along *= factor;
            for (j = m; j < n; j++)
                a[i * row + j] -= along * v[j];
        }
    }
}

/* One double-shift step of every lane on its own window, from low to last; p, q, r: how it begins there. from, end: all
   windows. Lanes outside theirs are reflected by nothing. */
static void arm_sweep_lanes(arm_many *a, int n, arm_many low, arm_many last, const arm_many *begin, int from, int end)
{
    const int row = n + 1;
    int i, j, k;
    for (k = from; k < end; k++) {
        arm_many *up = a + k * row, *mid = up + row, *under = mid + row, p = begin[0], q = begin[1], r = begin[2];
        const arm_flags first = (arm_flags)(low == (double)k), three = (arm_flags)(last > (double)(k + 1));
        arm_flags moves = (arm_flags)(low <= (double)k) & (arm_flags)(last > (double)k), later;
        const int below = k + 3 < end ? k + 3 : end;
        arm_many size, over, part, x, y, z;
        if (k > from) {
            p = arm_pick(first, p, up[k - 1]);
            q = arm_pick(first, q, mid[k - 1]);
            r = arm_pick(first, r, under[k - 1]);
        }
        r = (arm_many)((arm_flags)r & three);
        size = arm_roots(p * p + q * q + r * r);
        moves &= (arm_flags)(size > 0);
        size = arm_pick((arm_flags)(p < 0), -size, size);
        later = moves & ~first;
        if (k > from) {
            up[k - 1] = arm_pick(later, -size, up[k - 1]);
            mid[k - 1] = arm_pick(later, arm_all(0), mid[k - 1]);
            under[k - 1] = arm_pick(later & three, arm_all(0), under[k - 1]);
        }
        p += size;
        over = 1 / size;
        part = 1 / p;
        x = (arm_many)((arm_flags)(p * over) & moves);
        y = (arm_many)((arm_flags)(q * over) & moves);
        z = (arm_many)((arm_flags)(r * over) & moves);
        q = (arm_many)((arm_flags)(q * part) & moves);
        r = (arm_many)((arm_flags)(r * part) & moves);
        for (j = k; j <= end; j++) {
            const arm_many t = up[j] + q * mid[j] + r * under[j];
            up[j] -= t * x;
            mid[j] -= t * y;
            under[j] -= t * z;
        }
        for (i = from; i <= below; i++) {
            arm_many *c = a + i * row + k;
            const arm_many t = x * c[0] + y * c[1] + z * c[2];
            c[0] -= t;
            c[1] -= t * q;
            c[2] -= t * r;
        }
    }
}

/* The roots at the end of one lane's window that stand alone or as a pair, as many as there are: re, im. The last row that is
   left, -1 of none. */
static int arm_deflate_lane(const arm_many *a, int n, int t, int last, arm_many *re, arm_many *im)
{
    const int row = n + 1;
#define ARM_AT(i, j) a[(i) * row + (j)][t]
    while (last >= 0) {
        if (last == 0 || !(fabs(ARM_AT(last, last - 1)) > 0)) {
            re[last][t] = ARM_AT(last, last);
            im[last][t] = 0;
            last--;
        } else if (last == 1 || !(fabs(ARM_AT(last - 1, last - 2)) > 0)) {
            const double x = ARM_AT(last, last), y = ARM_AT(last - 1, last - 1);
            const double w = ARM_AT(last, last - 1) * ARM_AT(last - 1, last), p = (y - x) / 2, q = p * p + w;
            double z = sqrt(fabs(q));
            if (q >= 0) {
                z = p + (p < 0 ? -z : z);
                re[last - 1][t] = x + z;
                re[last][t] = fabs(z) > 0 ? x - w / z : x + z;
                im[last - 1][t] = im[last][t] = 0;
            } else {
                re[last - 1][t] = re[last][t] = x + p;
                im[last - 1][t] = z;
                im[last][t] = -z;
            }
            last -= 2;
        } else
            break;
    }
#undef ARM_AT
    return last;
}

/* Eigenvalues of upper Hessenberg matrices, as `arm_eigenvalues`: in each lane its own window, shifts and start. Lanes
   that do not converge are flagged. */
static arm_flags arm_eigenvalues_lanes(arm_many *a, int n, arm_many *re, arm_many *im)
{
    const double rounding = 2.220446049250313e-16;
    const int row = n + 1;
    arm_many norm = arm_all(0);
    arm_flags failed = {0};
    int last[ARM_MANY], steps[ARM_MANY], i, j, k, t;
    for (i = 0; i < n; i++)
        for (j = i > 0 ? i - 1 : 0; j < n; j++)
            norm += arm_size(a[i * row + j]);
    for (t = 0; t < ARM_MANY; t++) {
        last[t] = n - 1;
        steps[t] = 0;
    }
    for (;;) {
        arm_many low = arm_all(0), top, begin[3], x = arm_all(0), y = arm_all(0), w = arm_all(0);
        int from = n, end = -1;
        for (t = 0; t < ARM_MANY; t++)
            end = last[t] > end ? last[t] : end;
        for (k = 1; k <= end; k++) { /* nothing is left below the diagonal */
            arm_many *d = a + k * row + k, size = arm_size(d[-row - 1]) + arm_size(d[0]);
            size = arm_pick((arm_flags)(size > 0), size, norm);
            d[-1] = (arm_many)((arm_flags)d[-1] & (arm_flags)(arm_size(d[-1]) > rounding * size));
        }
        for (t = 0, end = -1; t < ARM_MANY; t++) {
            const int before = last[t];
            last[t] = arm_deflate_lane(a, n, t, before, re, im);
            steps[t] = last[t] < before ? 1 : steps[t] + 1;
            if (steps[t] > 60 && last[t] >= 0) {
                failed[t] = -1;
                last[t] = -1;
            }
            end = last[t] > end ? last[t] : end;
            top[t] = last[t];
        }
        if (end < 0)
            return failed;
        for (k = 1; k < end; k++)
            low = arm_pick((arm_flags)(top > (double)k) & (arm_flags)(a[k * row + k - 1] == 0), arm_all(k), low);
        for (t = 0; t < ARM_MANY; t++) {
            const int l = (int)low[t], m = last[t];
            double z, r, u;
            if (m < 0) {
                begin[0][t] = begin[1][t] = begin[2][t] = 0;
                continue;
            }
            from = l < from ? l : from;
#define ARM_AT(i, j) a[(i) * row + (j)][t]
            if (steps[t] % 10 == 9) { /* an exceptional shift */
                const double size = fabs(ARM_AT(m, m - 1)) + fabs(ARM_AT(m - 1, m - 2));
                x[t] = y[t] = 0.75 * size + ARM_AT(m, m);
                w[t] = -0.4375 * size * size;
            } else {
                x[t] = ARM_AT(m, m);
                y[t] = ARM_AT(m - 1, m - 1);
                w[t] = ARM_AT(m, m - 1) * ARM_AT(m - 1, m);
            }
            z = ARM_AT(l, l);
            r = x[t] - z;
            u = y[t] - z;
            begin[0][t] = (r * u - w[t]) / ARM_AT(l + 1, l) + ARM_AT(l, l + 1);
            begin[1][t] = ARM_AT(l + 1, l + 1) - z - r - u;
            begin[2][t] = ARM_AT(l + 2, l + 1);
#undef ARM_AT
            z = 1 / (fabs(begin[0][t]) + fabs(begin[1][t]) + fabs(begin[2][t]));
            begin[0][t] *= z;
            begin[1][t] *= z;
            begin[2][t] *= z;
        }
        arm_sweep_lanes(a, n, low, top, begin, from, end);
    }
}
