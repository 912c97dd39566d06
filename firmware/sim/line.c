#include "line.h"

#include <stdlib.h>
#include <string.h>

line_noise line_way[2];
double line_host_baud;
int line_stop_byte = -1;

/* Growing byte queues; bytes leave at `head`. */
typedef struct {
    uint8_t *data;
    size_t head, size, room;
} queue;

static queue queues[2];

static void push(queue *q, const uint8_t *bytes, size_t n) {
    if (q->head && q->head == q->size)
        q->head = q->size = 0;
    if (q->size + n > q->room && q->head) {
        memmove(q->data, q->data + q->head, q->size - q->head);
        q->size -= q->head;
        q->head = 0;
    }
    if (q->size + n > q->room) {
        q->room = (q->size + n) * 2;
        q->data = realloc(q->data, q->room);
        if (!q->data)
            abort();
    }
    memcpy(q->data + q->size, bytes, n);
    q->size += n;
}

/* A uniform number in [0, 1): xorshift64*, so that a seed repeats on every machine. */
static double uniform(line_noise *w) {
    w->random ^= w->random >> 12;
    w->random ^= w->random << 25;
    w->random ^= w->random >> 27;
    return (double)((w->random * 0x2545F4914F6CDD1DULL) >> 11) / 9007199254740992.0;
}

void line_seed(int way, uint64_t seed) {
    /* splitmix64 spreads small seeds; the direction is part of the seed so that both ways differ */
    uint64_t z = (seed * 2 + (uint64_t)way) + 0x9E3779B97F4A7C15ULL;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    z ^= z >> 31;
    line_way[way].random = z ? z : 1;
}

/* What noise makes of a byte: the byte, a changed one, or LINE_LOST. */
static int pass(int way, uint8_t byte) {
    line_noise *w = &line_way[way];
    w->bytes++;
    if (w->cut) {
        w->cut_off++;
        return LINE_LOST;
    }
    if (w->drop > 0 && uniform(w) < w->drop) {
        w->dropped++;
        return LINE_LOST;
    }
    if (w->flip > 0 && uniform(w) < w->flip) {
        w->flipped++;
        byte ^= (uint8_t)(1u << (unsigned)(uniform(w) * 8));
    }
    return byte;
}

void line_feed(const uint8_t *bytes, size_t n) { push(&queues[LINE_IN], bytes, n); }

size_t line_queued(void) { return queues[LINE_IN].size - queues[LINE_IN].head; }

size_t line_waiting(void) { return queues[LINE_OUT].size - queues[LINE_OUT].head; }

size_t line_collect(uint8_t *bytes, size_t room) {
    queue *q = &queues[LINE_OUT];
    size_t n = q->size - q->head;
    if (n > room)
        n = room;
    if (n)
        memcpy(bytes, q->data + q->head, n);
    q->head += n;
    return n;
}

void line_discard(int way) { queues[way].head = queues[way].size; }

int line_next(void) {
    queue *q = &queues[LINE_IN];
    return q->head == q->size ? LINE_EMPTY : pass(LINE_IN, q->data[q->head++]);
}

bool line_put(uint8_t byte) {
    int passed = pass(LINE_OUT, byte);
    if (passed == LINE_LOST)
        return false;
    uint8_t b = (uint8_t)passed;
    push(&queues[LINE_OUT], &b, 1);
    return b == line_stop_byte;
}

void line_json(FILE *out) {
    static const char *names[2] = {"in", "out"};
    fputc('{', out);
    for (int way = 0; way < 2; way++) {
        const line_noise *w = &line_way[way];
        fprintf(out, "%s\"%s\": {\"bytes\": %llu, \"flipped\": %llu, \"dropped\": %llu, \"cut_off\": %llu, \"cut\": %s}",
                way ? ", " : "", names[way], (unsigned long long)w->bytes, (unsigned long long)w->flipped,
                (unsigned long long)w->dropped, (unsigned long long)w->cut_off, w->cut ? "true" : "false");
    }
    fputc('}', out);
}
