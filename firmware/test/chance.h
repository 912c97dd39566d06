// Numbers at random, the same ones for the same seed.
#pragma once
#include <stdint.h>

void chance_seed(uint64_t seed);  // not 0
uint32_t rnd(uint32_t below);
int32_t between(int32_t low, int32_t high);  // both ends among them
