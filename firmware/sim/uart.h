/* USART0 of the chip, in place of libsimavr's.
 *
 * libsimavr 1.6 counts 11 bits a byte, notes the speed only when UBRRL is written and has an elastic
 * 64-byte receive FIFO, so it never overruns. This model follows the data sheet: 10 bits a byte, the
 * speed at the moment a byte starts, a receive buffer of two bytes behind the shift register, data
 * overrun (DOR) when a start bit meets all three full, a transmit buffer of one byte. */
#ifndef SIM_UART_H
#define SIM_UART_H

#include <stdint.h>
#include <stdio.h>

#include "chip.h"

void uart_attach(struct avr_t *avr, reset_kind kind);     /* take over the registers of a chip that was just made */
void uart_start(void);                    /* bytes may wait on the line */
size_t uart_swallow(void);                /* drop them: a bootloader has the chip, or nobody; how many */
void uart_clear(void);                    /* zero the counters */
void uart_json(FILE *out);

#endif
