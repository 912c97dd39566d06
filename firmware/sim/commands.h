/* The commands of the control channel; README.md says what they do. */
#ifndef SIM_COMMANDS_H
#define SIM_COMMANDS_H

#include <stdio.h>

/* Carry out one command (the line is taken apart), write its reply: one line of JSON. */
void commands_execute(char *line, FILE *reply);

void commands_stats(FILE *out);

#endif
