#include "chance.h"

static uint64_t state = 1;

void chance_seed(uint64_t seed) {
    state = seed;
}

uint32_t rnd(uint32_t below) {  // xorshift: rand() is slow
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return (state >> 16) % below;
}

int32_t between(int32_t low, int32_t high) {
    return low + (int32_t)rnd((uint32_t)(high - low) + 1);
}
