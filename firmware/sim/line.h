/* The serial cable between the host and the board's UART: a queue a direction, noise, cuts. */
#ifndef SIM_LINE_H
#define SIM_LINE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

enum { LINE_IN, LINE_OUT };               /* host to board, board to host */
enum { LINE_EMPTY = -1, LINE_LOST = -2 };

typedef struct {
    double flip, drop;                    /* probability per byte: one bit inverted; byte vanished */
    bool cut;
    uint64_t random;                      /* state of the generator, never 0 */
    uint64_t bytes, flipped, dropped, cut_off;
} line_noise;

extern line_noise line_way[2];

/* True bits per second of the host's side; 0 = the standard rate nearest to the board's. */
extern double line_host_baud;

/* A byte towards the host that the one who runs the board waits for; -1: none. */
extern int line_stop_byte;

void line_seed(int way, uint64_t seed);

/* Host side. */
void line_feed(const uint8_t *bytes, size_t n);       /* queue bytes towards the board */
size_t line_queued(void);                             /* bytes not yet sent towards the board */
size_t line_collect(uint8_t *bytes, size_t room);     /* take what the board has sent */
size_t line_waiting(void);
void line_discard(int way);                           /* forget what is queued */

/* UART side. */
int line_next(void);                  /* next byte towards the board, LINE_EMPTY, or LINE_LOST: a byte-time of silence */
bool line_put(uint8_t byte);          /* a byte from the board; true: the host has it, and it is `line_stop_byte` */

void line_json(FILE *out);

#endif
