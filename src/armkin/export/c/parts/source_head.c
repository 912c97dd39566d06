/* @about@ */
#include "@stem@.h"

#include <math.h>

#define ARM_LANES 1
#define ARM_INLINE static
#define ARM_RESTRICT restrict
#define ARM_GOAL @goal@ /* numbers of a target as the formulas take them */

