// The tick interrupt by hand, in two thirds of the time that gcc's takes: any tick but the first and the last of a motion, and those of
// which homing watches a switch. These go to __vector_tick(), in C, behind their step edges. What is done here is what is done there.
//
// r22 low byte of the timer when STEP rose, r23 step bits, r24 and r25 whatever is at hand. No other register is touched,
// but where a segment is taken up, and in a hold.
#pragma once

_Static_assert(STEP_HIGH_MAX * 8 / 5 < 165, "see below");

#define A(text, ...) __asm__ volatile(text : : __VA_ARGS__)
#define MEM(reg) "n"(_SFR_MEM_ADDR(reg))

// Ports beyond sbi's reach are rewritten: nothing else interrupts.
#define RAISE(i, port, bit, ...)                                \
    A(".if %[p] < 0x40\n\t"                                     \
      "sbrc r24, %[n]\n\t"                                      \
      "sbi %[p] - 0x20, %[b]\n\t"                               \
      ".else\n\t"                                               \
      "push r25\n\t"                                            \
      "lds r25, %[p]\n\t"                                       \
      "sbrc r24, %[n]\n\t"                                      \
      "ori r25, 1 << %[b]\n\t"                                  \
      "sts %[p], r25\n\t"                                       \
      "pop r25\n\t"                                             \
      ".endif",                                                 \
      [n] "n"(i), [p] MEM(PORT##port), [b] "n"(bit));

#define LOWER(i, port, bit, ...)                                \
    A(".if %[p] < 0x40\n\t"                                     \
      "cbi %[p] - 0x20, %[b]\n\t"                               \
      ".else\n\t"                                               \
      "lds r25, %[p]\n\t"                                       \
      "andi r25, 0xFF - (1 << %[b])\n\t"                        \
      "sts %[p], r25\n\t"                                       \
      ".endif",                                                 \
      [p] MEM(PORT##port), [b] "n"(bit));

// One byte of a sum in memory.
#define SUM(add, to, from) "lds r24, " to "\n\tlds r25, " from "\n\t" add " r24, r25\n\tsts " to ", r24\n\t"

#define PHASE(i, ...)                                                                                     \
    A(SUM("add", "%[p]", "%[q]") SUM("adc", "%[p]+1", "%[q]+1") SUM("adc", "%[p]+2", "%[q]+2") "brcc 1f\n\t" \
      "ori r23, 1 << %[n]\n"                                                                              \
      "1:",                                                                                               \
      [p] "i"(&dda.phase[i]), [q] "i"(&dda.rate[i]), [n] "n"(i));

// Of a segment's rate: 2^-24 step (fine) or 2^-16, for an axis; and its phase, if it turns round. r1 is 0, r20 `fine`, r21 who turns.
#define TAKE_RATE(i, ...)              \
    A("ldd r24, Z+%[at]\n\t"           \
      "ldd r25, Z+%[at]+1\n\t"         \
      "sbrc r20, %[n]\n\t"             \
      "rjmp 1f\n\t"                    \
      "sts %[q], r1\n\t"               \
      "sts %[q]+1, r24\n\t"            \
      "sts %[q]+2, r25\n\t"            \
      "rjmp 2f\n"                      \
      "1:\n\t"                         \
      "sts %[q], r24\n\t"              \
      "sts %[q]+1, r25\n\t"            \
      "sts %[q]+2, r1\n"               \
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

#define FIELD(name) "n"(offsetof(struct segment, name))

ISR(TIMER1_COMPA_vect, ISR_NAKED) {
    A("push r24\n\t"
      "in r24, __SREG__\n\t"
      "push r24\n\t"
      "lds r24, %[bits]",
      [bits] "i"(&dda.bits));
    STEPPER_PINS(RAISE)
    A("push r25\n\t"
      "push r23\n\t"
      "push r22\n\t"
      "lds r24, %[probe]\n\t"
      "tst r24\n\t"
      "brne short_long\n\t"
      "lds r24, %[left]\n\t"
      "lds r25, %[left]+1\n\t"
      "sbiw r24, 1\n\t"
      "brcs 1f\n\t"
      "sts %[left]+1, r25\n\t"
      "sts %[left], r24\n\t"
      "rjmp short_timer\n"
      "1:\n\t"
      "lds r23, %[tail]\n\t"
      "inc r23\n\t"
      "lds r25, %[head]\n\t"
      "cp r23, r25\n\t"
      "breq short_long\n\t"
      "lds r25, %[back]+%[top]\n\t"
      "sbrs r25, 7\n\t"  // LAST: phases begin anew
      "rjmp short_load\n"
      "short_long:\n\t"
      "pop r22\n\t"
      "pop r23\n\t"
      "pop r25\n\t"
      "pop r24\n\t"
      "out __SREG__, r24\n\t"
      "pop r24\n\t"
      "jmp %x[tick]",
      [probe] "i"(&dda.probe), [left] "i"(&dda.left), [tail] "i"(&queue_tail), [head] "i"(&queue_head), [back] "i"(&dda.back),
      [top] "n"(sizeof(axes_t) - 1), [tick] "i"(__vector_tick));

    // a segment is taken up, as by dda_load()
    A("short_load:\n\t"
      "push r31\n\t"
      "push r30\n\t"
      "push r21\n\t"
      "push r20\n\t"
      "push r1\n\t"
      "push r0\n\t"
      "sts %[tail], r23\n\t"
      "andi r23, %[mask]\n\t"
      "ldi r25, %[size]\n\t"
      "mul r23, r25\n\t"
      "movw r30, r0\n\t"
      "clr r1\n\t"
      "subi r30, lo8(-(%[queue]))\n\t"
      "sbci r31, hi8(-(%[queue]))\n\t"
      "sts %[now], r30\n\t"
      "sts %[now]+1, r31\n\t"
      "ldd r21, Z+%[back]+%[top]\n\t"
      "ldd r24, Z+%[bend]\n\t"
      "ldd r25, Z+%[bend]+1\n\t"
      "mov r20, r25\n\t"
      "lsl r20\n\t"
      "sbc r20, r20\n\t"  // its sign
      "sts %[grow]+3, r20\n\t"
      "sbrc r21, 6\n\t"
      "rjmp 1f\n\t"
      "lsl r24\n\t"
      "rol r25\n\t"
      "rol r20\n\t"
      "lsl r24\n\t"
      "rol r25\n\t"
      "rol r20\n\t"
      "sts %[grow], r24\n\t"
      "sts %[grow]+1, r25\n\t"
      "sts %[grow]+2, r20\n\t"
      "rjmp 2f\n"
      "1:\n\t"  // QUICK: 128 times it
      "asr r25\n\t"
      "ror r24\n\t"
      "sts %[grow]+2, r25\n\t"
      "sts %[grow]+1, r24\n\t"
      "mov r24, r1\n\t"
      "ror r24\n\t"
      "sts %[grow], r24\n"
      "2:",
      [mask] "n"(QUEUE_SLOTS - 1), [size] "n"(sizeof(struct segment)), [queue] "i"(queue), [back] FIELD(back), [bend] FIELD(bend),
      [top] "n"(sizeof(axes_t) - 1), [grow] "i"(&dda.grow), [tail] "i"(&queue_tail), [now] "i"(&dda.now));
    A("ldd r24, Z+%[first]\n\t"
      "ldd r25, Z+%[first]+1\n\t"
      "sts %[ocr]+1, r25\n\t"  // by the interval before, the timer would fire too early
      "sts %[ocr], r24\n\t"
      "sts %[interval]+2, r24\n\t"
      "sts %[interval]+3, r25\n\t"
      "sts %[interval], r1\n\t"
      "sts %[interval]+1, r1\n\t"
      "ldd r24, Z+%[add]\n\t"
      "sts %[sum]+1, r24\n\t"
      "ldd r24, Z+%[add]+1\n\t"
      "sts %[sum]+2, r24\n\t"
      "ldd r24, Z+%[add]+2\n\t"
      "sts %[sum]+3, r24\n\t"
      "sts %[sum], r1\n\t"
      "ldd r20, Z+%[fine]\n\t"
      ".if %[top]\n\t"
      "sts %[back]+%[top], r21\n\t"
      ".endif\n\t"
      "ldd r24, Z+%[from]\n\t"
      "lds r21, %[back]\n\t"
      "eor r21, r24\n\t"
      "sts %[back], r24",
      [first] FIELD(interval), [ocr] MEM(OCR1AL), [interval] "i"(&dda.interval), [add] FIELD(add), [sum] "i"(&dda.add),
      [fine] FIELD(fine), [from] FIELD(back), [back] "i"(&dda.back), [top] "n"(sizeof(axes_t) - 1));
    STEPPER_PINS(TAKE_RATE)
    A("andi r21, %[axes]\n\t"
      "breq short_straight\n\t"
      "lds r24, %[back]\n\t"
      "lds r25, %[invert]\n\t"
      "eor r24, r25",
      [axes] "n"(STEPPER_AXES), [back] "i"(&dda.back), [invert] "i"(&direction_invert));
    STEPPER_PINS(DIRECT)
    A("short_straight:");
    STEPPER_PINS(LOWER)  // 165 cycles behind the edge at least: longer than STEP_HIGH_MAX
    A("ldd r24, Z+%[ticks]\n\t"
      "ldd r25, Z+%[ticks]+1\n\t"
      "sbiw r24, 1\n\t"
      "sts %[left]+1, r25\n\t"
      "sts %[left], r24\n\t"
      "pop r0\n\t"
      "pop r1\n\t"
      "pop r20\n\t"
      "pop r21\n\t"
      "pop r30\n\t"
      "pop r31\n"
      "short_timer:",
      [ticks] FIELD(ticks), [left] "i"(&dda.left));

    // the timer, while there is plenty of time: OCR1A = interval - 1; a tick that is all but over, or over, would come a turn later
    A("lds r23, %[interval]+2\n\t"
      "lds r24, %[interval]+3\n\t"
      "lds r22, %[stretch]\n\t"
      "lds r25, %[stretch]+1\n\t"
      "subi r25, 1\n\t"
      "or r25, r22\n\t"
      "breq 2f\n\t"
      "lds r25, %[stretch]+1\n\t"  // a hold: interval * stretch >> 8, 65535 at most
      "push r0\n\t"
      "push r1\n\t"
      "push r20\n\t"
      "push r21\n\t"
      "mul r23, r22\n\t"
      "mov r20, r1\n\t"
      "mul r24, r25\n\t"
      "mov r21, r0\n\t"
      "tst r1\n\t"
      "brne 3f\n\t"
      "mul r23, r25\n\t"
      "add r20, r0\n\t"
      "adc r21, r1\n\t"
      "brcs 3f\n\t"
      "mul r24, r22\n\t"
      "add r20, r0\n\t"
      "adc r21, r1\n\t"
      "brcc 4f\n"
      "3:\n\t"
      "ldi r20, 0xFF\n\t"
      "ldi r21, 0xFF\n"
      "4:\n\t"
      "movw r24, r20\n\t"
      "mov r23, r24\n\t"
      "mov r24, r25\n\t"
      "pop r21\n\t"
      "pop r20\n\t"
      "pop r1\n\t"
      "pop r0\n"
      "2:\n\t"
      "subi r23, 1\n\t"
      "sbci r24, 0\n\t"
      "sts %[ocr]+1, r24\n\t"
      "sts %[ocr], r23\n\t"
      "lds r22, %[now]\n\t"
      "lds r25, %[now]+1\n\t"
      "tst r25\n\t"
      "breq 1f\n\t"
      "subi r22, -7\n\t"
      "sbci r25, -1\n\t"
      "cp r22, r23\n\t"
      "cpc r25, r24\n\t"
      "brcs 1f\n\t"
      "ldi r22, 0\n\t"
      "sts %[now]+1, r22\n\t"
      "sts %[now], r22\n\t"
      "lds r24, %[late]\n\t"
      "ori r24, 1\n\t"
      "sts %[late], r24\n"
      "1:",
      [interval] "i"(&dda.interval), [stretch] "i"(&dda.stretch), [ocr] MEM(OCR1AL), [now] MEM(TCNT1L), [late] "i"(&dda.overruns));

    // interval += add >> 8
    A(SUM("add", "%[i]", "%[a]+1") SUM("adc", "%[i]+1", "%[a]+2") SUM("adc", "%[i]+2", "%[a]+3") "lds r24, %[i]+3\n\t"
      "sbrc r25, 7\n\t"
      "rjmp 1f\n\t"
      "ldi r25, 0\n\t"
      "rjmp 2f\n"
      "1: ldi r25, 0xFF\n"
      "2: adc r24, r25\n\t"
      "sts %[i]+3, r24",
      [i] "i"(&dda.interval), [a] "i"(&dda.add));

    // add += grow, with every block of ticks or, QUICK, with each
    A("lds r24, %[left]\n\t"
      "andi r24, %[block] - 1\n\t"
      "breq 1f\n\t"
      "lds r24, %[back]\n\t"
      "sbrs r24, 6\n\t"
      "rjmp 2f\n"
      "1:\n\t" SUM("add", "%[a]", "%[g]") SUM("adc", "%[a]+1", "%[g]+1") SUM("adc", "%[a]+2", "%[g]+2") SUM("adc", "%[a]+3", "%[g]+3")
      "2:\n\t"
      "ldi r23, 0",
      [left] "i"(&dda.left), [block] "n"(BLOCK), [back] "i"((uint8_t *)&dda.back + sizeof dda.back - 1), [a] "i"(&dda.add),
      [g] "i"(&dda.grow));

    STEPPER_PINS(PHASE)
    A("sts %[bits], r23\n"
      "1:\n\t"
      "lds r24, %[now]\n\t"
      "sub r24, r22\n\t"
      "lds r25, %[high]\n\t"
      "cp r24, r25\n\t"
      "brcs 1b",
      [bits] "i"(&dda.bits), [now] MEM(TCNT1L), [high] "i"(&step_high));
    STEPPER_PINS(LOWER)
    A("sbis %[flags], %[due]\n\t"
      "rjmp 1f\n\t"
      "lds r24, %[now]\n\t"
      "lds r25, %[now]+1\n\t"
      "subi r24, %[allowed] + 1\n\t"
      "sbci r25, 0\n\t"
      "brcs 1f\n\t"
      "lds r24, %[late]\n\t"
      "subi r24, -1\n\t"
      "breq 1f\n\t"
      "sts %[late], r24\n"
      "1:\n\t"
      "pop r22\n\t"
      "pop r23\n\t"
      "pop r25\n\t"
      "pop r24\n\t"
      "out __SREG__, r24\n\t"
      "pop r24\n\t"
      "reti",
      [flags] "I"(_SFR_IO_ADDR(TIFR1)), [due] "n"(OCF1A), [now] MEM(TCNT1L), [allowed] "n"(LATE), [late] "i"(&dda.overruns));
}

#undef A
#undef MEM
