/* A value in [-pi, pi]; half a turn, which has two, as the positive one. */
ARM_INLINE arm_real arm_principal(arm_real value)
{
    return value < ARM_SLACK - ARM_PI ? value + ARM_TURN : value;
}

/* The copy of a value nearest to `near`; of two that are half a turn from it, to within the slack, the one above it. */
ARM_INLINE arm_real arm_nearest(arm_real value, arm_real near)
{
    return value + ARM_TURN * ARM_FLOOR((near + (ARM_PI + ARM_SLACK) - value) / ARM_TURN);
}

/* The copy of a revolute joint's value, whole turns away, that is within limits and nearest; where none is, the value
   itself. *inside is cleared if that is outside. */
ARM_INLINE arm_real arm_copy(arm_real value, arm_real near, arm_real lower, arm_real upper, int *inside)
{
    const arm_real low = lower - ARM_SLACK, high = upper + ARM_SLACK;
    const arm_real principal = arm_principal(value);
    if (lower >= -ARM_PI && upper <= ARM_PI) {
        value = principal;
        if (low <= -ARM_PI || high >= ARM_PI) { /* half a turn has two copies, one or both of them legal */
            const arm_real other = value - ARM_TURN;
            const int half = value > ARM_PI - ARM_SLACK;
            const int illegal = (value < low) | (value > high);
            const int nearer = ARM_ABS(other - near) < ARM_ABS(value - near) - ARM_SLACK;
            const int better = (other >= low) & (other <= high) & (illegal | nearer);
            value = (half & better) ? other : value;
        }
    } else {
        const arm_real moved = arm_nearest(value, near);
        const arm_real up = moved + ARM_TURN * ARM_CEIL((low - moved) / ARM_TURN);
        const arm_real down = moved - ARM_TURN * ARM_CEIL((moved - high) / ARM_TURN);
        const arm_real best = moved < low ? up : (moved > high ? down : moved);
        value = ((best >= low) & (best <= high)) ? best : principal;
    }
    *inside &= (value >= low) & (value <= high);
    return value;
}
