// The parts of the chip, and the main loop's way to them.
#pragma once
#include "../board.h"
#include "rp2040.h"

extern volatile bool awake;  // an interrupt has left something for the main loop
void sleep_setup(uint32_t now);
void sleep_until_awake(void);  // at most a millisecond

void stepper_setup(void);

void serial_setup(void);
uint8_t serial_get(const uint8_t **bytes);  // so many that came, in a row; the call takes them
void serial_pump(void);  // bytes to send, as the line takes them

void usb_setup(void);
void usb_boot_drive(bool may);  // if it was asked for: now, or, if it may not be, never
uint8_t usb_get(const uint8_t **bytes);
bool usb_ready(void);  // for a packet of at most 63 bytes
void usb_send(const uint8_t *data, uint8_t length);

void servo_setup(void);
void servo_frame(void);  // every 20 ms

void pins_setup(void);
void pin_function(uint8_t pin, uint8_t function, uint8_t pad);

void clocks_setup(void);
void watchdog_start(void);
void watchdog_feed(void);
uint8_t reset_cause(void);  // in MCUSR's bits
