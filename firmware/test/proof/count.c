// What EVA leaves open, counted out: motion_interval() of every number of ticks that a bent segment may have, wherever the core asks for it.
// Its products are linear in `bend`, so its ends and those beside 0 stand for all. Built with -fsanitize=undefined, which ends it.
#include <stdio.h>

#include "../../src/core/motion.h"

int main(void) {
    static const int16_t bends[] = {INT16_MIN, INT16_MIN + 1, -1, 1, INT16_MAX};
    enum { LONGEST_BEND = 1 << 14, LONGEST_QUICK = 1 << 10 };
    uint32_t calls = 0;
    for (int quick = 0; quick < 2; quick++) {
        for (uint16_t ticks = 1; ticks <= (quick ? LONGEST_QUICK : LONGEST_BEND); ticks++) {
            for (uint8_t n = 0; n < sizeof bends / sizeof *bends; n++) {
                for (int add = -1; add <= 1; add += 2) {
                    const struct segment s = {
                        .ticks = ticks, .interval = 65535, .add = add * 8388607, .bend = bends[n], .back = quick ? QUICK : 0};
                    motion_interval(&s, ticks - 1);
                    motion_interval(&s, ticks);
                    calls += 2;
                }
            }
        }
    }
    for (uint32_t at = 0; at <= UINT16_MAX; at++) {  // and every piece of an image that a CONFIG may bring
        static const uint8_t data[256];
        for (uint16_t length = 0; length < 256; length++) {
            const bool fits = at + length <= sizeof memory.image;
            if ((config_write(at, data, length) == OK) != fits) {
                return 1;
            }
            calls++;
        }
    }
    printf("%u calls, no overflow\n", calls);
    return 0;
}
