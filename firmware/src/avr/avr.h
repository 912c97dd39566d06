// The parts of the chip, and the main loop's way to them.
#pragma once
#include <stdbool.h>
#include <stdint.h>

#include "ports.h"

void stepper_setup(void);

void serial_setup(void);
bool serial_get(uint8_t *byte);

void servo_setup(void);
void servo_frame(void);  // every 20 ms: one pulse each

void pins_setup(void);

uint8_t reset_cause(void);  // MCUSR, or what the bootloader tells; 0: hidden
