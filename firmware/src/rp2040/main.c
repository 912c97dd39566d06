// The main loop. Bytes, milliseconds, motion, servo frames, each as it comes; between them the processor sleeps.
#ifdef __arm__
#include "../chip.h"
#include "../core/hal.h"
#include "../core/link.h"
#include "../core/motion.h"
#include "../core/protocol.h"
#include "pico.h"

enum { SERVO_PERIOD_MS = 20, MS = 1000 };

static uint32_t last;  // microsecond of the last millisecond

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

__attribute__((noinline)) int main(void) {  // not into start(), which stays in the flash
    const uint8_t cause = reset_cause();
    clocks_setup();
    pins_setup();
    stepper_setup();
    servo_setup();
    serial_setup();
    protocol_start(cause);
    last = REG(TIMER_RAWL);
    sleep_setup(last);
    watchdog_start();  // for hangs only
    for (;;) {
        const uint8_t *bytes;
        awake = false;
        watchdog_feed();
        usb_boot_drive(motion.state == IDLE);  // a moving arm does not stop for it
        const uint8_t count = serial_get(&bytes);
        for (uint8_t n = 0; n < count;) {
            n += link_bytes(bytes + n, count - n);
            protocol_frame();
        }
        milliseconds();
        protocol_poll();
        serial_pump();
        sleep_until_awake();
    }
}
#endif
