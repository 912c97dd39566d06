/* What drives the chip's input pins: levels set by hand, and limit switches that the axes run into. */
#ifndef SIM_INPUTS_H
#define SIM_INPUTS_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "chip.h"

enum { INPUT_LOW = 0, INPUT_HIGH = 1, INPUT_RELEASED = -1 };

typedef struct {
    const char *pin;          /* Arduino name */
    int axis;
    int64_t at;               /* closes when the axis's net steps are ... */
    bool below;               /* ... at or below this, else at or above */
    bool normally_closed;     /* contact to ground opens when pressed */
    uint64_t bounce;          /* cycles during which the contact chatters */
} switch_setup;

void inputs_attach(struct avr_t *avr, reset_kind kind);   /* drive the pins of a chip that was just made */
bool inputs_drive(const char *pin, int level);            /* false: no such pin */
int inputs_set_switch(const switch_setup *s);             /* false: no such pin, or too many */
bool inputs_force_switch(const char *pin, int pressed);   /* 1 pressed, 0 not, -1 by position again */
void inputs_moved(int axis, int64_t position);            /* the axis made a step */
void inputs_json(FILE *out);                              /* member "inputs" */

#endif
