/* Numbers and functions of double precision. */
#define ARM_PI 3.141592653589793
#define ARM_TURN 6.283185307179586
#define ARM_SLACK 1e-9 /* rad or mm: a joint this far outside still counts as on its limit */
#define ARM_EQUAL 5e-7 /* degrees or mm: motions that differ by less are equal */
#define ARM_INFINITY ((double)INFINITY)
#define ARM_SQRT(x) sqrt(x)
#define ARM_CBRT(x) cbrt(x)
#define ARM_RINT(x) rint(x)
#define ARM_FLOOR(x) floor(x)
#define ARM_CEIL(x) ceil(x)
#define ARM_COPYSIGN(x, y) copysign(x, y)
#define ARM_ABS(x) fabs(x)
#define ARM_COS(x) cos(x)
#define ARM_SIN(x) sin(x)
#ifndef ARM_TAN
#define ARM_TAN(x) tan(x)
#define ARM_ATAN2(y, x) atan2(y, x)
#endif
