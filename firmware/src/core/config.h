// The configuration in force, and what follows from it.
#pragma once
#include "errors.h"
#include "memory.h"

// Velocities are compared in 2^-38 steps a cycle, 2^-37 where ticks come faster: that makes 31 bits of the fastest.
#define VELOCITY_BITS (MIN_INTERVAL > 128 ? 38 : 37)
#define JUMP_MAX (1UL << 23)  // from there on an axis's acceleration is not checked

struct limits {
    uint16_t used;          // axes
    uint16_t invert;        // axes
    uint32_t top[AXES];     // max_rate as a velocity
    uint32_t jump[AXES];    // change of velocity in 1/256 of 50 ms, at 5/4 of max_accel
    float stop_time[AXES];  // ms · cycles: u = stop_time · rate / interval
};
extern struct limits limits;

enum error config_write(uint16_t offset, const uint8_t *data, uint8_t length);
enum error config_commit(uint16_t length, uint32_t crc);
void config_activate(void);  // derives `limits` from memory.image

// The limit rule of PROTOCOL.md, section 4: inside, or at least not farther outside than before.
bool within(int32_t lower, int32_t upper, int32_t before, int32_t after);

int32_t row_value(uint8_t row, const int32_t counts[AXES]);
int32_t row_slack(uint8_t row);  // what one count of each of its axes makes
bool row_known(uint8_t row);  // all its axes are where we think
