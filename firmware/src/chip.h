// What differs from chip to chip and must be known at compile time: src/avr/chip.h, src/rp2040/chip.h, or the PC's for the tests.
//
// A chip's header defines
//   HAL_LOCK() … HAL_UNLOCK()  a block that the tick interrupt stays out of; also a memory barrier both ways
//   HAL_BARRIER()              what was written before is in memory before what is written after
//   HAL_NOINIT                 attribute of variables that a reset leaves as they are
//   HAL_RECEIVE                bytes that the serial line keeps while the core is busy (INFO's `receive`)
//   fine_t, sfine_t            an unsigned and a signed integer of at least 24 bits
//   DDA_ADVANCE(planned)       planned = dda.interval >> 16, dda.interval += dda.add >> 8
//   HAL_NEAR(pointer)          keep it in a register that its fields are reached from, or nothing
//   HAL_COMING(cycles)         the next tick's interval, told in time where loading a segment may take longer than the one before
//   DDA_AXIS(i, …)             one axis of the tick, see core/dda.h
//   HAL_PREPARES               whether its tick takes the next segment's rates ahead of time (dda.prepared)
//   dda_direction(back)        sets the DIR pins, inline where a call would cost too much
//   HAL_MULTIPLY(a, b)         16 by 16 bits
// and, where it has a quicker way than C's: HAL_RECIPROCAL(interval), 2^23 / interval; HAL_STEPS(phase, rate, fine, ticks), see core/motion.h;
// HAL_CRC(crc, byte), see core/crc.h, with HAL_TABLE, the attribute of a constant table where it costs no RAM
#pragma once

// Not inlined: its variables take up stack only while it runs.
#define APART __attribute__((noinline))

#ifdef __AVR__
#include "avr/chip.h"
#elif defined(__arm__)
#include "rp2040/chip.h"
#else
#include "pc/chip.h"
#endif
