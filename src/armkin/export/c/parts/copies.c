/* The copy of a revolute joint's value, whole turns away, that is within limits and nearest; where none is, the value
   itself. *inside is cleared if that is outside. */
ARM_INLINE arm_real arm_copy(arm_real value, arm_real near, arm_real lower, arm_real upper, int *inside)
{
    const arm_real low = lower - ARM_SLACK, high = upper + ARM_SLACK;
    if (lower >= -ARM_PI && upper <= ARM_PI) {
        if (low <= -ARM_PI || high >= ARM_PI) { /* half a turn has two copies, one or both of them legal */
            const arm_real other = value - ARM_COPYSIGN(ARM_TURN, value);
            const int half = ARM_ABS(value) > ARM_PI - ARM_SLACK;
            const int legal = (value >= low) & (value <= high);
            const int better = (other >= low) & (other <= high) & (!legal | (ARM_ABS(other - near) < ARM_ABS(value - near)));
            value = (half & better) ? other : value;
        }
    } else {
        const arm_real moved = value + ARM_TURN * ARM_RINT((near - value) / ARM_TURN);
        const arm_real up = moved + ARM_TURN * ARM_CEIL((low - moved) / ARM_TURN);
        const arm_real down = moved - ARM_TURN * ARM_CEIL((moved - high) / ARM_TURN);
        const arm_real best = moved < low ? up : (moved > high ? down : moved);
        value = ((best >= low) & (best <= high)) ? best : value;
    }
    *inside &= (value >= low) & (value <= high);
    return value;
}
