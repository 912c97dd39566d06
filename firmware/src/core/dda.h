// The stepping itself: what the tick interrupt does, chip-free and inline so that it costs no call.
//
// Each tick puts out the step bits that the tick before computed, so that the edges do not wait for the arithmetic;
// then dda_next() computes the next ones. Counts are not kept here: Bresenham is exact, so motion.c tells them from the
// number of ticks.
#pragma once
#include <stdbool.h>
#include <stdint.h>

#include "../board.h"

// One bit an axis.
#if AXES <= 8
typedef uint8_t axes_t;
#else
typedef uint16_t axes_t;
#endif

struct segment {
    uint16_t ticks;
    uint16_t interval;     // cycles to the first tick
    int16_t add;           // 1/256 cycle a tick
    axes_t back;           // axes that count down
    uint16_t steps[AXES];  // magnitudes
    uint8_t last;          // the motion may rest after this one
};

// 1/256 cycle: 24 bits are enough, and quicker than 32.
#ifdef __AVR__
typedef __uint24 fine_t;
#else
typedef uint32_t fine_t;
#endif

struct dda {
    const struct segment *now;  // null: no motion
    uint16_t left;              // ticks of `now` still to compute
    fine_t interval;            // to the next tick, as planned
    uint16_t error[STEPPERS + 1];
    uint8_t bits;               // STEP pins of the next tick
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

_Static_assert(QUEUE_SLOTS <= 128 && (QUEUE_SLOTS & (QUEUE_SLOTS - 1)) == 0, "indices run freely in 8 bits");

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
    dda.interval = (fine_t)s->interval << 8;
    const uint16_t half = s->ticks >> 1;
    for (uint8_t i = 0; i < STEPPERS; i++) {
        dda.error[i] = half;
    }
    dda_direction(s->back);
    return true;
}

// Cycles to the next tick; dda_load() must have found a segment. Advances the plan to the tick after it.
static inline uint16_t dda_interval(void) {
    const fine_t fine = dda.interval;
    const uint16_t planned = fine >> 8;
    dda.interval = fine + dda.now->add;
    if (dda.stretch == 256) {
        return planned;
    }
    const uint32_t longer = (uint32_t)planned * dda.stretch >> 8;
    return longer > 0xFFFF ? 0xFFFF : longer;
}

// One axis of Bresenham: exact, and its edge lies in the middle of its share of ticks. True: step.
static inline bool dda_axis(uint16_t *error, uint16_t steps, uint16_t ticks) {
    if (*error < steps) {
        *error += ticks - steps;
        return true;
    }
    *error -= steps;
    return false;
}

#ifdef __AVR__
// The same: gcc does not see that the subtraction's borrow is the comparison. It saves a fifth of the interrupt.
#define DDA_AXIS(i, ...)                                   \
    {                                                      \
        uint16_t error = dda.error[i];                     \
        __asm__("sub %A0, %A2\n\t"                         \
                "sbc %B0, %B2\n\t"                         \
                "brcc 1f\n\t"                              \
                "add %A0, %A3\n\t"                         \
                "adc %B0, %B3\n\t"                         \
                "ori %1, %4\n"                             \
                "1:"                                       \
                : "+r"(error), "+d"(bits)                  \
                : "r"(s->steps[i]), "r"(ticks), "M"(1 << (i))); \
        dda.error[i] = error;                              \
    }
#else
#define DDA_AXIS(i, ...) bits |= dda_axis(&dda.error[i], s->steps[i], ticks) << (i);
#endif

static inline void dda_bits(void) {
    uint8_t bits = 0;
    const struct segment *s = dda.now;
    const uint16_t ticks = s->ticks;
    (void)ticks;
    STEPPER_PINS(DDA_AXIS)
    dda.bits = bits;
}

// The tick interrupt has put out dda.bits: what comes next? Returns the interval to the next tick, 0 at the end.
static inline uint16_t dda_next(void) {
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
