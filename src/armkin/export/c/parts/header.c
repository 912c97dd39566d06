/* @about@ */
#ifndef @guard@
#define @guard@

#ifdef __cplusplus
extern "C" {
#endif

typedef @real@ arm_real;

enum { ARM_JOINTS = @joints@, ARM_BRANCHES = @branches@, ARM_TARGET = @target@ };

/* Joint values q: @joints_are@. */
typedef struct {
    arm_real q[ARM_JOINTS]; /* the copy nearest to `near` that is within limits, whole turns apart */
    int branch;             /* index into arm_names */
    int within_limits;
    arm_real residual;      /* what the branch misses: lengths in reaches of the arm, and rad */
} arm_solution;

extern const char *const arm_names[ARM_BRANCHES];

/* The tool's pose, 4 x 4 row by row. */
void arm_fk(const arm_real *q, arm_real *pose);

/* The geometric Jacobian in the base's axes, 6 x ARM_JOINTS row by row, linear rows first. */
void arm_jacobian(const arm_real *q, arm_real *jacobian);

/* The target that joint values answer, as arm_ik takes it. */
void arm_target(const arm_real *q, arm_real *target);

/* All branches that reach a target, at most ARM_BRANCHES. target: @target_is@.
   near: joint values to stay close to, finite; where they are within limits and solve the target themselves, they are one
   of the branches. found: room for ARM_BRANCHES.
   edge: set to 1 for a target at a singular posture or on the boundary of what a branch reaches, else to 0. At an edge
   joints that are free take their values from near, where that reaches; branches that merge are one. What is listed is
   true, but others may be missing: none found at an edge does not say that the target is out of reach.
   Returns how many were found, -1 if the target is none (not finite, no rotation). No function here keeps anything
   between calls: threads and interrupts may share them. No pointer may be null. */
int arm_ik(const arm_real *target, const arm_real *near, arm_solution *found, int *edge);

/* Index of the branch within limits that moves the joints least from near, or -1. */
int arm_best(const arm_solution *found, int count, const arm_real *near);
@keep_outs@
#ifdef __cplusplus
}
#endif

#endif
