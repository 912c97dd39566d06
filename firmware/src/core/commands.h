// The frames in sequence, each done as a whole or not at all (PROTOCOL.md, sections 4 to 8).
#pragma once
#include "errors.h"
#include <stdint.h>

// `detail`: the axis, row or segment that the error is about.
enum error order_received(const uint8_t *payload, uint8_t length, uint8_t *detail);
