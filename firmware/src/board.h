// Which board this is. make passes -DBOARD_…; in the Arduino IDE a Mega is a RAMPS 1.4 and an Uno a CNC Shield:
// for servos on a bare Uno, exchange the last #include.
#pragma once

#if defined(BOARD_mega_ramps14) || defined(ARDUINO_AVR_MEGA2560) || defined(ARDUINO_AVR_MEGA)
#include "boards/mega_ramps14.h"
#elif defined(BOARD_pico6)
#include "boards/pico6.h"
#elif defined(BOARD_uno_servos)
#include "boards/uno_servos.h"
#else
#include "boards/uno_cnc_shield.h"
#endif

#define AXES (STEPPERS + SERVOS)
_Static_assert(STEPPERS <= 8 && AXES <= 15, "masks of axes");
#define ROWS (STEPPERS ? STEPPERS : AXES / 2)  // of the configuration: coupled joints
#define ALL_AXES ((1U << AXES) - 1)
#define STEPPER_AXES ((1U << STEPPERS) - 1)
#define SERVO_AXES (ALL_AXES & ~STEPPER_AXES)
#ifndef WATCHED_INTERVAL
#define WATCHED_INTERVAL (MIN_INTERVAL + MIN_INTERVAL / 8)
#endif
// What a driver may ask for, 0.1 us, where a board has not less room in MIN_INTERVAL.
#ifndef STEP_HIGH_MAX
#define STEP_HIGH_MAX 80
#define STEP_LOW_MAX 50
#define DIR_SETUP_MAX 100
#endif
_Static_assert(256000ULL * UNIT_DIVISOR == (unsigned long long)CLOCK * UNIT_FACTOR, "256 cycles in ms");
