// The main loop. It never waits: bytes, milliseconds, motion, servo frames, each as it comes.
//
// There is no Arduino core here, though the IDE builds this: its timer 0 interrupt would shake the step pulses. A main() of our own
// keeps all of it out of the program.
#include <avr/interrupt.h>
#include <avr/wdt.h>

#include "../core/hal.h"
#include "../core/link.h"
#include "../core/protocol.h"
#include "avr.h"

enum { AT_ONCE = 16 };
enum { FRAME = 625, LATE_FRAME = FRAME + 156 };  // half units of timer 0: 20 ms, 25 ms

// Timer 0 counts units of 64 µs and is looked at, not interrupted by: no time is lost if a look comes 16 ms late.
static uint8_t units_gone(void) {
    static uint8_t before;
    const uint8_t now = TCNT0, gone = now - before;
    before = now;
    return gone;
}

// True once for each millisecond; those that are late come one a turn, and bytes between them.
static bool millisecond_due(uint8_t units) {
    static uint16_t eighths;  // of a millisecond's 15.625 units: 125
    eighths += 8 * units;
    if (eighths < 125) {
        return false;
    }
    eighths -= 125;
    return true;
}

// Servo frames keep their own time: they do not wait for milliseconds that are late.
static void servos(uint8_t units) {
    static uint16_t waited;
    waited += 2 * units;
    if (waited >= FRAME && servo_frame()) {
        if (waited >= LATE_FRAME && hal_late_servos < 255) {
            hal_late_servos++;
        }
        waited = 0;
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
        const uint8_t units = units_gone();
        if (SERVOS) {
            servos(units);
        }
        if (millisecond_due(units)) {
            protocol_millisecond();
        }
        protocol_poll();
        protocol_frame();
    }
}
