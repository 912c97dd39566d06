#define ARM_FARTHEST @farthest@ /* mm: beyond, a target is left to Python first */
enum { ARM_BRANCHES = @branches@, ARM_TARGET = @target@, ARM_GOAL = @goal@ };

