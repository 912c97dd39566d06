// The RP2040's part of chip.h: one Cortex-M0+ core; the other one sleeps.
#pragma once
#include <stdint.h>

#include "../tick_in_c.h"

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
#define HAL_RECEIVE RECEIVE
