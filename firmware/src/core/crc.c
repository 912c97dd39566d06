#include "crc.h"

// The table is linear over XOR, so the entries of the eight single bits make all others.
#define BIT(n, b, k) ((n) & (1 << (b)) ? k##UL : 0UL)
#define ENTRY(n)                                                                                              \
    (BIT(n, 0, 0x77073096) ^ BIT(n, 1, 0xEE0E612C) ^ BIT(n, 2, 0x076DC419) ^ BIT(n, 3, 0x0EDB8832) ^          \
     BIT(n, 4, 0x1DB71064) ^ BIT(n, 5, 0x3B6E20C8) ^ BIT(n, 6, 0x76DC4190) ^ BIT(n, 7, 0xEDB88320))
#define PART(n, s) (crc_part)(ENTRY(n) >> (s))
#define FOUR(n, s) PART(n, s), PART(n + 1, s), PART(n + 2, s), PART(n + 3, s)
#define SIXTEEN(n, s) FOUR(n, s), FOUR(n + 4, s), FOUR(n + 8, s), FOUR(n + 12, s)
#define SIXTY_FOUR(n, s) SIXTEEN(n, s), SIXTEEN(n + 16, s), SIXTEEN(n + 32, s), SIXTEEN(n + 48, s)
#define TABLE(s) {SIXTY_FOUR(0, s), SIXTY_FOUR(64, s), SIXTY_FOUR(128, s), SIXTY_FOUR(192, s)}

#ifdef HAL_CRC  // byte by byte of the entries
const crc_part crc_table[4][256] HAL_TABLE __attribute__((aligned(256))) = {TABLE(0), TABLE(8), TABLE(16), TABLE(24)};
#else
const crc_part crc_table[1][256] = {TABLE(0)};
#endif

uint32_t crc_block(const void *data, uint16_t length) {
    const uint8_t *byte = data;
    uint32_t crc = CRC_START;
    for (uint16_t i = 0; i < length; i++) {
        crc = crc_byte(crc, byte[i]);
    }
    return ~crc;
}
