// The frames' meaning: sessions, sequence, and what each of them does (PROTOCOL.md).
#pragma once
#include <stdbool.h>
#include <stdint.h>

#include "../board.h"

#define PROTOCOL_VERSION 2
#define FIRMWARE_MAJOR 2
#define FIRMWARE_MINOR 0

// The session: what PROTOCOL.md, section 3, says about errors. Only protocol.c ends it.
struct session {
    uint8_t next;     // sequence number awaited
    uint8_t error;    // what ended the session; OK: it is open
    uint8_t detail;
    uint16_t digest;  // of the nonce, 0: there was no HELLO
    uint16_t silent;  // ms since the last valid frame
};
extern struct session session;

enum { LARGEST_REPLY = 19 + 4 * AXES + 6 > 41 ? 19 + 4 * AXES + 6 : 41 };  // STATUS or INFO on the line

void protocol_start(uint8_t cause);  // MCUSR of the reset, 0: hidden
void protocol_frame(void);           // does what link_bytes() has found to be whole, once there is room for its answer
void protocol_poll(void);            // as often as possible
void protocol_millisecond(void);
