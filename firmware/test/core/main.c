// What the core promises, on the PC: exact steps, holds on the path, limits, homing, jog, resets. One function a promise.
// For boards with at least two steppers.
#include "core.h"

const int32_t zero[AXES];
int32_t home_counts[AXES];
const struct host_segment cruise_segment = {.ticks = 30000, .interval = 1600, .steps = {30000, -15000}};

void fresh(uint32_t nonce) {
    bench_on_tick = NULL;
    bench_power();
    host_ready(nonce);
    memset(home_counts, 0, sizeof home_counts);
    for (uint8_t i = STEPPERS; i < AXES; i++) {
        home_counts[i] = 1500;
    }
    memset(bench_pins, 0, sizeof bench_pins);
}

void fresh_with(uint32_t nonce, const struct image *image) {
    fresh(nonce);
    host_hello(nonce + 1000);
    host_configure(image);
    CHECK(host_position(ALL_AXES, home_counts).error == OK && host_enable(3).error == OK);
    bench_run(5000);
}

bool pins_are(const int32_t *counts) {
    return memcmp(bench_pins, counts, STEPPERS * sizeof *counts) == 0;
}

void press_abort(void) {
    bench_abort = false;
    bench_run(3000);
}

int main(void) {
    srand(1);
    test_steps();
    test_accelerations();
    test_holds();
    test_sessions();
    test_positions();
    test_limits();
    test_homing_and_jog();
    printf("core: all promises kept\n");
    return 0;
}
