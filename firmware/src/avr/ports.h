// From the board's pin lists to port accesses, all of them resolved at compile time.
#pragma once
#include <avr/io.h>

#include "../board.h"

#define PIN_HIGH(port, bit) (PORT##port |= 1 << (bit))
#define PIN_LOW(port, bit) (PORT##port &= (uint8_t) ~(1 << (bit)))
#define PIN_OUTPUT(port, bit) (DDR##port |= 1 << (bit))
#define PIN_PULL_UP(port, bit) (PORT##port |= 1 << (bit))
#define PIN_READ(port, bit) (PIN##port >> (bit) & 1)
