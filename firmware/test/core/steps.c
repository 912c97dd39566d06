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

// Pieces of one speed, or half of whose change is within them, up to 12,000/s at so many times max_accel, one a frame: are all taken?
static bool crude_plan_is_taken(double seconds, double share, double within) {
    struct image image = host_image();
    image.axis[0].max_accel = 20000;
    image.axis[0].upper = 1 << 28;
    int32_t at[AXES];
    int64_t places = 1 << 22;
    fresh_with(220, &image);
    memcpy(at, home_counts, sizeof at);
    const double change = 20000 * share * seconds;
    const struct host_segment pause = {.ticks = 100, .interval = 16000};
    CHECK(host_motion(1, HOST_WIDE, at, 1, &pause).error == OK);
    for (double speed = 20000 * seconds / 2; speed < 12000; speed += change) {
        const double inside = speed > 20000 * seconds ? within * change : 0, begin = speed - inside / 2;
        const uint16_t ticks = fmax(1, round(seconds * CLOCK / 1000)), interval = round(seconds * CLOCK / ticks);
        const double first = interval * speed / begin, last = interval * speed / (begin + inside);
        struct host_segment piece = {.ticks = ticks, .interval = round(first)};
        piece.add = ticks > 1 ? round((last - first) / (ticks - 1) * 256) : 0;
        piece.rate[0] = round(speed * interval / CLOCK * (1 << 15)) * 256;
        places += (int64_t)ticks * piece.rate[0];
        piece.steps[0] = (places >> 23);
        places &= (1 << 23) - 1;
        const struct ack ack = host_motion(1, HOST_WIDE, at, 1, &piece);
        CHECK(ack.error == OK || (ack.error == E_ACCEL && ack.detail == 0));
        if (ack.error) {
            host_wait_idle(2000);
            return false;
        }
        at[0] += piece.steps[0];
        while (motion_free() == 0) {
            bench_run(1000);
            session.silent = 0;
        }
    }
    return true;
}

// 5/4 of max_accel is one budget, for jumps between segments and changes within them together.
static void crude_plans_have_one_budget(void) {
    const double lengths[] = {0.03, 0.04, 0.05};  // a queue of shorter ones would be dry
    for (size_t n = 0; n < sizeof lengths / sizeof *lengths; n++) {
        CHECK(crude_plan_is_taken(lengths[n], 1.0, 0) && crude_plan_is_taken(lengths[n], 1.2, 0));
        CHECK(crude_plan_is_taken(lengths[n], 1.1, 0.5));
        CHECK(!crude_plan_is_taken(lengths[n], 1.3, 0) && !crude_plan_is_taken(lengths[n], 1.3, 0.5));
        CHECK(!crude_plan_is_taken(lengths[n], 2.48, 0.5) && !crude_plan_is_taken(lengths[n], 1.3, 1));
    }
}

void test_steps(void) {
    crude_plans_have_one_budget();
    steps_are_exact();
    speeds_are_checked_where_segments_meet();
}
