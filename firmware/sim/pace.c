#include "pace.h"

#include <time.h>

#include "chip.h"

bool pace_stepped;
double pace_speed = 1;
uint64_t pace_ahead = CLOCK_HZ / 20;
uint64_t pace_patience;
bool pace_host_is_there;

/* A simulator that fell behind (a busy machine) lets its clock slip by what exceeds this, rather than
 * race through the lost time while the host has had no chance to answer. */
static const int64_t MOST_CATCHING_UP = 20000000;

/* Whoever is silent for so long is silent on purpose [ns]. */
static const int64_t MOST_PATIENCE = 20000000000;
static const int64_t LEAST_PATIENCE = 20000000;
static const int64_t SAME_WORDS = 2000000;           /* what comes that soon belongs to what came before */

static int64_t anchor_real;
static uint64_t anchor_cycle, host_cycle;
static int64_t host_real, gaps[2];                   /* when the host spoke last, and how long before the time before, ns */
static int64_t slipped, waited, waiting_since;       /* ns; the last: 0 while not waiting */

static int64_t now_ns(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

void pace_reset(void) {
    anchor_real = now_ns();
    anchor_cycle = chip_now();
}

void pace_host_spoke(void) {
    int64_t now = now_ns(), gap = now - host_real;
    host_cycle = chip_now();
    host_real = now;
    if (gap > SAME_WORDS) {
        gaps[1] = gaps[0];
        gaps[0] = gap;
    }
}

/* A host that fills a queue speaks every 10 ms: when it gets no time then, its queue may be dry long before the most
 * that is waited for. Cycles. */
static uint64_t patience(void) {
    int64_t gap = 3 * (gaps[0] < gaps[1] ? gaps[0] : gaps[1]);
    if (gap < LEAST_PATIENCE)
        gap = LEAST_PATIENCE;
    uint64_t cycles = (uint64_t)(gap / 1000) * (CLOCK_HZ / 1000000);
    return cycles < pace_patience ? cycles : pace_patience;
}

static bool host_is_awaited(int64_t now) {
    return pace_patience && pace_host_is_there && chip_now() >= host_cycle + patience() &&
           now < host_real + MOST_PATIENCE;
}

/* Nanoseconds until simulated time may go on; negative if it is late. */
static int64_t early(int64_t now) {
    double speed = pace_speed;
    if (speed <= 0) {
        if (chip_now() < host_cycle + pace_ahead) {
            pace_reset();
            return 0;
        }
        speed = 1;
    }
    if (host_is_awaited(now)) {
        pace_reset();
        return 1000000;
    }
    return anchor_real + (int64_t)((double)(chip_now() - anchor_cycle) * (1e9 / CLOCK_HZ) / speed) - now;
}

int64_t pace_wait(void) {
    int64_t now = now_ns(), wait = early(now);
    if (wait > 0) {
        if (!waiting_since)
            waiting_since = now;
        return wait;
    }
    if (waiting_since)
        waited += now - waiting_since;
    waiting_since = 0;
    if (wait < -MOST_CATCHING_UP) {
        slipped -= wait;
        pace_reset();
    }
    return 0;
}

void pace_json(FILE *out) {
    fprintf(out, "{\"speed\": %g, \"waited_ms\": %.3f, \"slipped_ms\": %.3f}", pace_speed, (double)waited / 1e6,
            (double)slipped / 1e6);
}
