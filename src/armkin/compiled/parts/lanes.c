/* Poses, or roots of several poses, in lockstep: number t of a vector belongs to lane t. ARM_MANY: as many lanes as one
   instruction takes. */
typedef double arm_many __attribute__((vector_size(8 * ARM_MANY)));
typedef int64_t arm_flags __attribute__((vector_size(8 * ARM_MANY)));

ARM_INLINE arm_many arm_all(double x)
{
    return (arm_many){0} + x;
}

ARM_INLINE arm_many arm_pick(arm_flags which, arm_many a, arm_many b)
{
    return (arm_many)((which & (arm_flags)a) | (~which & (arm_flags)b));
}

ARM_INLINE arm_many arm_size(arm_many a)
{
    return (arm_many)((arm_flags)a & INT64_MAX);
}

ARM_INLINE arm_many arm_larger(arm_many a, arm_many b)
{
    return arm_pick((arm_flags)(a > b), a, b);
}

ARM_INLINE int arm_any(arm_flags which)
{
    int64_t any = 0;
    int t;
    for (t = 0; t < ARM_MANY; t++)
        any |= which[t];
    return any != 0;
}

/* Square roots. */
ARM_INLINE arm_many arm_roots(arm_many a)
{
    double in[ARM_MANY], out[ARM_MANY];
    arm_many found;
    int t;
    memcpy(in, &a, sizeof a);
    for (t = 0; t < ARM_MANY; t++)
        out[t] = sqrt(in[t]);
    memcpy(&found, out, sizeof found);
    return found;
}

/* The nearest whole numbers, of sizes below 2^51. */
ARM_INLINE arm_many arm_whole(arm_many a)
{
    const double shift = 6755399441055744.0; /* 1.5 2^52 */
    return (a + shift) - shift;
}

/* The numbers of other lanes. */
ARM_INLINE arm_many arm_take(arm_many a, arm_flags lane)
{
#ifdef __clang__
    arm_many out;
    int t;
    for (t = 0; t < ARM_MANY; t++)
        out[t] = a[lane[t]];
    return out;
#else
    return __builtin_shuffle(a, lane);
#endif
}

/* Cosines and sines, as `arm_turns`. */
static void arm_turn_lanes(arm_many q, arm_many *cosine, arm_many *sine)
{
    const arm_many k = arm_whole(q * 0.6366197723675814);
    const arm_many r = ((q - k * 1.570796310901641845703125) - k * 1.589325471229585673428e-8)
        - k * 6.12323399573676588614e-17;
    const arm_many z = r * r;
    const arm_many s = r + r * z * (((((1.58962301576546568060e-10 * z - 2.50507477628578072866e-8) * z
        + 2.75573136213857245213e-6) * z - 1.98412698295895385996e-4) * z + 8.33333333332211858878e-3) * z
        - 1.66666666666666307295e-1);
    const arm_many c = 1 - z / 2 + z * z * (((((-1.13585365213876817300e-11 * z + 2.08757008419747316778e-9) * z
        - 2.75573141792967388112e-7) * z + 2.48015872888517045348e-5) * z - 1.38888888888730564116e-3) * z
        + 4.16666666666665929218e-2);
    const arm_many half = arm_whole(k / 2), odd = k - 2 * half;
    const arm_many sign = 1 - 2 * arm_size(half - 2 * arm_whole(half / 2));
    const arm_many across = odd * sign, along = (1 - arm_size(odd)) * sign;
    *cosine = along * c - across * s;
    *sine = along * s + across * c;
}

/* atan2, as `arm_fast_atan2`. */
static arm_many arm_angle_lanes(arm_many y, arm_many x)
{
    const arm_many ax = arm_size(x), ay = arm_size(y);
    const arm_flags steep = (arm_flags)(ay > ax);
    const arm_many below = arm_pick(steep, ay, ax), above = arm_pick(steep, ax, ay);
    const arm_flags far = (arm_flags)(above > 0.66 * below);
    const arm_many up = arm_pick(far, above - below, above), down = arm_pick(far, above + below, below);
    const arm_many t = up / arm_pick((arm_flags)(down > 0), down, arm_all(1));
    const arm_many z = t * t;
    const arm_many p = ((((-8.750608600031904122785e-1 * z - 1.615753718733365076637e1) * z
        - 7.500855792314704667340e1) * z - 1.228866684490136173410e2) * z - 6.485021904942025371773e1) * z;
    const arm_many q = ((((z + 2.485846490142306297962e1) * z + 1.650270098316988542046e2) * z
        + 4.328810604912902668951e2) * z + 4.853903996359136964868e2) * z + 1.945506571482613964425e2;
    const arm_many near = t + t * (p / q);
    const arm_many octant = arm_pick(far, near + 0.7853981633974483, near);
    const arm_many quadrant = arm_pick(steep, 1.5707963267948966 - octant, octant);
    const arm_many half = arm_pick((arm_flags)(x < 0), ARM_PI - quadrant, quadrant);
    return (arm_many)((arm_flags)half | ((arm_flags)y & INT64_MIN));
}

/* Frames, as `arm_times`, `arm_move` and `arm_invert`; links are the same in all lanes. */
ARM_INLINE void arm_times_lanes(const arm_many *a, const arm_many *b, arm_many *out)
{
    int i, j;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 4; j++) {
            const arm_many sum = a[4 * i] * b[j] + a[4 * i + 1] * b[4 + j] + a[4 * i + 2] * b[8 + j];
            out[4 * i + j] = j == 3 ? sum + a[4 * i + 3] : sum;
        }
}

ARM_INLINE void arm_link_lanes(const arm_many *a, const double *b, arm_many *out)
{
    arm_many all[12];
    int i;
    for (i = 0; i < 12; i++)
        all[i] = arm_all(b[i]);
    arm_times_lanes(a, all, out);
}

ARM_INLINE void arm_move_lanes(const arm_many *a, arm_many c, arm_many s, arm_many *out)
{
    int i;
    for (i = 0; i < 3; i++) {
        out[4 * i] = c * a[4 * i] + s * a[4 * i + 1];
        out[4 * i + 1] = c * a[4 * i + 1] - s * a[4 * i];
        out[4 * i + 2] = a[4 * i + 2];
        out[4 * i + 3] = a[4 * i + 3];
    }
}

/* A reflection (Householder) that turns column k of m rows, `row` numbers long, into a triangle's. */
static void arm_reflect_lanes(arm_many *a, int m, int k, int row)
{
    arm_many *column = a + k, square = arm_all(0), size, first, factor;
    int i, j;
    for (i = k; i < m; i++)
        square += column[i * row] * column[i * row];
    size = arm_roots(square);
    first = column[k * row];
    size = arm_pick((arm_flags)(first > 0), -size, size);
    factor = 1 / (size * (size - first));
    factor = arm_pick((arm_flags)(square > 0), factor, arm_all(0));
    column[k * row] = first - size;
    for (j = k + 1; j < row; j++) {
        arm_many along = arm_all(0), *other = a + j;
        for (i = k; i < m; i++)
            along += column[i * row] * other[i * row];
        along *= factor;
        for (i = k; i < m; i++)
            other[i * row] -= along * column[i * row];
    }
    column[k * row] = size;
}

/* Reflections that turn the first n columns into a triangle. */
static void arm_triangle_lanes(arm_many *a, int m, int n, int row)
{
    int k;
    for (k = 0; k < n && k < m - 1; k++)
        arm_reflect_lanes(a, m, k, row);
}

/* The right sides, columns from `right` to `end`, of a triangle of n rows become its solutions. */
static void arm_solve_lanes(arm_many *a, int n, int right, int end, int row)
{
    int i, j, k;
    for (k = n - 1; k >= 0; k--) {
        const arm_many over = 1 / a[k * row + k];
        for (j = right; j < end; j++) {
            arm_many sum = a[k * row + j];
            for (i = k + 1; i < n; i++)
                sum -= a[k * row + i] * a[i * row + j];
            a[k * row + j] = sum * over;
        }
    }
}
