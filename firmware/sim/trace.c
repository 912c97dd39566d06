#include "trace.h"

#include <stdio.h>

enum { TRACE_INPUT = 128, TRACE_IN = 250, TRACE_OUT = 251, TRACE_RESET = 252, TRACE_MARK = 253 };

static FILE *trace;

static void put_record(int id, int value) {
    if (!trace)
        return;
    uint64_t record = chip_now() << 16 | (uint64_t)id << 8 | (uint8_t)value;
    fwrite(&record, sizeof record, 1, trace);         /* little-endian hosts only, as libsimavr itself */
}

void trace_signal(int signal, bool level) { put_record(signal, level); }
void trace_input(int input, int level) { put_record(TRACE_INPUT + input, level); }
void trace_byte(int way, uint8_t byte) { put_record(way ? TRACE_OUT : TRACE_IN, byte); }
void trace_mark(uint8_t value) { put_record(TRACE_MARK, value); }

void trace_reset(struct avr_t *avr, reset_kind kind) {
    (void)avr;
    put_record(TRACE_RESET, (int)kind);
}

bool trace_open(const char *path, const char *board_name, const char *const *signals, int count) {
    trace = fopen(path, "wb");
    if (!trace)
        return false;
    setvbuf(trace, NULL, _IOFBF, 1 << 18);
    fprintf(trace, "{\"armkin_trace\": 1, \"board\": \"%s\", \"clock_hz\": %d, \"signals\": [", board_name, CLOCK_HZ);
    for (int i = 0; i < count; i++)
        fprintf(trace, "%s\"%s\"", i ? ", " : "", signals[i]);
    fprintf(trace, "]}\n");
    return true;
}

void trace_flush(void) {
    if (trace)
        fflush(trace);
}
