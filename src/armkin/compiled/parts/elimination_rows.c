/* What the elimination finds of n targets, edges as they are: branches (n, ARM_BRANCHES, ARM_JOINTS), nan behind the last;
   said: what `arm_candidates` says of each, 2 also where a target is to be read first. */
void arm_rows(int64_t n, const double *target, double *out_q, uint8_t *said)
{
    double goal[ARM_GOAL * ARM_LANES], q[ARM_BRANCHES * ARM_JOINTS * ARM_LANES], miss[ARM_BRANCHES * ARM_LANES];
    int doubt[ARM_LANES], unread[ARM_LANES];
    int64_t start;
    int i, j, b;
    for (start = 0; start < n; start += ARM_LANES) {
        const int count = n - start < ARM_LANES ? (int)(n - start) : ARM_LANES;
        arm_gather(target + start * ARM_TARGET, goal, unread, count);
        arm_candidates(goal, goal, q, miss, doubt, count);
        for (i = 0; i < count; i++) {
            double *row = out_q + (start + i) * ARM_BRANCHES * ARM_JOINTS;
            said[start + i] = (uint8_t)(unread[i] ? 2 : doubt[i]);
            for (b = 0; b < ARM_BRANCHES; b++)
                for (j = 0; j < ARM_JOINTS; j++)
                    row[b * ARM_JOINTS + j]
                        = miss[b * ARM_LANES + i] < ARM_INFINITY ? q[(b * ARM_JOINTS + j) * ARM_LANES + i] : NAN;
        }
    }
}
