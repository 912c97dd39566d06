/* The boards that can be emulated: which chip, and what hangs on which Arduino pin.
 *
 * Written from the boards' schematics, not from the firmware's own pin maps: two tables that were
 * made apart catch a wrong pin in either. */
#ifndef SIM_BOARDS_H
#define SIM_BOARDS_H

#include <stdbool.h>

enum { CLOCK_HZ = 16000000 };             /* the crystal of each of them */
enum { MAX_AXES = 6, MAX_SERVOS = 6 };

/* One stepper axis; pins are Arduino names ("D5", "A3"), NULL where the board has none. */
typedef struct {
    const char *name, *step, *dir, *enable, *limit;
} board_axis;

typedef struct {
    const char *name;
    const char *mcu;          /* simavr's name of the chip */
    bool mega;                /* Arduino Mega numbering, else Uno */
    int entry_cycles;         /* cycles from an interrupt's acceptance to its vector */
    int vector_rx, vector_udre, vector_tx;
    board_axis axis[MAX_AXES + 1];        /* ends with a NULL name */
    const char *servo[MAX_SERVOS + 1];    /* ends with NULL */
} board;

extern const board boards[];              /* ends with a NULL name */

const board *board_find(const char *name);

/* The port letter and bit behind an Arduino pin name, or behind a chip name such as "PC3". */
bool board_pin(const board *b, const char *name, char *port, int *bit);

#endif
