// The ticks: state machine 0 of PIO 0 makes all edges of STEP and DIR, and tells the interrupt when it has.
//
// It runs at CLOCK, 125 MHz / 5. A tick is two words from the processor:
//   A   bits 0-11 the pins before the edge: DIR as it shall be, STEP low; 12-31: cycles to wait
//   B   bits 0-11 the pins after the edge; 12-23 with STEP low again; 24-31: cycles to wait
//
//    0 pull block      A
//    1 out pins, 12    DIR, while STEP is low
//    2 out x, 20
//    3 jmp x--, 3
//    4 pull block      B
//    5 out pins, 12    the edge
//    6 irq set 0       the interrupt computes the next tick
//    7 mov x, y        y: how long STEP stays high
//    8 jmp x--, 8
//    9 out pins, 12    STEP low
//   10 out x, 8
//   11 jmp x--, 11     and on with 0
//
// From edge to edge it takes 12 + y + x(B) + x(A) cycles, high are y + 4 of them, and x(B) is such that "pull A" comes DEADLINE after the edge: so
// much time the interrupt has to bring A. If it is late, the machine waits (STEP low), and says so in TXSTALL: the tick came late. Whatever the
// interrupt does in time, the edges do not move. As on the AVR one tick is computed ahead of the pins, no more.
#ifdef __arm__
#include "../chip.h"
#include "../core/config.h"
#include "../core/dda.h"
#include "../core/hal.h"
#include "pico.h"

enum { DEADLINE = 78, AFTER = 6, PULSE = 4 };  // cycles; AFTER "pull A", and of a pulse, besides the waits
_Static_assert(DIR_FIRST == STEP_FIRST + STEPPERS && STEPPERS == 6, "twelve pins in a row");
_Static_assert(MIN_INTERVAL >= DEADLINE + AFTER, "room for A");
_Static_assert((DIR_SETUP_MAX + STEP_HIGH_MAX) * CLOCK / 10000000 < MIN_INTERVAL, "");
_Static_assert(DIR_SETUP_MAX * (CLOCK / 100000) / 100 < MIN_INTERVAL - DEADLINE - 2, "DIR comes that much before the edge");
_Static_assert(STEP_HIGH_MAX * (CLOCK / 100000) / 100 < DEADLINE - 6, "STEP is low again before the deadline");

enum { PULL = 0x80A0, OUT_PINS_12 = 0x600C, OUT_X_20 = 0x6034, OUT_X_8 = 0x6028, IRQ_SET_0 = 0xC000, MOV_X_Y = 0xA022 };
enum { JMP = 0x0000, JMP_X_DEC = 0x0040, MOV_Y_OSR = 0xA047, PULL_NOBLOCK = 0x8080, SET_PINDIRS = 0xE080 };
enum { EDGE = 5, FALL = 9 };  // addresses: STEP is high between them

static const uint16_t program[] = {PULL,      OUT_PINS_12, OUT_X_20,      JMP_X_DEC | 3, PULL,    OUT_PINS_12,
                                   IRQ_SET_0, MOV_X_Y,     JMP_X_DEC | 8, OUT_PINS_12,   OUT_X_8, JMP_X_DEC | 11};

static uint8_t dir_invert;   // axes whose positive counts put DIR high
static uint32_t dir;         // as pins of a word
static uint32_t rest;        // B's bits 24-31, in place
static uint32_t probe_mask, probe_level;

enum { STALLED = 1 << 24 };  // FDEBUG: a pull had to wait

void dda_direction(uint16_t back) {
    dir = (uint32_t)(((uint8_t)back ^ dir_invert) & STEPPER_AXES) << STEPPERS;
}

static inline void put_wait(uint32_t cycles) {
    REG(PIO_TXF0) = dir | cycles << 12;
}

static inline void put_edge(void) {
    REG(PIO_TXF0) = dir | dda.bits | dir << 12 | rest;
}

// What follows an edge; false at the end.
static inline uint16_t after_edge(void) {
    REG(PIO_IRQ) = 1;
    if (dda.probe) {
        dda_probe((REG(SIO_IN) & probe_mask) == probe_level);
    }
    const uint8_t tail = queue_tail;
    const uint16_t interval = dda_next();
    if (!interval || tail != queue_tail) {
        awake = true;
    }
    return interval;
}

void pio_interrupt(void) {
    const uint16_t interval = after_edge();
    if (!interval) {
        return;  // the machine waits for the next motion
    }
    put_wait(interval - DEADLINE - AFTER);
    dda_bits();
    put_edge();
    if (REG(PIO_FDEBUG) & STALLED) {
        REG(PIO_FDEBUG) = STALLED;
        dda.overruns += dda.overruns < 255;
        awake = true;
    }
}

static uint8_t at(void) {
    return REG(PIO_SM0_ADDR);
}

static bool pulsing(void) {
    return at() > EDGE && at() <= FALL;
}

// Stopped, empty, at its first instruction; STEP is low.
static void rewind(void) {
    do {
        REG(PIO_CTRL) = 1;
        while (pulsing()) {
        }
        REG(PIO_CTRL) = 0;
    } while (pulsing());
    while (!(REG(PIO_FSTAT) & STALLED)) {  // the same bit there: empty
        REG(PIO_SM0_INSTR) = PULL_NOBLOCK;
    }
    REG(PIO_CTRL) = 1 << 4;  // restart
    REG(PIO_SM0_INSTR) = JMP;
}

void hal_timer_start(uint16_t interval) {
    HAL_LOCK();
    rewind();
    put_wait(interval - AFTER);
    put_edge();
    REG(PIO_FDEBUG) = STALLED;
    REG(PIO_IRQ) = 1;
    REG(PIO_CTRL) = 1;
    HAL_UNLOCK();
}

// An edge that is out although its interrupt has not run yet counts.
void hal_timer_stop(void) {
    HAL_LOCK();
    rewind();
    if (REG(PIO_IRQ) & 1) {
        after_edge();
    }
    HAL_UNLOCK();
}

void hal_probe(uint8_t input, bool high) {
    probe_mask = 1UL << (SWITCH_FIRST + input);
    probe_level = high ? probe_mask : 0;
}

static uint32_t cycles(uint8_t tenths) {  // of a microsecond, rounded up
    return ((uint32_t)tenths * (CLOCK / 100000) + 99) / 100;
}

void hal_configured(void) {
    const uint32_t high = cycles(memory.image.step_high);
    const uint32_t wait = high > PULSE ? high - PULSE : 0;
    dir_invert = limits.invert;
    rest = (DEADLINE - 6 - wait) << 24;
    rewind();
    REG(PIO_TXF0) = wait;
    REG(PIO_SM0_INSTR) = PULL;
    REG(PIO_SM0_INSTR) = MOV_Y_OSR;
}

void stepper_setup(void) {
    enum { OUT_RIGHT = 1 << 19, WRAP_TOP = 12, WRAP_BOTTOM = 7, SET_COUNT = 26, SET_BASE = 5, OUT_COUNT = 20 };
    const uint32_t pins = 2 * STEPPERS;
    for (uint8_t i = 0; i < sizeof program / sizeof program[0]; i++) {
        REG(PIO_INSTR_MEM(i)) = program[i];
    }
    REG(PIO_SM0_CLKDIV) = (uint32_t)(SYSTEM_MHZ * 1000000UL / CLOCK) << 16;
    REG(PIO_SM0_EXECCTRL) = 11 << WRAP_TOP | 0 << WRAP_BOTTOM;
    REG(PIO_SM0_SHIFTCTRL) = OUT_RIGHT;
    for (uint8_t i = 0; i < pins; i++) {  // each an output, low
        REG(PIO_SM0_PINCTRL) = 1UL << SET_COUNT | (STEP_FIRST + i) << SET_BASE;
        REG(PIO_SM0_INSTR) = SET_PINDIRS | 1;
        pin_function(STEP_FIRST + i, F_PIO0, PAD_4MA);
    }
    REG(PIO_SM0_PINCTRL) = pins << OUT_COUNT | STEP_FIRST;
    REG(PIO_IRQ0_INTE) = 1 << 8;  // the machine's flag 0
    irq_enable(IRQ_PIO0, 0);
}
#endif
