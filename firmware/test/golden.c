// Replays firmware/golden against the core: golden FRAMES.txt A.talk B.talk …
#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../src/core/link.h"
#include "bench.h"

static int failures;
static const char *where;
static int line_number;

static void fail(const char *what) {
    fprintf(stderr, "%s:%d: %s\n", where, line_number, what);
    failures++;
}

// Hex to bytes; "??" is any byte (mask 0).
static size_t parse(const char *hex, uint8_t *bytes, uint8_t *mask) {
    size_t n = 0;
    for (; *hex && *hex != '#'; hex++) {
        if (isspace((unsigned char)*hex)) {
            continue;
        }
        const char pair[3] = {hex[0], hex[1], 0};
        mask[n] = pair[0] == '?' ? 0 : 0xFF;
        bytes[n++] = strtoul(pair, NULL, 16);
        hex++;
    }
    return n;
}

static void expect(const char *hex) {
    uint8_t want[400], mask[400], got[400];
    const size_t wanted = parse(hex, want, mask);
    const size_t length = bench_answer(got, sizeof got);
    bool same = length == wanted;
    for (size_t i = 0; same && i < length; i++) {
        same = ((got[i] ^ want[i]) & mask[i]) == 0;
    }
    if (!same) {
        fail("another answer than");
        fprintf(stderr, "  want %s  got  ", hex);
        for (size_t i = 0; i < length; i++) {
            fprintf(stderr, "%02x", got[i]);
        }
        fprintf(stderr, "\n");
    }
}

// A vector file, read from its first line by a board that has just been powered.
static FILE *begin(const char *path) {
    FILE *file = fopen(path, "r");
    if (!file) {
        perror(path);
        exit(2);
    }
    where = path;
    line_number = 0;
    bench_power();
    return file;
}

static void talk(const char *path) {
    char line[4096];
    FILE *file = begin(path);
    while (fgets(line, sizeof line, file)) {
        uint8_t bytes[2048], mask[2048];
        line_number++;
        if (line[0] == '>') {
            bench_payload(bytes, parse(line + 1, bytes, mask));
            bench_run(20);
        } else if (line[0] == '<') {
            expect(line + 1);
        } else if (!strncmp(line, "wire ", 5)) {
            bench_wire(bytes, parse(line + 5, bytes, mask));
            bench_run(20);
        } else if (!strncmp(line, "wait ", 5)) {
            bench_run(1000 * atoi(line + 5));
        } else if (!strncmp(line, "silent", 6)) {
            bench_run(20000);
            if (bench_answer(bytes, sizeof bytes)) {
                fail("an answer where none was due");
            }
        } else if (!strncmp(line, "reset", 5)) {
            bench_reset(0);
        } else if (strncmp(line, "board ", 6) != 0 && line[0] != '#' && line[0] != '\n') {
            fail("unknown line");
        }
    }
    uint8_t bytes[400];
    if (bench_answer(bytes, sizeof bytes)) {
        fail("an answer too many");
    }
    fclose(file);
}

// frames.txt: what the board sends must be byte for byte what is written there.
static void frames(const char *path) {
    char line[4096];
    FILE *file = begin(path);
    int seen = 0;
    while (fgets(line, sizeof line, file)) {
        line_number++;
        if (line[0] == '#') {
            continue;
        }
        char *payload_hex = strchr(line, '|'), *wire_hex = payload_hex ? strchr(payload_hex + 1, '|') : NULL;
        if (!wire_hex) {
            fail("not NAME | payload | wire");
            continue;
        }
        *wire_hex++ = 0;
        uint8_t payload[400], wire[400], got[400], mask[400];
        const size_t length = parse(payload_hex + 1, payload, mask), wire_length = parse(wire_hex, wire, mask);
        seen++;
        link_send(payload, length);
        if (bench_raw(got, sizeof got) != wire_length || memcmp(got, wire, wire_length) != 0) {
            fail("framed differently");
        }
        // the other direction: the receiver must take it (a sequenced frame without a session is acknowledged)
        if (payload[0] < 0x80) {
            bench_wire(wire, wire_length);
            if (!bench_answer(got, sizeof got)) {
                fail("not understood");
            }
        }
    }
    if (seen < 15) {
        fail("too few frames");
    }
    fclose(file);
}

int main(int argc, char **argv) {
    for (int i = 1; i < argc; i++) {
        if (strstr(argv[i], ".talk")) {
            talk(argv[i]);
        } else {
            frames(argv[i]);
        }
    }
    printf("golden: %d files, %d failures\n", argc - 1, failures);
    return failures != 0;
}
