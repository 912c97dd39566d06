#include "protocol.h"

#include <string.h>

#include "batch.h"
#include "bytes.h"
#include "cruise.h"
#include "hal.h"
#include "home.h"
#include "jog.h"
#include "link.h"

enum { HELLO = 0x01, STATUS_ASK, HOLD };
enum { CONFIG = 0x10, COMMIT, ENABLE, SET_POSITION, MOTION, HOME, JOG };
enum { ACK = 0x80, INFO, STATUS, CREDIT };
enum { SEQUENCED = 0x10, REPLIES = 0x80 };
enum { SILENCE_MS = 500, ABORT_MS = 3, SLOW_WHILE_LOST = 8 };
enum { DRIVERS = 1, PULSES = 2, CONFIGURED = 4, RETAINED = 8, ABORTED = 16, LATCH = 32 };  // flags

struct session session;

static uint32_t nonce;
static bool greeted;  // `nonce` is of a HELLO
static uint8_t cause;
static uint8_t abort_steady;
static uint8_t told_free;  // credit that the host knows of
static const int32_t FARTHEST = 1L << 30;

void session_end(enum error error, uint8_t detail) {
    if (!session.error) {
        session.error = error;
        session.detail = detail;
    }
    if (session.state == MOVING) {
        motion_hold();
    } else if (session.state == HOMING || session.state == JOGGING) {
        session.state = HOLDING;
        cruise.target = 0;
    }
}

// ---- replies

static uint8_t *put_head(uint8_t *p) {
    *p++ = session.next;
    *p++ = session.error;
    *p++ = session.detail;
    *p++ = session.state;
    return p;
}

static uint8_t *put_credit(uint8_t *p) {
    *p++ = told_free = motion_free();
    return put16(p, motion_queued());
}

static void send_ack(uint8_t type) {
    uint8_t reply[8] = {type};
    put_credit(put_head(reply + 1));
    link_send(reply, sizeof reply);
}

static uint8_t flags(void) {
    return (memory.drivers ? DRIVERS : 0) | (motion.pulses ? PULSES : 0) | (memory.config ? CONFIGURED : 0) |
           (motion.retained ? RETAINED : 0) | (session.abort ? ABORTED : 0) | (home_finished ? LATCH : 0);
}

static void send_info(uint8_t tag, uint32_t said) {
    uint8_t reply[33] = {INFO, tag, PROTOCOL_VERSION, FIRMWARE_MAJOR, FIRMWARE_MINOR};
    uint8_t *p = put32(reply + 5, said);
    *p++ = BOARD_ID;
    *p++ = AXES;
    p = put16(p, SERVO_AXES);
    *p++ = SWITCHES;
    *p++ = ROWS;
    *p++ = QUEUE_SLOTS;
    *p++ = FRAME_MAX;
    p = put16(p, MIN_INTERVAL);
    p = put32(p, CLOCK);
    p = put32(p, memory.config);
    p = put16(p, memory.known);
    *p++ = flags();
    p = put16(p, memory.boots);
    *p = cause;
    link_send(reply, sizeof reply);
}

static void send_status(uint8_t tag, uint8_t page) {
    uint8_t reply[16 + 4 * AXES] = {STATUS, tag};
    int32_t counts[AXES];
    if (page == 1) {
        memcpy(counts, motion.latch, sizeof counts);
    } else {
        motion_counts(counts);
    }
    uint8_t *p = put_head(reply + 2);
    *p++ = flags();
    p = put_credit(p);
    p = put16(p, memory.known);
    *p++ = hal_switches();
    *p++ = dda.overruns;
    *p++ = link_bad;
    *p++ = page == 1;
    for (uint8_t i = 0; i < AXES; i++) {
        p = put32(p, counts[i]);
    }
    link_send(reply, sizeof reply);
}

// ---- frames in sequence. Each is done as a whole or not at all.

static uint8_t detail;  // of the error that a handler returns

static enum error fault(enum error error, uint8_t about) {
    detail = about;
    return error;
}

static enum error config_frame(const uint8_t *p, uint8_t length) {
    if (length < 5) {
        return E_LENGTH;
    }
    if (session.state != IDLE) {
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

static enum error commit_frame(const uint8_t *p, uint8_t length) {
    if (length != 8) {
        return E_LENGTH;
    }
    if (session.state != IDLE) {
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
    if (session.state != IDLE) {
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

static enum error position_frame(const uint8_t *p, uint8_t length) {
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
    if (session.state != IDLE) {
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

static void get_rates(const uint8_t *p, int16_t rate[AXES]) {
    for (uint8_t i = 0; i < AXES; i++) {
        rate[i] = (int16_t)get16(p + 2 * i);
    }
}

// What HOME and JOG ask of a vector of rates.
static enum error check_rates(const int16_t rate[AXES], bool jogging) {
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
        const uint16_t most = memory.image.axis[i].max_rate;
        const uint16_t slow = most / SLOW_WHILE_LOST ? most / SLOW_WHILE_LOST : 1;
        const uint16_t size = rate[i] < 0 ? 0U - (uint16_t)rate[i] : (uint16_t)rate[i];
        if (size > (jogging && lost ? slow : most)) {
            return fault(E_RATE, i);
        }
    }
    return OK;
}

static enum error home_frame(const uint8_t *p, uint8_t length) {
    if (length != 13 + 2 * AXES) {
        return E_LENGTH;
    }
    if (!memory.config) {
        return E_CONFIG_NONE;
    }
    if (session.abort) {
        return E_ABORT;
    }
    if (session.state != IDLE) {
        return E_BUSY;
    }
    int16_t rate[AXES];
    bool any = false;
    get_rates(p + 13, rate);
    for (uint8_t i = 0; i < AXES; i++) {
        any |= rate[i] != 0;
    }
    const uint16_t backoff = get16(p + 5);
    if (!any || p[2] >= SWITCHES || p[3] > 1 || p[4] == 0 || backoff == 0) {
        return E_VALUE;
    }
    const enum error error = check_rates(rate, false);
    if (error) {
        return error;
    }
    home.input = p[2];
    home.closed = p[3];
    home.slow = p[4];
    home.backoff = backoff;
    home.travel = get32(p + 7);
    home.time = 100UL * get16(p + 11);
    memcpy(home.rate, rate, sizeof rate);
    home_begin();
    return OK;
}

static enum error jog_frame(const uint8_t *p, uint8_t length) {
    if (length != 2 + 2 * AXES) {
        return E_LENGTH;
    }
    if (!memory.config) {
        return E_CONFIG_NONE;
    }
    if (session.abort) {
        return E_ABORT;
    }
    if (session.state != IDLE && session.state != JOGGING) {
        return E_BUSY;
    }
    int16_t rate[AXES];
    get_rates(p + 2, rate);
    const enum error error = check_rates(rate, true);
    if (!error) {
        jog(rate);
    }
    return error;
}

static enum error dispatch(const uint8_t *p, uint8_t length) {
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

static void in_sequence(const uint8_t *p, uint8_t length) {
    if (session.error == OK && p[1] == session.next) {
        detail = 0;
        const enum error error = dispatch(p, length);
        if (error) {
            session_end(error, detail);
        } else {
            session.next++;
        }
    }
    send_ack(ACK);
}

// ---- frames that need no session

static void hello(const uint8_t *p) {
    const uint32_t said = get32(p + 3);
    if (p[2] != PROTOCOL_VERSION) {
        session_end(E_VERSION, 0);
    } else if (!greeted || said != nonce) {
        session_end(E_HELD, 0);  // whatever the former host had moving
        session.next = session.error = session.detail = 0;
        dda.overruns = link_bad = 0;
        nonce = said;
        greeted = true;
    }
    send_info(p[1], said);
}

void frame_received(const uint8_t *payload, uint8_t length) {
    if (payload[0] >= SEQUENCED && payload[0] < REPLIES) {
        session.silent = 0;
        in_sequence(payload, length);
    } else if (payload[0] == HELLO && length == 7) {
        session.silent = 0;
        hello(payload);
    } else if (payload[0] == STATUS_ASK && length == 3) {
        session.silent = 0;
        send_status(payload[1], payload[2]);
    } else if (payload[0] == HOLD && length == 2) {
        session.silent = 0;
        session_end(E_HELD, 0);
        send_ack(ACK);
    }
}

// ---- time

static void watch_abort(void) {
    const bool closed = memory.image.flags & ABORT_CLOSED;
    const bool active = memory.config && hal_abort_level() == closed;
    if (active == session.abort) {
        abort_steady = 0;
    } else if (++abort_steady >= ABORT_MS) {
        session.abort = active;
        abort_steady = 0;
    }
    if (session.abort && session.state != IDLE) {
        session_end(E_ABORT, 0);
    }
}

void protocol_millisecond(void) {
    watch_abort();
    if ((session.state == MOVING || session.state == HOMING) && ++session.silent >= SILENCE_MS) {
        session_end(E_SILENCE, 0);
    }
    motion_millisecond();
    if (session.state == HOMING) {
        home_millisecond();
    } else if (session.state == JOGGING) {
        jog_millisecond();
    }
}

void protocol_poll(void) {
    motion_poll();
    if (session.state == MOVING && (uint8_t)(motion_free() - told_free) >= QUEUE_SLOTS / 4) {
        send_ack(CREDIT);
    }
    if (session.state == HOMING) {
        home_poll();
    } else if (session.state == JOGGING) {
        jog_poll();
    } else if (session.state == HOLDING && motion.cruising) {
        cruise_poll();
        if (cruise_resting()) {
            motion_rest();
        }
    }
}

void protocol_start(uint8_t reset_cause) {
    cause = reset_cause;
    session = (struct session){.error = E_NO_SESSION};
    greeted = false;
    home_finished = false;
    motion_start(memory_restore(cause));
}
