/* What the board's outputs do: every edge recorded, step counts, pulse widths and violations of the driver's timing. */
#ifndef SIM_PINS_H
#define SIM_PINS_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "boards.h"
#include "chip.h"

/* The least times a stepper driver asks for, in nanoseconds (data sheets), and its wake-up. */
typedef struct {
    const char *name;
    int high_ns, low_ns, setup_ns, hold_ns, wake_us;
} driver;

extern const driver drivers[];            /* ends with a NULL name */

/* `stepped` is called after every step, with the axis's net steps. */
void pins_init(const board *b, const driver *d, void (*stepped)(int axis, int64_t position));
bool pins_trace_to(const char *path);     /* false: errno says why */

void pins_attach(struct avr_t *avr, reset_kind kind);     /* watch the ports of a chip that was just made */
void pins_clear(void);                    /* zero all figures but the positions */

int pins_axis(const char *name);          /* index, or -1 */
int64_t pins_position(int axis);          /* net steps since power-on of the emulator; positive = DIR low */

void pins_json(FILE *out);                /* members "axes" and "servos" */

#endif
