// The session: what PROTOCOL.md, section 3, says about errors and who may end it.
#pragma once
#include "errors.h"
#include <stdint.h>

enum state { IDLE, MOVING, HOLDING, HOMING, JOGGING };

struct session {
    uint8_t next;    // sequence number awaited
    uint8_t error;   // what ended the session; OK: it is open
    uint8_t detail;
    uint8_t state;   // of the board
    uint16_t silent; // ms since the last valid frame
    uint8_t abort;   // the abort input is active
};
extern struct session session;

// Ends the session (the first cause stays) and brings the board to rest.
void session_end(enum error error, uint8_t detail);
