#include "link.h"

#include <stdbool.h>

#include "../board.h"
#include "crc.h"
#include "hal.h"

enum { CRC_SIZE = 4 };
_Static_assert(FRAME_MAX <= 250, "COBS with one byte of overhead, lengths in 8 bits");

uint8_t link_bad;

static uint8_t frame[FRAME_MAX];
static uint8_t length;
static uint8_t block;    // bytes until the next COBS code
static uint32_t crc;     // of all bytes so far
static bool started, broken;

static void drop(void) {
    if (link_bad < 255) {
        link_bad++;
    }
}

static void decoded(uint8_t byte) {
    if (length == FRAME_MAX) {
        broken = true;
        return;
    }
    frame[length++] = byte;
    crc = crc_byte(crc, byte);
}

static uint8_t end_of_frame(void) {
    const bool whole = !broken && block == 0 && length >= CRC_SIZE + 2 && crc == CRC_GOOD;
    const bool empty = !started;
    const uint8_t size = length - CRC_SIZE;
    started = broken = false;
    length = 0;
    if (!whole && !empty) {
        drop();
    }
    return whole ? size : 0;
}

uint8_t *link_frame(void) {
    return frame;
}

uint8_t link_byte(uint8_t byte) {
    if (byte == 0) {
        return end_of_frame();
    }
    if (!started) {
        started = true;
        crc = CRC_START;
        block = byte - 1;
    } else if (block) {
        block--;
        decoded(byte);
    } else {
        decoded(0);  // each code but the first stands for the zero that ended its block
        block = byte - 1;
    }
    return 0;
}

APART void link_send(const uint8_t *payload, uint8_t size) {
    if (hal_send_room() < size + CRC_SIZE + 2) {
        return;
    }
    const uint32_t sum = crc_block(payload, size);
    const uint8_t tail[CRC_SIZE] = {sum, sum >> 8, sum >> 16, sum >> 24};
    const uint8_t total = size + CRC_SIZE;
#define BYTE(i) ((i) < size ? payload[i] : tail[(uint8_t)((i) - size)])
    for (uint8_t at = 0; at <= total;) {
        uint8_t run = 0;
        while (at + run < total && BYTE(at + run)) {
            run++;
        }
        hal_send(run + 1);
        for (uint8_t i = 0; i < run; i++) {
            hal_send(BYTE(at + i));
        }
        at += run + 1;
    }
    hal_send(0);
#undef BYTE
}
