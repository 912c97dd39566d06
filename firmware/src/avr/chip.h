// The AVR's part of chip.h.
#pragma once
#include <avr/interrupt.h>
#include <avr/pgmspace.h>
#include <stdint.h>

#include "direction.h"

#define HAL_BARRIER() __asm__ volatile("" ::: "memory")
#define HAL_LOCK()                 \
    {                              \
        const uint8_t sreg = SREG; \
        cli();                     \
        HAL_BARRIER();
#define HAL_UNLOCK() \
    HAL_BARRIER();   \
    SREG = sreg;     \
    }
#define HAL_NOINIT __attribute__((section(".noinit")))
#define HAL_PREPARES 1
#define HAL_TABLE PROGMEM
#define HAL_READ32(p) pgm_read_dword_near(p)
#define HAL_RECEIVE RECEIVE

typedef __uint24 fine_t;
typedef __int24 sfine_t;

// The carry of a 24-bit addition is the step. gcc does not see that, and would take more registers, which the interrupt would have to save.
#define DDA_AXIS(i, ...)                                                                     \
    {                                                                                        \
        uint8_t sum, rate;                                                                   \
        __asm__ volatile("lds %[s], %[p]\n\t"                                                \
                         "lds %[r], %[q]\n\t"                                                \
                         "add %[s], %[r]\n\t"                                                \
                         "sts %[p], %[s]\n\t"                                                \
                         "lds %[s], %[p]+1\n\t"                                              \
                         "lds %[r], %[q]+1\n\t"                                              \
                         "adc %[s], %[r]\n\t"                                                \
                         "sts %[p]+1, %[s]\n\t"                                              \
                         "lds %[s], %[p]+2\n\t"                                              \
                         "lds %[r], %[q]+2\n\t"                                              \
                         "adc %[s], %[r]\n\t"                                                \
                         "sts %[p]+2, %[s]\n\t"                                              \
                         "brcc 1f\n\t"                                                       \
                         "ori %[b], %[m]\n"                                                  \
                         "1:"                                                                \
                         : [s] "=&r"(sum), [r] "=&r"(rate), [b] "+d"(bits)                   \
                         : [p] "i"(&dda.phase[i]), [q] "i"(&dda.rate[i]), [m] "M"(1 << (i)) \
                         : "memory");                                                        \
    }

// The interval to the next tick, and the one after it is ready: interval += add >> 8 in 32 bits, from the struct to the struct. gcc would
// take ten registers more, which the interrupt would have to save.
#define DDA_ADVANCE(planned)                                                                               \
    {                                                                                                      \
        uint8_t low, high;                                                                                 \
        __asm__ volatile("ldd %[l], Z+0\n\t"                                                               \
                         "ldd %[h], Z+5\n\t"                                                               \
                         "add %[l], %[h]\n\t"                                                              \
                         "std Z+0, %[l]\n\t"                                                               \
                         "ldd %[l], Z+1\n\t"                                                               \
                         "ldd %[h], Z+6\n\t"                                                               \
                         "adc %[l], %[h]\n\t"                                                              \
                         "std Z+1, %[l]\n\t"                                                               \
                         "ldd %A[p], Z+2\n\t"                                                              \
                         "ldd %B[p], Z+3\n\t"                                                              \
                         "ldd %[h], Z+7\n\t"                                                               \
                         "mov %[l], %A[p]\n\t"                                                             \
                         "adc %[l], %[h]\n\t"                                                              \
                         "std Z+2, %[l]\n\t"                                                               \
                         "mov %[l], %B[p]\n\t"                                                             \
                         "sbrc %[h], 7\n\t"                                                                \
                         "rjmp 1f\n\t"                                                                     \
                         "eor %[h], %[h]\n\t"                                                              \
                         "rjmp 2f\n"                                                                       \
                         "1: ldi %[h], 0xFF\n"                                                             \
                         "2: adc %[l], %[h]\n\t"                                                           \
                         "std Z+3, %[l]\n"                                                                 \
                         : [l] "=&r"(low), [h] "=&d"(high), [p] "=&r"(planned)                             \
                         : "z"(&dda.interval)                                                              \
                         : "memory");                                                                      \
    }

// Keeps a pointer where its fields are one instruction away.
#define HAL_NEAR(pointer) __asm__("" : "+y"(pointer))

// By the interval before, the timer would fire too early behind a load that takes longer.
#define HAL_COMING(cycles) (OCR1A = (cycles))
