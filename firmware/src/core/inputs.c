#include "inputs.h"

#include <string.h>

#include "hal.h"
#include "motion.h"

enum { STEADY_MS = 3 };

struct inputs inputs;

static uint8_t abort_steady, power_steady, switch_steady;
static uint8_t switches;  // pressed, as seen last

void inputs_start(void) {
    memset(&inputs, 0, sizeof inputs);
    abort_steady = power_steady = switch_steady = switches = 0;
}

// True when `now` has differed from `state` for STEADY_MS.
static bool turned(bool now, bool state, uint8_t *steady) {
    *steady = now == state ? 0 : *steady + 1;
    if (*steady < STEADY_MS) {
        return false;
    }
    *steady = 0;
    return true;
}

static uint8_t pressed_now(void) {
    const uint8_t levels = hal_switches();
    uint8_t pressed = 0, bit = 1;
    (void)levels;
    for (uint8_t n = 0; n < SWITCHES; n++, bit <<= 1) {
        const uint8_t flags = memory.image.guard[n].flags;
        if (flags & USED && !!(levels & bit) == !!(flags & CLOSED)) {
            pressed |= bit;
        }
    }
    return pressed;
}

// Does a segment lead on into the switch? Small sums are the rounding of rates that cancel out.
static bool toward(uint8_t n, const struct segment *s) {
    float sum = 0, most = 0;
    for (uint8_t i = 0; i < AXES; i++) {
        const float part = (float)memory.image.guard[n].weight[i] * (uint32_t)segment_rate(s, i, 1U << i);
        const float size = part < 0 ? -part : part;
        most = size > most ? size : most;
        sum += s->back >> i & 1 ? -part : part;
    }
    return sum > most / 16;
}

enum error inputs_blocking(const struct segment *s, uint8_t *detail) {
    for (uint8_t n = 0; n < SWITCHES; n++) {
        if (inputs.pressed >> n & 1 && toward(n, s)) {
            *detail = n;
            return E_LIMIT_SWITCH;
        }
    }
    return OK;
}

enum error inputs_ready(bool moving) {
    if (!memory.config) {
        return E_CONFIG_NONE;
    }
    if (inputs.abort) {
        return E_ABORT;
    }
    if (inputs.power_cut) {
        return E_POWER;
    }
    return motion.state == IDLE || moving ? OK : E_BUSY;
}

APART enum error inputs_millisecond(uint8_t *detail) {
    const uint8_t flags = memory.image.flags;
    const bool abort = memory.config && hal_abort_level() == !!(flags & ABORT_CLOSED);
    const bool cut = memory.config && flags & POWER_SENSED && !hal_power_level();
    const uint8_t now = memory.config ? pressed_now() : 0;
    if (turned(abort, inputs.abort, &abort_steady)) {
        inputs.abort = abort;
    }
    if (turned(cut, inputs.power_cut, &power_steady)) {
        inputs.power_cut = cut;
        if (cut) {
            motion_lose(ALL_AXES);
            if (motion.state == IDLE) {
                memory_save();
            }
        }
    }
    switch_steady = now == switches ? switch_steady + (switch_steady < STEADY_MS) : 0;
    switches = now;
    if (switch_steady >= STEADY_MS - 1) {
        inputs.pressed = now;
    }
    if (motion.state == IDLE) {
        return OK;
    }
    if (inputs.abort || inputs.power_cut) {
        return inputs.abort ? E_ABORT : E_POWER;
    }
    const struct segment *s = inputs.pressed && motion.state != HOMING ? motion_running() : 0;
    return s ? inputs_blocking(s, detail) : OK;
}
