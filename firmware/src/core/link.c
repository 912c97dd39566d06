#include "link.h"

#include <stdbool.h>

#include "../board.h"
#include "crc.h"
#include "hal.h"

enum { CRC_SIZE = 4 };
_Static_assert(FRAME_MAX <= 250, "COBS with one byte of overhead, lengths in 8 bits");

uint8_t link_bad, link_length;

static uint8_t frame[FRAME_MAX];
static uint8_t filled;
static uint8_t block;  // bytes until the next COBS code, that one included; 0: between frames
static uint32_t crc;   // of all bytes so far

static void end_of_frame(void) {
    const bool whole = block == 1 && filled >= CRC_SIZE + 2 && crc == CRC_GOOD;
    if (whole) {
        link_length = filled - CRC_SIZE;
    } else if (block && link_bad < 255) {
        link_bad++;
    }
    block = 0;
}

uint8_t *link_frame(void) {
    return frame;
}

// The loop's variables are its own: the line brings a byte every 640 cycles, and the board must take them faster, whatever else it does.
APART uint8_t link_bytes(const uint8_t *bytes, uint8_t count) {
    uint8_t *at = frame + filled;
    uint8_t room = FRAME_MAX - filled, left = block, taken = 0;
    uint32_t sum = crc;
    do {
        uint8_t byte = *bytes++;
        taken++;
        if (byte == 0) {
            filled = FRAME_MAX - room;
            block = left;
            crc = sum;
            end_of_frame();
            return taken;
        }
        if (left == 0) {
            left = byte;
            at = frame;
            room = FRAME_MAX;
            sum = CRC_START;
            continue;
        }
        if (--left == 0) {  // each code but the first stands for the zero that ended its block
            left = byte;
            byte = 0;
        }
        if (room) {
            room--;
            *at++ = byte;
            sum = crc_byte(sum, byte);
        } else {
            sum = 0;  // it is too long: no CRC is right any more
        }
    } while (taken != count);
    filled = FRAME_MAX - room;
    block = left;
    crc = sum;
    return count;
}

APART void link_send(const uint8_t *payload, uint8_t size) {
    if (hal_send_room() < size + CRC_SIZE + 2) {
        return;
    }
    const uint32_t sum = crc_block(payload, size);
    const uint8_t tail[CRC_SIZE] = {sum, sum >> 8, sum >> 16, sum >> 24};
    const uint8_t total = size + CRC_SIZE;
#define BYTE(i) ((i) < size ? payload[i] : tail[(uint8_t)((i) - size) % CRC_SIZE])
    for (uint8_t at = 0; at <= total; at++) {
        uint8_t end = at;
        while (end < total && BYTE(end)) {
            end++;
        }
        hal_send(end - at + 1);
        for (; at < end; at++) {
            hal_send(BYTE(at));
        }
    }
    hal_send(0);
#undef BYTE
}
