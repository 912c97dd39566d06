// Timer 1: the tick interrupt.
//
// Order in it: step edges first, so that they only wait for the interrupt itself; then the timer, while there is plenty of time;
// then the arithmetic of the next tick, during which STEP stays high; then STEP low.
#include <avr/interrupt.h>
#include <stddef.h>

#include "../chip.h"
#include "../core/config.h"
#include "../core/dda.h"
#include "../core/hal.h"
#include "avr.h"

uint8_t direction_invert;

enum { LATE = 160 };  // cycles that a tick may come late: 10 us, as after the load of a segment at the highest rates

static uint8_t step_high;  // cycles that STEP stays high at least
static const volatile uint8_t *probe_port;
static uint8_t probe_mask, probe_level;

#if STEPPERS && !defined(TICK_IN_C)  // that is the oracle of the tick by hand
#define BY_HAND 1
#define TICK __vector_tick
#else
#define BY_HAND 0
#define TICK TIMER1_COMPA_vect
#endif

// Any tick; if there is one by hand, behind its step edges. -Os, as the Arduino IDE compiles, would make it slower.
void TICK(void) __attribute__((signal, used, externally_visible, optimize("O2")));
void TICK(void) {
#if !BY_HAND
    const uint8_t bits = dda.bits;
    (void)bits;
#define STEP_HIGH(i, port, bit, ...) \
    if (bits & 1 << (i)) {           \
        PIN_HIGH(port, bit);         \
    }
    STEPPER_PINS(STEP_HIGH)
#endif
    const uint16_t rise = TCNT1;

    if (dda.probe) {
        dda_probe((*probe_port & probe_mask) == probe_level);
    }
    const uint16_t interval = dda_next();
    if (interval) {
        OCR1A = interval - 1;
        if (TCNT1 >= interval - 8) {  // too late for this tick: it would come a whole turn of the timer later
            TCNT1 = 0;
            dda.overruns |= 1;
        }
        dda_bits();
    } else {
        TIMSK1 = 0;
    }

    while ((uint16_t)(TCNT1 - rise) < step_high) {
    }
#define STEP_LOW(i, port, bit, ...) PIN_LOW(port, bit);
    STEPPER_PINS(STEP_LOW)
    if (!interval) {
        TCCR1B = 0;
    } else if (TIFR1 & 1 << OCF1A && TCNT1 > LATE && dda.overruns < 255) {
        dda.overruns++;
    }
}

#if BY_HAND
#include "short_tick.h"
#endif

void hal_timer_start(uint16_t interval) {
    HAL_LOCK();
    TCCR1A = 0;
    TCCR1B = 1 << WGM12 | 1 << CS10;  // clear on compare, no prescaler
    OCR1A = interval - 1;
    TCNT1 = 0;
    TIFR1 = 1 << OCF1A;
    TIMSK1 = 1 << OCIE1A;
    HAL_UNLOCK();
}

void hal_timer_stop(void) {
    HAL_LOCK();
    TIMSK1 = 0;
    TCCR1B = 0;
    HAL_UNLOCK();
}

void hal_probe(uint8_t input, bool high) {
    switch (input) {  // no table, which would be in RAM
#define PROBE(i, port, bit)      \
    case i:                      \
        probe_port = &PIN##port; \
        probe_mask = 1 << (bit); \
        break;
        SWITCH_PINS(PROBE)
    }
    probe_level = high ? probe_mask : 0;
}

void hal_configured(void) {
    direction_invert = limits.invert;
    step_high = memory.image.step_high * 8 / 5 + 1;  // 0.1 µs to cycles
}

void stepper_setup(void) {
#define OUTPUTS(i, step_port, step_bit, dir_port, dir_bit) \
    PIN_OUTPUT(step_port, step_bit);                       \
    PIN_OUTPUT(dir_port, dir_bit);
    STEPPER_PINS(OUTPUTS)
}
