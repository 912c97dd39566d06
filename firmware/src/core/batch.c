#include "batch.h"

#include <string.h>

#include "bytes.h"
#include "motion.h"

enum { END = 1, WIDE = 2 };  // flags
enum { HEAD = 6 };           // type, tag, mask, flags, n

// The axes of the batch, in order, and where each of them is while its segments are read.
static struct {
    uint8_t count;
    uint8_t axis[AXES];
    int32_t at[AXES];  // all axes
} path;

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

static enum error check_axes(const uint8_t *starts, uint16_t mask, uint8_t *detail) {
    path.count = 0;
    memcpy(path.at, motion.plan, sizeof path.at);
    for (uint8_t i = 0; i < 16; i++) {
        if (!(mask >> i & 1)) {
            continue;
        }
        *detail = i;
        const enum error error =
            i >= AXES ? E_VALUE : check_axis(i, (int32_t)get32(starts + 4 * path.count));
        if (error) {
            return error;
        }
        path.axis[path.count++] = i;
    }
    *detail = 0;
    return OK;
}

// One segment from the frame into its slot. `time`: quarter cycles that it lasts at its fastest.
static enum error read_segment(const uint8_t *p, uint8_t flags, struct segment *s, uint32_t *time) {
    const bool wide = flags & WIDE;
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

static enum error check_steps(const uint8_t *p, uint8_t flags, struct segment *s, uint32_t time, uint8_t *detail) {
    for (uint8_t n = 0; n < path.count; n++) {
        const uint8_t i = *detail = path.axis[n];
        const int16_t steps = flags & WIDE ? (int16_t)get16(p + 2 * n) : (int8_t)p[n];
        const uint16_t size = steps < 0 ? 0U - (uint16_t)steps : (uint16_t)steps;
        if (size > s->ticks) {
            return E_STEPS;
        }
        if (size && (uint32_t)(size - 1) * limits.step_time[i] > time) {
            return E_RATE;
        }
        const int32_t before = path.at[i];
        path.at[i] = (int32_t)((uint32_t)before + (uint32_t)(int32_t)steps);
        if (!within(memory.image.axis[i].lower, memory.image.axis[i].upper, before, path.at[i])) {
            return E_LIMIT;
        }
        s->steps[i] = size;
        s->back |= steps < 0 ? 1U << i : 0;
    }
    *detail = 0;
    return OK;
}

static enum error check_rows(int32_t before[ROWS], uint8_t *detail) {
    for (uint8_t r = 0; r < memory.image.rows; r++) {
        const int32_t after = row_value(r, path.at);
        if (row_known(r) && !within(memory.image.row[r].lower, memory.image.row[r].upper, before[r], after)) {
            *detail = r;
            return E_LIMIT_JOINT;
        }
        before[r] = after;
    }
    return OK;
}

static enum error check_segments(const uint8_t *p, uint8_t count, uint8_t flags, uint8_t *detail) {
    const uint8_t head = flags & WIDE ? 6 : 5;
    const uint8_t size = head + path.count * (flags & WIDE ? 2 : 1);
    int32_t rows[ROWS];
    for (uint8_t r = 0; r < memory.image.rows; r++) {
        rows[r] = row_value(r, path.at);
    }
    for (uint8_t n = 0; n < count; n++, p += size) {
        struct segment *s = motion_slot(n);
        uint32_t time;
        enum error error = read_segment(p, flags, s, &time);
        if (error) {
            *detail = n;
            return error;
        }
        error = check_steps(p + head, flags, s, time, detail);
        if (!error) {
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
    enum error error = check_axes(starts, mask, detail);
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
    for (uint8_t n = 0; n < path.count; n++) {
        if (path.at[path.axis[n]] != (int32_t)get32(starts + 4 * (axes + n))) {
            *detail = path.axis[n];
            return E_END;
        }
    }
    if (session.state == IDLE) {
        motion_begin(MOVING);
    }
    motion_append(count, flags & END);
    return OK;
}
