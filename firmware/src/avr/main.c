// The main loop. It never waits: bytes, milliseconds, motion, servo frames, each as it comes.
//
// There is no Arduino core here, though the IDE builds this: its timer 0 interrupt would shake the step pulses. A main() of our own
// keeps all of it out of the program.
#include <avr/interrupt.h>
#include <avr/wdt.h>

#include "../core/protocol.h"
#include "avr.h"

enum { SERVO_PERIOD_MS = 20, BYTES_AT_ONCE = 64 };

// Timer 0 counts units of 16 µs and is looked at, not interrupted by: milliseconds are not lost if a look comes 4 ms late.
static uint8_t elapsed(void) {
    static uint8_t before, eighths;  // of a millisecond's 62.5 units: 125 halves
    const uint8_t now = TCNT0;
    uint16_t halves = eighths + 2 * (uint8_t)(now - before);
    uint8_t milliseconds = 0;
    before = now;
    while (halves >= 125) {
        halves -= 125;
        milliseconds++;
    }
    eighths = halves;
    return milliseconds;
}

static void millisecond(void) {
    protocol_millisecond();
    if (SERVOS) {
        static uint8_t until_frame;
        if (until_frame-- == 0) {
            until_frame = SERVO_PERIOD_MS - 1;
            servo_frame();
        }
    }
}

int main(void) {
    pins_setup();
    stepper_setup();
    servo_setup();
    serial_setup();
    TCCR0B = 1 << CS02;  // clock / 256
    protocol_start(reset_cause());
    wdt_enable(WDTO_250MS);  // for hangs only: the loop turns in well under 5 ms
    sei();
    for (;;) {
        uint8_t byte;
        wdt_reset();
        for (uint8_t n = 0; n < BYTES_AT_ONCE && serial_get(&byte); n++) {
            protocol_byte(byte);
        }
        for (uint8_t n = elapsed(); n; n--) {
            millisecond();
        }
        protocol_poll();
    }
}
