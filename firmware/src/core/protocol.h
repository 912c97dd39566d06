// The frames' meaning: sessions, sequence, and what each of them does (PROTOCOL.md).
#pragma once
#include <stdint.h>

#define PROTOCOL_VERSION 1
#define FIRMWARE_MAJOR 1
#define FIRMWARE_MINOR 0

void protocol_start(uint8_t cause);  // MCUSR of the reset, 0: hidden
void protocol_poll(void);            // as often as possible
void protocol_millisecond(void);
