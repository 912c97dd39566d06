#include "host.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "../src/core/bytes.h"
#include "../src/core/crc.h"

uint8_t host_next;
uint8_t host_frame[300];
size_t host_length;

struct image host_image(void) {
    struct image image = {.layout = 2, .axes = AXES, .step_high = 10, .step_low = 10, .dir_setup = 2, .wake = 1};
    for (uint8_t i = 0; i < AXES; i++) {
        const bool servo = i >= STEPPERS;
        image.axis[i] = (struct axis_config){
            .flags = USED,
            .lower = servo ? 500 : -100000,
            .upper = servo ? 2500 : 100000,
            .home = servo ? 1500 : 0,
            .max_rate = servo ? 2000 : 20000,
            .max_accel = servo ? 16000 : 200000,
        };
    }
    return image;
}

// The next answer of this type; CREDIT that comes unasked is passed over.
static size_t answer(uint8_t type, uint8_t *payload) {
    for (;;) {
        const size_t length = bench_answer(payload, 300);
        CHECK(length > 0);
        if (payload[0] == type) {
            return length;
        }
        CHECK(payload[0] == 0x83);
    }
}

static struct ack read_ack(const uint8_t *p) {
    return (struct ack){p[0], p[1], p[2], p[3], p[4], get16(p + 5), get16(p + 7)};
}

static struct ack await_ack(void) {
    uint8_t payload[300];
    CHECK(answer(0x80, payload) == 10);
    return read_ack(payload + 1);
}

void host_hello(uint32_t nonce) {
    uint8_t payload[300] = {0x01, 0, 2};
    put32(payload + 3, nonce);
    bench_payload(payload, 7);
    CHECK(answer(0x81, payload) == 35);
    host_next = 0;
}

struct ack host_order(uint8_t type, const void *body, size_t length) {
    host_frame[0] = type;
    host_frame[1] = host_next;
    memcpy(host_frame + 2, body, length);
    host_length = length + 2;
    bench_payload(host_frame, host_length);
    const struct ack ack = await_ack();
    host_next = ack.next;
    return ack;
}

void host_configure(const struct image *image) {
    const uint16_t length = offsetof(struct image, row) + image->rows * sizeof image->row[0];
    for (uint16_t at = 0; at < length; at += 100) {
        uint8_t body[102];
        const uint16_t n = length - at < 100 ? length - at : 100;
        put16(body, at);
        memcpy(body + 2, (const uint8_t *)image + at, n);
        CHECK(host_order(0x10, body, n + 2).error == OK);
    }
    uint8_t body[6];
    put32(put16(body, length), crc_block(image, length));
    CHECK(host_order(0x11, body, 6).error == OK);
}

struct ack host_position(uint16_t mask, const int32_t *counts) {
    uint8_t body[2 + 4 * AXES];
    uint8_t *p = put16(body, mask);
    for (uint8_t i = 0; i < AXES; i++) {
        if (mask >> i & 1) {
            p = put32(p, counts[i]);
        }
    }
    return host_order(0x13, body, p - body);
}

struct ack host_enable(uint8_t what) {
    return host_order(0x12, &what, 1);
}

size_t host_motion_payload(uint8_t *payload, uint16_t mask, uint8_t flags, const int32_t *start, uint8_t n,
                           const struct host_segment *segments) {
    int32_t end[AXES];
    memcpy(end, start, sizeof end);
    for (uint8_t k = 0; k < n; k++) {
        for (uint8_t i = 0; i < AXES; i++) {
            end[i] += segments[k].steps[i];
        }
    }
    uint8_t *p = put16(payload, mask);
    *p++ = flags;
    *p++ = n;
    for (uint8_t i = 0; i < AXES; i++) {
        p = mask >> i & 1 ? put32(p, start[i]) : p;
    }
    for (uint8_t i = 0; i < AXES; i++) {
        p = mask >> i & 1 ? put32(p, end[i]) : p;
    }
    for (uint8_t k = 0; k < n; k++) {
        const struct host_segment *s = &segments[k];
        const bool wide = flags & HOST_WIDE;
        int16_t rates[AXES];
        uint16_t fine = 0;
        for (uint8_t i = 0; i < AXES; i++) {
            double rate = s->rate[i] ? s->rate[i] : s->steps[i] * 8388608.0 / s->ticks;
            if (wide && fabs(rate) < 32767.5) {
                fine |= 1U << i;
            } else {
                rate /= 256;
            }
            rates[i] = fmax(-32767, fmin(32767, round(rate)));
        }
        if (wide) {
            p = put16(put16(p, s->ticks), s->interval);
            *p++ = 0;
            p = put16(put16(put16(p, s->add), s->bend), fine | (s->quick ? 0x8000 : 0));
        } else {
            *p++ = s->ticks;
            p = put16(put16(p, s->interval), s->add);
        }
        for (uint8_t i = 0; i < AXES; i++) {
            p = mask >> i & 1 ? put16(p, rates[i]) : p;
        }
    }
    return p - payload;
}

struct ack host_motion(uint16_t mask, uint8_t flags, const int32_t *start, uint8_t n, const struct host_segment *s) {
    uint8_t body[300];
    return host_order(0x14, body, host_motion_payload(body, mask, flags, start, n, s));
}

struct ack host_hold(void) {
    const uint8_t payload[2] = {0x03, 9};
    bench_payload(payload, 2);
    return await_ack();
}

struct ack host_home(uint8_t input, uint8_t closed, uint8_t slow, uint32_t backoff, uint32_t travel, uint16_t time,
                     const int32_t *rate) {
    uint8_t body[13 + 4 * AXES] = {input, closed, slow};
    uint8_t *p = put16(put32(put32(body + 3, backoff), travel), time);
    for (uint8_t i = 0; i < AXES; i++) {
        p = put32(p, rate[i]);
    }
    return host_order(0x15, body, sizeof body);
}

struct ack host_jog(const int32_t *rate) {
    uint8_t body[4 * AXES];
    for (uint8_t i = 0; i < AXES; i++) {
        put32(body + 4 * i, rate[i]);
    }
    return host_order(0x16, body, sizeof body);
}

struct status host_status(uint8_t page) {
    uint8_t payload[300] = {0x02, 7, page};
    bench_payload(payload, 3);
    CHECK(answer(0x82, payload) == 19 + 4 * AXES);
    CHECK(payload[1] == 7);
    struct status status = {
        .ack = read_ack(payload + 2),
        .flags = payload[6],
        .known = get16(payload + 10),
        .switches = payload[12],
        .overruns = payload[13],
        .bad = payload[14],
    };
    status.ack.free = payload[7];
    status.ack.queued = get16(payload + 8);
    status.ack.session = get16(payload + 16);
    for (uint8_t i = 0; i < AXES; i++) {
        status.counts[i] = (int32_t)get32(payload + 18 + 4 * i);
    }
    return status;
}

void host_ready(uint32_t nonce) {
    const struct image image = host_image();
    int32_t counts[AXES];
    host_hello(nonce);
    host_configure(&image);
    for (uint8_t i = 0; i < AXES; i++) {
        counts[i] = image.axis[i].home;
    }
    CHECK(host_position(ALL_AXES, counts).error == OK);
    CHECK(host_enable(3).error == OK);
    bench_run(5000);
}

void host_wait_idle(uint32_t at_most_ms) {
    while (host_status(0).ack.state != 0) {
        CHECK(at_most_ms-- > 0);
        bench_run(1000);
    }
}
