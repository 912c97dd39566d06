// For Frama-C's EVA: what the core does with any frame, any bytes on the line, any time, in any order.
#include "any_board.h"

static void tick(void) {
    if (dda.probe) {
        dda_probe(any & 1);
    }
    if (dda.now && dda_next()) {
        dda_bits();
    }
}

static void line(void) {
    const uint8_t byte = any;
    link_bytes(&byte, 1);
    protocol_frame();
}

int main(void) {
    Frama_C_make_unknown((char *)&memory, sizeof memory);
    protocol_start(any);
    while (Frama_C_nondet(0, 1)) {
        switch (Frama_C_interval(0, 3)) {
            case 0: line(); break;
            case 1: protocol_poll(); break;
            case 2: protocol_millisecond(); break;
            default: tick();
        }
    }
    return 0;
}
