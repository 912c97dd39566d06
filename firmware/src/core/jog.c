#include "jog.h"

#include <string.h>

#include "cruise.h"

enum { DEAD_MAN_MS = 250 };

static int16_t wanted[AXES];
static uint8_t left;  // ms

void jog(const int16_t rate[AXES]) {
    if (session.state == IDLE) {
        memset(&cruise, 0, sizeof cruise);
        motion_begin(JOGGING);
    }
    memcpy(wanted, rate, sizeof wanted);
    left = DEAD_MAN_MS;
}

void jog_poll(void) {
    if (left == 0 || memcmp(wanted, cruise.rate, sizeof wanted) != 0) {
        cruise.target = 0;
    }
    cruise_poll();
    if (!cruise_resting()) {
        return;
    }
    if (left == 0 || memcmp(wanted, cruise.rate, sizeof wanted) == 0) {
        motion_rest();
        return;
    }
    cruise_vector(wanted, 1, true);
    cruise.target = cruise.axes ? 1 : 0;
}

void jog_millisecond(void) {
    if (left) {
        left--;
    }
}
