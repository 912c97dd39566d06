#include "commands.h"

#include <string.h>

#include "batch.h"
#include "bytes.h"
#include "cruise.h"
#include "hal.h"
#include "home.h"
#include "inputs.h"
#include "jog.h"

enum { CONFIG = 0x10, COMMIT, ENABLE, SET_POSITION, MOTION, HOME, JOG };
enum { DRIVERS = 1, PULSES = 2 };  // ENABLE
enum { SLOW_WHILE_LOST = 8 };      // JOG: this part of max_rate

static const int32_t FARTHEST = 1L << 30;

static uint8_t detail;  // of the error that a handler returns

static enum error fault(enum error error, uint8_t about) {
    detail = about;
    return error;
}

APART static enum error config_frame(const uint8_t *p, uint8_t length) {
    if (length < 5) {
        return E_LENGTH;
    }
    if (motion.state != IDLE) {
        return E_BUSY;
    }
    const enum error error = config_write(get16(p + 2), p + 4, length - 4);
    if (error) {
        return error;
    }
    config_activate();
    motion.retained = motion.pulses = false;
    memory.drivers = false;
    hal_drivers(false);
    memory_save();
    return OK;
}

APART static enum error commit_frame(const uint8_t *p, uint8_t length) {
    if (length != 8) {
        return E_LENGTH;
    }
    if (motion.state != IDLE) {
        return E_BUSY;
    }
    const enum error error = config_commit(get16(p + 2), get32(p + 4));
    if (!error) {
        hal_drivers(memory.drivers);  // the polarity is known only now
        memory_save();
    }
    return error;
}

static enum error enable_frame(const uint8_t *p, uint8_t length) {
    if (length != 3) {
        return E_LENGTH;
    }
    if (p[2] & ~(DRIVERS | PULSES)) {
        return E_VALUE;
    }
    if (!memory.config) {
        return E_CONFIG_NONE;
    }
    if (motion.state != IDLE) {
        return E_BUSY;
    }
    const bool drivers = p[2] & DRIVERS, pulses = p[2] & PULSES;
    if (drivers && !memory.drivers) {
        motion.wake = memory.image.wake + 1;
    }
    motion_lose((drivers ? 0 : STEPPER_AXES) | (pulses ? 0 : SERVO_AXES));
    memory.drivers = drivers;
    motion.pulses = pulses;
    hal_drivers(drivers);
    memory_save();
    return OK;
}

// A stepper may stand beyond its limits (at its switch); a servo has no place there.
static bool possible(uint8_t axis, int32_t count) {
    if (axis < STEPPERS) {
        return count >= -FARTHEST && count <= FARTHEST;
    }
    return count >= memory.image.axis[axis].lower && count <= memory.image.axis[axis].upper;
}

APART static enum error position_frame(const uint8_t *p, uint8_t length) {
    if (length < 4) {
        return E_LENGTH;
    }
    const uint16_t mask = get16(p + 2);
    const uint8_t *counts = p + 4, *next = counts;
    for (uint8_t i = 0; i < 16; i++) {
        next += mask >> i & 1 ? 4 : 0;
    }
    if (next != p + length) {
        return E_LENGTH;
    }
    if (!memory.config) {
        return E_CONFIG_NONE;
    }
    if (inputs.power_cut) {
        return E_POWER;
    }
    if (motion.state != IDLE) {
        return E_BUSY;
    }
    next = counts;
    for (uint8_t i = 0; i < 16; i++) {
        if (!(mask >> i & 1)) {
            continue;
        }
        const int32_t count = (int32_t)get32(next);
        next += 4;
        if (i >= AXES || !(limits.used >> i & 1) || !possible(i, count)) {
            return fault(E_VALUE, i);
        }
        if (memory.known >> i & 1) {
            return fault(E_KNOWN, i);
        }
    }
    for (uint8_t i = 0; i < AXES; i++) {
        if (mask >> i & 1) {
            memory.counts[i] = (int32_t)get32(counts);
            counts += 4;
        }
    }
    memory.known |= mask;
    motion.retained = false;
    motion_rest();
    return OK;
}

static void get_rates(const uint8_t *p, int32_t rate[AXES]) {
    for (uint8_t i = 0; i < AXES; i++) {
        rate[i] = (int32_t)get32(p + 4 * i);
    }
}

// What HOME and JOG ask of a vector of rates.
static enum error check_rates(const int32_t rate[AXES], bool jogging) {
    uint16_t axes = 0;
    for (uint8_t i = 0; i < AXES; i++) {
        axes |= rate[i] ? 1U << i : 0;
    }
    const bool lost = axes & ~memory.known;
    for (uint8_t i = 0; i < AXES; i++) {
        if (!rate[i]) {
            continue;
        }
        if (!(limits.used >> i & 1) || (i >= STEPPERS && !jogging)) {
            return fault(E_VALUE, i);
        }
        if (i >= STEPPERS && !(memory.known >> i & 1)) {
            return fault(E_LOST, i);
        }
        if (i < STEPPERS ? !memory.drivers : !motion.pulses) {
            return fault(E_DISABLED, i);
        }
        const uint32_t most = memory.image.axis[i].max_rate;
        const uint32_t slow = most / SLOW_WHILE_LOST ? most / SLOW_WHILE_LOST : 1;
        const uint32_t size = rate[i] < 0 ? 0U - (uint32_t)rate[i] : (uint32_t)rate[i];
        if (size > (jogging && lost ? slow : most) || size > INT32_MAX) {  // its way back has to be a rate, too
            return fault(E_RATE, i);
        }
    }
    return OK;
}

APART static enum error home_frame(const uint8_t *p, uint8_t length) {
    if (length != 15 + 4 * AXES) {
        return E_LENGTH;
    }
    enum error error = inputs_ready(false);
    if (error) {
        return error;
    }
    int32_t rate[AXES];
    bool any = false;
    get_rates(p + 15, rate);
    for (uint8_t i = 0; i < AXES; i++) {
        any |= rate[i] != 0;
    }
    const uint32_t backoff = get32(p + 5), travel = get32(p + 9);
    if (!any || p[2] >= SWITCHES || p[3] > 1 || p[4] == 0 || backoff == 0 || backoff > (uint32_t)FARTHEST ||
        travel > (uint32_t)FARTHEST) {
        return E_VALUE;
    }
    error = check_rates(rate, false);
    if (error) {
        return error;
    }
    home.input = p[2];
    home.closed = p[3];
    home.slow = p[4];
    home.backoff = backoff;
    home.travel = travel;
    home.time = 100UL * get16(p + 13);
    memcpy(cruise.asked, rate, sizeof rate);
    home_begin();
    return OK;
}

APART static enum error jog_frame(const uint8_t *p, uint8_t length) {
    if (length != 2 + 4 * AXES) {
        return E_LENGTH;
    }
    int32_t rate[AXES];
    enum error error = inputs_ready(motion.state == JOGGING);
    if (!error) {
        get_rates(p + 2, rate);
        error = check_rates(rate, true);
    }
    if (!error) {
        jog(rate);
    }
    return error;
}

static enum error carry_out(const uint8_t *p, uint8_t length) {
    switch (p[0]) {
        case CONFIG:
            return config_frame(p, length);
        case COMMIT:
            return commit_frame(p, length);
        case ENABLE:
            return enable_frame(p, length);
        case SET_POSITION:
            return position_frame(p, length);
        case MOTION:
            return batch_received(p, length, &detail);
        case HOME:
            return home_frame(p, length);
        case JOG:
            return jog_frame(p, length);
        default:
            return E_TYPE;
    }
}

APART enum error order_received(const uint8_t *payload, uint8_t length, uint8_t *about) {
    detail = 0;
    const enum error error = carry_out(payload, length);
    *about = detail;
    return error;
}
