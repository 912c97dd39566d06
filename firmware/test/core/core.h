// What the tests of the core share: a bench just switched on, where its pins are, and one long cruise.
#pragma once
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "../../src/core/bytes.h"
#include "../../src/core/crc.h"
#include "../../src/core/dda.h"
#include "../../src/core/hal.h"
#include "../../src/core/motion.h"
#include "../../src/core/protocol.h"
#include "../host.h"

extern const int32_t zero[AXES];
extern int32_t home_counts[AXES];                 // of the bench just switched on: servos in the middle
extern const struct host_segment cruise_segment;  // 10 kHz, Y half as fast as X; u = 50 ms

void fresh(uint32_t nonce);  // switched on, configured, known, enabled
void fresh_with(uint32_t nonce, const struct image *image);  // the same with another configuration
bool pins_are(const int32_t *counts);
void press_abort(void);

// One group of promises each, in the file of its name.
void test_steps(void);
void test_accelerations(void);
void test_holds(void);
void test_sessions(void);
void test_positions(void);
void test_limits(void);
void test_homing_and_jog(void);
