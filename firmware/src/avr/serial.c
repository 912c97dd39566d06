// The serial line: interrupts fill and empty two rings.
#include <avr/interrupt.h>
#include <avr/io.h>

#include "../chip.h"
#include "../core/hal.h"
#include "../core/protocol.h"
#include "avr.h"

#ifndef BAUD
#define BAUD 250000UL
#endif

#ifndef USART_RX_vect  // the Mega numbers its ports
#define USART_RX_vect USART0_RX_vect
#define USART_UDRE_vect USART0_UDRE_vect
#endif

enum { RING = HAL_RECEIVE + 1, SENDING = AXES > 8 ? 128 : 64, SENDING_MASK = SENDING - 1 };
_Static_assert(RING <= 256, "8 bits count it");
_Static_assert(SENDING_MASK >= (int)LARGEST_REPLY, "an answer fits");

static uint8_t received[RING], sending[SENDING];
static volatile uint8_t received_head, received_tail, sending_head, sending_tail;

#if RECEIVE == 255
#define WRAP  // 8 bits do so by themselves
#else
#define WRAP                 \
    "cpi r24, %[ring]\n\t" \
    "brne 1f\n\t"          \
    "ldi r24, 0\n"          \
    "1:"
#endif

// By hand, as a tick may come while it runs: 21 cycles shorter than gcc's.
ISR(USART_RX_vect, ISR_NAKED) {
    __asm__ volatile(
        "push r24\n\t"
        "in r24, __SREG__\n\t"
        "push r24\n\t"
        "push r30\n\t"
        "push r31\n\t"
        "lds r24, %[status]\n\t"
        "sbrc r24, %[overrun]\n\t"  // a byte was lost before this one: this interrupt came too late
        "sts %[spilled], r24\n\t"
        "lds r30, %[head]\n\t"
        "mov r24, r30\n\t"
        "inc r24\n\t" WRAP
        "lds r31, %[tail]\n\t"
        "cp r24, r31\n\t"
        "breq 2f\n\t"
        "sts %[head], r24\n\t"
        "lds r24, %[data]\n\t"
        "ldi r31, 0\n\t"
        "subi r30, lo8(-(%[ring_]))\n\t"
        "sbci r31, hi8(-(%[ring_]))\n\t"
        "st Z, r24\n"
        "3:\n\t"
        "pop r31\n\t"
        "pop r30\n\t"
        "pop r24\n\t"
        "out __SREG__, r24\n\t"
        "pop r24\n\t"
        "reti\n"
        "2:\n\t"
        "lds r24, %[data]\n\t"  // it is lost
        "ldi r24, 1\n\t"
        "sts %[spilled], r24\n\t"
        "rjmp 3b\n"
        :
        : [status] "n"(_SFR_MEM_ADDR(UCSR0A)), [overrun] "n"(DOR0), [data] "n"(_SFR_MEM_ADDR(UDR0)), [head] "i"(&received_head), [spilled] "i"(&hal_spilled),
          [tail] "i"(&received_tail), [ring_] "i"(received), [ring] "n"(RING));
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

uint8_t serial_waiting(const uint8_t **bytes) {
    const uint8_t tail = received_tail, head = received_head;
    *bytes = &received[tail];
    return head >= tail ? head - tail : RING - tail;
}

void serial_taken(uint8_t count) {
    const uint16_t tail = received_tail + count;
    received_tail = tail == RING ? 0 : tail;
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
