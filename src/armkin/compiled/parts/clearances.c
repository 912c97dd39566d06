/* Least clearances (n,) of joint values (n, ARM_JOINTS), and their pairs. Returns how many have an angle beyond ARM_WILD,
   or none at all; these are marked. */
int64_t arm_clearances(int64_t n, const double *joints, double *out, int32_t *pairs, uint8_t *wild)
{
    double q[ARM_JOINTS * ARM_LANES], found[6 * ARM_SEGMENTS * ARM_LANES], ends[6 * ARM_SEGMENTS];
    int64_t start, left = 0;
    int i, j, pair;
    for (start = 0; start < n; start += ARM_LANES) {
        const int count = n - start < ARM_LANES ? (int)(n - start) : ARM_LANES;
        for (i = 0; i < count; i++) {
            uint8_t far = 0;
            for (j = 0; j < ARM_JOINTS; j++) {
                q[j * ARM_LANES + i] = joints[(start + i) * ARM_JOINTS + j];
                far |= !(fabs(q[j * ARM_LANES + i]) <= ARM_WILD);
            }
            wild[start + i] = far;
            left += far;
        }
        arm_ends(q, found, count);
        for (i = 0; i < count; i++) {
            for (j = 0; j < 6 * ARM_SEGMENTS; j++)
                ends[j] = found[j * ARM_LANES + i];
            out[start + i] = arm_least(ends, &pair);
            pairs[start + i] = pair;
        }
    }
    return left;
}
