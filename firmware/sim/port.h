/* The pseudo-terminal that stands for the board's USB serial port. */
#ifndef SIM_PORT_H
#define SIM_PORT_H

#include <poll.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

/* Opening the port resets the board, as DTR does on an Uno or Mega (a PTY has no DTR line). */
extern bool port_reset_on_open;

bool port_start(const char *link);         /* link: a name for the port, or NULL */
void port_end(void);
const char *port_path(void);               /* what to give to --port */
int port_wait_for(struct pollfd *fds);     /* fill in what poll() shall wait for; at most 2 */
bool port_service(void);                   /* move bytes; true: the host has sent some */
void port_look(void);                      /* see who has opened and closed the port up to now */
bool port_is_open(void);
void port_json(FILE *out);

#endif
