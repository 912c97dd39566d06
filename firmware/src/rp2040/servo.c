// Servo pulses: one PWM slice counts microseconds; its two halves are the two servos. A new width waits for the end of the period.
#ifdef __arm__
#include "../core/motion.h"
#include "pico.h"

enum { PERIOD_US = 20000 };

void servo_frame(void) {
    int32_t counts[AXES];
    uint32_t width[SERVOS];
    motion_counts(counts);
    for (uint8_t i = 0; i < SERVOS; i++) {
        const bool on = motion.pulses && memory.known >> (STEPPERS + i) & 1;
        width[i] = on ? (uint32_t)counts[STEPPERS + i] : 0;  // 0: no pulse
    }
    REG(PWM_CC(SERVO_SLICE)) = width[0] | width[1] << 16;
}

void servo_setup(void) {
    REG(PWM_DIV(SERVO_SLICE)) = SYSTEM_MHZ << 4;
    REG(PWM_TOP(SERVO_SLICE)) = PERIOD_US - 1;
    REG(PWM_CC(SERVO_SLICE)) = 0;
    REG(PWM_CSR(SERVO_SLICE)) = 1;
#define SERVO_OUTPUT(i, pin) pin_function(pin, F_PWM, PAD_4MA);
    SERVO_PINS(SERVO_OUTPUT)
}
#endif
