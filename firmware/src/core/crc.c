#include "crc.h"

// The table is linear over XOR, so the entries of the eight single bits make all others.
#define BIT(n, b, k) ((n) & (1 << (b)) ? k##UL : 0UL)
#define ENTRY(n)                                                                                              \
    (BIT(n, 0, 0x77073096) ^ BIT(n, 1, 0xEE0E612C) ^ BIT(n, 2, 0x076DC419) ^ BIT(n, 3, 0x0EDB8832) ^          \
     BIT(n, 4, 0x1DB71064) ^ BIT(n, 5, 0x3B6E20C8) ^ BIT(n, 6, 0x76DC4190) ^ BIT(n, 7, 0xEDB88320))
#define FOUR(n) ENTRY(n), ENTRY(n + 1), ENTRY(n + 2), ENTRY(n + 3)
#define SIXTEEN(n) FOUR(n), FOUR(n + 4), FOUR(n + 8), FOUR(n + 12)
#define SIXTY_FOUR(n) SIXTEEN(n), SIXTEEN(n + 16), SIXTEEN(n + 32), SIXTEEN(n + 48)

const uint32_t crc_table[256] HAL_TABLE = {SIXTY_FOUR(0), SIXTY_FOUR(64), SIXTY_FOUR(128), SIXTY_FOUR(192)};

uint32_t crc_block(const void *data, uint16_t length) {
    const uint8_t *byte = data;
    uint32_t crc = CRC_START;
    for (uint16_t i = 0; i < length; i++) {
        crc = crc_byte(crc, byte[i]);
    }
    return ~crc;
}
