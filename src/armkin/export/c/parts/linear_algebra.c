/* to -= factor what, from about `from` to `end`, a multiple of four: by fours, of which compilers make vectors. Up to three
   numbers before `from` change, too. */
ARM_INLINE void arm_subtract(double *ARM_RESTRICT to, const double *ARM_RESTRICT what, double factor, int from, int end)
{
    int b, j;
    for (b = from & ~3; b < end; b += 4)
        for (j = b; j < b + 4; j++)
            to[j] -= factor * what[j];
}

/* Exchange two rows likewise. */
ARM_INLINE void arm_swap(double *ARM_RESTRICT a, double *ARM_RESTRICT b, int from, int end)
{
    int k, j;
    for (k = from & ~3; k < end; k += 4) {
        double kept[4];
        for (j = 0; j < 4; j++)
            kept[j] = a[k + j];
        for (j = 0; j < 4; j++)
            a[k + j] = b[k + j];
        for (j = 0; j < 4; j++)
            b[k + j] = kept[j];
    }
}

/* The sum of products from `from` to `end`, multiples of four, in four partial sums. */
ARM_INLINE double arm_along(const double *a, const double *b, int from, int end)
{
    double sum[4] = {0, 0, 0, 0};
    int i, j;
    for (i = from; i < end; i += 4)
        for (j = 0; j < 4; j++)
            sum[j] += a[i + j] * b[i + j];
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

/* The row from k to n with the largest entry in column k; rows m long. No branch: which row it is cannot be foreseen. */
ARM_INLINE int arm_pivot(const double *a, int k, int n, int m)
{
    double most = fabs(a[k * m + k]);
    int best = k, i;
    for (i = k + 1; i < n; i++) {
        const double size = fabs(a[i * m + k]);
        best ^= (best ^ i) & -(size > most);
        most = size > most ? size : most;
    }
    return best;
}

/* Gaussian elimination with row pivots of an n x n system whose right sides stand from the column `right` on, rows m long;
   right and m are multiples of four. Afterwards the right sides hold the solution. Returns 0 if a pivot vanishes. */
ARM_INLINE int arm_reduce(double *a, int n, int right, int m)
{
    double over[16]; /* one over the pivots: n is at most sixteen */
    int i, j, k;
    for (k = 0; k < n; k++) {
        const int best = arm_pivot(a, k, n, m);
        if (!(fabs(a[best * m + k]) > 1e-300))
            return 0;
        if (best != k)
            arm_swap(a + k * m, a + best * m, k, m);
        over[k] = 1 / a[k * m + k];
        for (i = k + 1; i < n; i++)
            arm_subtract(a + i * m, a + k * m, a[i * m + k] * over[k], k, m);
    }
    for (k = n - 1; k >= 0; k--) {
        for (j = right; j < m; j++)
            a[k * m + j] *= over[k];
        for (i = 0; i < k; i++)
            arm_subtract(a + i * m, a + k * m, a[i * m + k], right, m);
    }
    return 1;
}

/* The right singular vector of the smallest singular value of an n x n matrix, n = 8, 12 or 16: inverse iteration on A^T A. */
ARM_INLINE void arm_null_vector(double *a, double *v, const int n)
{
    double w[16], lower[256], over[16], size = 0;
    int i, k;
    for (i = 0; i < n * n; i++)
        lower[i] = 0;
    for (k = 0; k < n; k++) { /* P A = L U, U in place */
        const int best = arm_pivot(a, k, n, n);
        if (best != k) {
            arm_swap(a + n * k, a + n * best, 0, n);
            arm_swap(lower + n * k, lower + n * best, 0, n);
        }
        if (!(fabs(a[n * k + k]) > 1e-14)) /* rounding's size, and not zero: an exact root has no last pivot */
            a[n * k + k] = 1e-14;
        over[k] = 1 / a[n * k + k];
        for (i = k + 1; i < n; i++) {
            const double factor = a[n * i + k] * over[k];
            lower[n * i + k] = factor;
            arm_subtract(a + n * i, a + n * k, factor, 0, n);
        }
    }
    for (i = 0; i < n; i++)
        v[i] = 1.0 + 0.37 * i - 0.11 * i * i; /* any start that no arm is made for */
    for (i = 0; i < n; i++) { /* U^T y = v */
        w[i] = v[i] * over[i];
        arm_subtract(v, a + n * i, w[i], 0, n);
    }
    for (k = n - 1; k > 0; k--) /* L^T z = y; the permutations of A^-T and A^-1 cancel */
        arm_subtract(w, lower + n * k, w[k], 0, n);
    for (i = 0; i < n; i++)
        size = fabs(w[i]) > size ? fabs(w[i]) : size;
    for (i = 0; i < n; i++)
        w[i] /= size;
    for (i = 1; i < n; i++) /* L y = z */
        for (k = 0; k < i; k++)
            w[i] -= lower[n * i + k] * w[k];
    size = 0;
    for (i = n - 1; i >= 0; i--) { /* U v = y; the unknown that was found last comes last into the sum */
        double sum = w[i];
        for (k = n - 1; k > i; k--)
            sum -= a[n * i + k] * v[k];
        v[i] = sum * over[i];
        size = fabs(v[i]) > size ? fabs(v[i]) : size;
    }
    for (i = 0; i < n; i++)
        v[i] /= size;
}

/* Rows of the following matrices are `most` long, a multiple of four that compilers know.

   Similarity transformations that make the rows and columns of a matrix about equally long (Osborne 1960). */
ARM_INLINE void arm_balance(double *a, int n, const int most)
{
    int i, j, done = 0, round;
    for (round = 0; round < 20 && !done; round++) {
        done = 1;
        for (i = 0; i < n; i++) {
            double c = 0, r = 0, f = 1, before;
            for (j = 0; j < n; j++)
                if (j != i) {
                    c += fabs(a[j * most + i]);
                    r += fabs(a[i * most + j]);
                }
            if (!(c > 0) || !(r > 0))
                continue;
            before = c + r;
            for (; c < r / 2; c *= 4)
                f *= 2;
            for (; c >= r * 2; c /= 4)
                f /= 2;
            if ((c + r) / f < 0.95 * before) {
                done = 0;
                for (j = 0; j < n; j++)
                    a[i * most + j] /= f;
                for (j = 0; j < n; j++)
                    a[j * most + i] *= f;
            }
        }
    }
}

/* To upper Hessenberg form by eliminations with row pivots (Wilkinson, The Algebraic Eigenvalue Problem, 6.8). */
ARM_INLINE void arm_hessenberg(double *a, int n, const int most)
{
    double factor[ARM_MOST], over; /* most <= ARM_MOST */
    int i, j, m;
    for (i = 0; i < most; i++)
        factor[i] = 0;
    for (m = 1; m < n - 1; m++) {
        const int best = 1 + arm_pivot(a + most, m - 1, n - 1, most);
        if (best != m) {
            arm_swap(a + best * most, a + m * most, m - 1, most);
            for (j = 0; j < n; j++) {
                const double swap = a[j * most + best];
                a[j * most + best] = a[j * most + m];
                a[j * most + m] = swap;
            }
        }
        if (!(fabs(a[m * most + m - 1]) > 1e-300))
            continue;
        over = 1 / a[m * most + m - 1];
        for (i = 0; i <= m; i++)
            factor[i] = 0;
        for (i = m + 1; i < n; i++) {
            factor[i] = a[i * most + m - 1] * over;
            arm_subtract(a + i * most, a + m * most, factor[i], m, most);
            a[i * most + m - 1] = 0;
        }
        for (j = 0; j < n; j++)
            a[j * most + m] += arm_along(a + j * most, factor, m & ~3, most);
    }
}

/* Eigenvalues of an upper Hessenberg matrix by Francis' double-shift QR steps (Martin, Peters & Wilkinson 1970).
   Returns 0 if they do not converge. */
ARM_INLINE int arm_eigenvalues(double *a, int n, const int most, double *re, double *im)
{
    const double rounding = 2.220446049250313e-16;
    double norm = 0, shift = 0;
    int b, i, j, k, l, m, last = n - 1, steps = 0;
    for (i = 0; i < n; i++)
        for (j = i > 0 ? i - 1 : 0; j < n; j++)
            norm += fabs(a[i * most + j]);
    while (last >= 0) {
        double p = 0, q = 0, r = 0, x, y, w, z;
        for (l = last; l > 0; l--) { /* the lowest row from which on nothing is left below the diagonal */
            double size = fabs(a[(l - 1) * most + l - 1]) + fabs(a[l * most + l]);
            if (!(size > 0))
                size = norm;
            if (fabs(a[l * most + l - 1]) <= rounding * size) {
                a[l * most + l - 1] = 0;
                break;
            }
        }
        x = a[last * most + last];
        if (l == last) { /* one root */
            re[last] = x + shift;
            im[last] = 0;
            last--;
            steps = 0;
            continue;
        }
        y = a[(last - 1) * most + last - 1];
        w = a[last * most + last - 1] * a[(last - 1) * most + last];
        if (l == last - 1) { /* two */
            p = (y - x) / 2;
            q = p * p + w;
            z = sqrt(fabs(q));
            x += shift;
            if (q >= 0) {
                z = p + (p < 0 ? -z : z);
                re[last - 1] = re[last] = x + z;
                if (fabs(z) > 0)
                    re[last] = x - w / z;
                im[last - 1] = im[last] = 0;
            } else {
                re[last - 1] = re[last] = x + p;
                im[last - 1] = z;
                im[last] = -z;
            }
            last -= 2;
            steps = 0;
            continue;
        }
        if (steps == 60)
            return 0;
        if (steps % 10 == 9) { /* an exceptional shift */
            double size;
            shift += x;
            for (i = 0; i <= last; i++)
                a[i * most + i] -= x;
            size = fabs(a[last * most + last - 1]) + fabs(a[(last - 1) * most + last - 2]);
            x = y = 0.75 * size;
            w = -0.4375 * size * size;
        }
        steps++;
        for (m = last - 2; m >= l; m--) { /* where two small entries follow each other the step may start */
            const double *d = a + m * most + m;
            double u, v, size;
            z = d[0];
            r = x - z;
            u = y - z;
            p = (r * u - w) / d[most] + d[1];
            q = d[most + 1] - z - r - u;
            r = d[2 * most + 1];
            size = 1 / (fabs(p) + fabs(q) + fabs(r));
            p *= size;
            q *= size;
            r *= size;
            if (m == l)
                break;
            u = fabs(d[-1]) * (fabs(q) + fabs(r));
            v = fabs(p) * (fabs(d[-most - 1]) + fabs(z) + fabs(d[most + 1]));
            if (u <= rounding * v)
                break;
        }
        for (i = m + 2; i <= last; i++) {
            a[i * most + i - 2] = 0;
            if (i > m + 2)
                a[i * most + i - 3] = 0;
        }
        for (k = m; k < last; k++) {
            double *up = a + k * most, *mid = up + most, *low = mid + most, size, u;
            const int three = k < last - 1, end = last < k + 3 ? last : k + 3;
            if (k > m) {
                p = up[k - 1];
                q = mid[k - 1];
                r = three ? low[k - 1] : 0;
            }
            size = sqrt(p * p + q * q + r * r); /* of a balanced matrix: no square over- or underflows unnoticed */
            if (!(size > 0))
                continue;
            size = p < 0 ? -size : size;
            if (k > m)
                up[k - 1] = -size;
            else if (l < m)
                up[k - 1] = -up[k - 1];
            p += size;
            w = 1 / size;
            u = 1 / p;
            x = p * w;
            y = q * w;
            z = r * w;
            q *= u;
            r *= u;
            if (three) {
                const double below = k > 0 ? up[k - 1] : 0;
                for (b = k & ~3; b <= last; b += 4) /* by fours; what lies outside the block is not read again */
                    for (j = b; j < b + 4; j++) {
                        const double t = up[j] + q * mid[j] + r * low[j];
                        up[j] -= t * x;
                        mid[j] -= t * y;
                        low[j] -= t * z;
                    }
                if (k > 0)
                    up[k - 1] = below;
                for (i = end; i >= l; i--) { /* first the rows that the next step begins with */
                    double *c = a + i * most + k;
                    const double t = x * c[0] + y * c[1] + z * c[2];
                    c[0] -= t;
                    c[1] -= t * q;
                    c[2] -= t * r;
                }
            } else {
                for (j = k; j <= last; j++) {
                    const double t = up[j] + q * mid[j];
                    up[j] -= t * x;
                    mid[j] -= t * y;
                }
                for (i = l; i <= end; i++) {
                    double *c = a + i * most + k;
                    const double t = x * c[0] + y * c[1];
                    c[0] -= t;
                    c[1] -= t * q;
                }
            }
        }
    }
    return 1;
}

/* The eigenvalues of a matrix of n rows, each `most` long. Returns 0 if they do not converge. */
ARM_INLINE int arm_roots_of(double *a, int n, const int most, double *re, double *im)
{
    arm_balance(a, n, most);
    arm_hessenberg(a, n, most);
    return arm_eigenvalues(a, n, most, re, im);
}
