// What is slow on the pins: ENABLE, limit switches, abort, the motors' power.
#ifdef __arm__
#include "../core/hal.h"
#include "../core/memory.h"
#include "pico.h"

void pin_function(uint8_t pin, uint8_t function, uint8_t pad) {
    REG(PAD(pin)) = pad;
    REG(IO_CTRL(pin)) = function;
}

static bool level(uint8_t pin) {
    return REG(SIO_IN) >> pin & 1;
}

void hal_drivers(bool on) {
    const bool high = on == !!(memory.image.flags & ENABLE_HIGH);
    REG(high ? SIO_OUT_SET : SIO_OUT_CLR) = 1UL << ENABLE_PIN;
}

uint8_t hal_switches(void) {
    return REG(SIO_IN) >> SWITCH_FIRST & ((1 << SWITCHES) - 1);
}

bool hal_abort_level(void) {
    return level(ABORT_PIN);
}

bool hal_power_level(void) {
    return level(POWER_PIN);
}

void pins_setup(void) {
    enum { PULLED_UP = PAD_INPUT | PAD_UP | PAD_SCHMITT, PLAIN = PAD_INPUT | PAD_SCHMITT };
    for (uint8_t i = 0; i < SWITCHES; i++) {
        pin_function(SWITCH_FIRST + i, F_SIO, PULLED_UP);
    }
    pin_function(ABORT_PIN, F_SIO, PULLED_UP);
    pin_function(POWER_PIN, F_SIO, PLAIN);
    REG(SIO_OUT_SET) = 1UL << ENABLE_PIN;  // off first, as drivers are mostly enabled by low
    REG(SIO_OE_SET) = 1UL << ENABLE_PIN;
    pin_function(ENABLE_PIN, F_SIO, PAD_4MA);
}
#endif
