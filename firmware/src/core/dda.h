// The stepping itself: what the tick interrupt does, chip-free and inline so that it costs no call.
//
// Each tick puts out the step bits that the tick before computed, so that the edges do not wait for the arithmetic;
// then dda_next() computes the next ones. Counts are not kept here: Bresenham is exact, so motion.c tells them from the
// number of ticks.
#pragma once
#include <stdbool.h>
#include <stdint.h>

#include "../board.h"

struct segment {
    uint16_t ticks;
    uint16_t interval;     // cycles to the first tick
    int16_t add;           // 1/256 cycle a tick
    uint16_t back;         // axes that count down
    uint16_t steps[AXES];  // magnitudes
    uint8_t last;          // the motion may rest after this one
};

struct dda {
    const struct segment *now;  // null: no motion
    uint16_t left;              // ticks of `now` still to compute
    uint32_t interval;          // 1/256 cycle, to the next tick, as planned
    uint16_t error[STEPPERS + 1];
    uint8_t bits;               // STEP pins of the next tick
    uint8_t beat;               // counts ticks: whoever reads the rest looks whether it changed
    uint8_t overruns;

    uint16_t stretch;      // hold: intervals become `stretch`/256 times as long; 256: as planned
    volatile bool probe;   // home: watch the switch
    bool pressed;          // since this tick:
    uint8_t pressed_slot;  //   in this slot
    uint16_t pressed_left; //   with so many ticks left
};

extern struct segment queue[QUEUE_SLOTS];
extern volatile uint8_t queue_head, queue_tail;  // free-running; the interrupt moves only the tail
extern struct dda dda;

static inline struct segment *queue_slot(uint8_t index) {
    return &queue[index % QUEUE_SLOTS];
}

// Sets the DIR pins, one interval before the next step.
#ifdef __AVR__
#include "../avr/direction.h"
#else
void dda_direction(uint16_t back);
#endif

// Takes up the segment at the tail. False: there is none.
static inline bool dda_load(void) {
    const uint8_t tail = queue_tail;
    if (tail == queue_head) {
        dda.now = 0;
        return false;
    }
    const struct segment *s = queue_slot(tail);
    dda.now = s;
    dda.left = s->ticks;
    dda.interval = (uint32_t)s->interval << 8;
    const uint16_t half = s->ticks >> 1;
    for (uint8_t i = 0; i < STEPPERS; i++) {
        dda.error[i] = half;
    }
    dda_direction(s->back);
    return true;
}

// Cycles to the next tick; dda_load() must have found a segment. Advances the plan to the tick after it.
static inline uint16_t dda_interval(void) {
    const uint32_t planned = dda.interval;
    dda.interval = planned + (int32_t)dda.now->add;
    if (dda.stretch == 256) {
        return planned >> 8;
    }
    const uint32_t longer = (planned >> 8) * dda.stretch >> 8;
    return longer > 0xFFFF ? 0xFFFF : longer;
}

// One axis of Bresenham: exact, and its edge lies in the middle of its share of ticks.
static inline bool dda_axis(uint8_t i) {
    const uint16_t steps = dda.now->steps[i];
    const uint16_t error = dda.error[i];
    if (error < steps) {
        dda.error[i] = error - steps + dda.now->ticks;
        return true;
    }
    dda.error[i] = error - steps;
    return false;
}

static inline void dda_bits(void) {
    uint8_t bits = 0;
#define ONE_AXIS(i, ...)    \
    if (dda_axis(i)) {      \
        bits |= 1 << i;     \
    }
    STEPPER_PINS(ONE_AXIS)
    dda.bits = bits;
}

// The tick interrupt has put out dda.bits: what comes next? Returns the interval to the next tick, 0 at the end.
static inline uint16_t dda_next(void) {
    dda.beat++;
    if (dda.left == 0) {
        queue_tail++;
        if (!dda_load()) {
            return 0;
        }
    }
    dda.left--;
    return dda_interval();  // dda_bits() is the caller's: it sets its timer first
}

// In the interrupt while homing, after the step edges: is the probed switch pressed?
static inline void dda_probe(bool pressed) {
    if (!pressed) {
        dda.pressed = false;
    } else if (!dda.pressed) {
        dda.pressed = true;
        dda.pressed_slot = queue_tail;
        dda.pressed_left = dda.left;
    }
}
