// A PC in place of the chip, for the tests: one thread, so nothing has to be locked.
#pragma once
#include <stdint.h>

#include "../tick_in_c.h"

#define HAL_LOCK() {
#define HAL_UNLOCK() }
#define HAL_BARRIER() __asm__ volatile("" ::: "memory")
#define HAL_NOINIT
#define HAL_RECEIVE RECEIVE
