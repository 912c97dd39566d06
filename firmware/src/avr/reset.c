// What happens before main: why the chip was reset, and the watchdog off.
#include <avr/io.h>
#include <avr/pgmspace.h>
#include <avr/wdt.h>

#include "avr.h"

// Bootloaders clear MCUSR. Optiboot hands its value on in r2 since version 4.6 (and from 8 on leaves MCUSR alone); the Uno's
// stock 4.4 and the Mega's stk500v2 say nothing.
static uint8_t seen_mcusr __attribute__((section(".noinit")));
uint8_t seen_r2 __attribute__((used, externally_visible, section(".noinit")));  // named in assembly

__attribute__((naked, used, section(".init0"))) static void save_r2(void) {
    __asm__ __volatile__("sts seen_r2, r2");
}

__attribute__((naked, used, section(".init3"))) static void stop_watchdog(void) {
    seen_mcusr = MCUSR;
    MCUSR = 0;
    wdt_disable();  // after a watchdog reset it runs on, at 16 ms
}

uint8_t reset_cause(void) {
    enum { CAUSES = 0x0F };
    if (seen_mcusr & CAUSES) {
        return seen_mcusr & CAUSES;
    }
#ifdef __AVR_ATmega328P__
    const uint16_t optiboot = pgm_read_word(FLASHEND - 1);  // its version, if it is there
    if (optiboot >= 0x0406 && optiboot < 0x2000) {
        return seen_r2 & CAUSES;
    }
#endif
    return 0;
}
