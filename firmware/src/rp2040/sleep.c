// The processor sleeps while nothing has come; a millisecond's alarm wakes it, as other interrupts do.
#ifdef __arm__
#include "pico.h"

enum { MS = 1000 };

volatile bool awake;

void timer_interrupt(void) {
    REG(TIMER_INTR) = 1;
    REG(TIMER_ALARM0) = REG(TIMER_RAWL) + MS;
    awake = true;
}

// Interrupts are off between the look and the sleep: one that comes then ends the sleep at once.
void sleep_until_awake(void) {
    while (!awake) {
        __asm__ volatile("cpsid i" ::: "memory");
        if (!awake) {
            __asm__ volatile("wfi" ::: "memory");
        }
        __asm__ volatile("cpsie i\n\tisb" ::: "memory");
    }
}

void sleep_setup(uint32_t now) {
    REG(TIMER_INTE) = 1;
    REG(TIMER_ALARM0) = now + MS;
    irq_enable(IRQ_TIMER0, 3);
}
#endif
