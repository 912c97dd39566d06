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
    fine_t plan_excess[AXES][2];  // of changes of velocity over their budget, up and down: see batch.c
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

// Appending: write segments into motion_slot(0), (1), … up to motion_free(), each with motion_advance(); then publish them all at once.
struct segment *motion_slot(uint8_t ahead);
void motion_advance(uint8_t axis, axes_t bit, const struct segment *s);  // motion.plan of an axis (bit: 1 << axis) to a segment's end
void motion_append(uint8_t segments, bool end);
uint32_t motion_units(const struct segment *s);  // its time, 256 cycles
int32_t motion_interval(const struct segment *s, uint16_t ticks);  // cycles to the tick after so many

void motion_begin(enum state state);  // leave IDLE: from here on a reset loses the position
void motion_rest(void);               // back to IDLE: the counts are final
void motion_replan(void);             // at rest: the plan begins where the arm stands
bool motion_queue_empty(void);
void motion_lose(uint16_t axes);  // their positions are not known any more
