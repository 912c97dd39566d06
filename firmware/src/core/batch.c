#include "batch.h"

#include <string.h>

#include "acceleration.h"
#include "bytes.h"
#include "inputs.h"
#include "motion.h"

enum { END = 1, WIDE = 2, GENTLE = 4 * (GENTLE_PARTS - 1) };  // flags
enum { HEAD = 6 };                     // type, tag, mask, flags, n
enum { NARROW_SIZE = 5, WIDE_SIZE = 11 };  // of a segment, without its rates
_Static_assert(FRAME_MAX / NARROW_SIZE < QUEUE_SLOTS, "a batch leaves the segment before it where it is");

enum { QUICK_INTERVAL = MIN_INTERVAL + MIN_INTERVAL / 4 };  // a tick that counts the bend costs more
enum { LONGEST_BEND = 1 << 14, LONGEST_QUICK = 1 << 10 };

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
        s->bend = 0;
        s->back = s->fine = 0;
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
    if (s->add == 0) {
        *last = s->interval;
        return s->bend == 0;
    }
    if (s->bend && s->ticks > (quick ? LONGEST_QUICK : LONGEST_BEND)) {
        return false;
    }
    const int32_t grown = s->bend == 0 ? 0 : quick ? s->bend * (int32_t)(s->ticks - 1) >> 1 : s->bend * (int32_t)((s->ticks - 1) / BLOCK) >> 6;
    const int32_t add = s->add + grown;
    if ((s->add > 0 && add < 0) || (s->add < 0 && add > 0) || add < -ADD_MOST || add >= ADD_MOST) {
        return false;
    }
    *last = motion_interval(s, s->ticks - 1);
    if (*last < least || *last > 0xFFFF) {
        return false;
    }
    return *last <= 0xFFFF - ADD_MOST / 65536 - 1 || motion_interval(s, s->ticks) <= 0xFFFF;
}

static enum error read_head(const uint8_t *p, bool wide, struct segment *s, const struct pace *before, struct pace *pace, uint32_t *units) {
    int32_t last;
    read_times(p, wide, s);
    if (!times_valid(s, &last)) {
        return E_INTERVAL;
    }
    *units += take_pace(s, last, before, pace);
    return OK;
}

// What is wrong first, axis by axis: each look goes only as far as the one before found nothing (`past`).
struct look {
    uint8_t past;  // axes to look at
    uint8_t error;
};

static void found(struct look *look, uint8_t axis, enum error error) {
    look->past = axis;
    look->error = error;
}

// Rates of the frame; the direction where one has one, else the one that the axis had.
APART static void read_rates(const uint8_t *p, uint16_t mask, struct segment *s, const struct pace *pace, struct look *look) {
    const uint16_t fastest = pace->first > pace->last ? pace->first : pace->last;
    const axes_t was = motion.plan_fraction.back, fine = s->fine;
    axes_t bit = 1, back = s->back | (was & ~(axes_t)mask);
    memset(s->rate, 0, sizeof s->rate);
    for (uint8_t i = 0; i < AXES; i++, mask >>= 1, bit <<= 1) {
        if (!(mask & 1)) {
            continue;
        }
        const int16_t rate = (int16_t)get16(p);
        p += 2;
        if (rate == INT16_MIN) {
            found(look, i, E_STEPS);
            break;
        }
        back |= rate < 0 ? bit : rate ? 0 : was & bit;
        const uint16_t size = rate < 0 ? -rate : rate;
        const bool greatest = size == 0x7FFF && !(fine & bit);
        s->rate[i] = size << 1 | greatest;
        if (HAL_MULTIPLY(fine & bit ? size >> 8 : size, fastest) > limits.top[i]) {
            found(look, i, E_RATE);
            break;
        }
    }
    s->back = back;
}

static inline __attribute__((always_inline)) void check_changes(const struct segment *a, const struct pace *before, const struct segment *s, const struct pace *pace, struct look *look) {
    //@ loop unroll AXES;
    for (uint8_t i = 0; (i = next_unclear(i, look->past, a, before, s, pace)) < look->past; i++) {
        if (accelerates(i, a, before, s, pace)) {
            found(look, i, E_ACCEL);
        }
    }
}

// The plan goes on to the segment's end.
APART static void plan_axes(uint16_t mask, const struct segment *s, struct look *look) {
    const axes_t turning = motion.plan_fraction.back ^ s->back;
    const uint16_t ticks = s->ticks;
    uint8_t named = mask, turned = turning, back = s->back, fine = s->fine, bit = 1;
    //@ loop unroll AXES;
    for (uint8_t i = 0; i < look->past; i++) {
        fine_t *const phase = &motion.plan_fraction.phase[i];
        if (turned & bit) {
            *phase ^= PHASE_TURN;
        }
        if (named & bit && s->rate[i]) {
            const uint16_t steps = motion_steps(phase, s->rate[i], fine & bit, ticks);
            const struct axis_config *config = &memory.image.axis[i];
            bool beyond_limit;  // it is the only one that it may come to, or go away from
            if (back & bit) {
                beyond_limit = (motion.plan[i] -= steps) < config->lower;
            } else {
                beyond_limit = (motion.plan[i] += steps) > config->upper;
            }
            if (beyond_limit && steps) {
                found(look, i, E_LIMIT);
            }
        }
        NEXT_AXIS(bit, (named = mask >> 8, turned = turning >> 8, back = s->back >> 8, fine = s->fine >> 8))
    }
    motion.plan_fraction.back = s->back & ALL_AXES;
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

static enum error read_axes(const uint8_t *p, uint16_t mask, uint8_t axes, const struct segment *a, const struct pace *before, struct segment *s,
                            const struct pace *pace, uint8_t *detail) {
    struct look look = {.past = axes};
    read_rates(p, mask, s, pace, &look);
    check_changes(a, before, s, pace, &look);
    plan_axes(mask, s, &look);
    if (look.error) {
        *detail = look.past;
    }
    return look.error;
}

// Leaves the last segment's pace in the first of two, and how long all are.
static enum error read_segments(const uint8_t *p, uint8_t count, uint16_t mask, bool wide, uint8_t size, struct pace paces[2], uint32_t *units, uint8_t *detail) {
    struct pace *before = &paces[count % 2], *pace = &paces[!(count % 2)];
    if (motion.state == IDLE) {
        begin_rows();
    }
    const struct segment *a = motion_slot(-1);
    memset(before, 0, sizeof *before);
    if (!motion.ended) {  // it may be done: nothing has been written over it yet
        take_pace(a, motion_interval(a, a->ticks - 1), before, before);
    }
    uint8_t axes = AXES;
    for (uint8_t n = 0; n < count; n++, p += size) {
        if (n == 2) {  // from here on axes that the batch does not name stand, and have stood
            axes = 0;
            for (uint16_t m = mask; m; m >>= 1) {
                axes++;
            }
        }
        struct segment *const s = motion_slot(n);
        enum error error = read_head(p, wide, s, before, pace, units);
        if (error) {
            *detail = n;
            return error;
        }
        if (!before->time) {
            before->time = pace->time;
        }
        error = read_axes(p + (wide ? WIDE_SIZE : NARROW_SIZE), mask, axes, a, before, s, pace, detail);
        if (!error) {
            error = check_rows(detail);
        }
        if (error) {
            return error;
        }
        struct pace *const done = before;
        before = pace;
        pace = done;
        a = s;
    }
    return OK;
}

static enum error check_end(const uint8_t *ends, uint16_t mask, const struct segment *s, const struct pace *last, bool end, uint8_t *detail) {
    struct look look = {.past = AXES};
    if (end) {
        const struct pace rest = {.time = last->time};
        check_changes(s, last, s, &rest, &look);
    }
    for (uint8_t i = 0; i < AXES; i++, mask >>= 1) {
        *detail = i;
        if (i == look.past) {
            return E_ACCEL;
        }
        if (mask & 1) {
            if (motion.plan[i] != (int32_t)get32(ends)) {
                return E_END;
            }
            ends += 4;
        }
    }
    *detail = 0;
    return OK;
}

static enum error read_batch(const uint8_t *payload, uint8_t axes, uint8_t segment, uint32_t *units, uint8_t *detail) {
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
    struct pace paces[2];
    error = read_segments(ends + 4 * axes, count, mask, flags & WIDE, segment, paces, units, detail);
    if (!error) {
        error = check_end(ends, mask, motion_slot(count - 1), paces, flags & END, detail);
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
    for (uint16_t m = mask; m; m &= m - 1) {
        axes++;
    }
    const uint8_t segment = (flags & WIDE ? WIDE_SIZE : NARROW_SIZE) + 2 * axes;
    if (count == 0 || flags & ~(END | WIDE | GENTLE) || length != HEAD + 8 * axes + count * segment) {
        return E_LENGTH;
    }
    uint32_t units = 0;
    enum error error = inputs_ready(motion.state == MOVING);
    if (!error) {
        error = read_batch(payload, axes, segment, &units, detail);
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
    motion_append(count, units, flags & END);
    return OK;
}
