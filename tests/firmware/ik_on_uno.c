/* The generated solver of an arm on an Uno, timed by its own clock. Built with the generated header as arm.h, its source,
   and -DIK, -DFK, -DREAL, -DSOLUTION, -DJOINTS, -DTARGET, -DBRANCHES from it; questions.h holds the targets and near.

   Timer 1 counts cycles; what an empty measurement takes is taken off. */
#include "arm.h"
#include "questions.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <stdint.h>

volatile uint32_t ik_cycles[QUESTIONS], fk_cycles[QUESTIONS];
volatile uint8_t found_count[QUESTIONS], all_done;
SOLUTION found[QUESTIONS][BRANCHES];
volatile uint16_t stack_left;

static volatile uint16_t overflows;
extern uint8_t _end;

ISR(TIMER1_OVF_vect)
{
    overflows++;
}

static uint32_t now(void)
{
    uint32_t high;
    uint16_t low;
    cli();
    low = TCNT1;
    high = overflows;
    if ((TIFR1 & 1) && low < 0x8000)
        high++;
    sei();
    return high << 16 | low;
}

int main(void)
{
    uint8_t k, *p;
    uint32_t empty;
    REAL pose[16];
    for (p = &_end; p < (uint8_t *)SP - 32; p++)
        *p = 0xc5;
    TCCR1A = 0;
    TCCR1B = 1; /* one count a cycle */
    TIMSK1 = 1;
    sei();
    empty = now();
    empty = now() - empty;
    for (k = 0; k < QUESTIONS; k++) {
        int edge;
        uint32_t start = now();
        found_count[k] = (uint8_t)IK(targets[k], near, found[k], &edge);
        ik_cycles[k] = now() - start - empty;
        start = now();
        FK(found[k][0].q, pose);
        fk_cycles[k] = now() - start - empty;
    }
    for (p = &_end; *p == 0xc5; p++)
        stack_left++;
    all_done = 1;
    for (;;)
        ;
}
