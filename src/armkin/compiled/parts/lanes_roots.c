/* As `arm_system_at`. */
static void arm_system_lanes(const arm_pencil *pencil, const arm_many *E, arm_flags lane, arm_many x, arm_many *A)
{
    const int r = pencil->r, w = pencil->w, n = pencil->wide ? 16 : 12, c = n + pencil->size;
    const arm_flags far = (arm_flags)(arm_size(x) > 1);
    const arm_many y = arm_pick(far, 1 / x, x);
    int i, j;
    for (i = 0; i < n; i++) {
        const arm_many *e = E + i * c;
        for (j = 0; j < 2 * r; j++) {
            const arm_many one = arm_take(e[j], lane), none = arm_take(e[n + j], lane);
            A[n * i + j] = arm_pick(far, one, none) + arm_pick(far, none, one) * y;
        }
        for (j = 0; j < w; j++) {
            const arm_many two = arm_take(e[2 * r + j], lane), one = arm_take(e[n + 2 * r + j], lane);
            const arm_many none = arm_take(e[n + 2 * r + w + j], lane);
            A[n * i + 2 * r + j] = (arm_pick(far, none, two) * y + one) * y + arm_pick(far, two, none);
        }
    }
}

/* What n x n matrices take to zero, n numbers: as `arm_null_vector`, by inverse iteration on R^T R of A = Q R. */
static void arm_null_lanes(arm_many *A, int n, arm_many *v)
{
    arm_many size = arm_all(0);
    int i, k;
    arm_triangle_lanes(A, n, n, n);
    for (i = 0; i < n; i++) {
        const arm_many d = A[n * i + i];
        A[n * i + i] = arm_pick((arm_flags)(arm_size(d) > 1e-14), d, arm_all(1e-14));
        v[i] = arm_all(1.0 + 0.37 * i - 0.11 * i * i);
    }
    for (i = 0; i < n; i++) { /* R^T y = v */
        v[i] /= A[n * i + i];
        for (k = i + 1; k < n; k++)
            v[k] -= A[n * i + k] * v[i];
        size = arm_larger(arm_size(v[i]), size);
    }
    for (i = 0; i < n; i++)
        v[i] /= size;
    size = arm_all(0);
    for (i = n - 1; i >= 0; i--) {
        v[i] /= A[n * i + i];
        for (k = 0; k < i; k++)
            v[k] -= A[n * k + i] * v[i];
        size = arm_larger(arm_size(v[i]), size);
    }
    for (i = 0; i < n; i++)
        v[i] /= size;
}

/* As `arm_vector`. */
static void arm_vector_lanes(const arm_pencil *pencil, const arm_many *u, arm_many x, arm_many *v)
{
    const int r = pencil->r, w = pencil->w, p = pencil->wide ? 16 : 12;
    const arm_many scale = arm_pick((arm_flags)(arm_size(x) > 1), x, arm_all(1)) / (1 + x * x);
    int i, j;
    for (i = 0; i < p; i++) {
        v[i] = arm_all(0);
        for (j = 0; j < r; j++) {
            const arm_many a1 = u[j] * scale, a2 = u[r + j] * scale;
            v[i] += (a1 * x + a2) * pencil->K_re[i * r + j] - (a1 - a2 * x) * pencil->K_im[i * r + j];
        }
        for (j = 0; j < w; j++)
            v[i] += pencil->W[i * w + j] * u[2 * r + j];
    }
}

/* (cos 3f, sin 3f, cos f, sin f) of f = q / 2. */
static void arm_half_lanes(arm_many q, arm_many *out)
{
    arm_turn_lanes(1.5 * q, &out[0], &out[1]);
    arm_turn_lanes(0.5 * q, &out[2], &out[3]);
}

/* As `arm_joints_from`, of loops without slides. */
static void arm_joints_lanes(const arm_pencil *pencil, const arm_many *v, const arm_many *Y, const arm_many *recover,
    arm_many x, arm_many *q, arm_many *defect)
{
    const int three = pencil->wide ? 4 : 3, third = 3 - pencil->hidden - pencil->dialytic;
    arm_many middle[3], link[72], a[12], b[12], f[15], m[5], part[6], cosine[3], sine[3], first[4], second[4], row[4];
    arm_many high = arm_all(0), low = arm_all(0), most = arm_all(-1), whole = arm_all(0), along = arm_all(0), sign;
    int i, j, k;
    for (i = 0; i < 4; i++) {
        arm_many size = arm_all(0);
        arm_flags better;
        for (j = 0; j < three; j++)
            size += v[three * i + j] * v[three * i + j];
        whole += size;
        better = (arm_flags)(size > most);
        most = arm_pick(better, size, most);
        for (j = 0; j < three; j++)
            row[j] = i ? arm_pick(better, v[three * i + j], row[j]) : v[j];
    }
    most = arm_all(-1);
    for (j = 0; j < three; j++) {
        arm_many size = arm_all(0);
        arm_flags better;
        for (i = 0; i < 4; i++)
            size += v[three * i + j] * v[three * i + j];
        better = (arm_flags)(size > most);
        most = arm_pick(better, size, most);
        low = arm_pick(better, v[2 * three + j], low);
        high = arm_pick(better, v[3 * three + j], high);
    }
    sign = arm_pick((arm_flags)(row[0] < 0), arm_all(-1), arm_all(1));
    middle[pencil->hidden] = pencil->psi + 2 * arm_angle_lanes(x, arm_all(1));
    middle[pencil->dialytic] = 2 * arm_angle_lanes(high, low);
    middle[third] = pencil->wide ? 2 * arm_angle_lanes(row[3], row[2]) : arm_angle_lanes(sign * row[2], sign * row[1]);
    for (k = 0; k < 3; k++)
        arm_turn_lanes(middle[k], &cosine[k], &sine[k]);
    arm_half_lanes(middle[pencil->dialytic], first);
    if (pencil->wide)
        arm_half_lanes(middle[third], second);
    else {
        second[0] = arm_all(1);
        second[1] = cosine[third];
        second[2] = sine[third];
    }
    for (i = 0; i < 4; i++)
        for (j = 0; j < three; j++)
            along += v[three * i + j] * first[i] * second[j];
    *defect = 1 - along * along / (4 * arm_larger(whole, arm_all(1e-300)));
    for (i = 0; i < 6; i++)
        for (k = 0; k < 12; k++)
            link[12 * i + k] = i == pencil->slot ? Y[k] : arm_all(pencil->links[12 * i + k]);
    for (i = 0; i < 12; i++)
        a[i] = link[12 + i];
    for (k = 0; k < 3; k++) {
        arm_move_lanes(a, cosine[k], sine[k], b);
        arm_times_lanes(b, link + 12 * (2 + k), a);
    }
    arm_features_lanes(a, f);
    for (i = 0; i < 5; i++) {
        m[i] = arm_all(0);
        for (k = 0; k < 15; k++)
            m[i] += recover[15 * i + k] * f[k];
    }
    sign = arm_pick((arm_flags)(m[0] < 0), arm_all(-1), arm_all(1));
    part[0] = arm_angle_lanes(sign * m[4], sign * m[3]);
    part[1] = arm_angle_lanes(sign * m[2], sign * m[1]);
    for (k = 0; k < 2; k++)
        arm_turn_lanes(part[k], &cosine[k], &sine[k]);
    {
        arm_many before[12], step[12], across = arm_all(0);
        arm_move_lanes(link + 60, cosine[0], sine[0], step);
        arm_times_lanes(step, link, before);
        arm_move_lanes(before, cosine[1], sine[1], step);
        along = arm_all(0);
        for (j = 0; j < 3; j++) {
            across += step[j] * a[4 * j + 1] - step[4 + j] * a[4 * j];
            along += step[j] * a[4 * j] + step[4 + j] * a[4 * j + 1];
        }
        part[5] = arm_angle_lanes(across, along);
    }
    for (k = 0; k < 3; k++)
        part[2 + k] = middle[k];
    for (k = 0; k < 6; k++)
        q[pencil->order[k]] = pencil->backward ? -part[k] : part[k];
}

/* As `arm_missing`. */
static arm_many arm_missing_lanes(const arm_many *q, const arm_many *goal, arm_many *frame, arm_many *joints,
    arm_many *error)
{
    arm_many moved[12], cosine, sine, square = arm_all(0);
    int i, j, k;
    for (i = 0; i < 12; i++)
        frame[i] = arm_all(i % 5 == 0 ? 1 : 0);
    for (k = 0; k < 6; k++) {
        for (i = 0; i < 12; i++)
            joints[12 * k + i] = frame[i];
        arm_turn_lanes(q[k], &cosine, &sine);
        arm_move_lanes(frame, cosine, sine, moved);
        if (k < 5)
            arm_link_lanes(moved, arm_loop_links + 12 * k, frame);
    }
    for (i = 0; i < 12; i++) {
        frame[i] = moved[i];
        square += (goal[i] - moved[i]) * (goal[i] - moved[i]);
    }
    for (i = 0; i < 3; i++) {
        const int x = (i + 1) % 3, y = (i + 2) % 3;
        error[i] = goal[4 * i + 3] - frame[4 * i + 3];
        error[3 + i] = arm_all(0);
        for (j = 0; j < 3; j++)
            error[3 + i] += 0.5 * (frame[4 * x + j] * goal[4 * y + j] - frame[4 * y + j] * goal[4 * x + j]);
    }
    return arm_roots(square);
}

/* The inverse of the Jacobian; its norm. */
static arm_many arm_inverse_lanes(const arm_many *frame, const arm_many *joints, arm_many *inverse)
{
    arm_many system[72], norm = arm_all(0);
    int i, j, k;
    for (k = 0; k < 6; k++) {
        const arm_many *f = joints + 12 * k;
        for (i = 0; i < 3; i++) {
            const int x = (i + 1) % 3, y = (i + 2) % 3;
            system[12 * i + k] = f[4 * x + 2] * (frame[4 * y + 3] - f[4 * y + 3])
                - f[4 * y + 2] * (frame[4 * x + 3] - f[4 * x + 3]);
            system[12 * (3 + i) + k] = f[4 * i + 2];
        }
    }
    for (i = 0; i < 6; i++)
        for (j = 0; j < 6; j++)
            system[12 * i + 6 + j] = arm_all(i == j ? 1 : 0);
    arm_triangle_lanes(system, 6, 6, 12);
    arm_solve_lanes(system, 6, 6, 12, 12);
    for (i = 0; i < 6; i++)
        for (j = 0; j < 6; j++) {
            inverse[6 * i + j] = system[12 * i + 6 + j];
            norm += inverse[6 * i + j] * inverse[6 * i + j];
        }
    norm = arm_roots(norm);
    return arm_pick((arm_flags)(norm < ARM_INFINITY), norm, arm_all(ARM_INFINITY));
}

/* As `arm_refine` without damping: the best points met, what they and the first ones miss, how weak the arm is there. */
static void arm_refine_lanes(const arm_many *goal, int steps, arm_many *q, arm_many *residual, arm_many *guess,
    arm_many *weakness)
{
    arm_many at[6], inverse[36], last = arm_all(0);
    arm_flags goes = ~(arm_flags){0};
    int i, j, step;
    for (i = 0; i < 6; i++)
        at[i] = q[i];
    for (i = 0; i < 36; i++)
        inverse[i] = arm_all(0);
    *residual = *weakness = arm_all(ARM_INFINITY);
    for (step = 0; arm_any(goes); step++) {
        arm_many frame[12], joints[72], error[6], move[6], longest = arm_all(0);
        const arm_many size = arm_missing_lanes(at, goal, frame, joints, error);
        const arm_flags better = goes & (arm_flags)(size < *residual);
        arm_flags fresh = goes;
        if (step == 0)
            *guess = size;
        else
            fresh &= (arm_flags)(size > 1e-3 * last) & (arm_flags)(size > 1e-14);
        *residual = arm_pick(better, size, *residual);
        for (i = 0; i < 6; i++)
            q[i] = arm_pick(better, at[i], q[i]);
        if (arm_any(fresh)) {
            arm_many found[36];
            *weakness = arm_pick(fresh, arm_inverse_lanes(frame, joints, found), *weakness);
            for (i = 0; i < 36; i++)
                inverse[i] = arm_pick(fresh, found[i], inverse[i]);
        }
        goes &= (arm_flags)(size > 1e-14);
        if (step >= steps)
            goes &= (arm_flags)(size > 1e-10) & (arm_flags)(size < 1e-3);
        if (step >= steps + 3)
            return;
        last = arm_pick(goes, size, last);
        for (i = 0; i < 6; i++) {
            move[i] = arm_all(0);
            for (j = 0; j < 6; j++)
                move[i] += inverse[6 * i + j] * error[j];
            longest = arm_pick((arm_flags)(arm_size(move[i]) <= longest), longest, arm_size(move[i]));
        }
        goes &= (arm_flags)(longest < ARM_INFINITY);
        longest = arm_pick((arm_flags)(longest > 0.5), 0.5 / longest, arm_all(1));
        for (i = 0; i < 6; i++)
            at[i] = arm_pick(goes, at[i] + move[i] * longest, at[i]);
    }
}
