// JOG: a dead-man's handle (PROTOCOL.md, section 8).
#pragma once
#include "motion.h"

void jog(const int32_t rate[AXES]);  // checked by the caller
void jog_poll(void);
void jog_millisecond(void);
