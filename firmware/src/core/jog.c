#include "jog.h"

#include <string.h>

#include "cruise.h"

enum { DEAD_MAN_MS = 250 };

static uint8_t left;  // ms

void jog(const int32_t rate[AXES]) {
    if (motion.state == IDLE) {
        memset(&cruise, 0, sizeof cruise);
        motion_begin(JOGGING);
    }
    memcpy(cruise.asked, rate, sizeof cruise.asked);
    left = DEAD_MAN_MS;
}

void jog_poll(void) {
    if (left == 0 || memcmp(cruise.asked, cruise.rate, sizeof cruise.rate) != 0) {
        cruise.target = 0;
    }
    cruise_poll();
    if (!cruise_resting()) {
        return;
    }
    if (left == 0 || memcmp(cruise.asked, cruise.rate, sizeof cruise.rate) == 0) {
        motion_rest();
        return;
    }
    cruise_vector(1, true);
    cruise.target = cruise.axes ? 1 : 0;
}

void jog_millisecond(void) {
    if (left) {
        left--;
    }
}
