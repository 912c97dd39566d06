// The queue of segments, where it stands, and how it stops.
#pragma once
#include "config.h"
#include "dda.h"

enum { GENTLE_PARTS = 8 };

enum state { IDLE, MOVING, HOLDING, HOMING, JOGGING };

// How far the axes are beyond their counts, and which way they were going.
struct fraction {
    fine_t phase[AXES];
    axes_t back;
};

struct motion {
    uint8_t state;
    // at the end of the queue:
    int32_t plan[AXES];
    struct fraction plan_fraction;
    fine_t plan_excess[AXES][2];  // of changes of velocity over their budget, see acceleration.h, up and down, of axes in:
    axes_t plan_exceeding;
    bool ended;                   // at rest
    uint8_t gentle;               // eighths of the accelerations that a hold leaves out

    int32_t latch[AXES];  // counts when the probed switch was pressed
    bool latched;         // dda.pressed has been taken into `latch`
    bool retained;        // the position was known through a reset
    bool pulses;          // servo pulses on
    bool cruising;        // the board plans by itself: HOME, JOG
    uint8_t wake;         // ms until the drivers are awake
};
extern struct motion motion;

void motion_start(bool retained);  // once, after the reset
// What goes wrong is returned; whoever calls them ends the session and calls motion_stop().
enum error motion_poll(void);         // as often as possible
enum error motion_millisecond(void);
void motion_stop(void);               // MOVING: come to rest along the path

void motion_counts(int32_t counts[AXES]);  // steps made until now
const struct segment *motion_running(void);  // null at rest
uint8_t motion_free(void);
uint16_t motion_queued(void);  // ms

// Appending: write segments into motion_slot(0), (1), … up to motion_free(), move motion.plan on, then publish them all at once.
struct segment *motion_slot(uint8_t ahead);
void motion_advance(const struct segment *s);  // motion.plan to a segment's end
void motion_append(uint8_t segments, uint32_t units, bool end);
uint32_t motion_units(const struct segment *s);  // its time, 256 cycles
int32_t motion_changed_interval(const struct segment *s, uint16_t ticks);

// Cycles to the tick after so many.
static inline int32_t motion_interval(const struct segment *s, uint16_t ticks) {
    return s->add ? motion_changed_interval(s, ticks) : s->interval;
}

// Steps that an axis makes in so many ticks; moves its phase on.
static inline uint16_t motion_steps(fine_t *phase, uint16_t rate, bool fine, uint16_t ticks) {
#ifdef HAL_STEPS
    return HAL_STEPS(phase, rate, fine, ticks);
#else
    const uint32_t made = HAL_MULTIPLY(rate, ticks);
    if (fine) {
        const uint32_t sum = (uint32_t)*phase + (made & PHASE_MASK);
        *phase = sum & PHASE_MASK;
        return (uint16_t)(made >> 24) + (uint16_t)(sum >> 24);
    }
    const uint32_t sum = made + (uint16_t)(*phase >> 8);
    *phase = (fine_t)(uint16_t)sum << 8 | (uint8_t)*phase;
    return sum >> 16;
#endif
}

void motion_begin(enum state state);  // leave IDLE: from here on a reset loses the position
void motion_rest(void);               // back to IDLE: the counts are final
void motion_replan(void);             // at rest: the plan begins where the arm stands
bool motion_queue_empty(void);
void motion_lose(uint16_t axes);  // their positions are not known any more
