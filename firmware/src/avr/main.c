// The main loop. It never waits: bytes, milliseconds, motion, servo frames, each as it comes.
//
// There is no Arduino core here, though the IDE builds this: its timer 0 interrupt would shake the step pulses. A main() of our own
// keeps all of it out of the program.
#include <avr/interrupt.h>
#include <avr/wdt.h>

#include "../core/link.h"
#include "../core/protocol.h"
#include "avr.h"

enum { SERVO_PERIOD_MS = 20, AT_ONCE = 16 };

// Timer 0 counts units of 64 µs and is looked at, not interrupted by: no millisecond is lost if a look comes 16 ms late.
// True once for each millisecond; those that are late come one a turn, and bytes between them.
static bool millisecond_due(void) {
    static uint8_t before;
    static uint16_t eighths;  // of a millisecond's 15.625 units: 125
    const uint8_t now = TCNT0;
    eighths += 8 * (uint8_t)(now - before);
    before = now;
    if (eighths < 125) {
        return false;
    }
    eighths -= 125;
    return true;
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

// All that waits, to the end of a frame: as soon as the frame before it was answered, the host may send more.
static void take_bytes(void) {
    const uint8_t *bytes;
    uint8_t waiting;
    while (!link_length && (waiting = serial_waiting(&bytes))) {
        serial_taken(link_bytes(bytes, waiting < AT_ONCE ? waiting : AT_ONCE));
    }
}

int main(void) {
    pins_setup();
    stepper_setup();
    servo_setup();
    serial_setup();
    TCCR0B = 1 << CS02 | 1 << CS00;  // clock / 1024
    protocol_start(reset_cause());
    wdt_enable(WDTO_250MS);  // for hangs only: the loop turns in well under 5 ms
    sei();
    for (;;) {
        wdt_reset();
        take_bytes();
        if (millisecond_due()) {
            millisecond();
        }
        protocol_poll();
        protocol_frame();
    }
}
