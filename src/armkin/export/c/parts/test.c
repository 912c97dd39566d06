/* @about@
   A test of what was generated, with values from armkin: returns how many postures fail. */
#include "@stem@.h"

#include <math.h>
#include <stdio.h>

enum { POSTURES = @postures@ };
static const arm_real joints[POSTURES][ARM_JOINTS] = {
    @golden_joints@};
static const arm_real poses[POSTURES][16] = {
    @golden_poses@};
static const arm_real targets[POSTURES][ARM_TARGET] = {
    @golden_targets@};
static const int counts[POSTURES] = {@golden_counts@};
/* all branches of the postures, one after the other, and which they are */
static const arm_real branches[@rows@][ARM_JOINTS] = {
    @golden_branches@};
static const int indices[@rows@] = {@golden_indices@};

static int close_to(arm_real value, arm_real wanted, arm_real tolerance)
{
    const double off = (double)value - (double)wanted;
    return off <= (double)tolerance && off >= -(double)tolerance;
}

int main(void)
{
    const arm_real length = @length@, angle = @angle@;
    static const arm_real home[ARM_JOINTS] = {@home@};
    static const int slides[ARM_JOINTS] = {@slides@};
    static const arm_real turns[ARM_JOINTS] = {@turns@}; /* square of a joint's turn per commanded turn, 0: it slides */
    arm_solution found[ARM_BRANCHES];
    static const int lengths[ARM_TARGET] = {@lengths@}; /* which numbers of a target are mm */
    arm_real pose[16], target[ARM_TARGET], jacobian[6 * ARM_JOINTS];
    int i, j, b, k, row = 0, failed = 0;
    for (i = 0; i < POSTURES; i++) {
        int edge, count, good = 1;
        arm_fk(joints[i], pose);
        for (k = 0; k < 16; k++)
            good &= close_to(pose[k], poses[i][k], k % 4 == 3 ? length : angle);
        arm_target(joints[i], target);
        for (k = 0; k < ARM_TARGET; k++)
            good &= close_to(target[k], targets[i][k], lengths[k] ? length : angle);
        arm_jacobian(joints[i], jacobian);
        for (j = 0; j < ARM_JOINTS; j++) { /* the last rows: the axis of a joint that turns */
            const double x = (double)jacobian[3 * ARM_JOINTS + j], y = (double)jacobian[4 * ARM_JOINTS + j];
            const double z = (double)jacobian[5 * ARM_JOINTS + j];
            good &= close_to((arm_real)(x * x + y * y + z * z), turns[j], angle);
        }
        count = arm_ik(targets[i], home, found, &edge);
        good &= count == counts[i];
        for (b = 0; b < counts[i]; b++, row++) {
            int same = 0;
            for (k = 0; k < count; k++) {
                int all = indices[row] < 0 || found[k].branch == indices[row];
                for (j = 0; j < ARM_JOINTS; j++)
                    all &= close_to(found[k].q[j], branches[row][j], slides[j] ? length : angle);
                same |= all;
            }
            good &= same;
        }
        if (!good)
            printf("posture %d: not what armkin says (%d branches, %d expected)\n", i, count, counts[i]);
        failed += !good;
    }
    printf("%d postures, %d failed\n", POSTURES, failed);
    return failed;
}
