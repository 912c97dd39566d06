// The stepping itself: what the tick interrupt does, inline so that it costs no call.
//
// Each tick puts out the step bits that the tick before computed, so that the edges do not wait for the arithmetic;
// then dda_next() computes the next ones. Each axis has a phase, a fraction of a step that each tick moves on by the
// segment's rate; where it overflows, there is a step. Phases go on from segment to segment. Counts are not kept here: the sum is
// exact, so motion.c tells them from the number of ticks.
//
// The interval between ticks changes by `add` with each tick, and `add` by `bend` with every 16th, or with each (QUICK): 1 / (v + a t)
// to second order, so that a ramp of constant acceleration takes few segments.
#pragma once
#include <stdbool.h>
#include <stdint.h>

#include "../board.h"
#include "../chip.h"

// One bit an axis, and two for LAST and QUICK.
#if AXES <= 6
typedef uint8_t axes_t;
#else
typedef uint16_t axes_t;
#endif

enum { LAST = 1 << (8 * sizeof(axes_t) - 1) };  // in `back`: the motion may rest after this segment
enum { QUICK = 1 << (8 * sizeof(axes_t) - 2) };  // in `back`: `bend` counts with every tick
_Static_assert(AXES < 8 * sizeof(axes_t) - 1, "two bits are LAST and QUICK");
_Static_assert(((axes_t)LAST & (axes_t)QUICK) == 0, "one is not the other, where an int has 16 bits, too");

// Masks of axes byte by byte, as a small chip is quick with: to the next axis's bit, in the byte that it stands in.
#define NEXT_AXIS(bit, shift)  \
    if (!(bit = bit << 1)) {    \
        bit = 1;                \
        shift;                  \
    }

enum { BENDS = 0x80 };  // in dda.changing
enum { BLOCK = 16 };  // ticks with the same `add`, counted from the segment's end

// Phases and rates: 2^-24 step. At rest a phase is half a step. An axis that turns round goes on from the other side.
#define PHASE_MASK 0xFFFFFFUL
#define PHASE_HALF 0x800000UL
#define PHASE_TURN 0xFFFFFEUL  // even stays even: the protocol's unit is 2^-23 step

struct segment {
    uint16_t ticks;
    uint16_t interval;    // cycles to the first tick
    sfine_t add;          // 2^-16 cycle a tick
    int16_t bend;         // 2^-22 cycle a tick, with every 16th; QUICK: 2^-17, with each
    axes_t back;          // axes that count down; LAST; QUICK
    axes_t fine;          // axes whose rate is in the small unit
    uint16_t rate[AXES];  // 2^-24 step (fine) or 2^-16
};

// A tick's part of a step.
static inline fine_t segment_rate(const struct segment *s, uint8_t axis, axes_t bit) {  // bit: 1 << axis, as shifting costs
    return s->fine & bit ? (fine_t)s->rate[axis] : (fine_t)s->rate[axis] << 8;
}

struct dda {
    const struct segment *now;  // null: no motion
    uint16_t left;              // ticks of `now` still to compute
    uint32_t interval;          // to the next tick, as planned; 2^-16 cycle
    int32_t add;                // 2^-24 cycle a tick
    fine_t phase[STEPPERS ? STEPPERS : 1], rate[STEPPERS ? STEPPERS : 1];
    axes_t back;                // as in the segment taken up last
    uint8_t bits;               // STEP pins of the next tick
    bool prepared;              // the next segment's rates are taken, and phases turned, by a chip's own tick
    uint8_t changing, fine;     // not 0: there is an `add`, and BENDS: a bend; a rate has a low byte. For a chip's own tick
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

// Takes up the segment at the tail. False: there is none.
bool dda_load(void);

// At rest every axis is in the middle between two steps.
static inline void dda_rest(void) {
    for (uint8_t i = 0; i < STEPPERS; i++) {
        dda.phase[i] = PHASE_HALF;
    }
    dda.back = 0;
    if (HAL_PREPARES) {
        dda.prepared = false;
    }
}

// After each block of ticks.
void dda_bend(void);

// Cycles to the next tick; dda_load() must have found a segment. Advances the plan to the tick after it.
static inline uint16_t dda_interval(void) {
    uint16_t planned;
    DDA_ADVANCE(planned)
    if ((uint8_t)dda.left % BLOCK == 0 || dda.back & QUICK) {
        dda_bend();
    }
    if (dda.stretch == 256) {
        return planned;
    }
    const uint32_t longer = (uint32_t)planned * dda.stretch >> 8;
    return longer > 0xFFFF ? 0xFFFF : longer;
}

static inline void dda_bits(void) {
    uint8_t bits = 0;
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
