// For Frama-C's EVA: what the core does with any frame, any bytes on the line, any time, in any order.
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

static void tick(void) {
    if (dda.probe) {
        dda_probe(any & 1);
    }
    if (dda.now && dda_next()) {
        dda_bits();
    }
}

static void line(void) {
    const uint8_t byte = any;
    link_bytes(&byte, 1);
    protocol_frame();
}

int main(void) {
    Frama_C_make_unknown((char *)&memory, sizeof memory);
    protocol_start(any);
    while (Frama_C_nondet(0, 1)) {
        switch (Frama_C_interval(0, 3)) {
            case 0: line(); break;
            case 1: protocol_poll(); break;
            case 2: protocol_millisecond(); break;
            default: tick();
        }
    }
    return 0;
}
