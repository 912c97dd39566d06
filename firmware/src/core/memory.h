// What survives a reset: the configuration image and where the arm stands, under a checksum.
#pragma once
#include <stdbool.h>
#include <stdint.h>

#include "../board.h"
#include "../chip.h"

#define PACKED __attribute__((packed))

struct PACKED axis_config {
    uint8_t flags;
    int32_t lower, upper, home;
    uint32_t max_rate, max_accel;
};

// A limit switch: while it is pressed, nothing moves with a positive sum of weight · rate.
struct PACKED guard_config {
    uint8_t flags;
    int8_t weight[AXES];
};

struct PACKED row_config {
    int32_t lower, upper;
    int16_t weight[AXES];
};

// Byte for byte the image of PROTOCOL.md, section 4: both ends are little-endian.
struct PACKED image {
    uint8_t layout, axes, rows, flags, step_high, step_low, dir_setup, wake;
    uint32_t meaning;
    struct axis_config axis[AXES];
    struct guard_config guard[SWITCHES];
    struct row_config row[ROWS];
};

enum { ABORT_CLOSED = 1, ENABLE_HIGH = 2, POWER_SENSED = 4 };  // image flags
enum { USED = 1, INVERT = 2, CLOSED = 2 };                     // axis and guard flags

struct memory {
    struct image image;
    uint32_t config;       // CRC of the image in force, 0: none
    int32_t counts[AXES];  // where the settled motion ends; all motion, when the board is idle
    uint16_t known;        // axes
    uint8_t drivers;
    uint16_t boots;
    uint32_t check;  // over all above
    volatile uint8_t moving;  // outside of the checksum: set in one store before the first step
};

extern struct memory memory;

bool memory_restore(uint8_t cause);  // at start: true if the position is retained
void memory_save(void);              // at rest, after any change
void memory_moving(void);            // a reset from here on means: lost
