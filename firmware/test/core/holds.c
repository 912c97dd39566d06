// A hold, whatever its cause, ends on the path, in the time of its ramp, with the position known.
#include "core.h"

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
        hold_by(by_hold, E_HELD),       hold_by(by_hello, E_HELD),     hold_by(press_abort, E_ABORT),
        hold_by(by_silence, E_SILENCE), hold_by(by_refusal, E_TYPE),
    };
    for (size_t i = 0; i < sizeof times / sizeof *times; i++) {
        CHECK(times[i] > 0.8 * ideal && times[i] < 1.2 * ideal);
    }
    printf("hold from full speed: %.1f ms, the ideal ramp is %.0f ms\n", times[0], ideal);
}

// A hold on a batch that asks for it leaves out 3/8 of the accelerations, and stays on the path; how, it says in ms.
static double hold_gently(uint8_t flags, uint32_t after) {
    fresh(7);
    const struct host_segment on = {.ticks = 3000, .interval = 1600, .steps = {3000, -1500}};
    CHECK(host_motion(3, flags | HOST_WIDE, home_counts, 1, &on).error == OK);
    bench_run(after);
    slowing = false;
    bench_on_tick = watch_slowing;
    bench_run(1000);
    slowing = true;
    host_hold();
    const uint64_t begin = bench_cycles;
    while (motion.state != IDLE) {
        CHECK(bench_cycles - begin < CLOCK);
        bench_run(100);
    }
    bench_on_tick = NULL;
    const struct status status = host_status(0);
    CHECK(status.ack.error == E_HELD && status.known == ALL_AXES && pins_are(status.counts));
    return (last_tick_at - begin) * 1e3 / CLOCK;
}

static void a_hold_is_as_gentle_as_the_batches_ask_for(void) {
    const double ramp = 50;  // ms
    const double whole = hold_gently(0, 100000), gentle = hold_gently(HOST_GENTLE, 100000);
    CHECK(fabs(gentle - whole / 0.625) < 0.03 * ramp);
    CHECK(fabs(hold_gently(HOST_END | HOST_GENTLE, 100000) - gentle) < 0.03 * ramp);
    // shortly before the queue runs dry: of its last 65 ms a gentle stop takes 40, of the last 56 there is no time for that
    CHECK(fabs(hold_gently(HOST_GENTLE, 232000) - gentle) < 0.03 * ramp);
    const double short_of_time = hold_gently(HOST_GENTLE, 241000);
    CHECK(short_of_time > whole && short_of_time < gentle - 0.03 * ramp);
    printf("gentle hold from full speed: %.1f ms, of whole %.1f ms\n", gentle, whole);
    // the next motion is not gentle because this one was; a later batch makes the whole motion so, and none less
    CHECK(host_status(0).ack.state == IDLE && motion.gentle == 0);
    fresh(8);
    const struct host_segment on = {.ticks = 1000, .interval = 1600, .steps = {1000}};
    int32_t at[AXES];
    memcpy(at, home_counts, sizeof at);
    const uint8_t flags[] = {0, HOST_GENTLE, 0, 4};
    for (int k = 0; k < 4; k++) {
        CHECK(host_motion(1, flags[k] | HOST_WIDE, at, 1, &on).error == OK);
        at[0] += 1000;
        CHECK(motion.gentle == (k ? 3 : 0));
    }
    host_hold();
    host_wait_idle(200);
}

// Where the path slows down as fast as a gentle hold, that takes u / (5/8) of the path: more than an open queue may have.
static void a_gentle_hold_does_not_outlast_the_queue(void) {
    const struct host_segment on = {.ticks = 1000, .interval = 1600, .steps = {1000}};
    for (int after = 20; after <= 180; after += 10) {
        fresh(400 + after);
        struct host_segment ramp[10];
        int32_t at[AXES];
        memcpy(at, home_counts, sizeof at);
        CHECK(host_motion(1, HOST_GENTLE | HOST_WIDE, at, 1, &on).error == OK);
        at[0] += 1000;
        int32_t end = at[0];
        for (int k = 0; k < 10; k++) {  // 10 ms each, at 5/8 of max_accel
            const double rate = 10000 - 125000 * 0.010 * (k + 0.5) / 2;
            ramp[k] = (struct host_segment){.ticks = rate / 100, .interval = 16e6 / rate, .steps = {rate / 100}};
            end += ramp[k].steps[0];
        }
        CHECK(host_motion(1, HOST_GENTLE, at, 10, ramp).error == OK);
        bench_run(after * 1000);
        host_hold();
        host_wait_idle(300);
        const struct status status = host_status(0);
        CHECK(status.known == ALL_AXES && pins_are(status.counts) && status.counts[0] < end);
    }
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

static void an_unfinished_queue_is_a_hold(uint8_t flags) {
    // 320 ms at 10 kHz without END, u = 50 ms, then the host is busy elsewhere but alive
    fresh(5);
    struct host_segment s[4];
    for (int k = 0; k < 4; k++) {
        s[k] = (struct host_segment){.ticks = 800, .interval = 1600, .steps = {800, -400}};
    }
    CHECK(host_motion(3, flags | HOST_WIDE, home_counts, 4, s).error == OK);
    host_wait_idle(1000);
    const struct status status = host_status(0);
    CHECK(status.ack.error == E_DRY && status.known == ALL_AXES && pins_are(status.counts));
    CHECK(bench_pins[0] > 1600 && bench_pins[0] < 3200);  // it braked before the end of the path
    CHECK(abs(bench_pins[0] + 2 * bench_pins[1]) <= 2);
}

static void a_slow_arm_stands_where_its_queue_ends(void) {
    // 320 ms at 2 kHz without END, u = 10 ms
    fresh(9);
    const struct host_segment s = {.ticks = 640, .interval = CLOCK / 2000, .steps = {640, -320}};
    CHECK(host_motion(3, HOST_WIDE, home_counts, 1, &s).error == OK);
    host_wait_idle(1000);
    const struct status status = host_status(0);
    CHECK(status.ack.error == E_DRY && status.known == ALL_AXES && pins_are(status.counts));
    CHECK(bench_pins[0] == 640 && bench_pins[1] == -320);
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
    // so is an `add` that would leave its 24 bits on the way, though all intervals fit
    const struct host_segment steep = {.ticks = 64, .interval = 1000, .add = 32767, .bend = 32767};
    fresh(302);
    CHECK(host_motion(1, HOST_END | HOST_WIDE, home_counts, 1, &steep).error == E_INTERVAL);
}

void test_holds(void) {
    holds_stop_on_the_path();
    hold_in_the_planned_ramp_follows_the_plan();
    a_hold_is_as_gentle_as_the_batches_ask_for();
    a_gentle_hold_does_not_outlast_the_queue();
    an_unfinished_queue_is_a_hold(0);
    an_unfinished_queue_is_a_hold(HOST_GENTLE);
    a_slow_arm_stands_where_its_queue_ends();
    an_abrupt_end_at_speed_loses_the_position();
    a_hold_is_obeyed_in_every_phase_of_a_segment();
}
