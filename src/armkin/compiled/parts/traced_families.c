#ifdef ARM_MANY
/* Room for the work on one target. */
typedef struct {
    arm_curves curves;
    arm_joining joining;
    arm_tracing tracing;
    arm_start start[ARM_STARTS];
    arm_pieces pieces;
} arm_work;

/* The pieces of a target; with answers that no curve passes, its curves anew from these. */
static void arm_solve_target(arm_work *work, const double *held, int64_t held_step, int answers, uint8_t *small)
{
    arm_curves *f = &work->curves;
    int round;
    f->postures = f->lost = 0;
    for (round = 0; round < 2; round++) {
        arm_join_curves(f, &work->joining, &work->tracing, work->start);
        if (!f->lost)
            arm_chain(f, &work->pieces);
        if (f->lost)
            return;
        *small = (uint8_t)arm_sample_curves(f, &work->pieces);
        if (round || !arm_answers_off_curves(f, &work->pieces, held, held_step, answers))
            break;
    }
    if (!f->lost)
        arm_find_pieces(f, &work->pieces);
}
#endif

/* The size of the memory that `arm_families` works in. */
int64_t arm_work_bytes(void)
{
#ifdef ARM_MANY
    return (int64_t)sizeof(arm_work);
#else
    return 0;
#endif
}

/* Families of n targets by tracing, near each (n, ARM_JOINTS); held: answers (values, n, answers, ARM_JOINTS - 1) with
   another joint held. Pieces, target after target: which curve of it, whether legal, the ends a and b, and the posture
   nearest to near. counts: pieces of each target, -1 where it is left to Python as something is odd or `room` is used
   up; small: whether no joint moves far along any curve. memory: of `arm_work_bytes`. */
void arm_families(int64_t n, const double *target, const double *near, const double *held, int64_t answers, int64_t room,
    int64_t *curve, uint8_t *legal, double *ends, double *nearest, int64_t *counts, uint8_t *small, void *memory)
{
    int64_t k, at = 0;
#ifdef ARM_MANY
    arm_work *work = memory;
    const int64_t step = answers * (ARM_JOINTS - 1);
    for (k = 0; k < n; k++) {
        double goal[12];
        int i, j;
        for (j = 0; j < 4; j++)
            for (i = 0; i < 3; i++)
                goal[3 * j + i] = target[16 * k + 4 * i + j];
        work->curves.goal = goal;
        work->curves.near = near + k * ARM_JOINTS;
        small[k] = 0;
        arm_solve_target(work, held + k * step, n * step, (int)answers, small + k);
        counts[k] = work->curves.lost || at + work->pieces.pieces > room ? -1 : work->pieces.pieces;
        for (i = 0; i < counts[k]; i++, at++) {
            const arm_piece *piece = &work->pieces.piece[i];
            curve[at] = piece->curve;
            legal[at] = (uint8_t)piece->legal;
            ends[2 * at] = piece->a;
            ends[2 * at + 1] = piece->b;
            memcpy(nearest + at * ARM_JOINTS, work->pieces.nearest[i], ARM_JOINTS * sizeof *nearest);
        }
    }
#else
    for (k = 0; k < n; k++)
        counts[k] = -1;
    (void)at; /* without lanes all are left to Python */
#endif
}
