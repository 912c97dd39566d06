// The parts of the chip, and the main loop's way to them.
#pragma once
#include <stdbool.h>
#include <stdint.h>

#include "ports.h"

void stepper_setup(void);

void serial_setup(void);
uint8_t serial_waiting(const uint8_t **bytes);  // so many that came, in a row
void serial_taken(uint8_t count);

void servo_setup(void);
bool servo_frame(void);  // every 20 ms: one pulse each; false: those of the frame before are not done

void pins_setup(void);

uint8_t reset_cause(void);  // MCUSR, or what the bootloader tells; 0: hidden
