// Frames: COBS and CRC in both directions (PROTOCOL.md, section 1).
#pragma once
#include <stdint.h>

// A byte from the line. Not 0: a frame is whole, link_frame() has its payload of that length until the next byte;
// its answer may be made in the same place.
uint8_t link_byte(uint8_t byte);
uint8_t *link_frame(void);
void link_send(const uint8_t *payload, uint8_t length);  // dropped if the line is full: the host asks again
extern uint8_t link_bad;                                 // frames dropped, saturating
