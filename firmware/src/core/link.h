// Frames: COBS and CRC in both directions (PROTOCOL.md, section 1).
#pragma once
#include <stdint.h>

// Bytes from the line, up to the end of a frame: so many are taken. If the frame is whole, link_length says the length of its payload:
// who has read it from link_frame() sets that to 0, and only then gives more bytes. An answer may be made in the same place.
uint8_t link_bytes(const uint8_t *bytes, uint8_t count);
extern uint8_t link_length;
uint8_t *link_frame(void);
void link_send(const uint8_t *payload, uint8_t length);  // nothing if the line is full
extern uint8_t link_bad;                                 // frames dropped, saturating
