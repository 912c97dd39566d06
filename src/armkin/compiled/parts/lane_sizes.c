enum { ARM_POINTS = ARM_LANES }; /* lanes of `arm_point` */
#undef ARM_LANES
#define ARM_LANES @lanes@
#define ARM_FARTHEST @farthest@ /* mm: beyond, a target is left to Python first */
enum { ARM_BRANCHES = @branches@, ARM_TARGET = @target@, ARM_GOAL = @goal@ };

