// Which positions are known: after consent, resets, and motors that are off.
#include "core.h"

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

void test_positions(void) {
    servos_speak_only_with_consent();
    wait_for_the_drivers();
    resets();
    motors_off_means_lost();
}
