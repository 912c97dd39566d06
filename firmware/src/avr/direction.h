// The DIR pins, inline for the tick interrupt: a call there would cost it a dozen saved registers.
#pragma once
#include "ports.h"

extern uint8_t direction_invert;  // axes whose positive counts put DIR high

static inline void dda_direction(uint16_t back) {
    const uint8_t high = (uint8_t)back ^ direction_invert;
    (void)high;
#define SET_DIRECTION(i, step_port, step_bit, port, bit) \
    if (high & 1 << (i)) {                               \
        PIN_HIGH(port, bit);                             \
    } else {                                             \
        PIN_LOW(port, bit);                              \
    }
    STEPPER_PINS(SET_DIRECTION)
}
