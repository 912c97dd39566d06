// What the core promises, on the PC: exact steps, holds on the path, limits, homing, jog, resets. One function a promise.
// For boards with at least two steppers.
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "../src/core/bytes.h"
#include "../src/core/crc.h"
#include "../src/core/dda.h"
#include "../src/core/motion.h"
#include "../src/core/protocol.h"
#include "host.h"

static const int32_t zero[AXES];
static int32_t home_counts[AXES];

static void fresh(uint32_t nonce) {
    bench_on_tick = NULL;
    bench_power();
    host_ready(nonce);
    memset(home_counts, 0, sizeof home_counts);
    for (uint8_t i = STEPPERS; i < AXES; i++) {
        home_counts[i] = 1500;
    }
    memset(bench_pins, 0, sizeof bench_pins);
}

static bool pins_are(const int32_t *counts) {
    return memcmp(bench_pins, counts, STEPPERS * sizeof *counts) == 0;
}

// ---- every tick of random segments makes the steps that PROTOCOL.md, section 6, says

static struct host_segment expected[12];
static uint8_t expected_at;
static uint32_t expected_tick;
static int64_t expected_place[AXES];  // 2^-23 step

static void compare_tick(void) {
    const struct host_segment *s = &expected[expected_at];
    expected_tick++;
    for (uint8_t i = 0; i < STEPPERS; i++) {
        CHECK(bench_pins[i] == (expected_place[i] + (int64_t)expected_tick * s->rate[i]) >> 23);
    }
    if (expected_tick == s->ticks) {
        for (uint8_t i = 0; i < STEPPERS; i++) {
            expected_place[i] += (int64_t)s->ticks * s->rate[i];
        }
        expected_tick = 0;
        expected_at++;
    }
}

static void wild(uint32_t nonce) {  // no limit but the counts'
    struct image image = host_image();
    fresh(nonce);
    for (uint8_t i = 0; i < STEPPERS; i++) {
        image.axis[i].max_rate = 60000;
        image.axis[i].max_accel = (1 << 24) - 1;
    }
    host_hello(nonce + 1000);
    host_configure(&image);
    CHECK(host_position(ALL_AXES, home_counts).error == OK && host_enable(3).error == OK);
    bench_run(5000);
}

static void steps_are_exact(void) {
    wild(1);
    int32_t at[AXES];
    memcpy(at, home_counts, sizeof at);
    for (int round = 0; round < 300; round++) {
        const uint8_t n = 1 + rand() % 3;
        int64_t place[AXES];
        memset(expected, 0, sizeof expected);
        for (uint8_t i = 0; i < AXES; i++) {
            place[i] = expected_place[i] = at[i] * (1LL << 23) + (1 << 22);
        }
        for (uint8_t k = 0; k < n; k++) {
            struct host_segment *s = &expected[k];
            s->ticks = 1 + rand() % 700;
            s->interval = 1400 + rand() % 3000;
            s->add = rand() % 400 - 200;
            s->bend = (rand() % 2 ? rand() % 2000 : 0) * (s->add < 0 ? -1 : s->add > 0);
            for (uint8_t i = 0; i < 2; i++) {
                s->rate[i] = rand() % 2 ? rand() % 65535 - 32767 : (rand() % 65533 - 32766) * 256;
                if (rand() % 8 == 0 || llabs((place[i] + (int64_t)s->ticks * s->rate[i]) >> 23) > 50000) {
                    s->rate[i] = 0;
                }
                const int64_t after = place[i] + (int64_t)s->ticks * s->rate[i];
                s->steps[i] = (after >> 23) - (place[i] >> 23);
                place[i] = after;
            }
        }
        expected_at = expected_tick = 0;
        bench_on_tick = compare_tick;
        CHECK(host_motion(3, HOST_END | HOST_WIDE, at, n, expected).error == OK);
        host_wait_idle(2000);
        bench_on_tick = NULL;
        CHECK(expected_at == n && expected_tick == 0);
        for (uint8_t i = 0; i < AXES; i++) {
            at[i] = place[i] >> 23;
        }
        const struct status status = host_status(0);
        CHECK(memcmp(status.counts, at, sizeof at) == 0 && pins_are(at));
    }
}

// ---- holds

// A long cruise in one segment: 10 kHz, Y half as fast as X. u = 50 ms.
static const struct host_segment cruise_segment = {.ticks = 30000, .interval = 1600, .steps = {30000, -15000}};
static uint64_t last_tick_at;
static uint64_t last_interval;
static bool slowing;

static void watch_slowing(void) {
    const uint64_t interval = bench_cycles - last_tick_at;
    if (slowing) {
        CHECK(interval + 1 >= last_interval);  // never faster again
    }
    last_interval = interval;
    last_tick_at = bench_cycles;
    CHECK(abs(2 * bench_pins[1] + bench_pins[0]) <= 2);  // on the path
}

// Holds from full speed by `cause`; returns ms until rest.
static double hold_by(void (*cause)(void), enum error error) {
    fresh(2);
    CHECK(host_motion(3, HOST_END | HOST_WIDE, home_counts, 1, &cruise_segment).error == OK);
    for (int i = 0; i < 10; i++) {
        bench_run(20000 + i);
        CHECK(pins_are(host_status(0).counts));  // on the way, too
    }
    slowing = false;
    bench_on_tick = watch_slowing;
    bench_run(1000);
    slowing = true;
    cause();
    const uint64_t begin = bench_cycles;
    while (motion.state != IDLE) {
        CHECK(bench_cycles - begin < CLOCK);
        bench_run(100);
    }
    bench_on_tick = NULL;
    const double ms = (last_tick_at - begin) * 1e3 / CLOCK;
    const struct status status = host_status(0);
    CHECK(status.ack.error == error && status.ack.free == QUEUE_SLOTS && status.ack.queued == 0);
    CHECK(pins_are(status.counts) && status.known == ALL_AXES && bench_drivers_on);
    // it never resumes by itself, and the session is over
    const int32_t stood = bench_pins[0];
    bench_run(1000000);
    CHECK(bench_pins[0] == stood);
    const struct host_segment one = {.ticks = 10, .interval = 16000, .steps = {5}};
    CHECK(host_motion(1, HOST_END, status.counts, 1, &one).error == error);
    // a new one goes on from there
    bench_abort = true;
    bench_run(10000);
    host_hello(3);
    CHECK(host_motion(1, HOST_END, status.counts, 1, &one).error == OK);
    host_wait_idle(100);
    CHECK(bench_pins[0] == stood + 5);
    return ms;
}

static void by_hold(void) {
    host_hold();
}

static void by_hello(void) {
    host_hello(77);
    session.error = session.error ? session.error : E_HELD;  // the new session is open: close it for the comparison
}

static void by_abort(void) {
    bench_abort = false;
    bench_run(3000);
}

static void by_silence(void) {
    bench_run(500000 - 1000);
    // the hold has only now begun
}

static void by_refusal(void) {
    CHECK(host_order(0x17, "", 0).error == E_TYPE);
}

static void holds_stop_on_the_path(void) {
    const double ideal = 50;  // ms: 10000 counts/s at 200000 counts/s²
    const double times[] = {
        hold_by(by_hold, E_HELD),       hold_by(by_hello, E_HELD),     hold_by(by_abort, E_ABORT),
        hold_by(by_silence, E_SILENCE), hold_by(by_refusal, E_TYPE),
    };
    for (size_t i = 0; i < sizeof times / sizeof *times; i++) {
        CHECK(times[i] > 0.8 * ideal && times[i] < 1.2 * ideal);
    }
    printf("hold from full speed: %.1f ms, the ideal ramp is %.0f ms\n", times[0], ideal);
}

static void hold_in_the_planned_ramp_follows_the_plan(void) {
    // speeds up in 100 ms, slows down in 200 ms by itself; a hold in there must not brake harder than max_accel
    fresh(4);
    struct host_segment ramp[30];
    for (int k = 0; k < 30; k++) {
        const double rate = k < 10 ? 10000 * (k + 0.5) / 10 : 10000 * (1 - (k - 9.5) / 20);
        ramp[k] = (struct host_segment){.ticks = rate / 100, .interval = 16e6 / rate, .steps = {rate / 100}};
    }
    int32_t at[AXES] = {0};
    for (int n = 0; n < 30; n += 10) {
        CHECK(host_motion(1, n == 20 ? HOST_END : 0, at, 10, ramp + n).error == OK);
        for (int k = 0; k < 10; k++) {
            at[0] += ramp[n + k].steps[0];
        }
    }
    bench_run(100000);
    bench_run(50000);
    host_hold();
    uint64_t before = bench_cycles;
    int32_t pins = bench_pins[0];
    double last_rate = 7500;
    while (motion.state != IDLE) {
        bench_run(10000);
        const double seconds = (double)(bench_cycles - before) / CLOCK;
        const double rate = (bench_pins[0] - pins) / seconds;
        CHECK(last_rate - rate < 200000 * seconds + 250);  // max_accel, and what quantising to ticks adds
        last_rate = rate;
        before = bench_cycles;
        pins = bench_pins[0];
    }
    CHECK(host_status(0).counts[0] == bench_pins[0]);
}

static void an_unfinished_queue_is_a_hold(void) {
    // 320 ms at 10 kHz without END, u = 50 ms, then the host is busy elsewhere but alive
    fresh(5);
    struct host_segment s[4];
    for (int k = 0; k < 4; k++) {
        s[k] = (struct host_segment){.ticks = 800, .interval = 1600, .steps = {800, -400}};
    }
    CHECK(host_motion(3, HOST_WIDE, home_counts, 4, s).error == OK);
    host_wait_idle(1000);
    const struct status status = host_status(0);
    CHECK(status.ack.error == E_DRY && status.known == ALL_AXES && pins_are(status.counts));
    CHECK(bench_pins[0] > 1600 && bench_pins[0] < 3200);  // it braked before the end of the path
    CHECK(abs(bench_pins[0] + 2 * bench_pins[1]) <= 2);
}

static void an_abrupt_end_at_speed_loses_the_position(void) {
    // the main loop hangs until the queue has run out at u = 50 ms: no path to brake on
    fresh(6);
    const struct host_segment s = {.ticks = 1000, .interval = 1600, .steps = {1000}};
    CHECK(host_motion(1, HOST_WIDE, home_counts, 1, &s).error == OK);
    bench_run(20000);
    bench_frozen = true;
    bench_run(100000);
    bench_frozen = false;
    host_wait_idle(1000);
    const struct status status = host_status(0);
    CHECK(status.ack.error == E_DRY && pins_are(status.counts));
    CHECK(!(status.known & 1) && (status.known | 1) == ALL_AXES);
}

// ---- credit, sequence, duplicates

static void credit_and_duplicates(void) {
    fresh(7);
    struct host_segment s[8];
    for (int k = 0; k < 8; k++) {
        s[k] = (struct host_segment){.ticks = 200, .interval = 16000, .steps = {10}};
    }
    int32_t at[AXES] = {0};
    uint8_t free = QUEUE_SLOTS;
    while (free >= 8) {
        const struct ack ack = host_motion(1, 0, at, 8, s);
        CHECK(ack.error == OK && ack.free == free - 8);
        free = ack.free;
        at[0] += 80;
        bench_payload(host_frame, host_length);  // the same again: a lost ACK makes the host do that
        uint8_t answer[300];
        CHECK(bench_answer(answer, sizeof answer) == 10 && answer[1] == host_next && answer[5] == free);
    }
    CHECK(free == 0 && host_motion(1, 0, at, 1, s).error == E_CREDIT);
    host_wait_idle(20000);
    CHECK(host_status(0).ack.error == E_CREDIT);
}

static void free_slots_are_told_unasked(void) {
    fresh(8);
    struct host_segment s[10];
    for (int k = 0; k < 10; k++) {
        s[k] = (struct host_segment){.ticks = 100, .interval = 1600, .steps = {10}};
    }
    int32_t at[AXES] = {0};
    for (unsigned sent = 0; sent + 10 <= QUEUE_SLOTS; sent += 10) {
        CHECK(host_motion(1, sent + 20 > QUEUE_SLOTS ? HOST_END : 0, at, 10, s).error == OK);
        at[0] += 100;
    }
    uint8_t answer[300], before = QUEUE_SLOTS / 10 * 10;
    before = QUEUE_SLOTS - before;
    int told = 0;
    for (int ms = 0; ms < 2000 && motion.state != IDLE; ms++) {
        bench_run(1000);
        if (bench_answer(answer, sizeof answer)) {
            CHECK(answer[0] == 0x83 && answer[5] >= before + QUEUE_SLOTS / 4);
            before = answer[5];
            told++;
        }
        session.silent = 0;
    }
    CHECK(told >= 3);
}

// ---- positions

static void servos_speak_only_with_consent(void) {
    bench_power();
    const struct image image = host_image();
    const uint8_t servo = STEPPERS;
    host_hello(1);
    host_configure(&image);
    int32_t counts[AXES] = {0};
    for (uint8_t i = STEPPERS; i < AXES; i++) {
        counts[i] = 1500;
    }
    counts[servo] = 2600;
    CHECK(host_position(1U << servo, counts).error == E_VALUE);
    host_hello(2);
    counts[servo] = 1500;
    CHECK(host_position(ALL_AXES, counts).error == OK);
    CHECK(host_enable(1).error == OK);  // pulses off: the servos are lost again, the steppers are not
    CHECK(host_status(0).known == STEPPER_AXES);
    const struct host_segment s = {.ticks = 100, .interval = 16000, .steps = {[STEPPERS] = 10}};
    CHECK(host_motion(1U << servo, HOST_END, counts, 1, &s).error == E_LOST);
}

static void wait_for_the_drivers(void) {
    bench_power();
    struct image image = host_image();
    image.wake = 20;
    host_hello(1);
    host_configure(&image);
    {
        int32_t counts[AXES] = {0};
        CHECK(host_position(1, counts).error == OK);
    }
    CHECK(host_enable(1).error == OK);
    const struct host_segment s = {.ticks = 100, .interval = 8000, .steps = {100}};
    CHECK(host_motion(1, HOST_END, zero, 1, &s).error == OK);
    bench_run(19000);
    CHECK(bench_ticks == 0 || bench_pins[0] == 0);
    host_wait_idle(1000);
    CHECK(bench_pins[0] == 100);
}

static void resets(void) {
    enum { POWER = 1, EXTERNAL = 2, BROWN = 4, WATCHDOG = 8 };
    const struct host_segment s = {.ticks = 1000, .interval = 1600, .steps = {500, -1000}};
    const struct {
        uint8_t cause;
        bool moving, corrupt, kept;
    } cases[] = {
        {0, false, false, true},         {EXTERNAL, false, false, true}, {WATCHDOG, false, false, true},
        {POWER, false, false, false},    {BROWN, false, false, false},   {POWER | BROWN, false, false, false},
        {EXTERNAL, true, false, false},  {0, true, false, false},        {WATCHDOG, true, false, false},
        {EXTERNAL, false, true, false},
    };
    for (size_t n = 0; n < sizeof cases / sizeof *cases; n++) {
        fresh(10 + n);
        const uint16_t boots = memory.boots;
        CHECK(host_motion(3, HOST_END | HOST_WIDE, home_counts, 1, &s).error == OK);
        bench_run(cases[n].moving ? 30000 : 200000);
        if (cases[n].corrupt) {
            ((uint8_t *)&memory)[20 + n] ^= 4;
        }
        bench_reset(cases[n].cause);
        const struct status status = host_status(0);
        CHECK(status.ack.error == E_NO_SESSION);
        if (cases[n].kept) {
            CHECK(status.known == STEPPER_AXES && status.flags == (1 | 4 | 8) && bench_drivers_on && pins_are(status.counts));
            CHECK(memory.boots == boots + 1);
            host_hello(99);
            CHECK(host_position(1, zero).error == E_KNOWN);
            host_hello(100);
            // another image: whatever was known is lost
            struct image image = host_image();
            image.meaning++;
            host_configure(&image);
            CHECK(host_status(0).known == 0);
        } else {
            CHECK(status.known == 0 && status.flags == 0 && memory.config == 0 && !bench_drivers_on);
        }
    }
}

static void motors_off_means_lost(void) {
    fresh(20);
    CHECK(host_enable(2).error == OK);
    CHECK(host_status(0).known == SERVO_AXES && !bench_drivers_on);
    CHECK(host_position(STEPPER_AXES, zero).error == OK);
    const struct host_segment s = {.ticks = 10, .interval = 16000, .steps = {5}};
    CHECK(host_motion(1, HOST_END, zero, 1, &s).error == E_DISABLED);
}

// ---- limits

static void limits_hold(void) {
    fresh(30);
    const struct host_segment out = {.ticks = 30000, .interval = 1600, .steps = {30000}};
    int32_t at[AXES];
    memcpy(at, home_counts, sizeof at);
    for (int k = 0; k < 3; k++) {
        CHECK(host_motion(1, HOST_END | HOST_WIDE, at, 1, &out).error == OK);
        at[0] += 30000;
        host_wait_idle(5000);
    }
    const struct ack ack = host_motion(1, HOST_END | HOST_WIDE, at, 1, &out);
    CHECK(ack.error == E_LIMIT && ack.detail == 0);
    CHECK(bench_pins[0] == 90000);

    // beyond a limit, as after homing at a switch behind it: only inwards
    fresh(31);
    CHECK(host_enable(2).error == OK);
    int32_t beyond[AXES] = {-100500};
    CHECK(host_position(1, beyond).error == OK);
    CHECK(host_enable(3).error == OK);
    const struct host_segment more = {.ticks = 20, .interval = 16000, .steps = {-1}};
    CHECK(host_motion(1, HOST_END, beyond, 1, &more).error == E_LIMIT);
    host_hello(32);
    const struct host_segment in = {.ticks = 200, .interval = 3200, .steps = {100}};
    CHECK(host_motion(1, HOST_END, beyond, 1, &in).error == OK);
    host_wait_idle(1000);
    CHECK(host_status(0).counts[0] == -100400);

    fresh(33);
    beyond[0] = 100500;
    CHECK(host_enable(2).error == OK && host_position(1, beyond).error == OK && host_enable(3).error == OK);
    CHECK(host_motion(1, HOST_END, beyond, 1, &in).error == E_LIMIT);
    host_hello(34);
    const struct host_segment back = {.ticks = 200, .interval = 3200, .steps = {-100}};
    CHECK(host_motion(1, HOST_END, beyond, 1, &back).error == OK);
    host_wait_idle(1000);
    CHECK(host_status(0).counts[0] == 100400);
}

// ---- images that must not come into force

static void spoil(struct image *image, int how) {
    struct axis_config *axis = &image->axis[1], *servo = &image->axis[STEPPERS];
    image->rows = 1;
    image->row[0] = (struct row_config){-5, 5, {1, 1}};
    switch (how) {
        case 0: image->layout = 1; break;
        case 1: image->axes = AXES - 1; break;
        case 2: image->rows = ROWS + 1; break;
        case 3: image->flags = 8; break;
        case 4: image->step_high = 81; break;
        case 5: image->step_low = 51; break;
        case 6: image->dir_setup = 101; break;
        case 7: axis->flags = 4 | USED; break;
        case 8: axis->lower = -(1 << 30) - 1; break;
        case 9: axis->upper = (1 << 30) + 1; break;
        case 10: axis->home = axis->upper + 1; break;
        case 11: axis->home = axis->lower - 1; break;
        case 12: axis->max_rate = 0; break;
        case 13: axis->max_accel = 0; break;
        case 14: axis->max_accel = 1 << 24; break;
        case 15: servo->lower = 399; break;
        case 16: servo->upper = 2601; break;
        case 17: image->row[0].lower = 6; break;
        case 18: image->row[0].weight[1] = 10737; axis->upper = 100001; break;  // 10737 · 100001 > 2³⁰
        case 19: axis->flags = 0; break;                                        // a row's axis is not used
        default: break;
    }
}

static void broken_images_are_refused(void) {
    for (int how = 0; how <= 20; how++) {
        struct image image = host_image();
        uint8_t body[6];
        spoil(&image, how);
        bench_power();
        host_hello(1);
        const uint16_t length = offsetof(struct image, row) + sizeof image.row[0];
        for (uint16_t at = 0; at < length; at += 50) {
            uint8_t chunk[52] = {at, at >> 8};
            const uint8_t n = length - at < 50 ? length - at : 50;
            memcpy(chunk + 2, (const uint8_t *)&image + at, n);
            CHECK(host_order(0x10, chunk, n + 2).error == OK);
        }
        put32(put16(body, length), crc_block(&image, length));
        CHECK(host_order(0x11, body, 6).error == (how < 20 ? E_CONFIG_BAD : OK));
        CHECK((memory.config != 0) == (how == 20));
    }
}

// ---- homing

static int32_t switch_at;      // pressed where X ≤ this
static uint8_t bouncing;       // chance in 256 that it reads wrong near the edge
static int32_t first_pressed;  // pins when it first read pressed since it was free for long

static void x_switch(void) {
    static bool was;
    bool pressed = bench_pins[0] <= switch_at;
    if (pressed && !was) {
        first_pressed = bench_pins[0];
    }
    was = pressed;
    if (abs(bench_pins[0] - switch_at) < 2 && rand() % 256 < bouncing) {
        pressed = !pressed;
    }
    bench_switches = pressed ? 0xFE : 0xFF;
}

static struct status home_x(int32_t where, uint8_t bounce, uint32_t travel, uint16_t time) {
    const int32_t rate[AXES] = {-4000};
    fresh(40);
    switch_at = where;
    bouncing = bounce;
    x_switch();
    bench_on_tick = x_switch;
    CHECK(host_home(0, 0, 26, 200, travel, time, rate).error == OK);
    CHECK(!(host_status(0).known & 1));
    host_wait_idle(60000);
    return host_status(0);
}

static void homing(void) {
    for (int n = 0; n < 20; n++) {
        const int32_t where = n % 4 == 3 ? 100 + rand() % 250 : -rand() % 8000;  // every fourth: pressed from the start
        const uint8_t bounce = n % 2 ? 60 : 0;
        const struct status status = home_x(where, bounce, 20000, 300);
        CHECK(status.ack.error == OK && status.flags & 32);
        const struct status latch = host_status(1);
        CHECK(abs(latch.counts[0] - where) <= (bounce ? 2 : 0));
        CHECK(status.counts[0] == bench_pins[0] && status.counts[0] <= latch.counts[0]);
        CHECK(latch.counts[0] - status.counts[0] < 100);
        // the host says where that is: the switch is at -5000
        const int32_t counts[AXES] = {status.counts[0] - latch.counts[0] - 5000};
        CHECK(host_position(1, counts).error == OK && host_status(0).known == ALL_AXES);
    }
    CHECK(home_x(-9000, 0, 5000, 300).ack.error == E_TRAVEL);
    CHECK(bench_pins[0] <= -5000 && bench_pins[0] > -6000 && !(memory.known & 1));
    CHECK(home_x(-9000, 0, 50000, 10).ack.error == E_TIME);
    CHECK(home_x(90000, 0, 5000, 300).ack.error == E_SWITCH);  // stuck
    CHECK(!(memory.known & 1));
    // abort, HOLD and a new HELLO stop it
    for (int how = 0; how < 3; how++) {
        const int32_t rate[AXES] = {-4000, 2000};
        fresh(50);
        bench_switches = 0xFF;
        CHECK(host_home(0, 0, 26, 200, 100000, 300, rate).error == OK);
        bench_run(400000);
        CHECK(abs(bench_pins[0] + 2 * bench_pins[1]) <= 4);  // in proportion
        if (how == 0) {
            host_hold();
        } else if (how == 1) {
            by_abort();
        } else {
            host_hello(51);
        }
        const int32_t at = bench_pins[0];
        host_wait_idle(200);
        CHECK(abs(bench_pins[0] - at) < 4000 * 0.1 && abs(bench_pins[0] - at) > 50);
        CHECK(host_status(0).counts[0] == bench_pins[0] && !(host_status(0).known & 3));
    }
}

// ---- jog

static void jogging(void) {
    const int32_t rate[AXES] = {8000, -4000}, back[AXES] = {-8000, 4000}, nothing[AXES] = {0}, slow[AXES] = {2500};
    fresh(60);
    for (int n = 0; n < 5; n++) {
        CHECK(host_jog(rate).error == OK);
        bench_run(100000);
    }
    CHECK(motion.state == JOGGING && bench_pins[0] > 3000);
    CHECK(abs(bench_pins[0] + 2 * bench_pins[1]) <= 4);
    // let go: rest within 250 ms + 80 ms of ramp + the queue
    const int32_t released = bench_pins[0];
    host_jog(rate);
    bench_run(400000);
    CHECK(motion.state == IDLE && session.error == OK);
    CHECK(bench_pins[0] - released < 8000 * 0.4);
    CHECK(host_status(0).counts[0] == bench_pins[0] && host_status(0).known == ALL_AXES);
    // reverse: first to rest, then back
    CHECK(host_jog(rate).error == OK);
    bench_run(200000);
    CHECK(host_jog(back).error == OK);
    bench_run(200000);
    CHECK(host_jog(back).error == OK);
    const int32_t turning = bench_pins[0];
    bench_run(200000);
    CHECK(bench_pins[0] < turning && motion.state == JOGGING);
    CHECK(host_jog(nothing).error == OK);
    bench_run(150000);
    CHECK(motion.state == IDLE && session.error == OK);
    // into the limit and no further, however long the key is held
    int32_t far[AXES] = {99000};
    CHECK(host_enable(2).error == OK && host_position(STEPPER_AXES, far).error == OK && host_enable(3).error == OK);
    const int32_t offset = 99000 - bench_pins[0];
    for (int n = 0; n < 20; n++) {
        CHECK(host_jog(rate).error == OK);
        bench_run(100000);
        CHECK(bench_pins[0] + offset <= 100000);
    }
    CHECK(motion.state == IDLE && host_status(0).counts[0] > 99900);
    // lost: slow
    CHECK(host_enable(2).error == OK && host_enable(3).error == OK);
    CHECK(host_jog(slow).error == OK);
    bench_run(500000);
    CHECK(motion.state == IDLE);
    const int32_t quick[AXES] = {2501};
    CHECK(host_jog(quick).error == E_RATE);
}

// ---- joint limits of coupled motors

static void coupled_motors(void) {
    bench_power();
    struct image image = host_image();
    image.rows = 1;
    image.row[0] = (struct row_config){-1000, 1000, {1, 1}};
    host_hello(1);
    host_configure(&image);
    CHECK(host_position(3, zero).error == OK && host_enable(1).error == OK);
    bench_run(5000);
    const struct host_segment over = {.ticks = 2000, .interval = 1600, .steps = {600, 401}};
    CHECK(host_motion(3, HOST_END | HOST_WIDE, zero, 1, &over).error == E_LIMIT_JOINT);
    host_hello(2);
    const struct host_segment fine = {.ticks = 6000, .interval = 1600, .steps = {6000, -5000}};
    CHECK(host_motion(3, HOST_END | HOST_WIDE, zero, 1, &fine).error == OK);
    host_wait_idle(1000);
    // jog along one motor: the joint stops it
    const int32_t rate[AXES] = {0, 5000}, away[AXES] = {0, -5000};
    for (int n = 0; n < 5; n++) {
        CHECK(host_jog(rate).error == OK);
        bench_run(100000);
        CHECK(bench_pins[0] + bench_pins[1] <= 1000);
    }
    CHECK(motion.state == IDLE);
    for (int n = 0; n < 10; n++) {
        CHECK(host_jog(away).error == OK);
        bench_run(100000);
        CHECK(bench_pins[0] + bench_pins[1] >= -1000);
    }
    CHECK(host_status(0).counts[1] + 6000 < -900);
}

// ---- abort input, normally closed

static void abort_normally_closed(void) {
    bench_power();
    struct image image = host_image();
    image.flags = ABORT_CLOSED;
    bench_abort = false;  // closed: all is well
    host_hello(1);
    host_configure(&image);
    CHECK(host_position(1, zero).error == OK && host_enable(1).error == OK);
    bench_run(10000);
    CHECK(!(host_status(0).flags & 16));
    bench_abort = true;  // a wire has come off
    bench_run(10000);
    CHECK(host_status(0).flags & 16);
    const struct host_segment s = {.ticks = 10, .interval = 16000, .steps = {5}};
    const int32_t rate[AXES] = {100};
    CHECK(host_motion(1, HOST_END, zero, 1, &s).error == E_ABORT);
    host_hello(2);
    CHECK(host_jog(rate).error == E_ABORT);
    host_hello(3);
    CHECK(host_home(0, 0, 26, 10, 100, 10, rate).error == E_ABORT);
    bench_abort = false;
    bench_run(2000);
    bench_abort = true;  // too short to count
    bench_run(2000);
    bench_abort = false;
    bench_run(10000);
    host_hello(4);
    CHECK(host_motion(1, HOST_END, zero, 1, &s).error == OK);
    host_wait_idle(100);
}

// ---- limit switches, power, bytes beyond the credit, speeds

// Guards X by switch 0, which is pressed where X is at least so many counts.
static int32_t guard_at;

static void guard_switch(void) {
    bench_switches = bench_pins[0] >= guard_at ? 0xFE : 0xFF;
}

static void guarded(uint32_t nonce, uint8_t flags) {
    fresh(nonce);
    struct image image = host_image();
    image.guard[0] = (struct guard_config){.flags = USED, .weight = {1}};
    image.flags = flags;
    host_hello(nonce + 1000);
    host_configure(&image);
    CHECK(host_position(ALL_AXES, home_counts).error == OK && host_enable(3).error == OK);
    bench_run(5000);
}

static void a_limit_switch_stops_within_one_ramp(void) {
    const struct host_segment on = {.ticks = 30000, .interval = 1600, .steps = {30000}};
    const struct host_segment away = {.ticks = 100, .interval = 16000, .steps = {-100}};
    guarded(70, 0);
    guard_at = 500;
    bench_on_tick = guard_switch;
    CHECK(host_motion(1, HOST_END | HOST_WIDE, home_counts, 1, &on).error == OK);
    host_wait_idle(1000);
    struct status status = host_status(0);
    CHECK(status.ack.error == E_LIMIT_SWITCH && status.ack.detail == 0);
    CHECK(status.known == ALL_AXES && pins_are(status.counts));
    CHECK(bench_pins[0] > 500 && bench_pins[0] < 500 + 10000 * (0.050 / 2 + 0.006));  // u = 50 ms, 3 ms of debounce
    // towards it: refused; away from it: fine
    host_hello(71);
    CHECK(host_motion(1, HOST_END | HOST_WIDE, status.counts, 1, &on).error == E_LIMIT_SWITCH);
    host_hello(72);
    CHECK(host_motion(1, HOST_END, status.counts, 1, &away).error == OK);
    host_wait_idle(1000);
    CHECK(host_status(0).ack.error == OK && bench_pins[0] == status.counts[0] - 100);
    bench_on_tick = NULL;
    bench_switches = 0xFF;
}

static void a_cut_of_the_power_loses_the_position(void) {
    for (int moving = 0; moving < 2; moving++) {
        guarded(80 + moving, POWER_SENSED);
        if (moving) {
            CHECK(host_motion(3, HOST_END | HOST_WIDE, home_counts, 1, &cruise_segment).error == OK);
            bench_run(100000);
        }
        bench_power_level = false;
        bench_run(5000);
        CHECK(host_status(0).known == 0 && host_status(0).flags & 64);
        host_wait_idle(1000);
        CHECK(host_status(0).ack.error == (moving ? E_POWER : OK));
        host_hello(90);
        CHECK(host_position(1, home_counts).error == E_POWER);
        bench_power_level = true;
        bench_run(5000);
        host_hello(91);
        CHECK(host_position(1, zero).error == OK);
    }
}

static void a_stuck_switch_is_left_by_two_back_offs_at_most(void) {
    const int32_t rate[AXES] = {-4000};
    fresh(85);
    bench_switches = 0xFE;  // pressed, for ever
    CHECK(host_home(0, 0, 26, 200, 20000, 600, rate).error == OK);
    host_wait_idle(60000);
    CHECK(host_status(0).ack.error == E_SWITCH);
    CHECK(bench_pins[0] > 380 && bench_pins[0] < 440);
    bench_switches = 0xFF;
}

static void lost_bytes_are_told_at_once(void) {
    uint8_t answer[300];
    fresh(86);
    bench_spill = true;
    bench_run(1000);
    CHECK(bench_answer(answer, sizeof answer) == 10 && answer[0] == 0x83 && answer[1] == host_next);
    CHECK(answer[2] == OK && answer[3] == E_SPILL);
    CHECK(host_status(0).ack.error == OK && host_status(0).ack.detail == 0);
}

static void speeds_are_checked_where_segments_meet(void) {
    // one step in one tick, at the shortest interval
    const struct host_segment one = {.ticks = 1, .interval = MIN_INTERVAL, .steps = {1}};
    fresh(87);
    CHECK(host_motion(1, HOST_END, home_counts, 1, &one).error == E_RATE);
    // 2,000/s², so 125 counts/s at once at most: from rest, between segments, within one, and to rest
    struct image image = host_image();
    image.axis[0].max_accel = 2000;
    const struct host_segment cases[][2] = {
        {{.ticks = 1000, .interval = 16000, .steps = {200}}},
        {{.ticks = 1000, .interval = 16000, .steps = {100}}, {.ticks = 1000, .interval = 16000, .steps = {300}}},
        {{.ticks = 1000, .interval = 40000, .add = -8960, .steps = {100}}},
        {{.ticks = 1000, .interval = 40000, .add = -8000, .steps = {250}}},
    };
    for (size_t n = 0; n < 4; n++) {
        host_hello(200 + n);
        if (n == 0) {
            host_configure(&image);
            CHECK(host_position(ALL_AXES, home_counts).error == OK && host_enable(3).error == OK);
        }
        const struct ack ack = host_motion(1, HOST_END | HOST_WIDE, home_counts, n == 1 ? 2 : 1, cases[n]);
        CHECK(ack.error == E_ACCEL && ack.detail == 0);
    }
    // what leads there gently is taken
    const struct host_segment ramp[] = {
        {.ticks = 1000, .interval = 16000, .steps = {100}}, {.ticks = 1000, .interval = 16000, .steps = {200}},
        {.ticks = 1000, .interval = 16000, .steps = {100}},
    };
    host_hello(210);
    CHECK(host_motion(1, HOST_END | HOST_WIDE, home_counts, 3, ramp).error == OK);
    host_wait_idle(5000);
    CHECK(host_status(0).ack.error == OK && bench_pins[0] == 400);
}

// Wherever a hold comes in a segment whose interval grows to the greatest, it is obeyed.
static void a_hold_is_obeyed_in_every_phase_of_a_segment(void) {
    const struct host_segment slow[] = {
        {.ticks = 200, .interval = 40000, .add = 32640, .steps = {100}},  // 65,372 at the last tick, 65,500 beyond
        {.ticks = 200, .interval = 65000, .steps = {100}},
    };
    for (int phase = 0; phase < 260; phase++) {
        fresh(300);
        CHECK(host_motion(1, HOST_END | HOST_WIDE, home_counts, 2, slow).error == OK);
        for (int n = 0; n < phase; n++) {
            bench_run(2500);
            session.silent = 0;
        }
        const int32_t before = bench_pins[0];
        host_hold();
        host_wait_idle(20);
        CHECK(host_status(0).counts[0] == bench_pins[0] && bench_pins[0] - before <= 2);
    }
    // an interval that would leave 16 bits one tick after the end is refused
    const struct host_segment beyond = {.ticks = 200, .interval = 40000, .add = 32767, .steps = {100}};
    fresh(301);
    CHECK(host_motion(1, HOST_END | HOST_WIDE, home_counts, 1, &beyond).error == E_INTERVAL);
}

static void replies_carry_the_session(void) {
    fresh(88);
    host_hello(0xABCD1234);
    CHECK(host_status(0).ack.session == 0x1234 && host_hold().session == 0x1234);
    bench_reset(0);
    CHECK(host_status(0).ack.session == 0);
}

int main(void) {
    srand(1);
    steps_are_exact();
    holds_stop_on_the_path();
    hold_in_the_planned_ramp_follows_the_plan();
    an_unfinished_queue_is_a_hold();
    an_abrupt_end_at_speed_loses_the_position();
    credit_and_duplicates();
    free_slots_are_told_unasked();
    servos_speak_only_with_consent();
    wait_for_the_drivers();
    resets();
    motors_off_means_lost();
    limits_hold();
    broken_images_are_refused();
    homing();
    jogging();
    coupled_motors();
    abort_normally_closed();
    a_limit_switch_stops_within_one_ramp();
    a_cut_of_the_power_loses_the_position();
    a_stuck_switch_is_left_by_two_back_offs_at_most();
    lost_bytes_are_told_at_once();
    speeds_are_checked_where_segments_meet();
    a_hold_is_obeyed_in_every_phase_of_a_segment();
    replies_carry_the_session();
    printf("core: all promises kept\n");
    return 0;
}
