// Motion that the board plans itself, for HOME and JOG: a vector of rates, and how fast along it.
//
// All axes keep their proportion; `share` is the part of the rates that they run at, and it rises and falls by `slope`
// a slice, so that no axis exceeds its max_accel. Three slices of 8 ms are kept in the queue.
#pragma once
#include "motion.h"

struct cruise {
    int32_t rate[AXES];  // counts/s
    float share;         // 0 … 1 of the rates
    float target;        // where the share is going
    float slope;         // a slice
    uint16_t axes;       // with a rate
    uint8_t leader;
    bool bounded;        // stop at the limits of known axes and rows
    int32_t asked[AXES]; // what HOME or JOG wants, kept from vector to vector
};
extern struct cruise cruise;

void cruise_vector(int8_t sign, bool bounded);  // at rest: along `asked` or against it; keeps target 0
void cruise_poll(void);        // feeds the queue
bool cruise_resting(void);     // target and share are 0 and the queue is done
int32_t cruise_covered(void);  // leader counts since cruise_vector(), by the plan
float cruise_brake(void);      // leader counts that stopping takes
