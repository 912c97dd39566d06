// For Frama-C's EVA: one frame, its bytes and its length unknown, in any state of the board; MOTION is any_segment.c's.
#include "any_board.h"

#include "../../src/core/home.h"
#include "../../src/core/inputs.h"
#include "../../src/core/motion.h"

enum { MOTION = 0x14 };

// An image that COMMIT has taken, or half of a new one, which is not in force.
static void any_image(void) {
    Frama_C_make_unknown((char *)&memory, sizeof memory);
    for (uint8_t i = 0; i < AXES; i++) {
        struct axis_config *axis = &memory.image.axis[i];
        axis->lower = Frama_C_interval(-(1 << 30), 1 << 30);
        axis->upper = Frama_C_interval(-(1 << 30), 1 << 30);
        axis->max_rate = Frama_C_unsigned_int_interval(1, 0xFFFFFFFF);
        axis->max_accel = Frama_C_interval(1, (1 << 24) - 1);
        memory.counts[i] = Frama_C_interval(-(1 << 30), 1 << 30);
        motion.plan[i] = Frama_C_interval(-(1 << 30), 1 << 30);
        motion.latch[i] = Frama_C_interval(-(1 << 30), 1 << 30);
    }
    memory.image.rows = Frama_C_interval(0, ROWS);
    config_activate();
}

// A frame of a type in these bounds, which the session takes.
static void one_frame(uint8_t first, uint8_t last) {
    uint8_t *p = link_frame();
    Frama_C_make_unknown((char *)p, FRAME_MAX);
    p[0] = Frama_C_interval(first, last);
    p[1] = session.next;
    link_length = Frama_C_interval(2, FRAME_MAX - 4);
    protocol_frame();
}

int main(void) {
    any_image();
    memory.known = Frama_C_interval(0, ALL_AXES);
    memory.drivers = any & 1;
    motion.state = Frama_C_interval(IDLE, JOGGING);
    motion.cruising = any & 1;
    inputs.abort = any & 1;
    inputs.power_cut = any & 1;
    if (Frama_C_interval(0, 1)) {
        session.error = any;
    }
    if (Frama_C_interval(0, 1)) {
        one_frame(0, MOTION - 1);
    } else {
        one_frame(MOTION + 1, 255);
    }
    return 0;
}
