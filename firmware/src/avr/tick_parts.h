// Parts of the tick by hand that are made for each motor: see short_tick.h, which says what the registers hold.
#pragma once

#define A(text, ...) __asm__ volatile(text : : __VA_ARGS__)
#define MEM(reg) "n"(_SFR_MEM_ADDR(reg))
#define FIELD(name) "n"(offsetof(struct segment, name))

// Ports beyond sbi's reach are rewritten: nothing else interrupts.
#define RAISE(i, port, bit, ...)    \
    A(".if %[p] < 0x40\n\t"         \
      "sbrc r24, %[n]\n\t"          \
      "sbi %[p] - 0x20, %[b]\n\t"   \
      ".else\n\t"                   \
      "lds r25, %[p]\n\t"           \
      "sbrc r24, %[n]\n\t"          \
      "ori r25, 1 << %[b]\n\t"      \
      "sts %[p], r25\n\t"           \
      ".endif",                     \
      [n] "n"(i), [p] MEM(PORT##port), [b] "n"(bit));

#define LOWER(i, port, bit, ...)          \
    A(".if %[p] < 0x40\n\t"               \
      "cbi %[p] - 0x20, %[b]\n\t"         \
      ".else\n\t"                         \
      "lds r25, %[p]\n\t"                 \
      "andi r25, 0xFF - (1 << %[b])\n\t"  \
      "sts %[p], r25\n\t"                 \
      ".endif",                           \
      [p] MEM(PORT##port), [b] "n"(bit));

// One byte of a sum in memory.
#define SUM(add, to, from) "lds r24, " to "\n\tlds r25, " from "\n\t" add " r24, r25\n\tsts " to ", r24\n\t"

#define PHASE(i, ...)                                                                                            \
    A(SUM("add", "%[p]", "%[q]") SUM("adc", "%[p]+1", "%[q]+1") SUM("adc", "%[p]+2", "%[q]+2") "brcc 1f\n\t" \
      "ori r23, 1 << %[n]\n"                                                                                     \
      "1:",                                                                                                      \
      [p] "i"(&dda.phase[i]), [q] "i"(&dda.rate[i]), [n] "n"(i));

// The same where no rate has a low byte.
#define PHASE_COARSE(i, ...)                                                    \
    A(SUM("add", "%[p]+1", "%[q]+1") SUM("adc", "%[p]+2", "%[q]+2") "brcc 1f\n\t" \
      "ori r23, 1 << %[n]\n"                                                     \
      "1:",                                                                      \
      [p] "i"(&dda.phase[i]), [q] "i"(&dda.rate[i]), [n] "n"(i));

// At rest: half a step. r22 is 0.
#define REST(i, ...)          \
    A("sts %[p], r22\n\t"     \
      "sts %[p]+1, r22\n\t"   \
      "sts %[p]+2, r24",      \
      [p] "i"(&dda.phase[i]));

// Of a segment's rate: 2^-24 step (fine) or 2^-16, for an axis; and its phase, if it turns round. r22 is 0, r20 `fine`, r21 who turns.
#define TAKE_RATE(i, ...)              \
    A("ldd r24, Z+%[at]\n\t"           \
      "ldd r25, Z+%[at]+1\n\t"         \
      "sbrc r20, %[n]\n\t"             \
      "rjmp 1f\n\t"                    \
      "sts %[q], r22\n\t"              \
      "sts %[q]+1, r24\n\t"            \
      "sts %[q]+2, r25\n\t"            \
      "rjmp 2f\n"                      \
      "1:\n\t"                         \
      "sts %[q], r24\n\t"              \
      "sts %[q]+1, r25\n\t"            \
      "sts %[q]+2, r22\n"              \
      "2:\n\t"                         \
      "sbrs r21, %[n]\n\t"             \
      "rjmp 3f\n\t"                    \
      "lds r24, %[p]\n\t"              \
      "ldi r25, 0xFE\n\t"              \
      "eor r24, r25\n\t"               \
      "sts %[p], r24\n\t"              \
      "lds r24, %[p]+1\n\t"            \
      "com r24\n\t"                    \
      "sts %[p]+1, r24\n\t"            \
      "lds r24, %[p]+2\n\t"            \
      "com r24\n\t"                    \
      "sts %[p]+2, r24\n"              \
      "3:",                            \
      [at] "n"(offsetof(struct segment, rate) + 2 * (i)), [q] "i"(&dda.rate[i]), [p] "i"(&dda.phase[i]), [n] "n"(i));

// r24: who puts DIR high.
#define DIRECT(i, step_port, step_bit, port, bit) \
    A(".if %[p] < 0x40\n\t"                       \
      "sbrc r24, %[n]\n\t"                        \
      "sbi %[p] - 0x20, %[b]\n\t"                 \
      "sbrs r24, %[n]\n\t"                        \
      "cbi %[p] - 0x20, %[b]\n\t"                 \
      ".else\n\t"                                 \
      "lds r25, %[p]\n\t"                         \
      "andi r25, 0xFF - (1 << %[b])\n\t"          \
      "sbrc r24, %[n]\n\t"                        \
      "ori r25, 1 << %[b]\n\t"                    \
      "sts %[p], r25\n\t"                         \
      ".endif",                                   \
      [n] "n"(i), [p] MEM(PORT##port), [b] "n"(bit));
