// What the core asks of the chip. src/avr implements it; so does the PC test bench.
#pragma once
#include <stdbool.h>
#include <stdint.h>

// Serial line out. A reply goes only if it fits, so that the core never waits.
uint8_t hal_send_room(void);
void hal_send(uint8_t byte);

// The tick timer: its interrupt runs dda.h. start: the first tick comes after `interval` cycles.
void hal_timer_start(uint16_t interval);
void hal_timer_stop(void);  // no tick comes once this has returned

// Keeps the tick interrupt out for a few cycles.
#ifdef __AVR__
#include <avr/interrupt.h>
#define HAL_LOCK()              \
    {                           \
        const uint8_t sreg = SREG; \
        cli();
#define HAL_UNLOCK() \
    SREG = sreg;     \
    }
#else
#define HAL_LOCK() {
#define HAL_UNLOCK() }
#endif

void hal_drivers(bool on);              // ENABLE pins, by the configured polarity
uint8_t hal_switches(void);             // levels, bit i is input i
bool hal_abort_level(void);             // true: high
void hal_probe(uint8_t input, bool high);  // which switch level the tick interrupt takes for pressed
void hal_configured(void);              // a new image is in force: read its timing
