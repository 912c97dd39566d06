// How fast axes are at a segment's ends, and whether they change that too fast: ACCEL of PROTOCOL.md, section 6. Of batch.c alone.
#pragma once
#include "motion.h"

#define RECIPROCAL (1UL << (VELOCITY_BITS - 15))
_Static_assert(RECIPROCAL / MIN_INTERVAL < 1UL << 16, "the reciprocal of an interval has 16 bits");

// A segment's time: in 2^-16 of 50 ms from 16 cycles, and a longer one's in 2^-8 of 50 ms from 256 cycles.
#define FRACTION ((uint32_t)((1ULL << 35) / (CLOCK / 20)))
#define WINDOW ((uint32_t)(65536ULL * 256 * 256 / (CLOCK / 20)))
_Static_assert((uint64_t)FRACTION * (CLOCK / 20 / 16) <= 1ULL << 31 && FRACTION * (MIN_INTERVAL / 16) >> 15, "32 bits; no segment takes no time");

// Velocities are rounded down in two places.
static const uint32_t ROUNDING = 4 * (RECIPROCAL / MIN_INTERVAL);
enum { CYCLES = 2 * VELOCITY_BITS - 67 };  // of a velocity, what whole cycles of its intervals make: 2^-9, or 2^-7

// What is the same for all axes of a segment.
struct pace {
    uint16_t first, last;  // RECIPROCAL / interval; at rest 0
    uint16_t time;         // 2^-16 of 50 ms, at most 50 ms; 0: rest, which is as long as the segment beside it
    uint16_t windows;      // of a longer one: 2^-8 of 50 ms; else 0
    uint16_t interval;     // the last; 0: none
};

// RECIPROCAL / interval: long division of a power of two, a third of what a small chip's library takes.
APART static uint16_t reciprocal(uint16_t interval) {
#ifdef HAL_RECIPROCAL
    return HAL_RECIPROCAL(interval);
#else
    uint16_t rest = RECIPROCAL >> 16, quotient = 0;
    for (uint8_t bit = 0; bit < 16; bit++) {
        const bool over = rest >> 15;
        rest <<= 1;
        quotient <<= 1;
        if (over || rest >= interval) {
            rest -= interval;
            quotient |= 1;
        }
    }
    return quotient;
#endif
}

// Returns how long the segment takes, in units of 256 cycles.
static uint32_t take_pace(const struct segment *s, uint16_t last, const struct pace *before, struct pace *pace) {
    pace->first = pace->last = s->interval == before->interval ? before->last : reciprocal(s->interval);
    if (s->add) {
        pace->last = reciprocal(last);
    }
    pace->interval = last;
    const uint32_t cycles = HAL_MULTIPLY(s->ticks, ((uint32_t)s->interval + last) >> 1);
    pace->windows = 0;
    if (cycles < CLOCK / 20) {  // shifts by whole bytes are what a small chip is quick with
        const uint_fast16_t sixteenths = (uint_fast16_t)(cycles >> 8) << 4 | (uint8_t)cycles >> 4;
        pace->time = sixteenths * FRACTION << 1 >> 16;
    } else {
        const uint32_t windows = ((cycles >> 16) * WINDOW >> 8) + ((cycles >> 8 & 0xFF) * WINDOW >> 16);
        pace->time = 0xFFFF;
        pace->windows = windows < 0xFFFF ? windows : 0xFFFF;
    }
    return cycles >> 8;
}

static uint32_t distance(int32_t a, int32_t b) {
    return a > b ? (uint32_t)a - (uint32_t)b : (uint32_t)b - (uint32_t)a;
}

// What 5/4 of max_accel makes of an axis's velocity; in units 2^8 as great where `time` is. 24 by 16 bits, in parts that a small chip is quick with.
static uint32_t budget(uint8_t axis, uint16_t time) {
    const uint16_t low = limits.jump[axis], high = limits.jump[axis] >> 16;
    return (HAL_MULTIPLY(low, time) >> 8) + (HAL_MULTIPLY(high, time) << 8);
}

static uint16_t size(const struct segment *s, uint8_t axis, axes_t bit) {
    return s->fine & bit ? s->rate[axis] >> 9 : s->rate[axis] >> 1;
}

static int32_t velocity(uint16_t size, uint16_t reciprocal, bool back) {
    const uint32_t v = HAL_MULTIPLY(size, reciprocal);
    return back ? -(int32_t)v : (int32_t)v;
}

// A quarter of the velocity in the middle of a segment; of a longer one than 50 ms, 25 ms from the end where it is `from`.
static int32_t quarter(int32_t from, int32_t to, uint16_t windows) {
    const int32_t half = from >> 1, change = (to >> 1) - half;
    if (!windows) {
        return (half + (change >> 1)) >> 1;
    }
    const uint16_t part = (1UL << 23) / windows;
    return (half + (change >> 16) * part + (int32_t)((uint32_t)(uint16_t)change * part >> 16)) >> 1;
}

// What changes have taken beyond their budget until now; true if that is more than rounding may be.
static bool beyond(fine_t *excess, int32_t change, uint32_t budget, uint32_t slack) {
    const int32_t sum = (int32_t)*excess + change;
    if (sum <= 0 || (uint32_t)sum <= budget) {
        *excess = 0;
        return false;
    }
    if ((uint32_t)sum - budget > slack) {
        return true;
    }
    *excess = (uint32_t)sum - budget;
    return false;
}

// One axis: true if its velocity jumps from `a` to `b`, or changes within `b`, by more than its budget. Between the middles of both, too,
// the change is within that; what was beyond it is kept, each way, and at most rounding's: so the velocities in the middles of
// any two segments differ by no more than the budget of the time between, and rounding once, however short they are.
APART static bool accelerates(uint8_t axis, const struct segment *a, const struct pace *before, const struct segment *b, const struct pace *pace) {
    const axes_t bit = 1U << axis;
    const int32_t left = velocity(size(a, axis, bit), before->last, a->back & bit), first = velocity(size(b, axis, bit), pace->first, b->back & bit);
    const int32_t last = pace->last == pace->first ? first : velocity(size(b, axis, bit), pace->last, b->back & bit);
    fine_t *const excess = motion.plan_excess[axis];
    const bool stands = !(before->first && a->rate[axis]) && !(pace->first && b->rate[axis]);
    if (stands || limits.jump[axis] >= JUMP_MAX) {
        motion.plan_exceeding &= ~bit;
        return false;
    }
    if (before->windows || !(motion.plan_exceeding & bit)) {
        excess[0] = excess[1] = 0;
    }
    const uint32_t between = budget(axis, (before->time >> 1) + (pace->time >> 1)), change = distance(first, last);
    const uint32_t slack = ROUNDING + ((distance(left, 0) + distance(last, 0)) >> CYCLES);
    if (distance(left, first) > between + slack ||
        (pace->windows && pace->windows < 0xFFFF && change >> 8 > budget(axis, pace->windows)) ||
        (!pace->windows && change && change > budget(axis, pace->time) + slack)) {
        return true;
    }
    const int32_t from = before->last == before->first ? left : velocity(size(a, axis, bit), before->first, a->back & bit);
    const int32_t more = quarter(first, last, pace->windows) - quarter(left, from, before->windows);
    const bool over = beyond(&excess[0], more, between >> 2, slack >> 2) | beyond(&excess[1], -more, between >> 2, slack >> 2);
    motion.plan_exceeding |= bit;
    if (!excess[0] && !excess[1]) {
        motion.plan_exceeding &= ~bit;
    }
    return over;
}

static uint16_t apart(uint16_t a, uint16_t b) {
    return a > b ? a - b : b - a;
}

// The first axis from `axis` on that needs a look by accelerates(). As nearly always none does: nothing is beyond its budget, and what changes
// at the jump and half of what changes on both sides of it is less than the budget's greater part, as is what changes within `b`
// (8: rounding of quarters); or the axis is not checked.
APART static uint8_t next_unclear(uint8_t axis, uint8_t axes, const struct segment *a, const struct pace *before, const struct segment *b, const struct pace *pace) {
    const uint16_t left = before->last, left_change = apart(before->first, left), change = apart(pace->first, pace->last);
    const uint16_t both = (left_change >> 1) + (change >> 1) + 1 + apart(left, pace->first), most = both > change ? both : change;
    if ((left_change && before->windows) || (change && pace->windows) || most > 0x7FFF) {
        return axis;
    }
    const uint16_t between = (before->time >> 1) + (pace->time >> 1), time = pace->time < between ? pace->time : between;
    axes_t turned = a->back ^ b->back, fine = b->fine, left_fine = a->fine, exceeding = motion.plan_exceeding;
    if (axis) {
        turned >>= axis, fine >>= axis, left_fine >>= axis, exceeding >>= axis;
    }
    for (; axis < axes; axis++, turned >>= 1, fine >>= 1, left_fine >>= 1, exceeding >>= 1) {
        uint16_t from = a->rate[axis], to = b->rate[axis];
        if (exceeding & 1) {
            break;
        }
        const uint16_t jump = limits.jump[axis] >> 8;
        if ((from | to) == 0 || jump >= JUMP_MAX >> 8) {
            continue;
        }
        from >>= left_fine & 1 ? 9 : 1;
        to >>= fine & 1 ? 9 : 1;
        const uint16_t turn = turned & 1 ? from + to : apart(from, to);
        uint32_t sum = HAL_MULTIPLY(from > to ? from : to, most) + 8;
        if (turn) {
            sum += HAL_MULTIPLY(turn, left);
        }
        if (sum > HAL_MULTIPLY(jump, time)) {
            break;
        }
    }
    return axis;
}
