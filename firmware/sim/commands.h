/* The commands of the control channel; README.md says what they do. */
#ifndef SIM_COMMANDS_H
#define SIM_COMMANDS_H

#include <stdbool.h>
#include <stdio.h>

enum { COMMANDS_MOST_BYTES = 1 << 19 };   /* that a command puts on the line */

/* Carry out one command (the line is taken apart), write its reply: one line of JSON. */
void commands_execute(char *line, FILE *reply);

/* Carry out one command without an answer; errors go to standard error. */
bool commands_do(char *line);

void commands_stats(FILE *out);

#endif
