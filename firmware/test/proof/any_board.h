// A board for Frama-C's EVA of which nothing is known: whatever its inputs say, at any time.
#include <__fc_builtin.h>

#include "../../src/core/dda.h"
#include "../../src/core/hal.h"
#include "../../src/core/link.h"
#include "../../src/core/memory.h"
#include "../../src/core/protocol.h"

#define any ((unsigned)Frama_C_interval(0, 255))

uint8_t hal_send_room(void) { return any; }
void hal_send(uint8_t byte) { (void)byte; }
void hal_timer_start(uint16_t interval) { (void)interval; }
void hal_timer_stop(void) { }
void hal_drivers(bool on) { (void)on; }
uint8_t hal_switches(void) { return any; }
bool hal_abort_level(void) { return any & 1; }
bool hal_power_level(void) { return any & 1; }
void hal_probe(uint8_t input, bool high) { (void)input; (void)high; }
void hal_configured(void) { }
void dda_direction(uint16_t back) { (void)back; }
