// The main loop. Bytes, milliseconds, motion, servo frames, each as it comes; between them the processor sleeps.
#ifdef __arm__
#include "../chip.h"
#include "../core/hal.h"
#include "../core/protocol.h"
#include "pico.h"

enum { SERVO_PERIOD_MS = 20, MS = 1000 };

volatile bool awake;

static uint32_t last;  // microsecond of the last millisecond

void timer_interrupt(void) {
    REG(TIMER_INTR) = 1;
    REG(TIMER_ALARM0) = REG(TIMER_RAWL) + MS;
    awake = true;
}

static void milliseconds(void) {
    while (REG(TIMER_RAWL) - last >= MS) {
        last += MS;
        protocol_millisecond();
        static uint8_t until_frame;
        if (until_frame-- == 0) {
            until_frame = SERVO_PERIOD_MS - 1;
            servo_frame();
        }
    }
}

// Interrupts are off between the look and the sleep: one that comes then ends the sleep at once.
static void sleep(void) {
    while (!awake) {
        __asm__ volatile("cpsid i" ::: "memory");
        if (!awake) {
            __asm__ volatile("wfi" ::: "memory");
        }
        __asm__ volatile("cpsie i\n\tisb" ::: "memory");
    }
}

__attribute__((noinline)) int main(void) {  // not into start(), which stays in the flash
    REG(VTOR) = (uint32_t)vectors;
    const uint8_t cause = reset_cause();
    clocks_setup();
    pins_setup();
    stepper_setup();
    servo_setup();
    serial_setup();
    protocol_start(cause);
    last = REG(TIMER_RAWL);
    REG(TIMER_INTE) = 1;
    REG(TIMER_ALARM0) = last + MS;
    irq_enable(IRQ_TIMER0, 3);
    watchdog_start();  // for hangs only
    for (;;) {
        const uint8_t *bytes;
        awake = false;
        watchdog_feed();
        const uint8_t count = serial_get(&bytes);
        for (uint8_t n = 0; n < count; n++) {
            protocol_byte(bytes[n]);
        }
        milliseconds();
        protocol_poll();
        serial_pump();
        sleep();
    }
}
#endif
