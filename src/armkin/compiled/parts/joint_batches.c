/* @what@ (n, @size@) of joint values (n, ARM_JOINTS). Returns how many have an angle beyond ARM_WILD, or none at all;
   these are marked. */
int64_t @formula@s(int64_t n, const double *joints, double *out, uint8_t *wild)
{
    double q[ARM_JOINTS * ARM_LANES], found[@size@ * ARM_LANES];
    int64_t start, left = 0;
    int i, j;
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
        @formula@(q, found, count);
        for (i = 0; i < count; i++)
            for (j = 0; j < @size@; j++)
                out[(start + i) * @size@ + j] = found[j * ARM_LANES + i];
    }
    return left;
}
