// The tick interrupt by hand, in two thirds of the time that gcc's takes: all ticks but those of which homing watches a switch, and those
// behind which the queue has nothing ready. These go to __vector_tick(), in C, behind their step edges. What is done here is what is done there.
//
// To take up a segment takes two ticks, as one would be late at the highest rates: the last tick of the segment before, when its steps are
// computed, takes the next one's rates and turns phases (dda.prepared); the first takes all else.
//
// r22 low byte of the timer when STEP rose, r23 step bits, r24 and r25 whatever is at hand, T: the segment's last tick. No other register is
// touched, but where a segment is taken up, a bend counts, and in a hold. What few segments need stands behind the end.
#pragma once

#include "tick_parts.h"

// Z: the slot behind dda.now.
#define NEXT_SLOT()                                                                                    \
    A("lds r30, %[now]\n\t"                                                                            \
      "lds r31, %[now]+1\n\t"                                                                          \
      "adiw r30, %[size]\n\t"                                                                          \
      "ldi r25, hi8(%[queue]+%[all])\n\t"                                                              \
      "cpi r30, lo8(%[queue]+%[all])\n\t"                                                              \
      "cpc r31, r25\n\t"                                                                               \
      "brne 1f\n\t"                                                                                    \
      "ldi r30, lo8(%[queue])\n\t"                                                                     \
      "ldi r31, hi8(%[queue])\n"                                                                       \
      "1:",                                                                                            \
      [now] "i"(&dda.now), [size] "I"(sizeof(struct segment)), [queue] "i"(queue), [all] "n"(sizeof queue));

// The timer: OCR1A = interval - 1; a tick that is all but over, or over, would come a turn later.
#define SET_TIMER()                                                                              \
    A("lds r23, %[interval]+2\n\t"                                                               \
      "lds r24, %[interval]+3\n\t"                                                               \
      "lds r25, %[stretch]\n\t"                                                                  \
      "tst r25\n\t"                                                                              \
      "brne 5f\n\t"                                                                              \
      "lds r25, %[stretch]+1\n\t"                                                                \
      "dec r25\n\t"                                                                              \
      "breq 2f\n"                                                                                \
      "5:\n\t" /* a hold: interval * stretch >> 8, 65535 at most */                              \
      "push r0\n\t"                                                                              \
      "push r1\n\t"                                                                              \
      "push r20\n\t"                                                                             \
      "push r21\n\t"                                                                             \
      "push r22\n\t"                                                                             \
      "lds r22, %[stretch]\n\t"                                                                  \
      "lds r25, %[stretch]+1\n\t"                                                                \
      "mul r23, r22\n\t"                                                                         \
      "mov r20, r1\n\t"                                                                          \
      "mul r24, r25\n\t"                                                                         \
      "mov r21, r0\n\t"                                                                          \
      "tst r1\n\t"                                                                               \
      "brne 3f\n\t"                                                                              \
      "mul r23, r25\n\t"                                                                         \
      "add r20, r0\n\t"                                                                          \
      "adc r21, r1\n\t"                                                                          \
      "brcs 3f\n\t"                                                                              \
      "mul r24, r22\n\t"                                                                         \
      "add r20, r0\n\t"                                                                          \
      "adc r21, r1\n\t"                                                                          \
      "brcc 4f\n"                                                                                \
      "3:\n\t"                                                                                   \
      "ldi r20, 0xFF\n\t"                                                                        \
      "ldi r21, 0xFF\n"                                                                          \
      "4:\n\t"                                                                                   \
      "mov r23, r20\n\t"                                                                         \
      "mov r24, r21\n\t"                                                                         \
      "pop r22\n\t"                                                                              \
      "pop r21\n\t"                                                                              \
      "pop r20\n\t"                                                                              \
      "pop r1\n\t"                                                                               \
      "pop r0\n"                                                                                 \
      "2:\n\t"                                                                                   \
      "subi r23, 1\n\t"                                                                          \
      "sbci r24, 0\n\t"                                                                          \
      "sts %[ocr]+1, r24\n\t"                                                                    \
      "sts %[ocr], r23\n\t"                                                                      \
      "lds r25, %[now]\n\t" /* the low byte first: the high one is kept for it */                \
      "subi r23, 7\n\t"                                                                          \
      "sbci r24, 0\n\t"                                                                          \
      "cp r25, r23\n\t"                                                                          \
      "lds r25, %[now]+1\n\t"                                                                    \
      "cpc r25, r24\n\t"                                                                         \
      "brcs 1f\n\t"                                                                              \
      "ldi r25, 0\n\t"                                                                           \
      "sts %[now]+1, r25\n\t"                                                                    \
      "sts %[now], r25\n\t"                                                                      \
      "lds r24, %[late]\n\t"                                                                     \
      "ori r24, 1\n\t"                                                                           \
      "sts %[late], r24\n"                                                                       \
      "1:",                                                                                      \
      [interval] "i"(&dda.interval), [stretch] "i"(&dda.stretch), [ocr] MEM(OCR1AL), [now] MEM(TCNT1L), [late] "i"(&dda.overruns))

// T, of the ticks that are left now.
#define LAST_TICK   \
    "clt\n\t"       \
    "brne 1f\n\t"   \
    "set\n"         \
    "1:\n\t"

ISR(TIMER1_COMPA_vect, ISR_NAKED) {
    A("push r24\n\t"
      "in r24, __SREG__\n\t"
      "push r24\n\t"
      "push r25\n\t"
      "lds r24, %[bits]",
      [bits] "i"(&dda.bits));
    STEPPER_PINS(RAISE)
    A("lds r24, %[probe]\n\t"
      "tst r24\n\t"
      "brne short_watched\n\t"
      "push r23\n\t"
      "push r22\n\t"
      "lds r22, %[timer]\n\t"
      "lds r24, %[left]\n\t"
      "lds r25, %[left]+1\n\t"
      "sbiw r24, 1\n\t"
      "brcs short_next\n\t" LAST_TICK
      "sts %[left]+1, r25\n\t"
      "sts %[left], r24\n\t"
      "rjmp short_timer\n"
      "short_next:\n\t"
      "lds r24, %[prepared]\n\t"
      "tst r24\n\t"
      "brne short_load\n\t"
      "pop r22\n\t"
      "pop r23\n"
      "short_watched:\n\t"
      "pop r25\n\t"
      "pop r24\n\t"
      "out __SREG__, r24\n\t"
      "pop r24\n\t"
      "jmp %x[tick]",
      [probe] "i"(&dda.probe), [timer] MEM(TCNT1L), [left] "i"(&dda.left), [prepared] "i"(&dda.prepared), [tick] "i"(__vector_tick));

    // a segment is taken up, as by dda_load()
    A("short_load:\n\t"
      "push r31\n\t"
      "push r30\n\t"
      "push r21");
    NEXT_SLOT();
    A("ldd r24, Z+%[first]\n\t"
      "ldd r25, Z+%[first]+1\n\t"
      "sts %[ocr]+1, r25\n\t"  // by the interval before, the timer would fire too early
      "sts %[ocr], r24\n\t"
      "sts %[interval]+2, r24\n\t"
      "sts %[interval]+3, r25\n\t"
      "ldi r21, 0\n\t"
      "sts %[interval], r21\n\t"
      "sts %[interval]+1, r21\n\t"
      "sts %[sum], r21\n\t"
      "sts %[prepared], r21\n\t"
      "sts %[now], r30\n\t"
      "sts %[now]+1, r31\n\t"
      "lds r24, %[tail]\n\t"
      "inc r24\n\t"
      "sts %[tail], r24\n\t"
      "ldd r25, Z+%[add]\n\t"
      "sts %[sum]+1, r25\n\t"
      "ldd r24, Z+%[add]+1\n\t"
      "sts %[sum]+2, r24\n\t"
      "or r25, r24\n\t"
      "ldd r24, Z+%[add]+2\n\t"
      "sts %[sum]+3, r24\n\t"
      "or r25, r24\n\t"
      "breq 2f\n\t"
      "ldi r25, 1\n\t"
      "ldd r24, Z+%[bend]\n\t"
      "ldd r21, Z+%[bend]+1\n\t"
      "or r24, r21\n\t"
      "breq 2f\n\t"
      "ldi r25, %[bends]\n"
      "2:\n\t"
      "sts %[changing], r25\n\t"
      "ldd r24, Z+%[ticks]\n\t"
      "ldd r25, Z+%[ticks]+1\n\t"
      "sbiw r24, 1\n\t" LAST_TICK
      "sts %[left]+1, r25\n\t"
      "sts %[left], r24\n\t"
      ".if %[top]\n\t"
      "ldd r24, Z+%[from]+%[top]\n\t"
      "sts %[back]+%[top], r24\n\t"
      ".endif\n\t"
      "ldd r24, Z+%[from]\n\t"
      "sts %[back], r24\n\t"
      "lds r25, %[invert]\n\t"
      "eor r24, r25",
      [first] FIELD(interval), [ocr] MEM(OCR1AL), [interval] "i"(&dda.interval), [add] FIELD(add), [sum] "i"(&dda.add), [tail] "i"(&queue_tail),
      [prepared] "i"(&dda.prepared), [now] "i"(&dda.now), [ticks] FIELD(ticks), [left] "i"(&dda.left), [from] FIELD(back),
      [back] "i"(&dda.back), [top] "n"(sizeof(axes_t) - 1), [invert] "i"(&direction_invert), [changing] "i"(&dda.changing),
      [bend] FIELD(bend), [bends] "M"(BENDS));
    STEPPER_PINS(DIRECT)
    A("pop r21\n\t"
      "pop r30\n\t"
      "pop r31\n"
      "short_timer:");
    SET_TIMER();

    // interval += add >> 8
    A("lds r24, %[changing]\n\t"
      "tst r24\n\t"
      "breq short_high\n\t" SUM("add", "%[i]", "%[a]+1") SUM("adc", "%[i]+1", "%[a]+2") SUM("adc", "%[i]+2", "%[a]+3") "lds r24, %[i]+3\n\t"
      "sbrc r25, 7\n\t"
      "rjmp 1f\n\t"
      "ldi r25, 0\n\t"
      "rjmp 2f\n"
      "1: ldi r25, 0xFF\n"
      "2: adc r24, r25\n\t"
      "sts %[i]+3, r24\n\t"
      "lds r24, %[changing]\n\t"
      "sbrc r24, 7\n\t"
      "rjmp short_bend\n"
      "short_high:\n\t"  // STEP is high long enough
      "lds r24, %[now]\n\t"
      "sub r24, r22\n\t"
      "lds r25, %[high]\n\t"
      "cp r24, r25\n\t"
      "brcs short_high",
      [changing] "i"(&dda.changing), [i] "i"(&dda.interval), [a] "i"(&dda.add), [now] MEM(TCNT1L), [high] "i"(&step_high));
    STEPPER_PINS(LOWER)
    A("ldi r23, 0\n\t"
      "lds r24, %[fine]\n\t"
      "tst r24\n\t"
      "breq 1f\n\t"
      "rjmp short_fine\n"
      "1:",
      [fine] "i"(&dda.fine));
    STEPPER_PINS(PHASE_COARSE)
    A("short_bits:\n\t"
      "sts %[bits], r23\n\t"
      "brts 1f\n\t"
      "rjmp short_end\n"
      "1:\n\t"
      "lds r24, %[tail]\n\t"
      "inc r24\n\t"
      "lds r25, %[head]\n\t"
      "cp r24, r25\n\t"
      "brne 1f\n\t"
      "rjmp short_end\n"
      "1:",
      [bits] "i"(&dda.bits), [tail] "i"(&queue_tail), [head] "i"(&queue_head));

    // the next segment's rates
    A("push r31\n\t"
      "push r30\n\t"
      "push r21\n\t"
      "push r20");
    NEXT_SLOT();
    A("ldi r22, 0\n\t"
      "ldd r20, Z+%[fine]\n\t"
      "sts %[any], r20\n\t"
      "ldd r21, Z+%[from]\n\t"
      "lds r24, %[back]+%[top]\n\t"
      "sbrc r24, 7\n\t"
      "rjmp 1f\n\t"
      "lds r24, %[back]\n\t"
      "eor r21, r24\n\t"
      "rjmp short_rates\n"
      "1:\n\t"  // LAST: phases begin anew
      "ldi r24, 0x80",
      [fine] FIELD(fine), [from] FIELD(back), [back] "i"(&dda.back), [top] "n"(sizeof(axes_t) - 1), [any] "i"(&dda.fine));
    STEPPER_PINS(REST)
    A("short_rates:");
    STEPPER_PINS(TAKE_RATE)
    A("ldi r24, 1\n\t"
      "sts %[prepared], r24\n\t"
      "pop r20\n\t"
      "pop r21\n\t"
      "pop r30\n\t"
      "pop r31\n"
      "short_end:\n\t"
      "sbis %[flags], %[due]\n\t"
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
      [prepared] "i"(&dda.prepared), [flags] "I"(_SFR_IO_ADDR(TIFR1)), [due] "n"(OCF1A), [now] MEM(TCNT1L), [allowed] "n"(LATE), [late] "i"(&dda.overruns));

    // add grows by the bend, with every block of ticks or, QUICK, with each; behind the last tick nobody looks
    A("short_bend:\n\t"
      "brts 1f\n\t"
      "lds r24, %[left]\n\t"
      "andi r24, %[block] - 1\n\t"
      "breq 2f\n\t"
      "lds r24, %[back]\n\t"
      "sbrc r24, 6\n\t"
      "rjmp 2f\n"
      "1:\n\t"
      "rjmp short_high\n"
      "2:\n\t"
      "push r31\n\t"
      "push r30\n\t"
      "push r22\n\t"
      "lds r30, %[now]\n\t"
      "lds r31, %[now]+1\n\t"
      "ldd r24, Z+%[bend]\n\t"
      "ldd r25, Z+%[bend]+1\n\t"
      "mov r22, r25\n\t"
      "lsl r22\n\t"
      "sbc r22, r22\n\t"  // its sign
      "lds r30, %[back]\n\t"
      "sbrc r30, 6\n\t"
      "rjmp 2f\n\t"
      "mov r23, r22\n\t"
      "lsl r24\n\t"
      "rol r25\n\t"
      "rol r23\n\t"
      "lsl r24\n\t"
      "rol r25\n\t"
      "rol r23\n\t"
      "rjmp 3f\n"
      "2:\n\t"  // QUICK: 128 times it
      "ldi r31, 0\n\t"
      "asr r25\n\t"
      "ror r24\n\t"
      "ror r31\n\t"
      "mov r23, r25\n\t"
      "mov r25, r24\n\t"
      "mov r24, r31\n"
      "3:\n\t"
      "lds r30, %[a]\n\t"
      "add r30, r24\n\t"
      "sts %[a], r30\n\t"
      "lds r30, %[a]+1\n\t"
      "adc r30, r25\n\t"
      "sts %[a]+1, r30\n\t"
      "lds r30, %[a]+2\n\t"
      "adc r30, r23\n\t"
      "sts %[a]+2, r30\n\t"
      "lds r30, %[a]+3\n\t"
      "adc r30, r22\n\t"
      "sts %[a]+3, r30\n\t"
      "pop r22\n\t"
      "pop r30\n\t"
      "pop r31\n\t"
      "rjmp short_high",
      [left] "i"(&dda.left), [block] "n"(BLOCK), [back] "i"((uint8_t *)&dda.back + sizeof dda.back - 1), [a] "i"(&dda.add),
      [now] "i"(&dda.now), [bend] FIELD(bend));

    A("short_fine:");
    STEPPER_PINS(PHASE)
    A("rjmp short_bits");
}

#undef A
#undef MEM
#undef FIELD
