#include "cruise.h"

#include <stddef.h>
#include <string.h>

enum { SLICES = 3, SLICE_MS = 8 };
#define SLICE (CLOCK / 1000 * SLICE_MS)  // cycles
#define TICKS (SLICE / (MIN_INTERVAL + MIN_INTERVAL / 8))
#define WATCHED_TICKS (SLICE / WATCHED_INTERVAL)  // where HOME is not faster than one step with each
_Static_assert(WATCHED_TICKS >= 16 && WATCHED_TICKS <= TICKS && SLICE / WATCHED_TICKS <= 0xFFFF, "a slice is one segment");
static const float SECONDS = SLICE_MS / 1e3F;

struct cruise cruise;
static int32_t origin;  // of the leader

static uint32_t size(int32_t x) {
    return x < 0 ? 0U - (uint32_t)x : (uint32_t)x;
}

void cruise_vector(int8_t sign, bool bounded) {
    const int32_t *rate = cruise.asked;
    float longest = 0;  // s to full speed
    memset(&cruise, 0, offsetof(struct cruise, asked));
    for (uint8_t i = 0; i < AXES; i++) {
        if (!rate[i]) {
            continue;
        }
        const float seconds = (float)size(rate[i]) / memory.image.axis[i].max_accel;
        longest = seconds > longest ? seconds : longest;
        cruise.rate[i] = sign < 0 ? (int32_t)(0U - (uint32_t)rate[i]) : rate[i];
        cruise.axes |= 1U << i;
        if (size(rate[i]) > size(rate[cruise.leader])) {
            cruise.leader = i;
        }
    }
    cruise.slope = longest > SECONDS ? SECONDS / longest : 1;
    cruise.bounded = bounded;
    origin = motion.plan[cruise.leader];
}

bool cruise_resting(void) {
    return cruise.target == 0 && cruise.share == 0 && motion_queue_empty();
}

int32_t cruise_covered(void) {
    const int32_t covered = motion.plan[cruise.leader] - origin;
    return covered < 0 ? -covered : covered;
}

// Slices of full rate that are still covered after the share has begun to fall.
static float braking(float share) {
    return share * (share / cruise.slope + 1) / 2;
}

float cruise_brake(void) {
    return braking(cruise.share) * SECONDS * size(cruise.rate[cruise.leader]);
}

// Would the arm, `slices` of full rate from the end of the queue, still be within its limits?
static bool clear(float slices) {
    int32_t there[AXES];
    for (uint8_t i = 0; i < AXES; i++) {
        const float far = cruise.rate[i] * slices * SECONDS;
        there[i] = motion.plan[i] + (int32_t)far + (far > 0) - (far < 0);
        const struct axis_config *axis = &memory.image.axis[i];
        if (cruise.rate[i] && memory.known >> i & 1 && !within(axis->lower, axis->upper, motion.plan[i], there[i])) {
            return false;
        }
    }
    for (uint8_t r = 0; r < memory.image.rows; r++) {
        const struct row_config *row = &memory.image.row[r];
        if (row_known(r) && !within(row->lower, row->upper, row_value(r, motion.plan), row_value(r, there))) {
            return false;
        }
    }
    return true;
}

static float toward(float share, float target) {
    if (share < target) {
        return share + cruise.slope < target ? share + cruise.slope : target;
    }
    return share - cruise.slope > target ? share - cruise.slope : target;
}

static void slice(void) {
    float next = toward(cruise.share, cruise.target);
    if (cruise.bounded && !clear((cruise.share + next) / 2 + braking(next))) {
        cruise.target = 0;
        next = toward(cruise.share, 0);
        if (!clear((cruise.share + next) / 2)) {  // the last counts before the limit
            cruise.share = 0;
            return;
        }
    }
    struct segment *s = motion_slot(0);
    const bool watched = !cruise.bounded && size(cruise.rate[cruise.leader]) < WATCHED_TICKS * 1000UL / SLICE_MS;
    const float part = (cruise.share + next) / 2 * (watched ? SECONDS / WATCHED_TICKS * (1UL << 16) : SECONDS / TICKS * (1UL << 16));
    memset(s, 0, sizeof *s);
    s->ticks = watched ? WATCHED_TICKS : TICKS;
    s->interval = watched ? SLICE / WATCHED_TICKS : SLICE / TICKS;
    for (uint8_t i = 0; i < AXES; i++) {
        const float rate = size(cruise.rate[i]) * part;
        const bool fine = rate < 256;
        s->rate[i] = fine ? (uint16_t)(rate * 128) * 2 : rate < 0xFFFE ? (uint16_t)(rate / 2) * 2 : 0xFFFE;
        s->fine |= fine ? 1U << i : 0;
        s->back |= cruise.rate[i] < 0 ? 1U << i : 0;
    }
    motion_advance(s);
    cruise.share = next;
    motion_append(1, motion_units(s), false);
}

void cruise_poll(void) {
    if (QUEUE_SLOTS - motion_free() < SLICES && (cruise.target > 0 || cruise.share > 0)) {
        slice();
    }
}
