// Servo pulses: timer 2 counts half microseconds, its compare interrupt makes the edges, one servo after the other.
//
// A pulse is longer than the timer's turn of 128 µs, so it is walked in steps, each far enough ahead (40 µs) for the
// interrupt to set the next one in time. Other interrupts make edges late, the tick's by up to 20 µs. Where there are no steppers that
// could suffer from it, the interrupt comes that much early and waits for the moment; beside steppers it does not.
#include <avr/interrupt.h>

#include "../core/motion.h"
#include "avr.h"

enum { EARLY = STEPPERS ? 0 : 40, GAP = 128 };  // half µs; GAP: between one servo's pulse and the next

static uint16_t width[SERVOS + 1];  // half µs of this frame's pulses, 0: none
static uint8_t current;             // whose edge is next
static bool rising;                 // which
static uint8_t moment;              // timer count that the compare is set for
static uint16_t ahead;              // half µs from there to the edge
static volatile bool busy;

static inline void edge(uint8_t servo, bool high) {
#define SERVO_EDGE(i, port, bit) \
    if (servo == (i)) {          \
        if (high) {              \
            PIN_HIGH(port, bit); \
        } else {                 \
            PIN_LOW(port, bit);  \
        }                        \
    }
    SERVO_PINS(SERVO_EDGE)
}

// From `current` on, the first servo that has a pulse. False: none is left.
static inline bool find_pulse(void) {
    while (current < SERVOS && !width[current]) {
        current++;
    }
    return current < SERVOS;
}

static inline void after_edge(void) {
    if (rising) {
        ahead = width[current];
        rising = false;
        return;
    }
    current++;
    rising = true;
    ahead = GAP;
    if (!find_pulse()) {
        TIMSK2 = 0;
        busy = false;
    }
}

ISR(TIMER2_COMPA_vect) {
    if (ahead == 0) {
        while (EARLY && (int8_t)(TCNT2 - moment) < 0) {
        }
        edge(current, rising);
        if (STEPPERS) {
            sei();  // a tick need not wait for the rest: the next compare is far
        }
        after_edge();
    } else if (STEPPERS) {
        sei();
    }
    if (ahead >= 512) {
        ahead -= 256;  // the same compare, a turn later
    } else {
        const uint8_t step = ahead >= 256 ? 128 : ahead;
        ahead -= step;
        moment += step;
        OCR2A = moment - EARLY;
    }
}

APART bool servo_frame(void) {
    int32_t counts[AXES];
    if (busy) {
        return false;
    }
    motion_counts(counts);
    for (uint8_t i = 0; i < SERVOS; i++) {
        const bool on = motion.pulses && memory.known >> (STEPPERS + i) & 1;
        width[i] = on ? 2 * (uint16_t)counts[STEPPERS + i] : 0;
    }
    current = 0;
    if (!find_pulse()) {
        return true;
    }
    busy = rising = true;
    ahead = 0;
    moment = TCNT2 + 16 + EARLY;
    OCR2A = moment - EARLY;
    TIFR2 = 1 << OCF2A;  // the compare is set: a match with the one before would count as a turn of the first pulse
    TIMSK2 = 1 << OCIE2A;
    return true;
}

void servo_setup(void) {
#define SERVO_OUTPUT(i, port, bit) PIN_OUTPUT(port, bit);
    SERVO_PINS(SERVO_OUTPUT)
    TCCR2A = 0;
    TCCR2B = 1 << CS21;  // clock / 8
}
