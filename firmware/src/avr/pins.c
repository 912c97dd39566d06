// Switches, the abort input and the drivers' ENABLE.
#include "../core/hal.h"
#include "../core/memory.h"
#include "avr.h"

void hal_drivers(bool on) {
    const bool high = on == !!(memory.image.flags & ENABLE_HIGH);
    (void)high;
#define SET_ENABLE(port, bit) \
    if (high) {               \
        PIN_HIGH(port, bit);  \
    } else {                  \
        PIN_LOW(port, bit);   \
    }
    ENABLE_PINS(SET_ENABLE)
}

uint8_t hal_switches(void) {
    uint8_t levels = 0;
#define ONE_SWITCH(i, port, bit) levels |= PIN_READ(port, bit) << (i);
    SWITCH_PINS(ONE_SWITCH)
    return levels;
}

#define READ_ONE(port, bit) PIN_READ(port, bit)
bool hal_abort_level(void) {
    return ABORT_PIN(READ_ONE);
}

bool hal_power_level(void) {
    return POWER_PIN(READ_ONE);
}

void pins_setup(void) {
#define SWITCH_INPUT(i, port, bit) PIN_PULL_UP(port, bit);
#define ABORT_INPUT(port, bit) PIN_PULL_UP(port, bit);
#define ENABLE_OUTPUT(port, bit) \
    PIN_HIGH(port, bit);         \
    PIN_OUTPUT(port, bit);  // off first, as these boards' drivers are enabled by low
    SWITCH_PINS(SWITCH_INPUT)
    ABORT_PIN(ABORT_INPUT)
    ENABLE_PINS(ENABLE_OUTPUT)
}
