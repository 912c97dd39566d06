// The configuration in force, and what follows from it.
#pragma once
#include "errors.h"
#include "memory.h"

struct limits {
    uint16_t used;             // axes
    uint16_t invert;           // axes
    uint16_t step_time[AXES];  // quarter cycles … of a step at max_rate: clock / (4 max_rate), at most 65535
    float stop_time[AXES];     // ms · cycles: u = stop_time · steps / (ticks · interval)
};
extern struct limits limits;

enum error config_write(uint16_t offset, const uint8_t *data, uint8_t length);
enum error config_commit(uint16_t length, uint32_t crc);
void config_activate(void);  // derives `limits` from memory.image

// The limit rule of PROTOCOL.md, section 4: inside, or at least not farther outside than before.
bool within(int32_t lower, int32_t upper, int32_t before, int32_t after);

int32_t row_value(uint8_t row, const int32_t counts[AXES]);
bool row_known(uint8_t row);  // all its axes are where we think
