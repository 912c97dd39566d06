// Noise against the core, under sanitizers: fuzz [FRAMES [SEED]], a million each by default.
//
// 1. random bytes, 2. damaged copies of frames that the board would obey: nothing may happen.
// 3. frames whose CRC is right though they were damaged before it was made: the board may obey, but steps must be those
//    that it reports, within the limits, and each batch must lead where it says.
#include <string.h>

#include "../src/core/bytes.h"
#include "../src/core/config.h"
#include "../src/core/crc.h"
#include "../src/core/link.h"
#include "../src/core/motion.h"
#include "../src/core/protocol.h"
#include "chance.h"
#include "host.h"

static size_t wire_of(const uint8_t *payload, size_t length, uint8_t *wire) {
    uint8_t data[300];
    size_t code = 0, at = 1;
    memcpy(data, payload, length);
    put32(data + length, crc_block(payload, length));
    for (size_t i = 0; i < length + 4; i++) {
        if (data[i]) {
            wire[at++] = data[i];
        } else {
            wire[code] = at - code;
            code = at++;
        }
    }
    wire[code] = at - code;
    wire[at++] = 0;
    return at;
}

// A frame that the board would obey just now.
static size_t obeyed(uint8_t *payload) {
    struct host_segment s[6];
    memset(s, 0, sizeof s);
    uint8_t n = 1 + rnd(6), flags = HOST_END;
    payload[1] = host_next;
    switch (rnd(8)) {
        case 0:
            payload[0] = 0x12;
            payload[2] = rnd(4);
            return 3;
        case 1:
            payload[0] = 0x10;
            put16(payload + 2, rnd(100));
            for (int i = 0; i < 20; i++) {
                payload[4 + i] = rnd(256);
            }
            return 24;
        case 2:
            payload[0] = 0x16;
            for (uint8_t i = 0; i < AXES; i++) {
                put32(payload + 2 + 4 * i, i < STEPPERS ? rnd(2000) : 0);
            }
            return 2 + 4 * AXES;
        case 3:
            payload[0] = 0x15;
            memset(payload + 2, 0, 13 + 4 * AXES);
            payload[4] = 1 + rnd(255);
            payload[5] = payload[13] = 100;
            put32(payload + 9, 10000);
            put32(payload + 15, rnd(4000) + 1);
            return 15 + 4 * AXES;
        case 4:
            payload[0] = 0x01;
            payload[2] = 2;
            put32(payload + 3, rnd(1 << 30));
            return 7;
        case 5:
            payload[0] = 0x03;
            return 2;
        default:
            payload[0] = 0x14;
            flags |= (rnd(2) ? HOST_WIDE : 0) | 4 * rnd(8);
            for (uint8_t k = 0; k < n; k++) {
                s[k].ticks = 1 + rnd(200);
                s[k].interval = 2000 + rnd(30000);
                for (uint8_t i = 0; i < STEPPERS; i++) {
                    s[k].steps[i] = (int)rnd(s[k].ticks < 100 ? s[k].ticks : 100) * (rnd(2) ? 1 : -1);
                }
            }
            if (n > 3) {
                n = 3;
            }
            return 2 + host_motion_payload(payload + 2, STEPPER_AXES, flags, motion.plan, n, s);
    }
}

static size_t damage(uint8_t *bytes, size_t length) {
    for (uint32_t k = 1 + rnd(3); k; k--) {
        const size_t at = rnd(length);
        switch (rnd(5)) {
            case 0:
                bytes[at] ^= 1 << rnd(8);
                break;
            case 1:
                bytes[at] = rnd(256);
                break;
            case 2:
                memmove(bytes + at, bytes + at + 1, length - at - 1);
                length -= length > 1;
                break;
            case 3:
                memmove(bytes + at + 1, bytes + at, length - at);
                bytes[at] = rnd(256);
                length++;
                break;
            default:
                length = at + 1;
        }
    }
    return length;
}

static struct memory memory_before;
static struct session session_before;

static void start(uint32_t nonce) {
    bench_power();
    host_ready(nonce);
    memory_before = memory;
    session_before = session;
    memset(bench_pins, 0, sizeof bench_pins);
}

// After junk: ends whatever frame is open, and sees that nothing has come of it.
static void nothing_happened(void) {
    static const int32_t zero[AXES];
    bench_wire((const uint8_t *)"", 1);
    bench_run(1000);
    CHECK(bench_raw((uint8_t[1]){0}, 1) == 0);  // not even an answer
    session.silent = session_before.silent;
    CHECK(memcmp(&memory, &memory_before, sizeof memory) == 0);
    CHECK(memcmp(&session, &session_before, sizeof session) == 0);
    CHECK(memcmp(bench_pins, zero, STEPPERS * sizeof *zero) == 0);
    CHECK(motion_queue_empty());
}

static void random_frames(uint32_t count) {
    uint8_t bytes[400];
    start(1);
    for (uint32_t n = 0; n < count; n++) {
        const size_t length = 1 + rnd(rnd(10) ? 60 : 390);
        for (size_t i = 0; i < length; i++) {
            bytes[i] = 1 + rnd(255);
        }
        if (rnd(2)) {  // a plausible first code
            bytes[0] = 1 + rnd(length);
        }
        bench_wire(bytes, length);
        bench_wire((const uint8_t *)"", 1);
        if (n % 64 == 0) {
            nothing_happened();
        }
    }
    nothing_happened();
}

// Is the frame still there, whole, between two zeros (or the ends)?
static bool survived(const uint8_t *wire, size_t length, const uint8_t *frame, size_t size) {
    for (size_t begin = 0; begin < length;) {
        const uint8_t *zero = memchr(wire + begin, 0, length - begin);
        const size_t end = zero ? (size_t)(zero - wire) : length;
        if (end - begin == size && memcmp(wire + begin, frame, size) == 0) {
            return true;
        }
        begin = end + 1;
    }
    return false;
}

static void damaged_frames(uint32_t count) {
    uint8_t payload[300], wire[400], original[400];
    start(2);
    for (uint32_t n = 0; n < count; n++) {
        const size_t whole = wire_of(payload, obeyed(payload), wire);
        memcpy(original, wire, whole);
        const size_t length = damage(wire, whole);
        if (survived(wire, length, original, whole - 1)) {
            continue;
        }
        bench_wire(wire, length);
        bench_wire((const uint8_t *)"", 1);
        if (n % 16 == 0) {
            nothing_happened();
        }
    }
    nothing_happened();
}

static uint32_t obeyed_count, moved_count;
static uint32_t nonce = 1000;
static bool counts_declared = true;  // by SET_POSITION: pins and counts part company
static int32_t offset[STEPPERS];
static uint32_t compared;

// At rest the pins have made the steps that the board reports.
static void compare_at_rest(void) {
    while (motion.state != IDLE) {
        bench_run(10000);
    }
    int32_t now[AXES];
    motion_counts(now);
    for (uint8_t i = 0; i < STEPPERS; i++) {
        CHECK(now[i] == motion.plan[i]);
        CHECK(counts_declared || now[i] == offset[i] + bench_pins[i]);
        offset[i] = now[i] - bench_pins[i];
    }
    compared += !counts_declared;
    counts_declared = false;
}

// Payloads damaged before their CRC was made: the handlers' own checks are all that stands between them and the motors.
static void damaged_payloads(uint32_t count) {
    uint8_t payload[400];
    start(3);
    for (uint32_t n = 0; n < count; n++) {
        if (session.error || !memory.config || !memory.drivers || (memory.known & STEPPER_AXES) != STEPPER_AXES) {
            compare_at_rest();
            host_hello(nonce++);
            if (!memory.config) {
                const struct image image = host_image();
                host_configure(&image);
            }
            int32_t counts[AXES] = {0};
            for (uint8_t i = STEPPERS; i < AXES; i++) {
                counts[i] = 1500;
            }
            const uint16_t lost = ALL_AXES & ~memory.known;
            host_enable(3);
            counts_declared = true;
            host_position(lost & STEPPER_AXES, counts);
        }
        host_next = session.next;
        size_t length = obeyed(payload);
        if (rnd(4)) {
            length = damage(payload, length);
        }
        if (length < 2 || length > 250) {
            continue;
        }
        if (rnd(2)) {
            payload[1] = session.next;
        }
        const uint8_t before = session.next;
        counts_declared |= payload[0] == 0x13;
        int32_t plan[AXES];
        memcpy(plan, motion.plan, sizeof plan);
        bench_payload(payload, length);
        const bool done = session.next != before && session.error == OK;
        obeyed_count += done;
        if (done && payload[0] == 0x14) {
            moved_count++;
            const uint8_t *p = payload + 6;
            uint8_t k = 0;
            for (uint8_t i = 0; i < AXES; i++) {
                k += payload[2] >> i & 1;
            }
            for (uint8_t i = 0, at = 0; i < AXES; i++) {
                if (payload[2] >> i & 1) {
                    CHECK((int32_t)get32(p + 4 * at) == plan[i]);
                    CHECK((int32_t)get32(p + 4 * (k + at)) == motion.plan[i]);
                    CHECK(within(memory.image.axis[i].lower, memory.image.axis[i].upper, plan[i], motion.plan[i]));
                    at++;
                } else {
                    CHECK(motion.plan[i] == plan[i]);
                }
            }
        }
        if (n % 4 == 0) {
            bench_run(2000);
        }
        while (bench_raw(payload, sizeof payload)) {
        }
        if (n % 256 == 0) {
            compare_at_rest();
        }
    }
}

int main(int argc, char **argv) {
    const uint32_t frames = argc > 1 ? strtoul(argv[1], NULL, 0) : 1000000;
    chance_seed(argc > 2 ? strtoul(argv[2], NULL, 0) : 0x9E3779B97F4A7C15ULL);
    random_frames(frames);
    printf("fuzz: %u random frames, nothing happened\n", frames);
    damaged_frames(frames);
    printf("fuzz: %u damaged frames, nothing happened\n", frames);
    damaged_payloads(frames / 10);
    printf("fuzz: %u damaged payloads with a right CRC: %u obeyed, %u of them motions\n", frames / 10, obeyed_count, moved_count);
    CHECK(moved_count > frames / 500 && obeyed_count > moved_count && compared > frames / 50000);
    return 0;
}
