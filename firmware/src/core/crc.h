// CRC-32 (IEEE 802.3, reflected), a byte at a time.
#pragma once
#include <stdint.h>

#include "../chip.h"

#define CRC_START 0xFFFFFFFFUL
#define CRC_GOOD 0xDEBB20E3UL  // the register after data and its own CRC

#ifdef HAL_CRC
typedef uint8_t crc_part;
extern const crc_part crc_table[4][256];
#define crc_byte(crc, byte) HAL_CRC(crc, byte)
#else
typedef uint32_t crc_part;
extern const crc_part crc_table[1][256];

static inline uint32_t crc_byte(uint32_t crc, uint8_t byte) {
    return crc_table[0][(uint8_t)crc ^ byte] ^ (crc >> 8);
}
#endif

uint32_t crc_block(const void *data, uint16_t length);  // finished: what zlib.crc32 gives
