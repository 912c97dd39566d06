#include "protocol.h"

#include <string.h>

#include "bytes.h"
#include "cruise.h"
#include "hal.h"
#include "home.h"
#include "inputs.h"
#include "jog.h"
#include "link.h"
#include "commands.h"

enum { HELLO = 0x01, STATUS_ASK, HOLD };
enum { ACK = 0x80, INFO, STATUS, CREDIT };
enum { SEQUENCED = 0x10, REPLIES = 0x80 };
enum { SILENCE_MS = 500 };
enum { DRIVERS = 1, PULSES = 2, CONFIGURED = 4, RETAINED = 8, ABORTED = 16, LATCH = 32, CUT = 64 };  // flags

struct session session;
volatile uint8_t hal_spilled, hal_late_servos;

static uint32_t nonce;
static bool greeted;  // `nonce` is of a HELLO
static uint8_t cause;
static uint8_t told_free;  // credit that the host knows of

// Ends the session (the first cause stays) and brings the board to rest.
APART static void fail(enum error error, uint8_t detail) {
    if (!session.error) {
        session.error = error;
        session.detail = detail;
    }
    if (error == E_LIMIT_SWITCH) {
        motion.gentle = 0;
    }
    if (motion.state == MOVING) {
        motion_stop();
    } else if (motion.state == HOMING || motion.state == JOGGING) {
        motion.state = HOLDING;
        cruise.target = 0;
    }
}

static inline void end(enum error error, uint8_t detail) {
    if (error) {
        fail(error, detail);
    }
}

// ---- replies

static uint8_t *put_head(uint8_t *p) {
    *p++ = session.next;
    *p++ = session.error;
    *p++ = session.detail;
    *p++ = motion.state;
    return p;
}

static uint8_t *put_credit(uint8_t *p) {
    *p++ = told_free = motion_free();
    return put16(p, motion_queued());
}

APART static void send_ack(uint8_t type) {
    uint8_t reply[10] = {type};
    put16(put_credit(put_head(reply + 1)), session.digest);
    link_send(reply, sizeof reply);
}

static uint8_t flags(void) {
    return (memory.drivers ? DRIVERS : 0) | (motion.pulses ? PULSES : 0) | (memory.config ? CONFIGURED : 0) |
           (motion.retained ? RETAINED : 0) | (inputs.abort ? ABORTED : 0) | (home_finished ? LATCH : 0) |
           (inputs.power_cut ? CUT : 0);
}

APART static void send_info(uint8_t tag, uint32_t said) {
    uint8_t reply[35] = {INFO, tag, PROTOCOL_VERSION, FIRMWARE_MAJOR, FIRMWARE_MINOR};
    uint8_t *p = put32(reply + 5, said);
    *p++ = BOARD_ID;
    *p++ = AXES;
    p = put16(p, SERVO_AXES);
    *p++ = SWITCHES;
    *p++ = ROWS;
    *p++ = QUEUE_SLOTS;
    *p++ = FRAME_MAX;
    p = put16(p, HAL_RECEIVE);
    p = put16(p, MIN_INTERVAL);
    p = put32(p, CLOCK);
    p = put32(p, memory.config);
    p = put16(p, memory.known);
    *p++ = flags();
    p = put16(p, memory.boots);
    *p = cause;
    link_send(reply, sizeof reply);
}

APART static void send_status(uint8_t tag, uint8_t page) {
    uint8_t *const reply = link_frame();
    reply[0] = STATUS;
    reply[1] = tag;
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
    p = put16(p, session.digest);
    for (uint8_t i = 0; i < AXES; i++) {
        p = put32(p, counts[i]);
    }
    *p = hal_late_servos;
    link_send(reply, 19 + 4 * AXES);
}

// Whether an answer fits the line out: until then a frame waits, so that every one is answered.
static bool answer_fits(void) {
    return hal_send_room() >= LARGEST_REPLY;
}

// ---- frames in sequence

static void in_sequence(const uint8_t *p, uint8_t length) {
    if (session.error == OK && p[1] == session.next) {
        uint8_t detail = 0;
        const enum error error = order_received(p, length, &detail);
        end(error, detail);
        session.next += error == OK;
    }
    send_ack(ACK);
}

// ---- frames that need no session

static void hello(const uint8_t *p) {
    const uint32_t said = get32(p + 3);
    if (p[2] != PROTOCOL_VERSION) {
        end(E_VERSION, 0);
    } else if (!greeted || said != nonce) {
        end(E_HELD, 0);  // whatever the former host had moving
        session.next = session.error = session.detail = 0;
        session.digest = said;
        dda.overruns = link_bad = hal_late_servos = 0;
        nonce = said;
        greeted = true;
    }
    send_info(p[1], said);
}

static void frame_received(const uint8_t *payload, uint8_t length) {
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
        end(E_HELD, 0);
        send_ack(ACK);
    }
}

APART void protocol_frame(void) {
    const uint8_t length = link_length;
    if (length && answer_fits()) {
        link_length = 0;
        frame_received(link_frame(), length);
    }
}

// ---- time

APART void protocol_millisecond(void) {
    const uint8_t state = motion.state;
    uint8_t detail = 0;
    const enum error error = inputs_millisecond(&detail);
    end(error, detail);
    if ((state == MOVING || state == HOMING) && ++session.silent >= SILENCE_MS) {
        end(E_SILENCE, 0);
    }
    end(motion_millisecond(), 0);
    if (motion.state == HOMING) {
        end(home_millisecond(), 0);
    } else if (motion.state == JOGGING) {
        jog_millisecond();
    }
}

// Bytes were lost because more of them waited than the host may send: it hears of it at once, and goes back.
static void watch_line(void) {
    if (!hal_spilled || !answer_fits()) {
        return;
    }
    hal_spilled = 0;
    const uint8_t detail = session.detail;
    session.detail = session.error ? detail : E_SPILL;
    send_ack(CREDIT);
    session.detail = detail;
}

APART void protocol_poll(void) {
    watch_line();
    end(motion_poll(), 0);
    if (motion.state == MOVING && (uint8_t)(motion_free() - told_free) >= QUEUE_SLOTS / 4 && answer_fits()) {
        send_ack(CREDIT);
    }
    if (motion.state == HOMING) {
        end(home_poll(), 0);
    } else if (motion.state == JOGGING) {
        jog_poll();
    } else if (motion.state == HOLDING && motion.cruising) {
        cruise_poll();
        if (cruise_resting()) {
            motion_rest();
        }
    }
}

APART void protocol_start(uint8_t reset_cause) {
    cause = reset_cause;
    session = (struct session){.error = E_NO_SESSION};
    greeted = false;
    home_finished = false;
    inputs_start();
    motion_start(memory_restore(cause));
}
