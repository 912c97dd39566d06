// Every tick makes the steps that PROTOCOL.md, section 6, says, and no axis is faster than it may be.
#include "core.h"

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
    for (uint8_t i = 0; i < STEPPERS; i++) {
        image.axis[i].max_rate = 60000;
        image.axis[i].max_accel = (1 << 24) - 1;
    }
    fresh_with(nonce, &image);
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
            s->quick = rand() % 2;
            s->bend = (rand() % 2 ? rand() % (s->quick ? 40 : 2000) : 0) * (s->add < 0 ? -1 : s->add > 0);
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

void test_steps(void) {
    steps_are_exact();
    speeds_are_checked_where_segments_meet();
}
