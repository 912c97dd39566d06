// The RP2040's part of chip.h: one Cortex-M0+ core; the other one sleeps.
#pragma once
#include <stdint.h>

#define HAL_BARRIER() __asm__ volatile("dmb" ::: "memory")
#define HAL_LOCK()                                                       \
    {                                                                    \
        uint32_t primask;                                                \
        __asm__ volatile("mrs %0, primask" : "=r"(primask));             \
        __asm__ volatile("cpsid i" ::: "memory");
#define HAL_UNLOCK()                                                     \
    __asm__ volatile("msr primask, %0" : : "r"(primask) : "memory");     \
    }
#define HAL_NOINIT __attribute__((section(".noinit")))
#define HAL_TABLE
#define HAL_READ32(p) (*(p))
#define HAL_RECEIVE RECEIVE

typedef uint32_t fine_t;
typedef int32_t sfine_t;

void dda_direction(uint16_t back);

// The upper 24 bits of a register would do, but the core keeps phases in the lower ones.
#define DDA_AXIS(i, ...)                                 \
    {                                                    \
        const uint32_t sum = dda.phase[i] + dda.rate[i]; \
        bits |= (sum >> 24) << (i);                      \
        dda.phase[i] = sum & 0xFFFFFF;                   \
    }

#define DDA_ADVANCE(planned)        \
    planned = dda.interval >> 16;   \
    dda.interval += dda.add >> 8;

#define HAL_NEAR(pointer)
