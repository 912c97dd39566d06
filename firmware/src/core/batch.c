#include "batch.h"

#include <string.h>

#include "bytes.h"
#include "motion.h"

enum { END = 1, WIDE = 2 };  // flags
enum { HEAD = 6 };           // type, tag, mask, flags, n

// The axes of the batch, in order: where each of them is while the segments are read, and what is asked of it at each.
// Gathered once, as the loop over segments and lanes is what limits the board's segments per second.
struct lane {
    uint8_t axis;
    axes_t bit;  // 1 << axis
    uint16_t step_time;
    int32_t lower, upper;
    int32_t at;
};
static struct lane lanes[AXES];
static uint8_t lane_count;

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

static enum error open_lanes(const uint8_t *starts, uint16_t mask, uint8_t *detail) {
    struct lane *lane = lanes;
    for (uint8_t i = 0; mask; i++, mask >>= 1) {
        if (!(mask & 1)) {
            continue;
        }
        *detail = i;
        const enum error error = i >= AXES ? E_VALUE : check_axis(i, (int32_t)get32(starts));
        if (error) {
            return error;
        }
        *lane++ = (struct lane){
            .axis = i,
            .bit = 1U << i,
            .step_time = limits.step_time[i],
            .lower = memory.image.axis[i].lower,
            .upper = memory.image.axis[i].upper,
            .at = motion.plan[i],
        };
        starts += 4;
    }
    lane_count = lane - lanes;
    *detail = 0;
    return OK;
}

// One segment from the frame into its slot. `time`: quarter cycles that it lasts at its fastest.
static enum error read_segment(const uint8_t *p, bool wide, struct segment *s, uint32_t *time) {
    memset(s, 0, sizeof *s);
    s->ticks = wide ? get16(p) : *p;
    p += wide ? 2 : 1;
    s->interval = get16(p);
    s->add = (int16_t)get16(p + 2);
    if (s->ticks == 0) {
        return E_INTERVAL;
    }
    const int32_t last = s->interval + ((int32_t)s->add * (uint16_t)(s->ticks - 1) >> 8);
    if (s->interval < MIN_INTERVAL || last < MIN_INTERVAL || last > 0xFFFF) {
        return E_INTERVAL;
    }
    *time = (uint32_t)s->ticks * (last < s->interval ? (uint16_t)last : s->interval) >> 2;
    return OK;
}

static enum error check_steps(const uint8_t *p, bool wide, struct segment *s, uint32_t time, uint8_t *detail) {
    for (struct lane *lane = lanes; lane < lanes + lane_count; lane++) {
        int16_t steps;
        if (wide) {
            steps = (int16_t)get16(p);
            p += 2;
        } else {
            steps = (int8_t)*p++;
        }
        if (!steps) {
            continue;
        }
        const uint16_t size = steps < 0 ? 0U - (uint16_t)steps : (uint16_t)steps;
        const int32_t before = lane->at;
        const int32_t after = before + steps;
        enum error error = OK;
        if (size > s->ticks) {
            error = E_STEPS;
        } else if ((uint32_t)(size - 1) * lane->step_time > time) {
            error = E_RATE;
        } else if (!within(lane->lower, lane->upper, before, after)) {
            error = E_LIMIT;
        }
        if (error) {
            *detail = lane->axis;
            return error;
        }
        lane->at = after;
        s->steps[lane->axis] = size;
        s->back |= steps < 0 ? lane->bit : 0;
    }
    return OK;
}

static void put_lanes(int32_t counts[AXES]) {
    for (uint8_t n = 0; n < lane_count; n++) {
        counts[lanes[n].axis] = lanes[n].at;
    }
}

static enum error check_rows(int32_t before[ROWS], uint8_t *detail) {
    int32_t counts[AXES];
    memcpy(counts, motion.plan, sizeof counts);
    put_lanes(counts);
    for (uint8_t r = 0; r < memory.image.rows; r++) {
        const int32_t after = row_value(r, counts);
        if (row_known(r) && !within(memory.image.row[r].lower, memory.image.row[r].upper, before[r], after)) {
            *detail = r;
            return E_LIMIT_JOINT;
        }
        before[r] = after;
    }
    return OK;
}

static enum error check_segments(const uint8_t *p, uint8_t count, uint8_t flags, uint8_t *detail) {
    const bool wide = flags & WIDE;
    const uint8_t head = wide ? 6 : 5;
    const uint8_t size = head + lane_count * (wide ? 2 : 1);
    int32_t rows[ROWS];
    for (uint8_t r = 0; r < memory.image.rows; r++) {
        rows[r] = row_value(r, motion.plan);
    }
    for (uint8_t n = 0; n < count; n++, p += size) {
        struct segment *s = motion_slot(n);
        uint32_t time;
        enum error error = read_segment(p, wide, s, &time);
        if (error) {
            *detail = n;
            return error;
        }
        error = check_steps(p + head, wide, s, time, detail);
        if (!error && memory.image.rows) {
            error = check_rows(rows, detail);
        }
        if (error) {
            return error;
        }
    }
    return OK;
}

enum error batch_received(const uint8_t *payload, uint8_t length, uint8_t *detail) {
    if (length < HEAD) {
        return E_LENGTH;
    }
    const uint16_t mask = get16(payload + 2);
    const uint8_t flags = payload[4], count = payload[5];
    uint8_t axes = 0;
    for (uint8_t i = 0; i < 16; i++) {
        axes += mask >> i & 1;
    }
    const uint16_t segment = flags & WIDE ? 6 + 2 * axes : 5 + axes;
    if (count == 0 || flags & ~(END | WIDE) || length != HEAD + 8 * axes + count * segment) {
        return E_LENGTH;
    }
    if (!memory.config) {
        return E_CONFIG_NONE;
    }
    if (session.abort) {
        return E_ABORT;
    }
    if (session.state != IDLE && session.state != MOVING) {
        return E_BUSY;
    }
    const uint8_t *starts = payload + HEAD;
    enum error error = open_lanes(starts, mask, detail);
    if (error) {
        return error;
    }
    if (count > motion_free()) {
        return E_CREDIT;
    }
    error = check_segments(starts + 8 * axes, count, flags, detail);
    if (error) {
        return error;
    }
    for (uint8_t n = 0; n < lane_count; n++) {
        if (lanes[n].at != (int32_t)get32(starts + 4 * (axes + n))) {
            *detail = lanes[n].axis;
            return E_END;
        }
    }
    put_lanes(motion.plan);
    if (session.state == IDLE) {
        motion_begin(MOVING);
    }
    motion_append(count, flags & END);
    return OK;
}
