/* The control channel: one command a line, one line of JSON back. commands.h knows the commands. */
#ifndef SIM_CONTROL_H
#define SIM_CONTROL_H

#include <poll.h>
#include <stdbool.h>

enum { CONTROL_FDS = 10 };                /* descriptors at most */

bool control_listen(const char *path);    /* a UNIX socket */
void control_stdin(bool until_end);       /* read commands from standard input; its end quits if `until_end` */
void control_end(void);
int control_wait_for(struct pollfd *fds); /* at most CONTROL_FDS */
void control_service(void);

#endif
