// Frames: COBS and CRC in both directions (PROTOCOL.md, section 1).
#pragma once
#include <stdint.h>

void link_byte(uint8_t byte);                            // from the line; calls frame_received()
void link_send(const uint8_t *payload, uint8_t length);  // dropped if the line is full: the host asks again
extern uint8_t link_bad;                                 // frames dropped, saturating

void frame_received(const uint8_t *payload, uint8_t length);  // the protocol's
