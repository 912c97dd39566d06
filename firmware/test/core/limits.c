// What bounds a motion from outside: limits, coupled joints, the abort input, switches, the motors' power.
#include "core.h"

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

// Guards X by switch 0, which is pressed where X is at least so many counts.
static int32_t guard_at;

static void guard_switch(void) {
    bench_switches = bench_pins[0] >= guard_at ? 0xFE : 0xFF;
}

static void guarded(uint32_t nonce, uint8_t flags) {
    struct image image = host_image();
    image.guard[0] = (struct guard_config){.flags = USED, .weight = {1}};
    image.flags = flags;
    fresh_with(nonce, &image);
}

static void a_limit_switch_stops_within_one_ramp(uint8_t flags) {
    const struct host_segment on = {.ticks = 30000, .interval = 1600, .steps = {30000}};
    const struct host_segment away = {.ticks = 100, .interval = 16000, .steps = {-100}};
    guarded(70, 0);
    guard_at = 500;
    bench_on_tick = guard_switch;
    CHECK(host_motion(1, flags | HOST_END | HOST_WIDE, home_counts, 1, &on).error == OK);
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

void test_limits(void) {
    limits_hold();
    coupled_motors();
    abort_normally_closed();
    a_limit_switch_stops_within_one_ramp(0);
    a_limit_switch_stops_within_one_ramp(HOST_GENTLE);
    a_cut_of_the_power_loses_the_position();
}
