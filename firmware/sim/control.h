/* The control channel: one command a line, one line of JSON back. commands.h knows the commands. */
#ifndef SIM_CONTROL_H
#define SIM_CONTROL_H

#include <poll.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

enum { CONTROL_FDS = 10, CONTROL_LONGEST = 1 << 20 };   /* descriptors at most; bytes of a line at most */

extern bool control_quit;
extern bool control_stepped;              /* time moves by `run` only */

bool control_listen(const char *path);    /* a UNIX socket */
void control_stdin(bool until_end);       /* read commands from standard input; its end quits if `until_end` */
void control_end(void);
int control_wait_for(struct pollfd *fds); /* at most CONTROL_FDS */
void control_service(void);

/* Run the chip and what `after` has put off until then. */
void control_run_until(uint64_t cycle);

/* Carry out one command without an answer; errors go to standard error. */
bool control_do(char *command);

/* Carry out a command at that cycle; false: too many wait. */
bool control_later(uint64_t cycle, const char *command);

#endif
