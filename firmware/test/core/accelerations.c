// The quick look at accelerations takes nothing for clear that the exact one refuses, or of which it keeps an excess.
#include "core.h"

#include "../../src/core/acceleration.h"

static uint16_t wobbling(uint16_t x, uint16_t part) {
    const int32_t off = x / part ? rand() % (2 * (x / part) + 1) - x / part : 0;
    return x + off;
}

// A segment of one axis that goes on from `before`, more or less; its last interval is another one.
static uint16_t any_segment(struct segment *s, uint16_t interval, uint16_t rate) {
    const uint16_t parts[] = {2, 10, 100, 1000}, last = wobbling(interval, parts[rand() % 4]);
    const bool even = rand() % 4 == 0;
    *s = (struct segment){.ticks = 1 + rand() % (rand() % 8 ? 300 : 60000), .interval = interval, .add = !even, .back = rand() % 16 == 0, .fine = rand() % 8 == 0};
    s->rate[0] = rate;
    return even ? interval : last;
}

void test_accelerations(void) {
    enum { ROUNDS = 300000 };
    uint32_t clear = 0, refused = 0;
    const uint16_t parts[] = {1, 10, 100, 1000};
    for (uint32_t round = 0; round < ROUNDS; round++) {
        struct segment a, b;
        struct pace none = {0}, before, pace;
        const uint16_t interval = MIN_INTERVAL + 20 + rand() % 20000, rate = rand() % 65536;
        const uint16_t last = any_segment(&a, interval, rate);
        take_pace(&a, last, &none, &before);
        const uint16_t least = MIN_INTERVAL, next = wobbling(last, parts[1 + rand() % 3]);
        const uint16_t end = any_segment(&b, next < least ? least : next, wobbling(rate, parts[rand() % 4]));
        take_pace(&b, end < least ? least : end, &before, &pace);
        if (rand() % 16 == 0) {
            before = (struct pace){.time = pace.time};  // rest
        }
        const bool kept = rand() % 8 == 0;
        limits.jump[0] = 1 + ((uint32_t)rand() % (JUMP_MAX - 1) >> rand() % 16);
        motion.plan_exceeding = kept;
        const bool is_clear = next_unclear(0, 1, &a, &before, &b, &pace) == 1;
        const bool over = accelerates(0, &a, &before, &b, &pace);
        CHECK(!is_clear || !(over || motion.plan_exceeding || kept));
        clear += is_clear;
        refused += over;
    }
    CHECK(clear > ROUNDS / 20 && refused > ROUNDS / 20);
}
