/* Interrupts: what libsimavr leaves out of them, and how long they take. */
#ifndef SIM_INTERRUPTS_H
#define SIM_INTERRUPTS_H

#include <stdint.h>
#include <stdio.h>

#include "chip.h"

void interrupts_attach(struct avr_t *avr, reset_kind kind);

/* When the interrupt that is being served was raised; 0 outside of interrupts. */
uint64_t interrupts_raised(void);

void interrupts_clear(void);              /* zero the figures */
void interrupts_json(FILE *out);          /* member "interrupts" */

#endif
