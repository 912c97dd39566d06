/* @about@ */
#include <math.h>
#include <stdint.h>
#include <string.h>

/* poses worked on at once: vectors of the compiler's choice, and blocks that stay in the cache */
#define ARM_LANES 16
#define ARM_INLINE static inline __attribute__((always_inline))
#define ARM_RESTRICT restrict
#define ARM_SELDOM __attribute__((cold, noinline)) /* small rather than fast: optimising it would take seconds */
#if defined __AVX512F__
#define ARM_MANY 8 /* numbers that one instruction takes, where compilers (GCC, Clang) have vectors as types */
#elif defined __AVX2__ || defined __clang__
#define ARM_MANY 4
#elif defined __GNUC__ && defined __aarch64__
#define ARM_MANY 2
#endif
#define ARM_ROUNDED 1e-14 /* a rotation this far from orthonormal is taken as it is: `armkin.inverse.tasks` */
#define ARM_WILD 1e5 /* rad: beyond, angles are left to Python, whose functions reduce them exactly */

typedef double arm_real;
enum { ARM_JOINTS = @joints@ };

const char arm_content[] = "@content@";

