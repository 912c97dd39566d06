// The serial line: UART 0 on GP0 and GP1, or the USB. Both listen; answers go where the last byte came from.
#ifdef __arm__
#include "../core/hal.h"
#include "../core/protocol.h"
#include "pico.h"

#ifndef BAUD
#define BAUD 250000UL
#endif

enum { RING = HAL_RECEIVE + 1, MASK = RING - 1, SENDING = 1024, SENDING_MASK = SENDING - 1 };
_Static_assert((RING & MASK) == 0, "powers of two");

enum { RX_EMPTY = 1 << 4, TX_FULL = 1 << 5 };              // FR
enum { RECEIVED = 1 << 4, TIMED_OUT = 1 << 6 };            // IMSC: four bytes wait, or fewer and nothing follows
enum { OVERRUN = 1 << 11 };                                // DR

enum { AT_ONCE = 64 };  // bytes, between two looks at the clock
static uint8_t received[RING], taken[AT_ONCE], sending[SENDING];
static volatile uint16_t received_head, received_tail;
static uint16_t sending_head, sending_tail;
static bool by_usb;

void uart_interrupt(void) {
    while (!(REG(UART_FR) & RX_EMPTY)) {
        const uint32_t data = REG(UART_DR);
        const uint16_t next = (received_head + 1) & MASK;
        if (next == received_tail || data & OVERRUN) {
            hal_spilled = true;
        }
        if (next != received_tail) {
            received[received_head] = data;
            received_head = next;
        }
    }
    REG(UART_ICR) = RECEIVED | TIMED_OUT;
    awake = true;
}

static void speak(bool usb) {
    if (by_usb != usb) {
        by_usb = usb;
        sending_tail = sending_head;  // it was for the other line
    }
}

static uint16_t send_room(void) {
    return SENDING_MASK - ((sending_head - sending_tail) & SENDING_MASK);
}

// Bytes of the line that answers go to wait until there is room for the answers to all of them.
static bool must_wait(bool usb) {
    enum { SHORTEST = 8, ANSWERS = AT_ONCE / SHORTEST * LARGEST_REPLY };
    _Static_assert((int)ANSWERS < (int)SENDING, "there is room for them");
    return by_usb == usb && send_room() < ANSWERS;
}

uint8_t serial_get(const uint8_t **bytes) {
    const uint16_t tail = received_tail, head = received_head;
    if (must_wait(tail == head)) {
        return 0;
    }
    if (tail == head) {
        const uint8_t count = usb_get(bytes);
        if (count) {
            speak(true);
        }
        return count;
    }
    speak(false);
    const uint16_t run = (head > tail ? head : RING) - tail;
    const uint8_t count = run < AT_ONCE ? run : AT_ONCE;
    for (uint8_t n = 0; n < count; n++) {
        taken[n] = received[tail + n];
    }
    *bytes = taken;
    received_tail = (tail + count) & MASK;
    awake = true;  // there may be more
    return count;
}

uint8_t hal_send_room(void) {
    const uint16_t room = send_room();
    return room < 255 ? room : 255;
}

void hal_send(uint8_t byte) {
    sending[sending_head] = byte;
    sending_head = (sending_head + 1) & SENDING_MASK;
}

// A packet is shorter than it may be: a full one would want an empty one behind it (USB 2.0, 5.8.3).
static void pump_usb(void) {
    uint8_t packet[63], length = 0;
    if (!usb_ready()) {
        return;
    }
    while (sending_tail != sending_head && length < sizeof packet) {
        packet[length++] = sending[sending_tail];
        sending_tail = (sending_tail + 1) & SENDING_MASK;
    }
    if (length) {
        usb_send(packet, length);
    }
}

// The UART keeps 32 bytes: 1.3 ms at 250000 baud, and the main loop turns once a millisecond.
void serial_pump(void) {
    if (by_usb) {
        pump_usb();
        return;
    }
    while (sending_tail != sending_head && !(REG(UART_FR) & TX_FULL)) {
        REG(UART_DR) = sending[sending_tail];
        sending_tail = (sending_tail + 1) & SENDING_MASK;
    }
}

void serial_setup(void) {
    enum { EIGHT_BITS = 3 << 5, FIFOS = 1 << 4, ON = 1, TRANSMIT = 1 << 8, RECEIVE_ON = 1 << 9 };
    const uint32_t divider = (SYSTEM_MHZ * 1000000UL * 4 + BAUD / 2) / BAUD;  // 1/64 (DS 4.2.7.1); exact for 250000
    REG(UART_IBRD) = divider >> 6;
    REG(UART_FBRD) = divider & 63;
    REG(UART_LCR_H) = EIGHT_BITS | FIFOS;
    REG(UART_IFLS) = 0;  // 4 bytes
    REG(UART_CR) = ON | TRANSMIT | RECEIVE_ON;
    REG(UART_IMSC) = RECEIVED | TIMED_OUT;
    pin_function(UART_TX_PIN, F_UART, PAD_4MA);
    pin_function(UART_RX_PIN, F_UART, PAD_INPUT | PAD_UP | PAD_SCHMITT);
    irq_enable(IRQ_UART0, 1);
    usb_setup();
}
#endif
