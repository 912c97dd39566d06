// A host for the tests: makes payloads, keeps the sequence, checks the answers.
#pragma once
#include <stdio.h>
#include <stdlib.h>

#include "../src/core/errors.h"
#include "../src/core/memory.h"
#include "bench.h"

#define CHECK(what)                                                                  \
    do {                                                                             \
        if (!(what)) {                                                               \
            fprintf(stderr, "%s:%d: not so: %s\n", __FILE__, __LINE__, #what);       \
            exit(1);                                                                 \
        }                                                                            \
    } while (0)

struct ack {
    uint8_t next, error, detail, state, free;
    uint16_t queued, session;
};

struct status {
    struct ack ack;
    uint8_t flags, switches, overruns, bad;
    uint16_t known;
    int32_t counts[AXES];
};

enum { HOST_END = 1, HOST_WIDE = 2, HOST_GENTLE = 4 * 3 };  // gentle: 3/8

// Whole steps in whole ticks, from half a step to half a step as near as the rates come.
struct host_segment {
    uint16_t ticks, interval;
    int16_t add;  // 1/256 cycle
    int16_t bend;
    bool quick;
    int16_t steps[AXES];
    int32_t rate[AXES];  // 2^-23 step a tick, where it is not 0, as the form can say it: then `steps` says what comes of it
};

extern uint8_t host_next;
extern uint8_t host_frame[300];  // the last frame sent in sequence
extern size_t host_length;

struct image host_image(void);  // every axis used, wide limits
void host_hello(uint32_t nonce);
void host_configure(const struct image *image);
struct ack host_order(uint8_t type, const void *body, size_t length);  // in sequence
struct ack host_position(uint16_t mask, const int32_t *counts);
struct ack host_enable(uint8_t what);
size_t host_motion_payload(uint8_t *payload, uint16_t mask, uint8_t flags, const int32_t *start, uint8_t n,
                           const struct host_segment *segments);
struct ack host_motion(uint16_t mask, uint8_t flags, const int32_t *start, uint8_t n, const struct host_segment *s);
struct ack host_hold(void);
struct ack host_home(uint8_t input, uint8_t closed, uint8_t slow, uint32_t backoff, uint32_t travel, uint16_t time,
                     const int32_t *rate);
struct ack host_jog(const int32_t *rate);
struct status host_status(uint8_t page);
void host_ready(uint32_t nonce);            // all of the above up to a known position (0, servos 1500) and power on
void host_wait_idle(uint32_t at_most_ms);   // asking all the while
