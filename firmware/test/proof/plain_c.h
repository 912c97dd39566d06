// What Frama-C shall not see of the core's C: asserts that gcc has checked, and `volatile`, for which EVA would take any value at all.
#define _Static_assert(...) struct checked_by_gcc
#define volatile
