// The tick's inner part in plain C, for chips of 32 bits: phases are kept to 24 of them by hand. A chip's chip.h includes it.
#pragma once
#include <stdint.h>

typedef uint32_t fine_t;
typedef int32_t sfine_t;

void dda_direction(uint16_t back);

#define DDA_AXIS(i, ...)                                 \
    {                                                    \
        const uint32_t sum = dda.phase[i] + dda.rate[i]; \
        bits |= (sum >> 24) << (i);                      \
        dda.phase[i] = sum & 0xFFFFFF;                   \
    }

#define DDA_ADVANCE(planned)      \
    planned = dda.interval >> 16; \
    dda.interval += dda.add >> 8;

#define HAL_PREPARES 0
#define HAL_MULTIPLY(a, b) ((uint32_t)(uint16_t)(a) * (uint16_t)(b))
#define HAL_NEAR(pointer)
#define HAL_COMING(cycles)
