// Lives of a board, at random, under sanitizers: lives [LIVES [SEED]], a thousand by default.
//
// A life is an image (whole, or with one fault), resets, limit switches where axes stand or by whim, power cuts, aborts, rows, and frames
// of every kind in any state. Promised: a faulty image is refused; at rest a known axis's count is what its pins made; joints and
// rows end no farther outside than they began; a pressed switch, a cut, an abort end motion; a homing's latch is the switch's edge.
#include <string.h>

#include "../src/core/bytes.h"
#include "../src/core/config.h"
#include "../src/core/crc.h"
#include "../src/core/home.h"
#include "../src/core/inputs.h"
#include "../src/core/motion.h"
#include "../src/core/protocol.h"
#include "chance.h"
#include "host.h"
#include "images.h"

static struct image image;
static int32_t edge[SWITCHES ? SWITCHES : 1];  // pins of the axis: at or beyond it the switch is pressed
static bool below[SWITCHES ? SWITCHES : 1], loose[SWITCHES ? SWITCHES : 1];  // loose: a switch that follows no axis
static uint32_t moved, homed, stopped, refused, cut;
static uint32_t nonce = 1;

static bool closed(uint8_t n) {
    return image.guard[n].flags & CLOSED;
}

static void follow(void) {
    for (uint8_t n = 0; n < SWITCHES; n++) {
        const int32_t at = bench_pins[axis_of(n)];
        if (!loose[n]) {
            const bool high = (below[n] ? at <= edge[n] : at >= edge[n]) == closed(n);
            bench_switches = (bench_switches & ~(1U << n)) | (uint8_t)high << n;
        }
    }
}

static uint8_t reply[300];
static size_t reply_length;

static void ask(const uint8_t *payload, size_t length) {
    bench_payload(payload, length);
    for (size_t n; (n = bench_answer(reply, sizeof reply));) {
        reply_length = n;
    }
}

static enum error order(uint8_t type, const uint8_t *body, size_t length) {
    uint8_t payload[300] = {type, session.next};
    memcpy(payload + 2, body, length);
    ask(payload, length + 2);
    return reply[2];
}

static void hello(void) {
    uint8_t payload[7] = {0x01, 0, 2};
    put32(payload + 3, ++nonce);
    ask(payload, sizeof payload);
}

static enum error configure(void) {
    const uint16_t length = image_length(&image);
    uint8_t body[250];
    const uint16_t piece = between(20, FRAME_MAX - 9);
    for (uint16_t at = 0; at < length; at += piece) {
        const uint16_t n = length - at < piece ? length - at : piece;
        put16(body, at);
        memcpy(body + 2, (const uint8_t *)&image + at, n);
        CHECK(order(0x10, body, n + 2) == OK);
    }
    put32(put16(body, length), crc_block(&image, length) ^ (rnd(40) == 0));
    return order(0x11, body, 6);
}

static int32_t offset[STEPPERS];  // count - pins
static uint16_t followed;         // axes whose count has gone with the pins since they were last compared

static void compare_at_rest(void) {
    int32_t now[AXES];
    motion_counts(now);
    for (uint8_t i = 0; i < STEPPERS; i++) {
        const bool same = now[i] - offset[i] == bench_pins[i];
        CHECK(same || !(followed >> i & memory.known >> i & 1));
        offset[i] = now[i] - bench_pins[i];
        followed |= 1U << i;
    }
}

static void come_to_rest(void) {
    for (uint32_t ms = 0; motion.state != IDLE; ms++) {
        CHECK(ms < 20000);
        bench_run(1000);
    }
    compare_at_rest();
}

static void state_positions(void) {
    uint8_t body[2 + 4 * AXES];
    const uint16_t mask = limits.used & ~memory.known;
    uint8_t *p = put16(body, mask);
    for (uint8_t i = 0; i < AXES; i++) {
        if (mask >> i & 1) {
            p = put32(p, i < STEPPERS ? between(-300, 300) : image.axis[i].home);
        }
    }
    order(0x13, body, p - body);
    followed &= ~mask;
}

static void motion_frame(void) {
    uint8_t payload[300];
    struct host_segment s[2];
    memset(s, 0, sizeof s);
    const uint16_t mask = limits.used & memory.known & STEPPER_AXES & (rnd(2) ? STEPPER_AXES : rnd(1 << STEPPERS));
    const uint8_t n = 1 + rnd(2);
    for (uint8_t k = 0; k < n; k++) {
        s[k].ticks = 100 + rnd(300);
        s[k].interval = CLOCK / 4000 + rnd(CLOCK / 2000);
        for (uint8_t i = 0; i < STEPPERS; i++) {
            s[k].steps[i] = mask >> i & 1 ? between(-90, 90) : 0;
        }
    }
    if (!mask) {
        return;
    }
    const uint8_t flags = (rnd(4) ? HOST_END : 0) | HOST_WIDE;
    const size_t length = host_motion_payload(payload, mask, flags, motion.plan, n, s);
    const bool idle = motion.state == IDLE;
    moved += order(0x14, payload, length) == OK;
    if (session.error == E_LIMIT_SWITCH && idle) {
        refused++;
    }
}

static void rates(uint8_t *p, bool one) {
    const uint8_t only = rnd(STEPPERS);
    for (uint8_t i = 0; i < AXES; i++) {
        const bool moves = one ? i == only : rnd(AXES) == 0;
        put32(p + 4 * i, moves ? between(-3000, 3000) : 0);
    }
}

static bool homing_fair;  // its switch follows an axis, and alone may stop it
static uint8_t homing;

static void home_frame(void) {
    uint8_t body[13 + 4 * AXES];
    homing = SWITCHES ? rnd(SWITCHES) : 0;
    if (motion.state == IDLE) {
        compare_at_rest();
    }
    body[0] = rnd(16) ? homing : rnd(256);
    body[1] = rnd(16) ? closed(homing) : rnd(3);
    body[2] = rnd(16) ? 16 + rnd(200) : rnd(2);
    put32(body + 3, rnd(16) ? 20 + rnd(200) : rnd(2));
    put32(body + 7, rnd(8) ? 5000 : rnd(200));
    put16(body + 11, rnd(8) ? 400 : rnd(4));
    rates(body + 13, true);
    const uint8_t i = axis_of(homing);
    if (rnd(8)) {
        memset(body + 13, 0, 4 * AXES);
        put32(body + 13 + 4 * i, (uint32_t)between(500, 3000) * (below[homing] ? -1 : 1));
    }
    homing_fair = order(0x15, body, sizeof body) == OK && body[0] == homing && body[1] == closed(homing) && !loose[homing] && get32(body + 13 + 4 * i);
    homing_fair = homing_fair && ((int32_t)get32(body + 13 + 4 * i) < 0) == below[homing];
}

static void frame(void) {
    uint8_t body[4 * AXES];
    switch (rnd(12)) {
        case 0:
            body[0] = rnd(8) ? 3 : rnd(5);
            order(0x12, body, 1);
            break;
        case 1:
            ask((const uint8_t[]){0x03, 0}, 2);
            break;
        case 2:
        case 3:
            rates(body, rnd(2));
            order(0x16, body, 4 * AXES);
            break;
        case 4:
        case 5:
            home_frame();
            break;
        case 6:
            hello();
            break;
        case 7:
            state_positions();
            break;
        default:
            motion_frame();
    }
}

static void whim(void) {
    const uint8_t n = SWITCHES ? rnd(SWITCHES) : 0;
    switch (rnd(16)) {
        case 0:
            bench_abort = !bench_abort;
            break;
        case 1:
            bench_power_level = !bench_power_level;
            bench_run(5000);
            if (!bench_power_level && memory.config && image.flags & POWER_SENSED) {
                CHECK(!memory.known && (motion.state == IDLE || session.error));
                cut++;
            }
            break;
        case 2:
            loose[n] = !loose[n];
            bench_switches ^= loose[n] && SWITCHES ? 1U << n : 0;
            break;
        case 3:
        case 4:
            bench_abort = !(image.flags & ABORT_CLOSED);
            bench_power_level = true;
            break;
        default:
            break;
    }
    follow();
}

// While a guard's switch is pressed and the arm goes into it, the session ends within the debouncing.
static void watch_guards(void) {
    for (uint8_t n = 0; n < SWITCHES; n++) {
        const struct segment *s = motion_running();
        uint8_t detail;
        const bool steady = inputs.pressed >> n & 1;
        if (s && steady && motion.state == MOVING && inputs_blocking(s, &detail)) {
            bench_run(1000);
            CHECK(motion.state != MOVING || session.error);
        }
    }
    stopped += session.error == E_LIMIT_SWITCH && motion.state == HOLDING;
}

static void within_promises(const int32_t before[AXES]) {
    for (uint8_t i = 0; i < AXES; i++) {
        if (memory.config && limits.used >> i & memory.known >> i & 1) {
            CHECK(within(memory.image.axis[i].lower, memory.image.axis[i].upper, before[i], motion.plan[i]));
        }
    }
    for (uint8_t r = 0; r < memory.image.rows; r++) {
        const struct row_config *row = &memory.image.row[r];
        const int32_t was = row_value(r, before), is = row_value(r, motion.plan), slack = row_slack(r);
        CHECK(!row_known(r) || ((is >= row->lower || is >= was - slack) && (is <= row->upper || is <= was + slack)));
    }
}

static void live(void) {
    bench_power();
    memset(edge, 0, sizeof edge);
    for (uint8_t n = 0; n < SWITCHES; n++) {
        below[n] = rnd(2);
        loose[n] = false;
        edge[n] = below[n] ? -between(50, 400) : between(50, 400);
    }
    followed = 0;
    hello();
    image = sound_image(below);
    if (rnd(3) == 0) {
        spoil_image(&image);
        CHECK(configure() == E_CONFIG_BAD && !memory.config);
        return;
    }
    if (configure() != OK) {
        CHECK(!memory.config);
        return;
    }
    bench_abort = !(image.flags & ABORT_CLOSED);
    bench_on_tick = follow;
    follow();
    hello();
    state_positions();
    order(0x12, (const uint8_t[]){3}, 1);
    bench_run(8000);
    compare_at_rest();
    for (uint8_t turn = 0; turn < 40; turn++) {
        int32_t before[AXES];
        const uint8_t mode = motion.state;
        if (session.error) {
            come_to_rest();
            hello();
            state_positions();
            order(0x12, (const uint8_t[]){3}, 1);
        }
        memcpy(before, motion.plan, sizeof before);
        whim();
        frame();
        if (motion.state == MOVING && mode == IDLE) {
            within_promises(before);
        }
        bench_run(rnd(30) * 1000);
        watch_guards();
        if (rnd(3) == 0) {
            if (motion.state == HOMING && homing_fair && rnd(8)) {
                for (uint32_t ms = 0; motion.state == HOMING && ms < 20000; ms++) {
                    ask((const uint8_t[]){0x02, 0, 0}, 3);
                    bench_run(1000);
                }
                if (home_finished) {
                    const uint8_t i = axis_of(homing);
                    CHECK(motion.latch[i] - offset[i] == edge[homing]);
                    homed++;
                }
            }
            come_to_rest();
        }
        if (rnd(60) == 0) {
            bench_reset(rnd(2) ? 2 : 1 << rnd(4));
            followed = 0;
            hello();
        }
    }
    bench_on_tick = 0;
    come_to_rest();
}

int main(int argc, char **argv) {
    const uint32_t lives = argc > 1 ? strtoul(argv[1], NULL, 0) : 1000;
    chance_seed(argc > 2 ? strtoul(argv[2], NULL, 0) : 0x9E3779B97F4A7C15ULL);
    for (uint32_t n = 0; n < lives; n++) {
        live();
    }
    printf("%u lives: %u motions, %u homings to the step, %u stops at a switch, %u refused there, %u cuts\n", lives, moved, homed, stopped, refused, cut);
    CHECK(moved > lives && homed > lives / 50 && stopped + refused > lives / 50 && cut > lives / 50);
    return 0;
}
