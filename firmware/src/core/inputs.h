// What the board hears besides the line: the abort input, the motors' power, limit switches (PROTOCOL.md, section 9).
#pragma once
#include "dda.h"
#include "errors.h"

struct inputs {
    bool abort;       // active
    bool power_cut;   // sensed
    uint8_t pressed;  // guarded switches
};
extern struct inputs inputs;

void inputs_start(void);
// What stops a motion; `detail`: the switch. HOME looks after its own.
enum error inputs_millisecond(uint8_t *detail);

// May MOTION (`moving`: also while it runs), HOME or JOG begin?
enum error inputs_ready(bool moving);
// LIMIT_SWITCH if a segment leads on into a pressed switch.
enum error inputs_blocking(const struct segment *s, uint8_t *detail);
