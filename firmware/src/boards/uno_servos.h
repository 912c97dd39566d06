// A bare Arduino Uno with up to six RC servos on D2 … D7.
#define BOARD_ID 3
#define STEPPERS 0
#define SERVOS 6
#define SWITCHES 0
#define CLOCK 16000000UL
#define UNIT_FACTOR 2  // 256 cycles are 2/125 ms
#define UNIT_DIVISOR 125
#define QUEUE_SLOTS 32  // a power of two
#define FRAME_MAX 120
#define RECEIVE 127       // bytes
#define MIN_INTERVAL 1600  // cycles between ticks: 10 kHz; a servo hears of its count every 20 ms

#define STEPPER_PINS(P)
#define SERVO_PINS(P) \
    P(0, D, 2)        \
    P(1, D, 3)        \
    P(2, D, 4)        \
    P(3, D, 5)        \
    P(4, D, 6)        \
    P(5, D, 7)
#define SWITCH_PINS(P)
#define ENABLE_PINS(P)
#define ABORT_PIN(P) P(C, 0)  // A0
#define POWER_PIN(P) P(C, 1)  // A1: high while the motors have power
