#include "motion.h"

#include <string.h>

#include "hal.h"

struct motion motion;

static uint8_t settled;               // segments before this one are in memory.counts
static struct fraction settled_fraction;
static uint32_t queued_units;         // of the segments from `settled` on
static uint16_t latched_left;
static uint8_t latched_slot;
static float speed;       // u: ms that the arm needs to stop, as last looked at
static float hold_speed;  // u that the hold allows
static uint8_t pace;

static const float STANDING = 1.0F;   // ms: u at which a hold stands still
static const float TOO_FAST = 30.0F;  // ms: u from which an abrupt stop loses steps
static const float SLOW = 24.0F;      // ms: u below which the arm may stand where its queue ends
static const float UNIT_MS = 256e3F / CLOCK;

#define SHARED(x) (*(volatile __typeof__(x) *)&(x))  // the interrupt changes it

static int32_t product(int16_t a, uint16_t b) {
    return (int32_t)(HAL_MULTIPLY((uint16_t)a, b) - (a < 0 ? (uint32_t)b << 16 : 0));
}

// What the bend makes of the interval.
APART static int32_t bent(const struct segment *s, uint16_t ticks) {
    if (s->back & QUICK) {
        const uint32_t bends = HAL_MULTIPLY(ticks, ticks - 1) / 2;
        return (product(s->bend, bends >> 8) + (product(s->bend, bends & 0xFF) >> 8)) >> 9;
    }
    const uint8_t first = (s->ticks - 1) % BLOCK + 1;  // ticks of the first block
    const uint16_t more = ticks > first ? ticks - first : 0;
    const uint16_t blocks = more / BLOCK, rest = more % BLOCK;
    const uint32_t bends = HAL_MULTIPLY(BLOCK / 2 * blocks + rest, blocks + 1);  // of all ticks so far
    return product(s->bend, bends >> 8) >> 14;
}

// Cycles between ticks after `ticks` of them, not rounded from tick to tick.
APART int32_t motion_changed_interval(const struct segment *s, uint16_t ticks) {
    const uint8_t fine = s->add;
    int32_t change = product(s->add >> 8, ticks);
    if (fine) {
        change += HAL_MULTIPLY(fine, ticks) >> 8;
    }
    change = s->interval + (change >> 8);
    return s->bend ? change + bent(s, ticks) : change;
}

static uint16_t last_interval(const struct segment *s) {
    return motion_interval(s, s->ticks - 1);
}

static uint32_t span(uint16_t ticks, uint16_t first, uint16_t last) {
    return HAL_MULTIPLY(ticks, ((uint32_t)first + last) >> 1) >> 8;
}

uint32_t motion_units(const struct segment *s) {
    return span(s->ticks, s->interval, last_interval(s));
}

static void at_rest(struct fraction *f) {
    for (uint8_t i = 0; i < AXES; i++) {
        f->phase[i] = PHASE_HALF;
    }
    f->back = 0;
}

static void advance_all(int32_t counts[AXES], struct fraction *f, const struct segment *s, uint16_t ticks) {
    const axes_t turning = f->back ^ s->back;
    uint8_t turned = turning, back = s->back, fine = s->fine, bit = 1;
    for (uint8_t i = 0; i < AXES; i++) {
        if (turned & bit) {
            f->phase[i] ^= PHASE_TURN;
        }
        if (s->rate[i]) {
            const uint16_t steps = motion_steps(&f->phase[i], s->rate[i], fine & bit, ticks);
            counts[i] += back & bit ? -(int32_t)steps : (int32_t)steps;
        }
        NEXT_AXIS(bit, (turned = turning >> 8, back = s->back >> 8, fine = s->fine >> 8))
    }
    f->back = s->back & ALL_AXES;
    if (s->back & LAST && ticks == s->ticks) {
        at_rest(f);
    }
}

void motion_advance(const struct segment *s) {
    advance_all(motion.plan, &motion.plan_fraction, s, s->ticks);
}

// The interrupt notes ticks, not counts: turn them into counts while their segment is still there.
APART static void take_latch(void) {
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
    struct fraction f = settled_fraction;
    memcpy(motion.latch, memory.counts, sizeof motion.latch);
    for (uint8_t at = settled; at != slot; at++) {
        advance_all(motion.latch, &f, queue_slot(at), queue_slot(at)->ticks);
    }
    const struct segment *s = queue_slot(slot);
    advance_all(motion.latch, &f, s, s->ticks - left);
}

// Counts what has been done up to the segment at `tail`. (Read the tail before: what is latched later lies behind it.)
static void settle_to(uint8_t tail) {
    if (dda.probe) {
        take_latch();
    }
    while (settled != tail) {
        const struct segment *s = queue_slot(settled);
        advance_all(memory.counts, &settled_fraction, s, s->ticks);
        queued_units -= motion_units(s);
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
    *interval = SHARED(dda.interval) >> 16;
    HAL_UNLOCK();
    settle_to(tail);
    return s;
}

const struct segment *motion_running(void) {
    uint16_t left, interval;
    return running(&left, &interval);
}

void motion_counts(int32_t counts[AXES]) {
    uint16_t left, interval;
    const struct segment *s = running(&left, &interval);
    memcpy(counts, memory.counts, sizeof memory.counts);
    if (s) {
        struct fraction f = settled_fraction;
        advance_all(counts, &f, s, s->ticks - left - 1);  // the bits of one tick are computed, not yet out
    }
}

uint8_t motion_free(void) {
    return QUEUE_SLOTS - (uint8_t)(queue_head - settled);
}

uint16_t motion_queued(void) {
    // a segment has less than 2^24 units
    const bool fits = (uint64_t)QUEUE_SLOTS * UNIT_FACTOR <= 256;
    const uint32_t ms = fits ? queued_units * UNIT_FACTOR / UNIT_DIVISOR
                             : (uint32_t)((uint64_t)queued_units * UNIT_FACTOR / UNIT_DIVISOR);
    return ms > 0xFFFF ? 0xFFFF : ms;
}

bool motion_queue_empty(void) {
    return settled == queue_head;
}

struct segment *motion_slot(uint8_t ahead) {
    return queue_slot(queue_head + ahead);
}

static void plan_rest(void) {
    motion.plan_exceeding = 0;
    motion.ended = true;
    at_rest(&motion.plan_fraction);
}

void motion_append(uint8_t segments, uint32_t units, bool end) {
    queued_units += units;
    motion.ended = false;
    if (end) {
        motion_slot(segments - 1)->back |= LAST;
        plan_rest();
    }
    HAL_BARRIER();
    queue_head += segments;
}

static void flush(void) {
    queue_head = settled = queue_tail;
    queued_units = 0;
}

void motion_begin(enum state state) {
    memory_moving();
    motion.state = state;
    motion.cruising = state != MOVING;
    speed = 0;
}

void motion_replan(void) {
    memcpy(motion.plan, memory.counts, sizeof motion.plan);
    plan_rest();
}

void motion_rest(void) {
    dda.stretch = 256;
    dda.probe = false;
    dda_rest();
    at_rest(&settled_fraction);
    motion_replan();
    motion.state = IDLE;
    motion.cruising = false;
    motion.gentle = 0;
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
    axes_t bit = 1;
    for (uint8_t i = 0; i < AXES; i++, bit <<= 1) {
        if (s->rate[i]) {
            const float one = (float)(uint32_t)segment_rate(s, i, bit) * limits.stop_time[i];
            most = one > most ? one : most;
        }
    }
    return most / interval;
}

static void stand_still(void) {
    hal_timer_stop();
    settle();
    const struct segment *s = dda.now;
    if (s) {
        advance_all(memory.counts, &settled_fraction, s, s->ticks - dda.left - 1);
    }
    dda.now = 0;
    flush();
    motion_rest();
}

void motion_stop(void) {
    uint16_t left, interval;
    const struct segment *s = running(&left, &interval);
    motion.state = HOLDING;
    if (!s) {
        stand_still();
        return;
    }
    hold_speed = stop_time(s, interval);
}

// The queue must always hold the time that a stop takes: on a path that slows down by itself, a stop takes all of it. A slow arm needs
// none: it may begin before the queue is full.
static bool running_dry(const struct segment *s, uint16_t left, uint16_t interval) {
    if (motion.ended || (motion.state == MOVING && speed < SLOW)) {
        return false;
    }
    const uint32_t rest = queued_units - motion_units(s) + span(left, interval, last_interval(s));
    return rest * UNIT_MS < speed + speed / 32 + 2.0F;
}

// Time is stretched so that u falls by 1 ms a ms, or gently while the queue lasts, unless the plan is slower by itself.
static void hold_millisecond(const struct segment *s, uint16_t interval) {
    const float planned = stop_time(s, interval);
    hold_speed -= (GENTLE_PARTS - motion.gentle) * (1.0F / GENTLE_PARTS);
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

APART enum error motion_millisecond(void) {
    uint16_t left, interval;
    if (motion.wake) {
        motion.wake--;
    }
    if (motion.cruising || (motion.state != MOVING && motion.state != HOLDING)) {
        return OK;
    }
    const bool holding = motion.state == HOLDING, look = ++pace % 4 == 0;
    const struct segment *s = holding || look ? running(&left, &interval) : 0;
    if (!s) {
        return OK;
    }
    bool dry = false;
    if (look) {
        speed = holding ? hold_speed : stop_time(s, interval);
        dry = running_dry(s, left, interval);
        motion.gentle = dry ? 0 : motion.gentle;  // no time for that
    }
    if (holding) {
        hold_millisecond(s, interval);
        return OK;
    }
    return dry ? E_DRY : OK;
}

// All of the queue is done.
static enum error arrive(void) {
    const struct segment *s = queue_slot(settled - 1);  // nothing has been written over it yet
    const bool dry = !(s->back & LAST);
    const bool moving = motion.state == MOVING;
    if (dry && speed > TOO_FAST) {
        for (uint8_t i = 0; i < AXES; i++) {
            motion_lose(s->rate[i] ? 1U << i : 0);
        }
    }
    motion_rest();
    return dry && moving ? E_DRY : OK;  // no path was left to decelerate on
}

APART enum error motion_poll(void) {
    settle();
    if (SHARED(dda.now)) {
        return SHARED(dda.overruns) && motion.state == MOVING ? E_OVERRUN : OK;
    }
    settle();  // what ended between the two looks
    if (motion_queue_empty()) {
        return motion.cruising || motion.state == IDLE ? OK : arrive();
    }
    if (!motion.wake) {
        dda_load();
        dda.left--;
        const uint16_t interval = dda_interval();
        dda_bits();
        hal_timer_start(interval);
    }
    return OK;
}

void motion_start(bool retained) {
    queue_head = queue_tail = settled = 0;
    queued_units = 0;
    dda = (struct dda){.stretch = 256};
    motion = (struct motion){0};
    motion.retained = retained;
    config_activate();
    hal_drivers(memory.drivers);
    motion_rest();
}
