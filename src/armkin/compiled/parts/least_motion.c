/* Of several branches of many targets, the one that moves the joints least: as armkin.columns.ik_columns.nearest_branches, to the same
   bits. */
#include <math.h>
#include <stdint.h>

const char arm_content[] = "@content@";

/* n targets, each with so many branches of so many joints, q, of which some are wanted. near, scale: of all joints of all
   branches; away: room for as many; digits: the power of ten to which motions are rounded before they are compared.
   branch: the first of those that move least, -1 where none is wanted; motion: sum of |q - near| / scale. */
void arm_nearest(int64_t n, int64_t branches, int64_t joints, const double *restrict q, const uint8_t *restrict wanted,
    const double *restrict near, const double *restrict scale, double *restrict away, double digits,
    int64_t *restrict branch, double *restrict motion)
{
    int64_t i, b, j, k;
    for (i = 0; i < n; i++, q += branches * joints, wanted += branches) {
        double least = INFINITY;
        branch[i] = -1;
        for (k = 0; k < branches * joints; k++)
            away[k] = fabs(q[k] - near[k]) / scale[k];
        for (b = 0; b < branches; b++) {
            double total = 0, key;
            for (j = 0; j < joints; j++)
                total += away[b * joints + j];
            key = rint(total * digits) / digits;
            if (wanted[b] && key < least) {
                least = key;
                branch[i] = b;
                motion[i] = total;
            }
        }
    }
}
