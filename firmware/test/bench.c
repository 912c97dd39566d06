#include "bench.h"

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../src/core/crc.h"
#include "../src/core/dda.h"
#include "../src/core/hal.h"
#include "../src/core/home.h"
#include "../src/core/link.h"
#include "../src/core/memory.h"
#include "../src/core/motion.h"
#include "../src/core/protocol.h"

int32_t bench_pins[AXES];
uint8_t bench_switches = 0xFF;
bool bench_abort = true;
uint64_t bench_cycles, bench_ticks;
bool bench_drivers_on;
void (*bench_on_tick)(void);
bool bench_frozen, bench_power_level = true;

static uint16_t directions;
static bool timer_on;
static uint64_t next_tick, next_millisecond;
static uint8_t probe_input;
static bool probe_high;

static uint8_t sent[1 << 16];
static size_t sent_head, sent_tail;

uint8_t hal_send_room(void) {
    return 255;
}

void hal_send(uint8_t byte) {
    sent[sent_head++ % sizeof sent] = byte;
}

void hal_timer_start(uint16_t interval) {
    assert(!timer_on);
    assert(interval >= MIN_INTERVAL);
    timer_on = true;
    next_tick = bench_cycles + interval;
}

void hal_timer_stop(void) {
    timer_on = false;
}

void hal_drivers(bool on) {
    bench_drivers_on = on;
}

uint8_t hal_switches(void) {
    return bench_switches;
}

bool hal_abort_level(void) {
    return bench_abort;
}

bool hal_power_level(void) {
    return bench_power_level;
}

void hal_probe(uint8_t input, bool high) {
    probe_input = input;
    probe_high = high;
}

void hal_configured(void) {
}

void dda_direction(uint16_t back) {
    directions = back;
}

// What src/avr/stepper.c does in the interrupt.
static void tick(void) {
    const uint8_t bits = dda.bits;
    for (uint8_t i = 0; i < STEPPERS; i++) {
        if (bits >> i & 1) {
            bench_pins[i] += directions >> i & 1 ? -1 : 1;
        }
    }
    bench_ticks++;
    if (bench_on_tick) {
        bench_on_tick();
    }
    if (dda.probe) {
        dda_probe((bench_switches >> probe_input & 1) == probe_high);
    }
    const uint16_t interval = dda_next();
    if (interval) {
        assert(interval >= MIN_INTERVAL);
        dda_bits();
        next_tick += interval;
    } else {
        timer_on = false;
    }
}

void bench_run(uint32_t us) {
    const uint64_t end = bench_cycles + us * (CLOCK / 1000000);
    for (;;) {
        if (!bench_frozen) {
            protocol_poll();
        }
        const bool tick_first = timer_on && next_tick < next_millisecond;
        const uint64_t next = tick_first ? next_tick : next_millisecond;
        if (next > end) {
            bench_cycles = end;
            return;
        }
        bench_cycles = next;
        if (tick_first) {
            tick();
        } else {
            next_millisecond += CLOCK / 1000;
            if (!bench_frozen) {
                protocol_millisecond();
            }
        }
    }
}

void bench_reset(uint8_t cause) {
    timer_on = false;
    sent_tail = sent_head;
    bench_wire((const uint8_t[]){0}, 1);
    link_bad = 0;
    next_millisecond = bench_cycles + CLOCK / 1000;
    protocol_start(cause);
}

void bench_power(void) {
    for (size_t i = 0; i < sizeof memory; i++) {
        ((uint8_t *)&memory)[i] = rand();
    }
    memset(bench_pins, 0, sizeof bench_pins);
    bench_switches = 0xFF;
    bench_abort = bench_power_level = true;
    bench_frozen = false;
    hal_spilled = 0;
    bench_reset(0);
}

void bench_wire(const uint8_t *bytes, size_t length) {
    for (size_t i = 0; i < length;) {
        i += link_bytes(bytes + i, length - i < 255 ? length - i : 255);
        protocol_frame();
    }
}

void bench_payload(const uint8_t *payload, size_t length) {
    uint8_t data[300], wire[302];
    assert(length + 4 <= sizeof data);
    const uint32_t crc = crc_block(payload, length);
    memcpy(data, payload, length);
    for (int i = 0; i < 4; i++) {
        data[length + i] = crc >> (8 * i);
    }
    size_t code = 0, at = 1;
    for (size_t i = 0; i < length + 4; i++) {
        if (data[i]) {
            wire[at++] = data[i];
        } else {
            wire[code] = at - code;
            code = at++;
        }
    }
    wire[code] = at - code;
    wire[at++] = 0;
    bench_wire(wire, at);
}

size_t bench_answer(uint8_t *payload, size_t room) {
    uint8_t data[300];
    size_t length = 0, block = 0;
    bool first = true;
    while (sent_tail != sent_head) {
        const uint8_t byte = sent[sent_tail++ % sizeof sent];
        if (byte == 0) {
            assert(block == 0 && length >= 6 && length - 4 <= room);
            const uint32_t crc = crc_block(data, length - 4);
            for (int i = 0; i < 4; i++) {
                assert(data[length - 4 + i] == (uint8_t)(crc >> (8 * i)));
            }
            memcpy(payload, data, length - 4);
            return length - 4;
        }
        if (block) {
            block--;
            data[length++] = byte;
        } else {
            if (!first) {
                data[length++] = 0;
            }
            first = false;
            block = byte - 1;
        }
    }
    return 0;
}

size_t bench_raw(uint8_t *bytes, size_t room) {
    size_t n = 0;
    while (sent_tail != sent_head && n < room) {
        bytes[n++] = sent[sent_tail++ % sizeof sent];
    }
    return n;
}
