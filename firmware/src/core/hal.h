// What the core asks of the chip, by calls and one flag; chip.h has the rest. src/avr and src/rp2040 implement it; so does the PC test bench.
#pragma once
#include <stdbool.h>
#include <stdint.h>

#include "../chip.h"

// Serial line out. A reply goes only if it fits, so that the core never waits.
uint8_t hal_send_room(void);
void hal_send(uint8_t byte);
extern volatile uint8_t hal_late_servos;  // frames of servo pulses that came too late, saturating; the session sets it to 0
extern volatile uint8_t hal_spilled;  // set by the chip when bytes are lost because more than HAL_RECEIVE wait

// The tick timer: its interrupt runs dda.h. start: the first tick comes after `interval` cycles.
void hal_timer_start(uint16_t interval);
void hal_timer_stop(void);  // no tick comes once this has returned

void hal_drivers(bool on);              // ENABLE pins, by the configured polarity
uint8_t hal_switches(void);             // levels, bit i is input i
bool hal_abort_level(void);             // true: high
bool hal_power_level(void);             // of the motors' supply, true: it is there
void hal_probe(uint8_t input, bool high);  // which switch level the tick interrupt takes for pressed
void hal_configured(void);              // a new image is in force: read its timing
