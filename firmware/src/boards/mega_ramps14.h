// Arduino Mega 2560 with RAMPS 1.4. Axes X Y Z E0 E1, and four servos.
#define BOARD_ID 2
#define STEPPERS 5
#define SERVOS 4
#define SWITCHES 6
#define CLOCK 16000000UL
#define UNIT_FACTOR 2  // 256 cycles are 2/125 ms
#define UNIT_DIVISOR 125
#define QUEUE_SLOTS 128  // a power of two
#define FRAME_MAX 240
#define RECEIVE 255       // bytes
#define MIN_INTERVAL 576  // cycles between ticks: 27.8 kHz
#define WATCHED_INTERVAL 864  // while homing watches a switch, as these ticks take longer

// axis, STEP port and bit, DIR port and bit: D54/D55, D60/D61, D46/D48, D26/D28, D36/D34
#define STEPPER_PINS(P) \
    P(0, F, 0, F, 1)    \
    P(1, F, 6, F, 7)    \
    P(2, L, 3, L, 1)    \
    P(3, A, 4, A, 6)    \
    P(4, C, 1, C, 3)
#define SERVO_PINS(P) \
    P(0, B, 5)        \
    P(1, H, 3)        \
    P(2, E, 3)        \
    P(3, G, 5)  // D11 D6 D5 D4
#define SWITCH_PINS(P) \
    P(0, E, 5)         \
    P(1, E, 4)         \
    P(2, J, 1)         \
    P(3, J, 0)         \
    P(4, D, 3)         \
    P(5, D, 2)  // X- X+ Y- Y+ Z- Z+: D3 D2 D14 D15 D18 D19
#define ENABLE_PINS(P) \
    P(D, 7)            \
    P(F, 2)            \
    P(K, 0)            \
    P(A, 2)            \
    P(C, 7)                   // D38 D56 D62 D24 D30
#define ABORT_PIN(P) P(F, 3)  // A3 on AUX-1: A0 is the X driver's STEP here
#define POWER_PIN(P) P(F, 4)  // A4 on AUX-1: high while the motors have power
