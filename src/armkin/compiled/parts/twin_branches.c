/* Whether a posture may keep its target a quarter of the way to another, each joint at a constant pace, those that turn by about
   half a turn either way: `_moves_straight` in Python. slack: how much it may miss there. */
ARM_SELDOM static int arm_straight(const double *goal, const double *from, const double *way, double slack)
{
    static const double unit[ARM_JOINTS] = {@unit@};
    static const int slides[ARM_JOINTS] = {@slides@};
    double at[ARM_JOINTS * ARM_POINTS], T[16 * ARM_POINTS], r[ARM_JOINTS];
    int j, flips;
    for (flips = 0; flips < 1 << ARM_JOINTS; flips++) {
        double miss = 0.0;
        for (j = 0; j < ARM_JOINTS; j++) {
            const int flip = (flips >> j) & 1;
            if (flip && (slides[j] || 0.5 * ARM_TURN - fabs(way[j]) > @wide@))
                break;
            at[j * ARM_POINTS] = from[j * ARM_POINTS] + 0.25 * (way[j] - (flip ? copysign(ARM_TURN, way[j]) : 0.0)) * unit[j];
        }
        if (j < ARM_JOINTS)
            continue;
        arm_pose(at, T, 1);
        arm_residual(T, goal, at, r);
        for (j = 0; j < ARM_JOINTS; j++)
            miss += r[j] * r[j];
        if (!(sqrt(miss) > slack))
            return 1;
    }
    return 0;
}

/* Whether a branch off a self-motion may be one with it, or a part of it, for `drop_contained` and `drop_twins` in Python. */
ARM_SELDOM static int arm_doubted(const double *goal, const double *from, const double *way, const arm_branch *motion,
    const arm_branch *other)
{
    double held = 0.0;
    int j, moving = 0, differing = 0, alike = 1, more = 0;
    for (j = 0; j < ARM_JOINTS; j++) {
        moving += motion->moves[j], differing += fabs(way[j]) > @turned@;
        held = fmax(held, motion->moves[j] ? 0.0 : fabs(way[j]));
        alike &= !motion->moves[j] || other->moves[j], more |= other->moves[j] && !motion->moves[j];
    }
    if (!other->motion)
        return other->weak && other->sigma < @high@ && moving <= ARM_JOINTS / 2 && held < @close_by@;
    if (motion->sigma < @solution@ && alike && more)
        return 1;
    if (motion->partial && held < 3.0 * @turned@ && other->sigma < @solution@) /* `_on_motion` in Python goes round it */
        return 1;
    if (!motion->partial || !other->partial || held > @drift@)
        return 0;
    if (held > @turned@) /* Python follows a circuit, which bends */
        return arm_straight(goal, from, way, @drift@);
    return differing <= @along@ && arm_straight(goal, from, way, 100.0 * @turned@);
}

/* Which branch is on the component of each of some: twin, -1 where there is none. 0 if that is left open. */
ARM_SELDOM static int arm_twins(const double *goal, const arm_branch *one, const double *at, int count, int *twin)
{
    double way[ARM_JOINTS];
    int a, b, j;
    for (a = 0; a < count; a++)
        for (twin[a] = -1, b = 0; b < count; b++) {
            const double away = arm_way(at + b, at + a, way);
            if (a == b || (!one[a].weak && !(away < @close_by@)))
                continue;
            if (away < @close_by@ && (!one[a].weak || !one[b].weak))
                return 0;
            if (one[a].on[b] || arm_member(one + a, way)) {
                if (twin[a] >= 0)
                    return 0;
                twin[a] = b;
            } else if (one[a].motion && arm_doubted(goal, at + a, way, one + a, one + b))
                return 0;
        }
    for (a = 0; a < count; a++)
        if ((b = twin[a]) >= 0) {
            int alike = twin[b] == a && one[a].turns == one[b].turns && one[a].motion == one[b].motion;
            for (j = 0; alike && one[a].motion && j < ARM_JOINTS; j++)
                alike = one[a].moves[j] == one[b].moves[j];
            if (!alike)
                return 0;
        }
    return 1;
}
