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
    printf("%u calls, no overflow\n", calls);
    return 0;
}
