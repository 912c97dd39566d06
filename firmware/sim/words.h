/* The words of a command line. */
#ifndef SIM_WORDS_H
#define SIM_WORDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

void words_begin(char *line);             /* it is taken apart in place */
const char *word(void);                   /* the next one, "" at the end; safe inside a JSON string */
const char *words_rest(void);             /* what follows the last word */

bool word_number(const char *text, double *v);
bool word_integer(const char *text, long long *v);
bool word_time(const char *text, uint64_t *cycles);       /* "3ms", "250us", "2s", "800cycles", "800" (cycles) */
long word_bytes(const char *text, uint8_t *bytes, size_t room);    /* hexadecimal; the number of bytes, or -1 */

#endif
