// Arduino Uno (ATmega328P, 16 MHz) with CNC Shield V3. Axes X Y Z A, and one servo.
// The A socket needs the two jumpers that put it on D12 and D13.
#define BOARD_ID 1
#define STEPPERS 4
#define SERVOS 1
#define SWITCHES 3
#define CLOCK 16000000UL
#define UNIT_FACTOR 2  // 256 cycles are 2/125 ms
#define UNIT_DIVISOR 125
#define QUEUE_SLOTS 32  // a power of two
#define FRAME_MAX 152
#define RECEIVE 167  // bytes: a whole frame, and a question
#define MIN_INTERVAL 400  // cycles between ticks: 40 kHz
#define WATCHED_INTERVAL 720  // while homing watches a switch, as these ticks take longer

// axis, STEP port and bit, DIR port and bit
#define STEPPER_PINS(P) \
    P(0, D, 2, D, 5)    \
    P(1, D, 3, D, 6)    \
    P(2, D, 4, D, 7)    \
    P(3, B, 4, B, 5)
#define SERVO_PINS(P) P(0, C, 3)  // A3
#define SWITCH_PINS(P) \
    P(0, B, 1)         \
    P(1, B, 2)         \
    P(2, B, 3)                      // D9 D10 D11: the X Y Z limits
#define ENABLE_PINS(P) P(B, 0)      // D8, one for all
#define ABORT_PIN(P) P(C, 0)        // A0
#define POWER_PIN(P) P(C, 1)        // A1: high while the motors have power
