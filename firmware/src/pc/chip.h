// A PC in place of the chip, for the tests: one thread, so nothing has to be locked.
#pragma once
#include <stdint.h>

#define HAL_LOCK() {
#define HAL_UNLOCK() }
#define HAL_BARRIER() __asm__ volatile("" ::: "memory")
#define HAL_NOINIT
#define HAL_TABLE
#define HAL_READ32(p) (*(p))
#ifdef RECEIVE
#define HAL_RECEIVE RECEIVE
#else
#define HAL_RECEIVE 127
#endif

typedef uint32_t fine_t;
typedef int32_t sfine_t;

void dda_direction(uint16_t back);

// Kept to 24 bits by hand.
#define DDA_AXIS(i, ...)                                   \
    {                                                      \
        const uint32_t sum = dda.phase[i] + dda.rate[i];    \
        bits |= (sum >> 24) << (i);                        \
        dda.phase[i] = sum & 0xFFFFFF;                     \
    }

#define DDA_ADVANCE(planned)            \
    planned = dda.interval >> 16;       \
    dda.interval += dda.add >> 8;

#define HAL_NEAR(pointer)
