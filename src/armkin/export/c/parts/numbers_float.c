/* Numbers and functions of single precision. */
#define ARM_PI 3.1415927f
#define ARM_TURN 6.2831853f
#define ARM_SLACK 1e-5f /* rad or mm: a joint this far outside still counts as on its limit */
#define ARM_EQUAL 5e-4f /* degrees or mm: motions that differ by less are equal */
#define ARM_INFINITY INFINITY
#define ARM_SQRT(x) sqrtf(x)
#define ARM_CBRT(x) cbrtf(x)
#define ARM_RINT(x) floorf((x) + 0.5f)
#define ARM_FLOOR(x) floorf(x)
#define ARM_CEIL(x) ceilf(x)
#define ARM_COPYSIGN(x, y) copysignf(x, y)
#define ARM_ABS(x) fabsf(x)
#define ARM_COS(x) cosf(x)
#define ARM_SIN(x) sinf(x)
#define ARM_TAN(x) tanf(x)
#define ARM_ATAN2(y, x) atan2f(y, x)
