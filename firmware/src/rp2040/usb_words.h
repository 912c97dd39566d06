// What the board says of itself on the USB: a serial port (USB CDC 1.2, abstract control model; IAD as in USB 2.0's ECN).
//
// 1209:0001 is pid.codes' number for tests: whoever sells boards asks for one of their own.
#pragma once
#include <stdint.h>

enum { NOTICE_IN = 1, DATA = 2 };  // endpoints; DATA both ways
enum { PACKET = 64 };

static const uint8_t device_descriptor[] = {
    18,   1,                       // device
    0x00, 0x02,                    // USB 2.0
    0xEF, 2,    1,    PACKET,      // classes are told by association
    0x09, 0x12, 0x01, 0x00,        // 1209:0001
    0x00, 0x02,                    // version
    1,    2,    0,    1,           // strings: maker, product; one configuration
};

static const uint8_t configuration_descriptor[] = {
    9, 2, 75, 0, 2, 1, 0, 0x80, 250,           // 75 bytes, two interfaces, from the bus, 500 mA at most
    8, 11, 0, 2, 2, 2, 0, 0,                   // both belong together
    9, 4, 0, 0, 1, 2, 2, 0, 0,                 // control, one endpoint
    5, 0x24, 0, 0x20, 0x01,                    //   header: CDC 1.2
    5, 0x24, 1, 0, 1,                          //   no calls; data on interface 1
    4, 0x24, 2, 2,                             //   line coding and line state
    5, 0x24, 6, 0, 1,                          //   union
    7, 5, 0x80 | NOTICE_IN, 3, 8, 0, 255,      //   interrupt, never used
    9, 4, 1, 0, 2, 10, 0, 0, 0,                // data, two endpoints
    7, 5, DATA, 2, PACKET, 0, 0,               //   bulk out
    7, 5, 0x80 | DATA, 2, PACKET, 0, 0,        //   bulk in
};
_Static_assert(sizeof configuration_descriptor == 75, "its own length");

static const uint8_t languages[] = {4, 3, 0x09, 0x04};
static const uint8_t maker[] = {14, 3, 'a', 0, 'r', 0, 'm', 0, 'k', 0, 'i', 0, 'n', 0};
static const uint8_t product[] = {12, 3, 'p', 0, 'i', 0, 'c', 0, 'o', 0, '6', 0};
