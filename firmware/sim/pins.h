/* What the pins do: every edge recorded, step counts, pulse widths and violations of the driver's timing. */
#ifndef SIM_PINS_H
#define SIM_PINS_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "boards.h"

struct avr_t;

/* The least times a stepper driver asks for, in nanoseconds (data sheets), and its wake-up. */
typedef struct {
    const char *name;
    int high_ns, low_ns, setup_ns, hold_ns, wake_us;
} driver;

extern const driver drivers[];            /* ends with a NULL name */

void pins_init(const board *b, const driver *d);
bool pins_trace_open(const char *path);
void pins_trace_flush(void);

void pins_attach(struct avr_t *avr);      /* watch the ports of a chip that was just made */
void pins_clear(void);                    /* zero all figures but the positions */

int pins_axis(const char *name);          /* index, or -1 */
int64_t pins_position(int axis);          /* net steps since power-on of the emulator; positive = DIR low */

/* Records in the trace that are no edges of the board's outputs. */
void pins_trace_byte(int way, uint8_t byte);
void pins_trace_reset(int kind);
void pins_trace_mark(uint8_t value);
void pins_trace_input(int input, int level);

void pins_json(FILE *out);                /* members "axes" and "servos" */

#endif
