// Configuration images at random: whole, or with one fault.
#pragma once
#include <stdbool.h>
#include <stdint.h>

#include "../src/core/memory.h"

static inline uint8_t axis_of(uint8_t n) {  // that a switch stands at
    return n % STEPPERS;
}

struct image sound_image(const bool *below);    // what PROTOCOL.md, section 4, allows; below: switches at an axis's lower end
void spoil_image(struct image *image);          // one fault, for which it must be refused
uint16_t image_length(const struct image *image);
