#include "batch.h"

#include <string.h>

#include "bytes.h"
#include "inputs.h"
#include "motion.h"

enum { END = 1, WIDE = 2, GENTLE = 4 * (GENTLE_PARTS - 1) };  // flags
enum { HEAD = 6 };                     // type, tag, mask, flags, n
enum { NARROW_SIZE = 5, WIDE_SIZE = 11 };  // of a segment, without its rates

enum { QUICK_INTERVAL = MIN_INTERVAL + MIN_INTERVAL / 4 };  // a tick that counts the bend costs more
#define RECIPROCAL (1UL << (VELOCITY_BITS - 15))
_Static_assert(RECIPROCAL / MIN_INTERVAL < 1UL << 16, "the reciprocal of an interval has 16 bits");

// A segment's time in 1/256 of 50 ms, from units of 256 cycles.
#define WINDOW ((uint32_t)(65536ULL * 256 * 256 / (CLOCK / 20)))
enum { LONGEST = 255, LONGEST_BEND = 1 << 14, LONGEST_QUICK = 1 << 10 };

// Velocities are rounded down in two places.
static const uint32_t ROUNDING = 4 * (RECIPROCAL / MIN_INTERVAL);

// What is the same for all axes of a segment.
struct pace {
    uint16_t first, last;  // RECIPROCAL / interval
    uint32_t time;         // 1/256 of 50 ms
    uint8_t window;        // the same, rounded up, at most 255
};

static enum error check_axis(uint8_t i, int32_t start) {
    if (!(limits.used >> i & 1)) {
        return E_VALUE;
    }
    if (!(memory.known >> i & 1)) {
        return E_LOST;
    }
    if (i < STEPPERS ? !memory.drivers : !motion.pulses) {
        return E_DISABLED;
    }
    return start == motion.plan[i] ? OK : E_START;
}

static enum error check_start(const uint8_t *starts, uint16_t mask, uint8_t *detail) {
    for (uint8_t i = 0; mask; i++, mask >>= 1) {
        if (!(mask & 1)) {
            continue;
        }
        *detail = i;
        const enum error error = i >= AXES ? E_VALUE : check_axis(i, (int32_t)get32(starts));
        if (error) {
            return error;
        }
        starts += 4;
    }
    *detail = 0;
    return OK;
}

// `fine` may have bits of axes that there are not: nobody looks at them. Its bit 15 is QUICK.
static void read_times(const uint8_t *p, bool wide, struct segment *s) {
    s->ticks = wide ? get16(p) : *p;
    p += wide ? 2 : 1;
    s->interval = get16(p);
    if (!wide) {
        s->add = (sfine_t)(int16_t)get16(p + 2) * 256;
        return;
    }
    s->add = (sfine_t)(int16_t)get16(p + 3) * 256 + p[2];
    s->bend = (int16_t)get16(p + 5);
    s->fine = get16(p + 7);
    s->back = p[8] & 0x80 ? QUICK : 0;
}

static const int32_t ADD_MOST = 1L << 23;  // the tick has 24 bits for it

// An interval one tick past the end must fit as well, as the interrupt has it ready; and it must not turn within the segment.
static bool times_valid(const struct segment *s, int32_t *last) {
    const bool quick = s->back & QUICK;
    const uint16_t least = quick ? QUICK_INTERVAL : MIN_INTERVAL;
    if (s->ticks == 0 || s->interval < least) {
        return false;
    }
    if (s->bend && s->ticks > (quick ? LONGEST_QUICK : LONGEST_BEND)) {
        return false;
    }
    const int32_t grown = quick ? s->bend * (int32_t)(s->ticks - 1) >> 1 : s->bend * (int32_t)((s->ticks - 1) / BLOCK) >> 6;
    const int32_t add = s->add + grown;
    if ((s->add > 0 && add < 0) || (s->add < 0 && add > 0) || (s->add == 0 && s->bend) || add < -ADD_MOST || add >= ADD_MOST) {
        return false;
    }
    *last = motion_interval(s, s->ticks - 1);
    if (*last < least || *last > 0xFFFF) {
        return false;
    }
    return motion_interval(s, s->ticks) <= 0xFFFF;
}

static enum error read_head(const uint8_t *p, bool wide, struct segment *s, struct pace *pace) {
    int32_t last;
    read_times(p, wide, s);
    if (!times_valid(s, &last)) {
        return E_INTERVAL;
    }
    pace->first = pace->last = RECIPROCAL / s->interval;
    if (s->add) {
        pace->last = RECIPROCAL / (uint32_t)last;
    }
    const uint32_t units = motion_units(s);
    pace->time = units < 65536 ? units * WINDOW >> 16 : ((units >> 8) * WINDOW >> 16) << 8;
    pace->window = pace->time < LONGEST ? pace->time + 1 : LONGEST;
    return OK;
}

static uint32_t distance(int32_t a, int32_t b) {
    return a > b ? (uint32_t)a - (uint32_t)b : (uint32_t)b - (uint32_t)a;
}

static uint8_t longer(uint8_t a, uint8_t b) {
    return a > b ? a : b;
}

static bool jumps(uint8_t axis, int32_t from, int32_t to, uint8_t window) {
    const uint32_t change = distance(from, to), jump = limits.jump[axis];
    return change > ROUNDING && jump < JUMP_MAX && change > jump * window + ROUNDING;
}

// Within a segment, too, the velocity may change by no more than 5/4 of what max_accel allows.
static bool bends(uint8_t axis, int32_t from, int32_t to, const struct pace *pace) {
    if (pace->time < LONGEST) {
        return jumps(axis, from, to, pace->window);
    }
    const uint32_t windows = (pace->time >> 8) + 1;
    return windows <= LONGEST && limits.jump[axis] < JUMP_MAX && distance(from, to) >> 8 > limits.jump[axis] * windows;
}

// A rate of the frame; the direction where it has one, else the one that the axis had.
static enum error read_rate(const uint8_t *p, uint8_t axis, axes_t bit, struct segment *s) {
    const int16_t rate = (int16_t)get16(p);
    if (rate == INT16_MIN) {
        return E_STEPS;
    }
    s->back |= rate < 0 ? bit : rate ? 0 : motion.plan_fraction.back & bit;
    const uint16_t size = rate < 0 ? -rate : rate;
    const bool greatest = size == 0x7FFF && !(s->fine & bit);
    s->rate[axis] = size << 1 | greatest;
    return OK;
}

static enum error check_rate(uint8_t axis, axes_t bit, const struct segment *s, const struct pace *pace) {
    const uint16_t rate = s->fine & bit ? s->rate[axis] >> 9 : s->rate[axis] >> 1;
    int32_t first = (int32_t)((uint32_t)rate * pace->first);
    int32_t last = pace->first == pace->last ? first : (int32_t)((uint32_t)rate * pace->last);
    if ((uint32_t)first > limits.top[axis] || (uint32_t)last > limits.top[axis]) {
        return E_RATE;
    }
    if (s->back & bit) {
        first = -first;
        last = -last;
    }
    if (jumps(axis, motion.plan_speed[axis], first, longer(motion.plan_window, pace->window)) ||
        (s->add && bends(axis, first, last, pace))) {
        return E_ACCEL;
    }
    motion.plan_speed[axis] = last;
    return OK;
}

// One axis of a segment from the frame into its slot; the plan goes on to its end.
static enum error read_axis(const uint8_t *p, uint8_t axis, axes_t bit, struct segment *s, const struct pace *pace) {
    enum error error = read_rate(p, axis, bit, s);
    if (!error) {
        error = check_rate(axis, bit, s, pace);
    }
    if (error) {
        return error;
    }
    const int32_t before = motion.plan[axis];
    motion_advance(axis, bit, s);
    const struct axis_config *config = &memory.image.axis[axis];
    return within(config->lower, config->upper, before, motion.plan[axis]) ? OK : E_LIMIT;
}

static int32_t nearest[ROWS];  // a row's value nearest to its limits since the motion began

static void begin_rows(void) {
    for (uint8_t r = 0; r < memory.image.rows; r++) {
        nearest[r] = row_value(r, motion.plan);
    }
}

// Coupled motors do not reach their counts together: on the way back from outside of a limit a joint may be off by one count of each.
static enum error check_rows(uint8_t *detail) {
    for (uint8_t r = 0; r < memory.image.rows; r++) {
        const struct row_config *row = &memory.image.row[r];
        const int32_t after = row_value(r, motion.plan);
        const int32_t slack = row_slack(r);
        if (row_known(r) && (after < row->lower ? after < nearest[r] - slack : after > row->upper && after > nearest[r] + slack)) {
            *detail = r;
            return E_LIMIT_JOINT;
        }
        if (after < row->lower ? after > nearest[r] : after <= row->upper || after < nearest[r]) {
            nearest[r] = after;
        }
    }
    return OK;
}

static enum error read_axes(const uint8_t *p, uint16_t mask, struct segment *s, const struct pace *pace, uint8_t *detail) {
    axes_t bit = 1;
    for (uint8_t i = 0; i < AXES; i++, mask >>= 1, bit <<= 1) {
        enum error error = OK;
        if (mask & 1) {
            error = read_axis(p, i, bit, s, pace);
            p += 2;
        } else if (motion.plan_speed[i] || motion.plan_fraction.back & bit) {  // it was moving: from now on it stands
            if (jumps(i, motion.plan_speed[i], 0, longer(motion.plan_window, pace->window))) {
                error = E_ACCEL;
            }
            motion.plan_speed[i] = 0;
            s->back |= motion.plan_fraction.back & bit;
        }
        if (error) {
            *detail = i;
            return error;
        }
    }
    motion.plan_window = pace->window;
    return OK;
}

static enum error read_segments(const uint8_t *p, uint8_t count, uint16_t mask, bool wide, uint8_t size, uint8_t *detail) {
    if (motion.state == IDLE) {
        begin_rows();
    }
    for (uint8_t n = 0; n < count; n++, p += size) {
        struct segment *s = motion_slot(n);
        struct pace pace;
        memset(s, 0, sizeof *s);
        enum error error = read_head(p, wide, s, &pace);
        if (error) {
            *detail = n;
            return error;
        }
        error = read_axes(p + (wide ? WIDE_SIZE : NARROW_SIZE), mask, s, &pace, detail);
        if (!error) {
            error = check_rows(detail);
        }
        if (error) {
            return error;
        }
    }
    return OK;
}

static enum error check_end(const uint8_t *ends, uint16_t mask, bool end, uint8_t *detail) {
    for (uint8_t i = 0; i < AXES; i++) {
        *detail = i;
        if (end && jumps(i, motion.plan_speed[i], 0, motion.plan_window)) {
            return E_ACCEL;
        }
        if (mask >> i & 1) {
            if (motion.plan[i] != (int32_t)get32(ends)) {
                return E_END;
            }
            ends += 4;
        }
    }
    *detail = 0;
    return OK;
}

static enum error read_batch(const uint8_t *payload, uint8_t axes, uint8_t segment, uint8_t *detail) {
    const uint16_t mask = get16(payload + 2);
    const uint8_t flags = payload[4], count = payload[5];
    const uint8_t *starts = payload + HEAD, *ends = starts + 4 * axes;
    enum error error = check_start(starts, mask, detail);
    if (error) {
        return error;
    }
    if (count > motion_free()) {
        return E_CREDIT;
    }
    error = read_segments(ends + 4 * axes, count, mask, flags & WIDE, segment, detail);
    if (!error) {
        error = check_end(ends, mask, flags & END, detail);
    }
    if (!error && motion.state == IDLE) {
        error = inputs_blocking(motion_slot(0), detail);
    }
    return error;
}

APART enum error batch_received(const uint8_t *payload, uint8_t length, uint8_t *detail) {
    if (length < HEAD) {
        return E_LENGTH;
    }
    const uint16_t mask = get16(payload + 2);
    const uint8_t flags = payload[4], count = payload[5];
    uint8_t axes = 0;
    for (uint8_t i = 0; i < 16; i++) {
        axes += mask >> i & 1;
    }
    const uint8_t segment = (flags & WIDE ? WIDE_SIZE : NARROW_SIZE) + 2 * axes;
    if (count == 0 || flags & ~(END | WIDE | GENTLE) || length != HEAD + 8 * axes + count * segment) {
        return E_LENGTH;
    }
    enum error error = inputs_ready(motion.state == MOVING);
    if (!error) {
        error = read_batch(payload, axes, segment, detail);
    }
    if (error) {
        if (motion.state == IDLE) {
            motion_replan();  // what was read is void; a moving arm comes to rest first
        }
        return error;
    }
    if (motion.state == IDLE) {
        motion_begin(MOVING);
    }
    const uint8_t gentle = (flags & GENTLE) / 4;
    if (gentle > motion.gentle) {
        motion.gentle = gentle;
    }
    motion_append(count, flags & END);
    return OK;
}
