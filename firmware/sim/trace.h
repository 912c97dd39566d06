/* The record of all that happens at the chip's pins and on the line; its format: README.md. */
#ifndef SIM_TRACE_H
#define SIM_TRACE_H

#include <stdbool.h>
#include <stdint.h>

#include "chip.h"

struct avr_t;

/* Signals are numbered in the order of their names. Before this call, records go nowhere. */
bool trace_open(const char *path, const char *board_name, const char *const *signals, int count);
void trace_flush(void);

void trace_signal(int signal, bool level);
void trace_input(int input, int level);   /* 8 * port (A = 0) + bit */
void trace_byte(int way, uint8_t byte);   /* LINE_IN, LINE_OUT */
void trace_reset(struct avr_t *avr, reset_kind kind);
void trace_mark(uint8_t value);

#endif
