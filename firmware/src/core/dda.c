#include "dda.h"

struct segment queue[QUEUE_SLOTS];
volatile uint8_t queue_head, queue_tail;
struct dda dda;

// Not inlined into the interrupt, which would have to save more registers with every tick.
__attribute__((noinline, optimize("O2"))) bool dda_load(void) {
    const uint8_t tail = queue_tail;
    if (tail == queue_head) {
        dda.now = 0;
        return false;
    }
    const struct segment *s = queue_slot(tail);
    HAL_NEAR(s);
    const uint16_t interval = s->interval;
    HAL_COMING(interval);
    dda.now = s;
    dda.left = s->ticks;
    dda.interval = (uint32_t)interval << 16;
    dda.add = (int32_t)((uint32_t)(int32_t)s->add << 8);
    const axes_t back = s->back;
    if (HAL_PREPARES) {
        dda.changing = s->bend ? BENDS : s->add != 0;
    }
    if (HAL_PREPARES && dda.prepared) {
        dda.prepared = false;
        dda.back = back;
        dda_direction(back);
        return true;
    }
    if (dda.back & LAST) {
        dda_rest();
    }
    const axes_t turned = dda.back ^ back, fine = s->fine;
    (void)turned;
    (void)fine;
    if (HAL_PREPARES) {
        dda.fine = fine;
    }
#define LOAD(i, ...)                          \
    if (fine & 1 << (i)) {                    \
        dda.rate[i] = s->rate[i];             \
    } else {                                  \
        dda.rate[i] = (fine_t)s->rate[i] << 8; \
    }                                         \
    if (turned & 1 << (i)) {                  \
        dda.phase[i] ^= PHASE_TURN;           \
    }
    STEPPER_PINS(LOAD)
    dda.back = back;
    dda_direction(back);
    return true;
}

__attribute__((noinline)) void dda_bend(void) {
    const int16_t bend = dda.now->bend;
    if (!bend) {  // at the highest rates there is none, and no time
        return;
    }
    const int32_t more = dda.back & QUICK ? (int32_t)bend * 128 : (int32_t)bend * 4;
    dda.add = (int32_t)((uint32_t)dda.add + (uint32_t)more);  // behind the last tick it may turn round: nobody looks
}
