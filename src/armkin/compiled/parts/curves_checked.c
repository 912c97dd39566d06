/* Whether answers with another joint held, of which every small closed curve has one, are on curves that are known. */

/* Postures in which curves have joint ARM_OTHER at a value: at most `room`; -1 where there are more. */
static int arm_crossings(const arm_pieces *w, double value, double crossing[][ARM_WIDTH], int room)
{
    int count = 0, j, k, point;
    for (point = 0; point < w->first[w->curves]; point++) {
        const arm_way *way = &w->way[point];
        const double gap = arm_wrap(way->q[ARM_OTHER] - value), change = way->chord[ARM_OTHER];
        double u;
        if (!(gap * (gap + change) <= 0) || change == 0)
            continue;
        if (count == room)
            return -1;
        for (u = -gap / change, k = 0; k <= ARM_CROSSING_SECANTS; k++) {
            for (j = 0; j < ARM_JOINTS; j++)
                crossing[count][j] = way->q[j] + way->chord[j] * (u * u * (3 - 2 * u))
                    + (way->begin[j] * (1 - u) - way->end[j] * u) * (u * (1 - u));
            u -= arm_wrap(crossing[count][ARM_OTHER] - value) / change;
            u = u < 0 ? 0 : u > 1 ? 1 : u;
        }
        count++;
    }
    return count;
}

/* The answers of a target, with joint ARM_OTHER held at each value (ARM_HELD, answers, ARM_JOINTS - 1; nan behind the
   last), that are on no curve become `postures`: how many. */
static int arm_answers_off_curves(arm_curves *f, const arm_pieces *w, const double *held, int64_t held_step, int answers)
{
    static const double value[] = {@values@};
    double crossing[ARM_CURVES][ARM_WIDTH];
    int begin = f->postures = 0, i, j, k, v, count;
    for (v = 0; v < (int)(sizeof value / sizeof *value); v++, held += held_step) {
        count = arm_crossings(w, value[v], crossing, ARM_CURVES);
        if (count < 0) {
            f->lost = 1;
            return 0;
        }
        for (i = 0; i < answers; i++) {
            const double *other = held + i * (ARM_JOINTS - 1);
            double q[ARM_WIDTH] = {0};
            if (!(other[0] == other[0]))
                continue;
            for (j = 0; j < ARM_JOINTS; j++)
                q[j] = j == ARM_OTHER ? value[v] : other[j - (j > ARM_OTHER)];
            for (k = 0; k < count && !(arm_distance(q, crossing[k]) < ARM_ON_CURVE); k++)
                ;
            if (k < count)
                continue;
            if (f->postures == ARM_EXTRA) {
                f->lost = 1;
                return 0;
            }
            memcpy(f->posture[f->postures++], q, sizeof q);
        }
    }
    return f->postures - begin;
}
