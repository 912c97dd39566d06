/* How fast simulated time runs. */
#ifndef SIM_PACE_H
#define SIM_PACE_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

extern bool pace_stepped;                 /* simulated time moves by the command `run` only */
extern double pace_speed;                 /* simulated per real second; 0: as fast as possible */

/* At speed 0, how far simulated time may run away from the host, in cycles after its last byte. */
extern uint64_t pace_ahead;

/* How long simulated time waits for a host that has the port open and is silent: it stands so many cycles after the
 * host's last byte, sooner if it was not silent for a third as long lately; 0: it does not wait. A host that the computer gives no time is no silent host. */
extern uint64_t pace_patience;
extern bool pace_host_is_there;           /* has the port open */

void pace_reset(void);
void pace_host_spoke(void);
int64_t pace_wait(void);                  /* nanoseconds to wait before simulating on */
void pace_json(FILE *out);

#endif
