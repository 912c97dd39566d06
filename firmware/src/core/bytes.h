// Little-endian numbers in frames.
#pragma once
#include <stdint.h>

static inline uint16_t get16(const uint8_t *p) {
    return p[0] | (uint16_t)p[1] << 8;
}

static inline uint32_t get32(const uint8_t *p) {
    return get16(p) | (uint32_t)get16(p + 2) << 16;
}

static inline uint8_t *put16(uint8_t *p, uint16_t x) {
    p[0] = x;
    p[1] = x >> 8;
    return p + 2;
}

static inline uint8_t *put32(uint8_t *p, uint32_t x) {
    return put16(put16(p, x), x >> 16);
}
