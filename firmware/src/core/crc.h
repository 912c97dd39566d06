// CRC-32 (IEEE 802.3, reflected), a byte at a time.
#pragma once
#include <stdint.h>

#include "../chip.h"

#define CRC_START 0xFFFFFFFFUL
#define CRC_GOOD 0xDEBB20E3UL  // the register after data and its own CRC

extern const uint32_t crc_table[256];

static inline uint32_t crc_byte(uint32_t crc, uint8_t byte) {
    return HAL_READ32(&crc_table[(uint8_t)crc ^ byte]) ^ (crc >> 8);
}

uint32_t crc_block(const void *data, uint16_t length);  // finished: what zlib.crc32 gives
