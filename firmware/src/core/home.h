// HOME: move until a switch says so (PROTOCOL.md, section 8).
#pragma once
#include "motion.h"

struct home {
    uint8_t input;
    bool closed;        // pressed is high
    uint8_t slow;       // 1/256
    uint32_t backoff;   // leader counts
    uint32_t travel;    // leader counts
    uint32_t time;      // ms left
};
extern struct home home;

extern bool home_finished;  // the latch is that of a finished HOME

void home_begin(void);  // along cruise.asked
enum error home_poll(void);  // what goes wrong ends the session
enum error home_millisecond(void);
