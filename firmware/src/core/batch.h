// MOTION: checks a batch and queues it (PROTOCOL.md, section 6).
#pragma once
#include "errors.h"
#include <stdint.h>

enum error batch_received(const uint8_t *payload, uint8_t length, uint8_t *detail);
