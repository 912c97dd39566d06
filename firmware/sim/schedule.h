/* Time that passes: the chip runs, and commands that were put off until then are carried out. */
#ifndef SIM_SCHEDULE_H
#define SIM_SCHEDULE_H

#include <stdbool.h>
#include <stdint.h>

extern bool schedule_quit;                /* set it to end the emulator */

/* Put a command off until that cycle; false: too many wait. */
bool schedule_later(uint64_t cycle, const char *command);

/* Run the chip until that cycle; `carry_out` gets each command at its own, in a text that it may take apart. */
void schedule_run_until(uint64_t cycle, bool (*carry_out)(char *command));

#endif
