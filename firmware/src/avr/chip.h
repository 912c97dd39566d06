// The AVR's part of chip.h.
#pragma once
#include <avr/interrupt.h>
#include <avr/pgmspace.h>
#include <stdbool.h>
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

// 2^23 / interval, of intervals above 256: the first nine bits of the quotient are 0.
static inline uint16_t hal_reciprocal(uint16_t interval) {
    uint16_t rest = 256, quotient = 0;
    __asm__(".rept 15\n\t"
            "lsl %A[q]\n\t"
            "rol %B[q]\n\t"
            "lsl %A[r]\n\t"
            "rol %B[r]\n\t"
            "brcs 2f\n\t"
            "cp %A[r], %A[i]\n\t"
            "cpc %B[r], %B[i]\n\t"
            "brcs 3f\n"
            "2:\n\t"
            "sub %A[r], %A[i]\n\t"
            "sbc %B[r], %B[i]\n\t"
            "inc %A[q]\n"
            "3:\n\t"
            ".endr"
            : [q] "+r"(quotient), [r] "+r"(rest)
            : [i] "r"(interval));
    return quotient;
}
#define HAL_RECIPROCAL(interval) hal_reciprocal(interval)

// 16 by 16 bits; inline, as gcc would call its library for it.
static inline uint32_t hal_multiply(uint16_t a, uint16_t b) {
    uint32_t product;
    __asm__("mul %A[a], %A[b]\n\t"
            "movw %A[p], r0\n\t"
            "mul %B[a], %B[b]\n\t"
            "movw %C[p], r0\n\t"
            "mul %A[a], %B[b]\n\t"
            "add %B[p], r0\n\t"
            "adc %C[p], r1\n\t"
            "clr r1\n\t"
            "adc %D[p], r1\n\t"
            "mul %B[a], %A[b]\n\t"
            "add %B[p], r0\n\t"
            "adc %C[p], r1\n\t"
            "clr r1\n\t"
            "adc %D[p], r1"
            : [p] "=&r"(product)
            : [a] "r"(a), [b] "r"(b)
            : "r0");
    return product;
}
#define HAL_MULTIPLY(a, b) hal_multiply(a, b)

// A phase goes on by rate * ticks, and what overflows are the steps: motion_steps() in 40 cycles for gcc's 75.
static inline uint16_t hal_steps(fine_t *phase, uint16_t rate, bool fine, uint16_t ticks) {
    uint32_t sum = hal_multiply(rate, ticks);
    if (!fine) {
        __asm__("ldd r0, %a[at]+1\n\t"
                "add %A[s], r0\n\t"
                "std %a[at]+1, %A[s]\n\t"
                "ldd r0, %a[at]+2\n\t"
                "adc %B[s], r0\n\t"
                "std %a[at]+2, %B[s]\n\t"
                "adc %C[s], r1\n\t"
                "adc %D[s], r1"
                : [s] "+r"(sum), "+m"(*phase)
                : [at] "b"(phase)
                : "r0");
        return sum >> 16;
    }
    __asm__("ldd r0, %a[at]+0\n\t"
            "add %A[s], r0\n\t"
            "std %a[at]+0, %A[s]\n\t"
            "ldd r0, %a[at]+1\n\t"
            "adc %B[s], r0\n\t"
            "std %a[at]+1, %B[s]\n\t"
            "ldd r0, %a[at]+2\n\t"
            "adc %C[s], r0\n\t"
            "std %a[at]+2, %C[s]\n\t"
            "adc %D[s], r1"
            : [s] "+r"(sum), "+m"(*phase)
            : [at] "b"(phase)
            : "r0");
    return sum >> 24;
}
#define HAL_STEPS(phase, rate, fine, ticks) hal_steps(phase, rate, fine, ticks)

// The four bytes of the table's entries stand 256 apart: an index is an address's low byte.
static inline uint32_t hal_crc(uint32_t crc, uint8_t byte) {
    extern const uint8_t crc_table[4][256];
    __asm__("mov r30, %A[c]\n\t"
            "eor r30, %[b]\n\t"
            "ldi r31, hi8(%[t])\n\t"
            "lpm %A[c], Z\n\t"
            "eor %A[c], %B[c]\n\t"
            "inc r31\n\t"
            "lpm %B[c], Z\n\t"
            "eor %B[c], %C[c]\n\t"
            "inc r31\n\t"
            "lpm %C[c], Z\n\t"
            "eor %C[c], %D[c]\n\t"
            "inc r31\n\t"
            "lpm %D[c], Z"
            : [c] "+r"(crc)
            : [b] "r"(byte), [t] "i"(crc_table)
            : "r30", "r31");
    return crc;
}
#define HAL_CRC(crc, byte) hal_crc(crc, byte)
