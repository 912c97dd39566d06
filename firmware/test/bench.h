// A PC in place of the chip: implements hal.h, lets time pass tick by tick, and counts the steps at the "pins".
#pragma once
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "../src/board.h"

void bench_power(void);          // power-on: no memory
void bench_reset(uint8_t cause);  // the memory survives
void bench_run(uint32_t us);     // this much time passes
void bench_wire(const uint8_t *bytes, size_t length);
void bench_payload(const uint8_t *payload, size_t length);  // adds CRC and framing
size_t bench_answer(uint8_t *payload, size_t room);         // the next answer, checked and unframed; 0: none

size_t bench_raw(uint8_t *bytes, size_t room);               // all that was sent, as it went over the line

extern int32_t bench_pins[AXES];   // net steps, as the STEP and DIR pins say
extern uint8_t bench_switches;     // levels
extern bool bench_abort;           // level
extern uint64_t bench_cycles;
extern uint64_t bench_ticks;
extern bool bench_drivers_on;
extern bool bench_frozen;       // the main loop hangs, the ticks go on
extern bool bench_power_level;  // of the motors' supply
extern void (*bench_on_tick)(void);  // with each tick, once its edges are out
