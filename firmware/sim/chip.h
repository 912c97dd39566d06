/* The chip: libsimavr's core with the board's program, resets and memory.
 *
 * One process emulates one board, so the modules keep their state to themselves. Time is counted in
 * cycles of the 16 MHz crystal since power was first applied; resets do not turn it back. */
#ifndef SIM_CHIP_H
#define SIM_CHIP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "boards.h"

struct avr_t;
struct avr_int_vector_t;

typedef enum { RESET_POWER, RESET_BROWNOUT, RESET_EXTERNAL, RESET_WATCHDOG } reset_kind;

/* What hangs on the chip; main.c lists the parts. */
typedef struct {
    void (*attach)(struct avr_t *avr, reset_kind kind);   /* a reset has just made this chip */
    void (*start)(void);                  /* the program is about to run on; NULL: no matter */
    size_t (*swallow)(void);              /* nobody reads the line: drop what waits on it, return how much; NULL: no matter */
} chip_part;

extern const board *chip_board;
extern struct avr_t *chip;                /* replaced at every reset */
extern bool chip_stop;                    /* set it to make chip_run_until return early */

/* A bootloader runs first for this many ms after an external reset, swallows what arrives meanwhile,
 * uses the top of the SRAM and clears MCUSR before any start of the program; negative: there is none. */
extern double chip_bootloader_ms;

/* `parts` ends with one without `attach`. */
bool chip_load(const board *b, const char *elf, uint64_t seed, const chip_part *parts);
void chip_reset(reset_kind kind);
void chip_run_until(uint64_t cycle);
uint64_t chip_now(void);
const char *chip_state(void);             /* "running", "bootloader", "stopped", "crashed" */

struct avr_int_vector_t *chip_vector(int number);

/* The chip's data space. */
bool chip_peek(long address, uint8_t *bytes, int n);
bool chip_poke(long address, const uint8_t *bytes, int n);

void chip_json(FILE *out);                /* members, without braces */

#endif
