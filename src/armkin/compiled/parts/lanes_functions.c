/* Signs of numbers: -1, 0 or 1; and numbers with the signs of others. */
ARM_INLINE arm_many arm_signs(arm_many a)
{
    return arm_pick((arm_flags)(a > 0), arm_all(1), arm_pick((arm_flags)(a < 0), arm_all(-1), arm_all(0)));
}

ARM_INLINE arm_many arm_signed(arm_many a, arm_many sign)
{
    return (arm_many)(((arm_flags)a & INT64_MAX) | ((arm_flags)sign & INT64_MIN));
}

/* Tangents and cube roots. */
ARM_INLINE arm_many arm_tangents(arm_many a)
{
    arm_many cosine, sine;
    arm_turn_lanes(a, &cosine, &sine);
    return sine / cosine;
}

ARM_INLINE arm_many arm_cube_roots(arm_many a)
{
    int t;
    for (t = 0; t < ARM_MANY; t++)
        a[t] = cbrt(a[t]);
    return a;
}
