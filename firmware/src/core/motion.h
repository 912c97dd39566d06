// The queue of segments, where it stands, and how it stops.
#pragma once
#include "config.h"
#include "dda.h"
#include "session.h"

struct motion {
    int32_t plan[AXES];   // counts at the end of the queue
    int32_t latch[AXES];  // counts when the probed switch was pressed
    bool latched;         // dda.pressed has been taken into `latch`
    bool ended;           // the queue ends with END
    bool retained;        // the position was known through a reset
    bool pulses;          // servo pulses on
    bool cruising;        // the board plans by itself: HOME, JOG
    uint8_t wake;         // ms until the drivers are awake
};
extern struct motion motion;

void motion_start(bool retained);  // once, after the reset
void motion_poll(void);            // as often as possible
void motion_millisecond(void);
void motion_counts(int32_t counts[AXES]);  // steps made until now
uint8_t motion_free(void);
uint16_t motion_queued(void);  // ms

// Appending: write segments into motion_slot(0), (1), … up to motion_free(), move motion.plan on, then publish them all at once.
struct segment *motion_slot(uint8_t ahead);
void motion_append(uint8_t segments, bool end);

void motion_begin(enum state state);  // leave IDLE: from here on a reset loses the position
void motion_rest(void);               // back to IDLE: the counts are final
void motion_hold(void);
bool motion_queue_empty(void);
void motion_lose(uint16_t axes);  // their positions are not known any more
