// For Frama-C's EVA: what the core makes of one segment whose bytes are unknown, and the line of bytes that are.
#include <__fc_builtin.h>

#include "../../src/core/batch.c"
#include "../../src/core/hal.h"
#include "../../src/core/link.h"

uint8_t hal_send_room(void) { return Frama_C_interval(0, 255); }
void hal_send(uint8_t byte) { (void)byte; }
void hal_timer_start(uint16_t interval) { (void)interval; }
void hal_timer_stop(void) { }
void hal_drivers(bool on) { (void)on; }
void hal_configured(void) { }
void dda_direction(uint16_t back) { (void)back; }
enum error inputs_ready(bool moving) { return moving ? E_BUSY : OK; }
enum error inputs_blocking(const struct segment *s, uint8_t *detail) { (void)s; *detail = 0; return OK; }

// A plan within the limits that every image keeps to, under way or at rest.
static void any_plan(void) {
    for (uint8_t i = 0; i < AXES; i++) {
        motion.plan[i] = Frama_C_interval(-(1 << 30), 1 << 30);
        motion.plan_excess[i][0] = Frama_C_interval(0, 1 << 23);
        motion.plan_excess[i][1] = Frama_C_interval(0, 1 << 23);
        motion.plan_fraction.phase[i] = Frama_C_interval(0, PHASE_MASK);
        limits.top[i] = Frama_C_interval(0, 0x7FFFFFFF);
        limits.jump[i] = Frama_C_interval(1, JUMP_MAX);
        memory.image.axis[i].lower = Frama_C_interval(-(1 << 30), 1 << 30);
        memory.image.axis[i].upper = Frama_C_interval(-(1 << 30), 1 << 30);
    }
    motion.plan_exceeding = Frama_C_interval(0, ALL_AXES);
    motion.plan_fraction.back = Frama_C_interval(0, ALL_AXES);
}

static bool any_head(struct segment *s, const struct pace *before, struct pace *pace) {
    uint8_t p[WIDE_SIZE];
    Frama_C_make_unknown((char *)p, sizeof p);
    uint32_t units = 0;
    return read_head(p, Frama_C_interval(0, 1), s, before, pace, &units) == OK;
}

// Behind another segment, or at rest, as at an END.
static void one_segment(bool resting) {
    uint8_t rates[2 * AXES], others[2 * AXES], detail;
    Frama_C_make_unknown((char *)rates, sizeof rates);
    Frama_C_make_unknown((char *)others, sizeof others);
    any_plan();
    struct segment *a = &queue[1], *s = &queue[0];
    struct pace none = {0}, before, pace;
    struct look look = {.past = AXES};
    if (!any_head(a, &none, &before)) {
        return;
    }
    read_rates(others, Frama_C_interval(0, ALL_AXES), a, &before, &look);
    if (look.error || !any_head(s, &before, &pace)) {
        return;
    }
    if (resting) {
        before = (struct pace){.time = pace.time};
    }
    if (read_axes(rates, Frama_C_interval(0, ALL_AXES), Frama_C_interval(0, AXES), a, &before, s, &pace, &detail) != OK) {
        return;
    }
    motion_units(s);
    const uint16_t ticks = Frama_C_interval(0, 65535);
    if (ticks <= s->ticks) {
        motion_interval(s, ticks);
        motion_advance(s);
    }
}

static void ticks(void) {
    queue_head = 1;
    queue_tail = 0;
    if (dda_load()) {
        while (dda.left) {
            dda.left--;
            dda_interval();
            dda_bits();
        }
    }
}

static void line(void) {
    while (Frama_C_interval(0, 1)) {
        const uint8_t byte = Frama_C_interval(0, 255);
        link_bytes(&byte, 1);
    }
}

int main(void) {
    dda.stretch = Frama_C_interval(256, 65535);
    one_segment(true);
    one_segment(false);
    ticks();
    line();
    return 0;
}
