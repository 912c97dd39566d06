/* Whether limits leave half a turn on either side of every `near`: 0 if not, 2 if that is zero as well, so that what an
   arctangent gives is the nearest copy already but for the sign of half a turn, else 1. */
ARM_INLINE int arm_wide(const double *near, double lower, double upper, int count)
{
    int i, wide = 1, zero = 1;
    for (i = 0; i < count; i++) {
        wide &= (near[i] - ARM_PI >= lower) & (near[i] + ARM_PI <= upper);
        zero &= near[i] == 0.0;
    }
    return wide ? wide + zero : 0;
}
