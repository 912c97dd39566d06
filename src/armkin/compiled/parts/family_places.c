/* Where families of a target may change, in numbers of type @real@: the real roots of trigonometric polynomials, as
   `armkin.inverse.redundant.turn_roots` finds them. */
typedef struct {
    @real@ turn[4][ARM_ANGLES]; /* cosine and sine of where the polynomials are asked, real and imaginary parts */
    @real@ along[ARM_ANGLES][ARM_ORDERS], across[ARM_ANGLES][ARM_ORDERS]; /* from values to coefficients */
    @real@ cosine[ARM_ORDERS][ARM_CELLS], sine[ARM_ORDERS][ARM_CELLS]; /* of k times the middles of cells */
    @real@ of_real[ARM_ORDERS][ARM_TERMS], of_imaginary[ARM_ORDERS][ARM_TERMS]; /* from coefficients to series */
    @real@ rest[ARM_ORDERS]; /* what a coefficient adds to a series' terms above the linear one, at most */
    @real@ half[2][ARM_TERMS][ARM_TERMS]; /* series of the two halves of a cell */
} arm_tables@suffix@;

static void arm_prepare@suffix@(arm_tables@suffix@ *all)
{
    const @real@ turn = 8 * @atan@(1), step = turn / ARM_SAMPLED, shift = @shift@, width = turn / (2 * ARM_CELLS);
    int i, j, k;
    memset(all, 0, sizeof *all);
    for (i = 0; i < ARM_ANGLES; i++) {
        const @real@ c = @cos@(i * step), s = @sin@(i * step), ch = @cosh@(shift), sh = @sinh@(shift);
        all->turn[0][i] = c * ch;
        all->turn[1][i] = s * sh;
        all->turn[2][i] = s * ch;
        all->turn[3][i] = -c * sh;
        for (k = 0; k <= ARM_DEGREE + ARM_TAIL && i < ARM_SAMPLED; k++) {
            all->along[i][k] = @cos@(i * k % ARM_SAMPLED * step) * @exp@(-k * shift) / ARM_SAMPLED;
            all->across[i][k] = @sin@(i * k % ARM_SAMPLED * step) * @exp@(-k * shift) / ARM_SAMPLED;
        }
    }
    for (k = 0; k <= ARM_DEGREE; k++) {
        @real@ term = k ? 2 : 1;
        for (i = 0; i < ARM_CELLS; i++) {
            all->cosine[k][i] = @cos@(k * ((2 * i + 1) * width - turn / 2));
            all->sine[k][i] = @sin@(k * ((2 * i + 1) * width - turn / 2));
        }
        all->rest[k] = 2 * (@exp@(k * width) - 1 - k * width);
        for (j = 0; j < ARM_TERMS; term *= k * width / ++j)
            (j % 2 ? all->of_imaginary : all->of_real)[k][j] = (j + 1) % 4 < 2 ? term : -term;
    }
    for (i = 0; i < ARM_TERMS; i++)
        for (j = 0; j <= i; j++) {
            @real@ term = 1;
            for (k = 1; k <= j; k++)
                term = term * (i - j + k) / k;
            for (k = 0; k < i; k++)
                term /= 2;
            all->half[0][i][j] = (i - j) % 2 ? -term : term;
            all->half[1][i][j] = term;
        }
}

/* Values of all polynomials of a target. */
static void arm_equations@suffix@(const @real@ *ARM_RESTRICT g, const @real@ (*ARM_RESTRICT turn)[ARM_ANGLES],
    @real@ (*ARM_RESTRICT value)[ARM_ANGLES])
{
    int i;
    for (i = 0; i < @angles@; i++) {
        const @real@ cr = turn[0][i], ci = turn[1][i], sr = turn[2][i], si = turn[3][i];
@equations@
    }
}

/* Series that are monotone in their cells, and have a root there; of which polynomials, and what rounding may add. */
typedef struct {
    @real@ a[ARM_TERMS][ARM_ROOTS], middle[ARM_ROOTS], width[ARM_ROOTS], slack[ARM_ROOTS];
    int which[ARM_ROOTS];
    int count;
} arm_simple@suffix@;

/* A cell's roots, or its halves': 0 if some may be missing; noise counts as one. */
static int arm_cell_roots@suffix@(const arm_tables@suffix@ *all, const @real@ *first, @real@ middle, @real@ width,
    @real@ slack, int which, arm_simple@suffix@ *found)
{
    struct {
        @real@ a[ARM_TERMS], middle, width;
        int halvings;
    } stack[ARM_HALVINGS + 2];
    int depth = 1, decided = 1, i, j, side;
    memcpy(stack[0].a, first, sizeof stack[0].a);
    stack[0].middle = middle;
    stack[0].width = width;
    stack[0].halvings = 0;
    while (depth) {
        const int halvings = stack[--depth].halvings;
        @real@ a[ARM_TERMS], other = 0, slope = 0, even = 0, odd = 0, low, high, wide;
        int single, noise, touches;
        memcpy(a, stack[depth].a, sizeof a);
        middle = stack[depth].middle;
        wide = stack[depth].width;
        if (found->count == ARM_ROOTS)
            return 0;
        for (j = 1; j < ARM_TERMS; j++)
            other += @fabs@(a[j]);
        if (halvings < ARM_HALVINGS && !(@fabs@(a[0]) <= other + slack))
            continue;
        for (j = 2; j < ARM_TERMS; j++)
            slope += j * @fabs@(a[j]);
        for (j = 0; j < ARM_TERMS; j += 2) {
            even += a[j];
            odd += a[j + 1];
        }
        low = even - odd;
        high = even + odd;
        single = @fabs@(a[1]) > slope + ARM_TERMS * slack;
        noise = !single && other <= ARM_TERMS * slack;
        if (halvings == ARM_HALVINGS || noise) {
            decided = 0;
            memset(a, 0, sizeof a); /* the middle counts as a root */
            a[1] = 1;
            single = touches = 1;
        } else
            touches = low * high <= 0 || @fabs@(low) <= slack || @fabs@(high) <= slack;
        if (single && touches) {
            for (j = 0; j < ARM_TERMS; j++)
                found->a[j][found->count] = a[j];
            found->middle[found->count] = middle;
            found->slack[found->count] = slack;
            found->which[found->count] = which;
            found->width[found->count++] = wide;
        }
        for (side = 0; side < 2 && !single; side++, depth++) {
            @real@ *b = stack[depth].a;
            memset(b, 0, sizeof a);
            for (i = 0; i < ARM_TERMS; i++)
                for (j = 0; j < ARM_TERMS; j++)
                    b[j] += a[i] * all->half[side][i][j];
            stack[depth].width = wide / 2;
            stack[depth].middle = middle + (side ? wide : -wide) / 2;
            stack[depth].halvings = halvings + 1;
        }
    }
    return decided;
}

/* Roots of series, by Newton's method; open: also of those polynomials of which rounding may move one by `most`. */
static void arm_zeros@suffix@(arm_simple@suffix@ *found, double most, uint8_t *open, double *root)
{
    int start, i, j, step;
    for (i = found->count; i % ARM_LANES; i++) { /* lanes without a series */
        for (j = 0; j < ARM_TERMS; j++)
            found->a[j][i] = j == 1;
        found->middle[i] = found->width[i] = found->slack[i] = 0;
        found->which[i] = 0;
    }
    for (start = 0; start < found->count; start += ARM_LANES) {
        @real@ x[ARM_LANES] = {0}, slant[ARM_LANES];
        for (step = 0; step < ARM_NEWTON; step++) {
            @real@ value[ARM_LANES], slope[ARM_LANES] = {0};
            memcpy(value, found->a[ARM_TERMS - 1] + start, sizeof value);
            for (j = ARM_TERMS - 2; j >= 0; j--)
                for (i = 0; i < ARM_LANES; i++) {
                    slope[i] = slope[i] * x[i] + value[i];
                    value[i] = value[i] * x[i] + found->a[j][start + i];
                }
            for (i = 0; i < ARM_LANES; i++) {
                x[i] -= value[i] / slope[i];
                x[i] = x[i] > 1 ? 1 : x[i] < -1 ? -1 : x[i];
                slant[i] = slope[i];
            }
        }
        for (i = 0; i < ARM_LANES; i++)
            root[start + i] = (double)(found->middle[start + i] + found->width[start + i] * x[i]);
        for (i = 0; i < ARM_LANES; i++)
            open[found->which[start + i]] |= !(found->slack[start + i] * found->width[start + i] <= most * @fabs@(slant[i]));
    }
}

/* Roots of the polynomials of a target that are open, in no order, behind `count` others: how many there are then. Those
   stay open of which roots may be missing, or moved by `most`. root: room for ARM_ROOTS. */
static int arm_turn_roots@suffix@(const arm_tables@suffix@ *all, const double *frame, double most, uint8_t *open,
    double *root, int count)
{
    @real@ value[2 * ARM_EQUATIONS][ARM_ANGLES], g[12], width = 4 * @atan@(1) / ARM_CELLS;
    double own[ARM_ROOTS];
    uint8_t still[ARM_EQUATIONS] = {0};
    arm_simple@suffix@ found;
    int f, i, j, k;
    for (i = 0; i < 3; i++) /* a rotation to the last digit: half of R (3 - R' R) */
        for (j = 0; j < 3; j++) {
            @real@ sum = 3 * (@real@)frame[3 * i + j];
            for (k = 0; k < 9; k++)
                sum -= (@real@)frame[3 * i + k / 3] * frame[3 * (k % 3) + k / 3] * frame[3 * (k % 3) + j];
            g[3 * i + j] = sum / 2;
            g[9 + i] = frame[9 + i];
        }
    arm_equations@suffix@(g, all->turn, value);
    found.count = 0;
    for (f = 0; f < ARM_EQUATIONS; f++) {
        @real@ re[ARM_ORDERS] = {0}, im[ARM_ORDERS] = {0}, at[ARM_CELLS] = {0}, slope[ARM_CELLS] = {0};
        @real@ tail = 0, total = 0, rest = 0, slack;
        if (!open[f])
            continue;
        for (i = 0; i < ARM_SAMPLED; i++)
            for (k = 0; k < ARM_ORDERS; k++) {
                const @real@ x = value[2 * f][i], y = value[2 * f + 1][i];
                re[k] += x * all->along[i][k] + y * all->across[i][k];
                im[k] += y * all->along[i][k] - x * all->across[i][k];
            }
        for (k = 0; k <= ARM_DEGREE + ARM_TAIL; k++) {
            const @real@ size = @sqrt@(re[k] * re[k] + im[k] * im[k]);
            if (k <= ARM_DEGREE) {
                total += size;
                rest += size * all->rest[k];
            } else
                tail = @fmax@(tail, size * @exp@(k * (@real@)@shift@));
        }
        if (!(total < ARM_INFINITY)) { /* nothing is known of values that are none */
            still[f] = 1;
            continue;
        }
        slack = ARM_SAFE * (2 * ARM_DEGREE + 1) * tail + 10 * @rounding@ * total;
        for (k = 0; k <= ARM_DEGREE; k++) {
            const @real@ twice = k ? 2 : 1, x = twice * re[k], y = twice * im[k];
            for (i = 0; i < ARM_CELLS; i++) {
                at[i] += x * all->cosine[k][i] - y * all->sine[k][i];
                slope[i] += k * width * (x * all->sine[k][i] + y * all->cosine[k][i]);
            }
        }
        for (i = 0; i < ARM_CELLS; i++) {
            @real@ a[ARM_TERMS] = {0};
            if (@fabs@(at[i]) > @fabs@(slope[i]) + rest + slack)
                continue;
            for (k = 0; k <= ARM_DEGREE; k++) {
                const @real@ x = re[k] * all->cosine[k][i] - im[k] * all->sine[k][i];
                const @real@ y = re[k] * all->sine[k][i] + im[k] * all->cosine[k][i];
                for (j = 0; j < ARM_TERMS; j++)
                    a[j] += x * all->of_real[k][j] + y * all->of_imaginary[k][j];
            }
            still[f] |= !arm_cell_roots@suffix@(all, a, (2 * i + 1) * width - 4 * @atan@(1), width, slack, f, &found);
        }
    }
    arm_zeros@suffix@(&found, most, still, own);
    for (i = 0; i < found.count; i++)
        if (!still[found.which[i]] && count < ARM_ROOTS)
            root[count++] = own[i];
    memcpy(open, still, sizeof still);
    open[0] |= count == ARM_ROOTS;
    return count;
}
