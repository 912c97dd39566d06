#include "motion.h"

#include <string.h>

#include "hal.h"

struct segment queue[QUEUE_SLOTS];
volatile uint8_t queue_head, queue_tail;
struct dda dda;
struct motion motion;

static uint8_t settled;        // segments before this one are in memory.counts
static uint32_t queued_units;  // of the segments from `settled` on
static uint16_t latched_left;
static uint8_t latched_slot;
static float speed;       // u: ms that the arm needs to stop, as last looked at
static float hold_speed;  // u that the hold allows
static uint8_t pace;

static const float STANDING = 1.0F;       // ms: u at which a hold stands still
static const float TOO_FAST = 30.0F;      // ms: u from which an abrupt stop loses steps
static const float UNIT_MS = 256e3F / CLOCK;

#define SHARED(x) (*(volatile __typeof__(x) *)&(x))  // the interrupt changes it

static uint16_t last_interval(const struct segment *s) {
    return s->interval + ((int32_t)s->add * (uint16_t)(s->ticks - 1) >> 8);
}

static uint32_t span(uint16_t ticks, uint16_t first, uint16_t last) {
    return ticks * (((uint32_t)first + last) >> 1) >> 8;
}

static uint32_t units(const struct segment *s) {
    return span(s->ticks, s->interval, last_interval(s));
}

// Steps of one axis that `ticks` of its segment have put out (PROTOCOL.md, section 6).
static uint16_t done(const struct segment *s, uint8_t axis, uint16_t ticks) {
    return ((uint32_t)ticks * s->steps[axis] + (s->ticks - 1 - (s->ticks >> 1))) / s->ticks;
}

static void add_steps(int32_t counts[AXES], const struct segment *s, uint16_t ticks) {
    axes_t back = s->back;
    for (uint8_t i = 0; i < AXES; i++, back >>= 1) {
        if (s->steps[i]) {
            const uint16_t n = ticks == s->ticks ? s->steps[i] : done(s, i, ticks);
            counts[i] += back & 1 ? -(int32_t)n : (int32_t)n;
        }
    }
}

// The interrupt notes ticks, not counts: turn them into counts while their segment is still there.
static void take_latch(void) {
    bool pressed;
    uint8_t slot;
    uint16_t left;
    HAL_LOCK();
    pressed = SHARED(dda.pressed);
    slot = SHARED(dda.pressed_slot);
    left = SHARED(dda.pressed_left);
    HAL_UNLOCK();
    if (!pressed || (motion.latched && slot == latched_slot && left == latched_left)) {
        motion.latched = pressed;
        return;
    }
    motion.latched = true;
    latched_slot = slot;
    latched_left = left;
    memcpy(motion.latch, memory.counts, sizeof motion.latch);
    for (uint8_t at = settled; at != slot; at++) {
        add_steps(motion.latch, queue_slot(at), queue_slot(at)->ticks);
    }
    const struct segment *s = queue_slot(slot);
    add_steps(motion.latch, s, s->ticks - left);
}

// Counts what has been done up to the segment at `tail`. (Read the tail before: what is latched later lies behind it.)
static void settle_to(uint8_t tail) {
    if (dda.probe) {
        take_latch();
    }
    while (settled != tail) {
        const struct segment *s = queue_slot(settled);
        add_steps(memory.counts, s, s->ticks);
        queued_units -= units(s);
        settled++;
    }
}

static void settle(void) {
    settle_to(queue_tail);
}

// The running segment and its ticks left to compute; null at rest. Its slot stays ours until it is settled.
static const struct segment *running(uint16_t *left, uint16_t *interval) {
    const struct segment *s;
    uint8_t tail;
    HAL_LOCK();
    tail = queue_tail;
    s = SHARED(dda.now);
    *left = SHARED(dda.left);
    *interval = SHARED(dda.interval) >> 8;
    HAL_UNLOCK();
    settle_to(tail);
    return s;
}

void motion_counts(int32_t counts[AXES]) {
    uint16_t left, interval;
    const struct segment *s = running(&left, &interval);
    memcpy(counts, memory.counts, sizeof memory.counts);
    if (s) {
        add_steps(counts, s, s->ticks - left - 1);  // the bits of one tick are computed, not yet out
    }
}

uint8_t motion_free(void) {
    return QUEUE_SLOTS - (uint8_t)(queue_head - settled);
}

uint16_t motion_queued(void) {
    const uint32_t ms = queued_units * 2 / 125;  // 256 cycles = 2/125 ms
    return ms > 0xFFFF ? 0xFFFF : ms;
}

bool motion_queue_empty(void) {
    return settled == queue_head;
}

struct segment *motion_slot(uint8_t ahead) {
    return queue_slot(queue_head + ahead);
}

void motion_append(uint8_t segments, bool end) {
    for (uint8_t n = 0; n < segments; n++) {
        struct segment *s = motion_slot(n);
        s->last = end && n + 1 == segments;
        queued_units += units(s);
    }
    motion.ended = end;
    queue_head += segments;
}

static void flush(void) {
    queue_head = settled = queue_tail;
    queued_units = 0;
}

void motion_begin(enum state state) {
    memory_moving();
    session.state = state;
    motion.cruising = state != MOVING;
    speed = 0;
}

void motion_rest(void) {
    dda.stretch = 256;
    dda.probe = false;
    memcpy(motion.plan, memory.counts, sizeof motion.plan);
    session.state = IDLE;
    motion.cruising = false;
    memory_save();
}

void motion_lose(uint16_t axes) {
    memory.known &= ~axes;
    if (!memory.known) {
        motion.retained = false;
    }
}

// u of PROTOCOL.md, section 7, in ms.
static float stop_time(const struct segment *s, uint16_t interval) {
    float most = 0;
    for (uint8_t i = 0; i < AXES; i++) {
        if (s->steps[i]) {
            const float one = s->steps[i] * limits.stop_time[i];
            most = one > most ? one : most;
        }
    }
    return most / ((float)s->ticks * interval);
}

static void stand_still(void) {
    hal_timer_stop();
    settle();
    const struct segment *s = dda.now;
    if (s) {
        add_steps(memory.counts, s, s->ticks - dda.left - 1);
    }
    dda.now = 0;
    flush();
    motion_rest();
}

void motion_hold(void) {
    uint16_t left, interval;
    const struct segment *s = running(&left, &interval);
    session.state = HOLDING;
    if (!s) {
        stand_still();
        return;
    }
    hold_speed = stop_time(s, interval);
}

// Time is stretched so that u falls by 1 ms a ms, unless the plan is slower by itself.
static void hold_millisecond(const struct segment *s, uint16_t interval) {
    const float planned = stop_time(s, interval);
    hold_speed -= 1.0F;
    speed = planned < hold_speed ? planned : hold_speed;
    if (hold_speed < STANDING) {
        stand_still();
        return;
    }
    const float stretch = planned <= hold_speed ? 256.0F : 256.0F * planned / hold_speed;
    const uint16_t fixed = stretch > 65535.0F ? 65535U : (uint16_t)stretch;
    HAL_LOCK();
    SHARED(dda.stretch) = fixed;
    HAL_UNLOCK();
}

// The queue must always hold the path that a stop needs.
static void watch_queue(const struct segment *s, uint16_t left, uint16_t interval) {
    speed = stop_time(s, interval);
    if (motion.ended) {
        return;
    }
    // The way to a stop takes u / 2 of this speed, and longer on a path that slows down by itself.
    const uint32_t rest = queued_units - units(s) + span(left, interval, last_interval(s));
    const struct segment *last = queue_slot(queue_head - 1);
    const float end = stop_time(last, last_interval(last));
    const float need = speed > 0 ? speed * speed / (speed + end) : 0;
    if (rest * UNIT_MS < need + speed / 32 + 2.0F) {
        session_end(E_DRY, 0);
    }
}

void motion_millisecond(void) {
    uint16_t left, interval;
    if (motion.wake) {
        motion.wake--;
    }
    if (motion.cruising || (session.state != MOVING && session.state != HOLDING)) {
        return;
    }
    const struct segment *s = running(&left, &interval);
    if (!s) {
        return;
    }
    if (session.state == HOLDING) {
        hold_millisecond(s, interval);
    } else if (++pace % 4 == 0) {
        watch_queue(s, left, interval);
    }
}

// All of the queue is done.
static void arrive(void) {
    const struct segment *s = queue_slot(settled - 1);  // nothing has been written over it yet
    if (!s->last) {
        if (speed > TOO_FAST) {
            for (uint8_t i = 0; i < AXES; i++) {
                motion_lose(s->steps[i] ? 1U << i : 0);
            }
        }
        if (session.state == MOVING) {
            session.state = HOLDING;  // no path is left to decelerate on
            session_end(E_DRY, 0);
        }
    }
    motion_rest();
}

void motion_poll(void) {
    settle();
    if (SHARED(dda.overruns) && session.state == MOVING) {
        session_end(E_OVERRUN, 0);
    }
    if (SHARED(dda.now)) {
        return;
    }
    settle();  // what ended between the two looks
    if (motion_queue_empty()) {
        if (!motion.cruising && session.state != IDLE) {
            arrive();
        }
    } else if (!motion.wake) {
        dda_load();
        dda.left--;
        const uint16_t interval = dda_interval();
        dda_bits();
        hal_timer_start(interval);
    }
}

void motion_start(bool retained) {
    queue_head = queue_tail = settled = 0;
    queued_units = 0;
    dda = (struct dda){.stretch = 256};
    motion = (struct motion){0};
    motion.retained = retained;
    memcpy(motion.plan, memory.counts, sizeof motion.plan);
    config_activate();
    hal_drivers(memory.drivers);
}
