// Homing and jog: motions that the board makes up itself.
#include "core.h"

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
            press_abort();
        } else {
            host_hello(51);
        }
        const int32_t at = bench_pins[0];
        host_wait_idle(200);
        CHECK(abs(bench_pins[0] - at) < 4000 * 0.1 && abs(bench_pins[0] - at) > 50);
        CHECK(host_status(0).counts[0] == bench_pins[0] && !(host_status(0).known & 3));
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

void test_homing_and_jog(void) {
    homing();
    jogging();
    a_stuck_switch_is_left_by_two_back_offs_at_most();
}
