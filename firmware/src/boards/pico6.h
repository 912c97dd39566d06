// Raspberry Pi Pico (RP2040) with six step/dir drivers. Axes X Y Z A B C, and two servos.
//
// The clock is the PIO's: 125 MHz / 5. One state machine makes the edges of all STEP and DIR pins, so these are two runs of six.
#define BOARD_ID 4
#define STEPPERS 6
#define SERVOS 2
#define SWITCHES 6
#define CLOCK 25000000UL
#define UNIT_FACTOR 32  // 256 cycles are 32/3125 ms
#define UNIT_DIVISOR 3125
#define QUEUE_SLOTS 128  // a power of two
#define FRAME_MAX 250
#define MIN_INTERVAL 100  // cycles between ticks: 250 kHz
#define RECEIVE 2047      // bytes

// What a tick has room for, 0.1 us: see rp2040/stepper.c.
#define STEP_HIGH_MAX 20
#define STEP_LOW_MAX 20
#define DIR_SETUP_MAX 7

// axis, STEP and DIR: GP2 ... GP7, GP8 ... GP13
#define STEPPER_PINS(P) \
    P(0, 2, 8)          \
    P(1, 3, 9)          \
    P(2, 4, 10)         \
    P(3, 5, 11)         \
    P(4, 6, 12)         \
    P(5, 7, 13)
#define STEP_FIRST 2
#define DIR_FIRST 8
#define SERVO_PINS(P) \
    P(0, 14)          \
    P(1, 15)  // the two halves of PWM slice 7
#define SERVO_SLICE 7
#define SWITCH_PINS(P) \
    P(0, 16)           \
    P(1, 17)           \
    P(2, 18)           \
    P(3, 19)           \
    P(4, 20)           \
    P(5, 21)
#define SWITCH_FIRST 16
#define ENABLE_PIN 22
#define ABORT_PIN 26
#define POWER_PIN 27  // high (3.3 V at most) while the motors have power
#define UART_TX_PIN 0
#define UART_RX_PIN 1
