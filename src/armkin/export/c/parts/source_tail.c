
const char *const arm_names[ARM_BRANCHES] = {
    @names@};

void arm_fk(const arm_real *q, arm_real *pose)
{
    arm_pose(q, pose, 1);
}

void arm_jacobian(const arm_real *q, arm_real *jacobian)
{
    arm_slope(q, jacobian, 1);
}

void arm_target(const arm_real *q, arm_real *target)
{
    arm_goal(q, target, 1);
}
