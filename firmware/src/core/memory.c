#include "memory.h"

#include <stddef.h>
#include <string.h>

#include "crc.h"

HAL_NOINIT struct memory memory;

enum { POWER_ON = 1, BROWN_OUT = 4 };         // MCUSR
enum { STANDING = 0x5A, MOVING = 0xA5 };      // far from what decayed memory holds

static uint32_t sum(void) {
    return crc_block(&memory, offsetof(struct memory, check));
}

bool memory_restore(uint8_t cause) {
    const bool intact = !(cause & (POWER_ON | BROWN_OUT)) && memory.check == sum();
    const bool retained = intact && memory.moving == STANDING;
    const uint16_t boots = intact ? memory.boots : 0;
    if (!retained) {
        memset(&memory, 0, sizeof memory);
    }
    memory.boots = boots + 1;
    memory.known &= STEPPER_AXES;  // a servo without pulses holds nothing
    memory_save();
    return retained && memory.known;
}

void memory_save(void) {
    memory.check = sum();
    HAL_BARRIER();
    memory.moving = STANDING;
}

void memory_moving(void) {
    memory.moving = MOVING;
    HAL_BARRIER();
}
