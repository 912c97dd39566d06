// The serial line: interrupts fill and empty two rings.
#include <avr/interrupt.h>
#include <avr/io.h>

#include "../chip.h"
#include "../core/hal.h"
#include "avr.h"

#ifndef BAUD
#define BAUD 250000UL
#endif

#ifndef USART_RX_vect  // the Mega numbers its ports
#define USART_RX_vect USART0_RX_vect
#define USART_UDRE_vect USART0_UDRE_vect
#endif

enum { RING = HAL_RECEIVE + 1, MASK = RING - 1, SENDING = RING / 2, SENDING_MASK = SENDING - 1 };
_Static_assert((RING & MASK) == 0, "powers of two");

static uint8_t received[RING], sending[SENDING];
static volatile uint8_t received_head, received_tail, sending_head, sending_tail;

ISR(USART_RX_vect) {
    const uint8_t byte = UDR0;
    const uint8_t head = received_head, next = (head + 1) & MASK;
    if (next != received_tail) {
        received[head] = byte;
        received_head = next;
    } else {
        hal_spilled = true;  // it is lost
    }
}

ISR(USART_UDRE_vect) {
    const uint8_t tail = sending_tail;
    UDR0 = sending[tail];
    const uint8_t next = (tail + 1) & SENDING_MASK;
    sending_tail = next;
    if (next == sending_head) {
        UCSR0B = 1 << RXEN0 | 1 << TXEN0 | 1 << RXCIE0;
    }
}

bool serial_get(uint8_t *byte) {
    const uint8_t tail = received_tail;
    if (tail == received_head) {
        return false;
    }
    *byte = received[tail];
    received_tail = (tail + 1) & MASK;
    return true;
}

uint8_t hal_send_room(void) {
    return SENDING_MASK - ((sending_head - sending_tail) & SENDING_MASK);
}

void hal_send(uint8_t byte) {
    sending[sending_head] = byte;
    sending_head = (sending_head + 1) & SENDING_MASK;
    UCSR0B = 1 << RXEN0 | 1 << TXEN0 | 1 << RXCIE0 | 1 << UDRIE0;
}

void serial_setup(void) {
#if BAUD == 250000UL
    UCSR0A = 0;
    UBRR0 = F_CPU / 16 / BAUD - 1;  // exact
#else
    UCSR0A = 1 << U2X0;
    UBRR0 = (F_CPU / 4 / BAUD - 1) / 2;
#endif
    UCSR0C = 1 << UCSZ01 | 1 << UCSZ00;
    UCSR0B = 1 << RXEN0 | 1 << TXEN0 | 1 << RXCIE0;
}
