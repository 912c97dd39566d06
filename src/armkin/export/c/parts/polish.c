/* The chain's last frame and all joints' frames before they move (6 x 12); what is missing to the goal, linear first;
   returns the Frobenius norm of the difference. */
static double arm_missing(const double *q, const double *goal, double *frame, double *joints, double *error)
{
    double moved[12], value[8], cosine[8], sine[8], square = 0;
    int i, j, k;
    for (i = 0; i < 8; i++)
        value[i] = i < 6 ? q[i] : 0;
    arm_turns(value, cosine, sine);
    for (i = 0; i < 12; i++)
        frame[i] = i % 5 == 0 ? 1 : 0;
    for (k = 0; k < 6; k++) {
        for (i = 0; i < 12; i++)
            joints[12 * k + i] = frame[i];
        arm_move(frame, arm_loop_slides[k], q[k], cosine[k], sine[k], moved);
        if (k < 5)
            arm_times(moved, arm_loop_links + 12 * k, frame);
    }
    for (i = 0; i < 12; i++) {
        frame[i] = moved[i];
        square += (goal[i] - moved[i]) * (goal[i] - moved[i]);
    }
    for (i = 0; i < 3; i++) {
        const int x = (i + 1) % 3, y = (i + 2) % 3;
        error[i] = goal[4 * i + 3] - frame[4 * i + 3];
        error[3 + i] = 0;
        for (j = 0; j < 3; j++)
            error[3 + i] += 0.5 * (frame[4 * x + j] * goal[4 * y + j] - frame[4 * y + j] * goal[4 * x + j]);
    }
    return sqrt(square);
}

typedef struct {
    double q[6], residual, guess, weakness, key;
} arm_answer;

/* Newton's method, damped by the residual (Levenberg, Marquardt) if `damped`: the best point met. Undamped it takes three
   steps more on a slow way to an answer. */
static void arm_refine(const double *goal, int steps, int damped, arm_answer *out)
{
    const int most = damped ? steps : steps + 3;
    double q[6], inverse[36], last = 0;
    int i, j, k, step;
    for (i = 0; i < 6; i++)
        q[i] = out->q[i];
    out->residual = out->weakness = ARM_INFINITY;
    for (step = 0; step <= most; step++) {
        double frame[12], joints[72], error[6], move[6], longest = 0;
        const double size = arm_missing(q, goal, frame, joints, error);
        if (step == 0)
            out->guess = size;
        if (size < out->residual) {
            out->residual = size;
            for (i = 0; i < 6; i++)
                out->q[i] = q[i];
        }
        if (step == 0 || (size > 1e-3 * last && size > 1e-14)) {
            double system[96], J[36];
            for (k = 0; k < 6; k++) {
                const double *f = joints + 12 * k;
                for (i = 0; i < 3; i++) {
                    const int x = (i + 1) % 3, y = (i + 2) % 3;
                    const double across = f[4 * x + 2] * (frame[4 * y + 3] - f[4 * y + 3])
                        - f[4 * y + 2] * (frame[4 * x + 3] - f[4 * x + 3]);
                    J[6 * i + k] = arm_loop_slides[k] ? f[4 * i + 2] : across;
                    J[6 * (3 + i) + k] = arm_loop_slides[k] ? 0 : f[4 * i + 2];
                }
            }
            for (i = 0; i < 6; i++)
                for (j = 0; j < 16; j++)
                    system[16 * i + j] = j < 6 ? J[6 * i + j] : (j - 8 == i ? 1 : 0);
            out->weakness = 0;
            if (!arm_reduce(system, 6, 8, 16)) {
                out->weakness = ARM_INFINITY;
                return;
            }
            for (i = 0; i < 6; i++)
                for (j = 0; j < 6; j++) {
                    inverse[6 * i + j] = system[16 * i + 8 + j];
                    out->weakness += inverse[6 * i + j] * inverse[6 * i + j];
                }
            out->weakness = sqrt(out->weakness);
            if (damped && step < steps - 2) {
                const double damping = size * (size < 1 ? size : 1);
                for (i = 0; i < 6; i++)
                    for (j = 0; j < 16; j++) {
                        double sum = i == j ? damping : 0;
                        for (k = 0; k < 6 && j < 6; k++)
                            sum += J[6 * k + i] * J[6 * k + j];
                        system[16 * i + j] = j < 8 || j > 13 ? sum : J[6 * (j - 8) + i];
                    }
                if (!arm_reduce(system, 6, 8, 16))
                    return;
                for (i = 0; i < 6; i++)
                    for (j = 0; j < 6; j++)
                        inverse[6 * i + j] = system[16 * i + 8 + j];
            }
        }
        if (!(size > 1e-14) || step == most || (step >= steps && !(size > 1e-10 && size < 1e-3)))
            return;
        last = size;
        for (i = 0; i < 6; i++) {
            move[i] = 0;
            for (j = 0; j < 6; j++)
                move[i] += inverse[6 * i + j] * error[j];
            longest = !(fabs(move[i]) <= longest) ? fabs(move[i]) : longest;
        }
        if (!(longest < ARM_INFINITY))
            return;
        for (i = 0; i < 6; i++)
            q[i] += longest > 0.5 ? move[i] * (0.5 / longest) : move[i];
    }
}

/* Turns in (-pi, pi], and the number by which answers are sorted. */
static void arm_sortable(arm_answer *answer)
{
    double value[8] = {0, 0, 0, 0, 0, 0, 0, 0}, cosine[8], sine[8];
    int k;
    for (k = 0; k < 6; k++) {
        double *q = &answer->q[k];
        if (!arm_loop_slides[k])
            *q -= ARM_TURN * floor((*q + ARM_PI) / ARM_TURN);
        value[k] = *q;
    }
    arm_turns(value, cosine, sine);
    answer->key = 0;
    for (k = 0; k < 6; k++) {
        answer->key += arm_weights[k] * (arm_loop_slides[k] ? value[k] : cosine[k]);
        answer->key += arm_weights[6 + k] * (arm_loop_slides[k] ? 0 : sine[k]);
    }
}
