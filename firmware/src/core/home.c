#include "home.h"

#include "cruise.h"
#include "hal.h"

enum { DEBOUNCE_MS = 4 };
enum phase { RELEASE, APPROACH, BACK_OFF, TOUCH };

struct home home;
bool home_finished;

static enum phase phase;
static uint32_t overshoot;  // leader counts from the edge to where the first approach came to rest
static bool reached;      // this phase has what it wanted: come to rest, then go on
static uint8_t steady;    // ms that the switch has said the same
static uint16_t seen_left;
static uint8_t seen_slot;

static bool pressed(void) {
    const bool high = hal_switches() >> home.input & 1;
    return high == home.closed;
}

static void enter(enum phase to, int8_t sign, float share) {
    phase = to;
    reached = false;
    steady = 0;
    cruise_vector(sign, false);
    cruise.target = share;
    HAL_LOCK();
    dda.pressed = false;
    HAL_UNLOCK();
    motion.latched = false;
    dda.probe = to == APPROACH || to == TOUCH;
}

void home_begin(void) {
    uint16_t axes = 0;
    for (uint8_t i = 0; i < AXES; i++) {
        axes |= cruise.asked[i] ? 1U << i : 0;
    }
    motion_lose(axes);
    home_finished = false;
    hal_probe(home.input, home.closed);
    motion_begin(HOMING);
    if (pressed()) {
        enter(RELEASE, -1, home.slow / 256.0F);
    } else {
        enter(APPROACH, 1, 1);
    }
}

// Where each phase ends: `reached` if it went well.
static enum error look(void) {
    const uint32_t covered = cruise_covered();
    switch (phase) {
        case RELEASE:  // a switch that stays pressed for two back-offs is stuck
            reached = steady >= DEBOUNCE_MS;
            if (!reached && covered > 2 * home.backoff) {
                return E_SWITCH;
            }
            break;
        case APPROACH:
            reached = steady >= DEBOUNCE_MS;
            if (!reached && covered > home.travel) {
                return E_TRAVEL;
            }
            break;
        case BACK_OFF:
            reached = covered + cruise_brake() >= overshoot + home.backoff;
            break;
        case TOUCH:
            reached = steady >= DEBOUNCE_MS;
            if (!reached && covered > 2 * home.backoff) {
                return E_SWITCH;
            }
            break;
    }
    if (reached) {
        cruise.target = 0;
    }
    return OK;
}

static enum error next_phase(void) {
    switch (phase) {
        case RELEASE:
            enter(APPROACH, 1, 1);
            break;
        case APPROACH: {
            const int32_t past = motion.plan[cruise.leader] - motion.latch[cruise.leader];
            overshoot = past < 0 ? -past : past;
            enter(BACK_OFF, -1, 1);
            break;
        }
        case BACK_OFF:
            if (pressed()) {
                return E_SWITCH;
            }
            enter(TOUCH, 1, home.slow / 256.0F);
            break;
        case TOUCH:
            home_finished = true;
            motion_rest();
            break;
    }
    return OK;
}

enum error home_poll(void) {
    const enum error error = reached ? OK : look();
    if (error) {
        return error;
    }
    cruise_poll();
    return reached && cruise_resting() ? next_phase() : OK;
}

// The tick interrupt latches the first tick at which the switch reads pressed and stays so; it counts after 4 ms.
enum error home_millisecond(void) {
    if (phase == RELEASE) {
        steady = pressed() ? 0 : steady + 1;
    } else if (dda.probe && !reached) {
        uint8_t slot;
        uint16_t left;
        bool held;
        HAL_LOCK();
        held = dda.pressed;
        slot = dda.pressed_slot;
        left = dda.pressed_left;
        HAL_UNLOCK();
        steady = held && slot == seen_slot && left == seen_left && pressed() ? steady + 1 : 0;
        seen_slot = slot;
        seen_left = left;
        if (steady >= DEBOUNCE_MS) {
            dda.probe = false;  // the latch stands, bounces on the way to rest do not matter
        }
    }
    if (home.time == 0) {
        return E_TIME;
    }
    home.time--;
    return OK;
}
