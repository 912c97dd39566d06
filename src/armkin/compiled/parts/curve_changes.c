/* Where, between samples, curves cross a limit or the redundant joint turns back. */

/* Margins of postures on ways, or slopes of their redundant joint. */
ARM_INLINE arm_many arm_way_value(const arm_ways *ways, arm_many u, int slope)
{
    return slope ? arm_way_slope(ways, u, ARM_REDUNDANT) : arm_margin(ways, u);
}

/* Where these change their sign between lo and the next part: regula falsi, the Illinois way. */
static arm_many arm_find_roots(const arm_ways *ways, arm_many lo, int slope)
{
    arm_many hi = lo + 1.0 / ARM_PARTS, share = 0.5 * (lo + hi), side = arm_all(0);
    arm_many at_lo = arm_way_value(ways, lo, slope), at_hi = arm_way_value(ways, hi, slope);
    int k;
    for (k = 0; k < ARM_SECANTS; k++) {
        const arm_flags equal = (arm_flags)(at_hi == at_lo);
        const arm_many difference = arm_pick(equal, arm_all(1), at_hi - at_lo);
        arm_many middle;
        arm_flags low;
        share = arm_pick(equal, 0.5 * (lo + hi), (lo * at_hi - hi * at_lo) / difference);
        share = arm_less(arm_larger(share, lo), hi);
        middle = arm_way_value(ways, share, slope);
        low = ~((arm_flags)(middle >= 0) ^ (arm_flags)(at_lo >= 0));
        at_hi = arm_pick(low, arm_pick((arm_flags)(side > 0), 0.5 * at_hi, at_hi), middle);
        at_lo = arm_pick(low, middle, arm_pick((arm_flags)(side < 0), 0.5 * at_lo, at_lo));
        lo = arm_pick(low, share, lo);
        hi = arm_pick(low, hi, share);
        side = arm_pick(low, arm_all(1), arm_all(-1));
    }
    return share;
}

/* Points of curves at shares u of ways, whose tangents there are `tangent` if a way has no length. */
static void arm_between(const double *goal, const arm_ways *ways, const arm_many *tangent, arm_many u, double tolerance,
    arm_points *points)
{
    const arm_flags still = (arm_flags)(arm_dot(ways->chord, ways->chord) == 0);
    int j;
    arm_on_ways(ways, u, points->q);
    for (j = 0; j < ARM_JOINTS; j++)
        points->tangent[j] = arm_pick(still, tangent[j], ways->chord[j]);
    arm_onto_curves(goal, points, tolerance, ARM_NEWTON, 0);
}

/* Postures in which a limit is crossed at shares u of ways: its joint is held on it. */
static void arm_cross_limits(const double *goal, const arm_ways *ways, const arm_many *tangent, arm_many u, arm_many *q)
{
    arm_points points, touching;
    arm_many room = arm_all(ARM_INFINITY), guess[ARM_JOINTS], offset, drift = arm_all(0);
    arm_flags valid;
    int j;
    arm_on_ways(ways, u, guess);
    for (j = 0; j < ARM_JOINTS; j++) {
        points.q[j] = guess[j];
        points.tangent[j] = arm_all(0);
        if (arm_stops(j))
            room = arm_less(room, arm_room_of(guess[j], j, &offset));
    }
    for (j = 0; j < ARM_JOINTS; j++)
        if (arm_stops(j)) {
            const arm_many own = arm_room_of(guess[j], j, &offset);
            const arm_flags least = (arm_flags)(own == room);
            points.tangent[j] = arm_pick(least, arm_all(1), arm_all(0));
            points.q[j] += arm_pick(least, arm_pick((arm_flags)(offset < 0), -own, own), arm_all(0));
            guess[j] = points.q[j];
            room = arm_pick(least, arm_all(-ARM_INFINITY), room); /* the first one alone */
        }
    arm_onto_curves(goal, &points, ARM_PAIR_STEP, ARM_NEWTON, 0);
    for (j = 0; j < ARM_JOINTS; j++)
        drift = arm_larger(drift, arm_size(points.q[j] - guess[j]));
    valid = (arm_flags)(points.step < ARM_PAIR_STEP) & (arm_flags)(drift < ARM_REACH);
    if (arm_any(~valid)) /* the joint touches its limit alone */
        arm_between(goal, ways, tangent, u, ARM_PAIR_STEP, &touching);
    for (j = 0; j < ARM_JOINTS; j++)
        q[j] = arm_any(~valid) ? arm_pick(valid, points.q[j], touching.q[j]) : points.q[j];
}

/* Postures in which the redundant joint turns back at about shares u of ways: by steps along the tangents. */
static void arm_turn_back(const double *goal, const arm_ways *ways, const arm_many *tangent, arm_many u, arm_many *q)
{
    const arm_many size = arm_larger(arm_roots(arm_dot(ways->begin, ways->begin)), arm_all(ARM_TINY));
    arm_many bend = arm_way_slope(ways, u + ARM_WAY, ARM_REDUNDANT) - arm_way_slope(ways, u - ARM_WAY, ARM_REDUNDANT);
    arm_points end;
    int j, k;
    bend /= 2 * ARM_WAY * arm_larger(size * size, arm_all(ARM_TINY));
    arm_between(goal, ways, tangent, u, ARM_PAIR_STEP, &end);
    for (k = 0; k < ARM_TURNS; k++) {
        const arm_many slope = end.tangent[ARM_REDUNDANT];
        const arm_flags bent = (arm_flags)(arm_size(bend) > ARM_TINY);
        arm_many step = arm_pick(bent, -slope / arm_pick(bent, bend, arm_all(1)), arm_all(0));
        arm_flags moved;
        step = arm_less(arm_larger(step, -ARM_REACH * size), ARM_REACH * size);
        moved = (arm_flags)(arm_size(step) > ARM_PAIR_STEP); /* of a shorter one the bend would be rounding */
        if (!arm_any(moved))
            break;
        for (j = 0; j < ARM_JOINTS; j++)
            end.q[j] += arm_pick(moved, step * end.tangent[j], arm_all(0));
        arm_onto_curves(goal, &end, ARM_PAIR_STEP, ARM_NEWTON, 0);
        bend = arm_pick(moved, (end.tangent[ARM_REDUNDANT] - slope) / arm_pick(moved, step, arm_all(1)), bend);
    }
    memcpy(q, end.q, sizeof end.q);
}

/* Changes of one kind, exactly. */
static void arm_settle_changes(const arm_curves *f, arm_pieces *w, const int *change, int count, int turns)
{
    int begin, i;
    for (begin = 0; begin < count; begin += ARM_MANY) {
        const int number = arm_few(count - begin);
        arm_ways ways;
        arm_many tangent[ARM_JOINTS], u, q[ARM_JOINTS];
        for (i = 0; i < ARM_MANY; i++) {
            const arm_sample *one = &w->sample[w->change[change[begin + (i < number ? i : 0)]].sample];
            arm_put_way(&w->way[one->point], &ways, i);
            arm_put(w->tangent[one->point], tangent, i);
            u[i] = one->share;
        }
        u = arm_find_roots(&ways, u, turns);
        if (turns)
            arm_turn_back(f->goal, &ways, tangent, u, q);
        else
            arm_cross_limits(f->goal, &ways, tangent, u, q);
        for (i = 0; i < number; i++) {
            arm_get(q, w->change[change[begin + i]].q, i);
            w->change[change[begin + i]].share = u[i];
        }
    }
}

/* Where between samples a limit is crossed or the joint turns back. */
static void arm_find_changes(arm_curves *f, arm_pieces *w)
{
    int crossing[ARM_CHANGES], turn[ARM_CHANGES], crossings = 0, turns = 0, curve, k, kind;
    w->changes = 0;
    for (curve = 0; curve < w->curves; curve++)
        for (k = ARM_PARTS * w->first[curve]; k < ARM_PARTS * w->first[curve + 1]; k++) {
            const arm_sample *one = &w->sample[k];
            const arm_sample *next
                = (k + 1) % ARM_PARTS ? one + 1 : &w->sample[ARM_PARTS * arm_after(w, curve, one->point)];
            for (kind = 0; kind < 2; kind++) {
                w->change_at[k][kind] = -1;
                if (one->behind == ARM_END || (kind ? one->up == next->up : one->inside == next->inside))
                    continue;
                if (w->changes == ARM_CHANGES) {
                    f->lost = 1;
                    return;
                }
                w->change[w->changes].sample = k;
                w->change[w->changes].turns = kind;
                *(kind ? &turn[turns++] : &crossing[crossings++]) = w->changes;
                w->change_at[k][kind] = w->changes++;
            }
        }
    arm_settle_changes(f, w, crossing, crossings, 0);
    arm_settle_changes(f, w, turn, turns, 1);
}
