// The USB serial port: the RP2040's device controller (DS 4.1), its packets in 4 kB of memory of its own.
//
// Control transfers on endpoint 0; data on endpoint 2, one buffer each way. A packet is taken only when the ring has room for it: until then
// the controller tells the host to wait, so nothing is lost here.
#ifdef __arm__
#include <string.h>

#include "../chip.h"
#include "pico.h"
#include "usb_words.h"

// Registers and packet memory (DS 4.1.4, 4.1.2.5.2)
#define USB_ADDRESS 0x50110000
#define USB_MAIN_CTRL 0x50110040
#define USB_SIE_CTRL 0x5011004C
#define USB_SIE_STATUS 0x50110050
#define USB_BUFF_STATUS 0x50110058
#define USB_STALL_ARM 0x50110068
#define USB_MUXING 0x50110074
#define USB_POWER 0x50110078
#define USB_INTE 0x50110090
#define USB_INTS 0x50110098
#define PACKETS 0x50100000
#define CONTROL_IN(endpoint) (PACKETS + 8 * (endpoint))      // of endpoints from 1 on
#define CONTROL_OUT(endpoint) (PACKETS + 8 * (endpoint) + 4)
#define BUFFER_IN(endpoint) (PACKETS + 0x80 + 8 * (endpoint))
#define BUFFER_OUT(endpoint) (PACKETS + 0x84 + 8 * (endpoint))
#define AT(offset) ((volatile uint8_t *)(uintptr_t)(PACKETS + (offset)))

enum { SETUP_AT = 0x000, CONTROL_AT = 0x100, NOTICE_AT = 0x180, IN_AT = 0x1C0, OUT_AT = 0x200 };
enum { FULL = 1 << 15, DATA1 = 1 << 13, STALL = 1 << 11, AVAILABLE = 1 << 10, LENGTH = 0x3FF };  // buffer control
enum { BULK = 2U << 26, INTERRUPT = 3U << 26 };                                                   // endpoint control
#define ENABLED (1UL << 31 | 1UL << 29)                                                           // and told of every buffer
enum { ON_BUFFER = 1 << 4, ON_RESET = 1 << 12, ON_SETUP = 1 << 16 };                              // interrupts
enum { WAS_RESET = 1 << 19, WAS_SETUP = 1 << 17 };                                                // SIE_STATUS

#define ROM16(at) (*(volatile const uint16_t *)(uintptr_t)(at))
enum { BOOT_DRIVE_BAUD = 1200 };

enum { RING = 4096, RING_MASK = RING - 1 };
static uint8_t ring[RING];
static volatile uint16_t ring_head, ring_tail;

static volatile bool configured, sending, receiving;
static bool in_data1, out_data1;  // which packet of a pair is next
static uint8_t new_address;
static bool takes_line_coding, baud_was_set;
static volatile bool to_boot_drive;  // asked for by 1200 baud
static const uint8_t *answer;  // what is left to send on endpoint 0
static uint16_t answer_left;
static bool answer_data1;
static uint8_t line_coding[7] = {0x90, 0xD0, 0x03, 0x00, 0, 0, 8};  // 250000 8N1, without meaning here

// AVAILABLE comes last, and the controller's slower clock has to have seen the rest by then (DS 4.1.2.5.1).
static void hand_over(uint32_t control, uint32_t value) {
    REG(control) = value;
    for (uint8_t n = 0; n < 4; n++) {
        __asm__ volatile("nop\n\tnop\n\tnop");
    }
    REG(control) = value | AVAILABLE;
}

static void put(uint16_t at, const uint8_t *data, uint16_t length) {
    for (uint16_t i = 0; i < length; i++) {
        AT(at)[i] = data[i];
    }
}

// ---- endpoint 0

static void answer_on(void) {
    const uint16_t part = answer_left < PACKET ? answer_left : PACKET;
    put(CONTROL_AT, answer, part);
    answer += part;
    answer_left -= part;
    hand_over(BUFFER_IN(0), FULL | (answer_data1 ? DATA1 : 0) | part);
    answer_data1 = !answer_data1;
}

static void say(const uint8_t *data, uint16_t length, uint16_t wanted) {
    answer = data;
    answer_left = length < wanted ? length : wanted;
    answer_on();
}

static void agree(void) {
    say(0, 0, 0);
}

static void refuse(void) {
    REG(USB_STALL_ARM) = 3;  // both ways of endpoint 0
    REG(BUFFER_IN(0)) = STALL;
    REG(BUFFER_OUT(0)) = STALL;
}

static void await_packet(void) {
    receiving = true;
    hand_over(BUFFER_OUT(DATA), (out_data1 ? DATA1 : 0) | PACKET);
    out_data1 = !out_data1;
}

static void configure(void) {
    REG(CONTROL_IN(NOTICE_IN)) = ENABLED | INTERRUPT | NOTICE_AT;
    REG(CONTROL_IN(DATA)) = ENABLED | BULK | IN_AT;
    REG(CONTROL_OUT(DATA)) = ENABLED | BULK | OUT_AT;
    in_data1 = out_data1 = sending = false;
    configured = true;
    await_packet();
}

static void descriptor(uint8_t kind, uint8_t index, uint16_t wanted) {
    if (kind == 1) {
        say(device_descriptor, sizeof device_descriptor, wanted);
    } else if (kind == 2) {
        say(configuration_descriptor, sizeof configuration_descriptor, wanted);
    } else if (kind == 3 && index == 0) {
        say(languages, sizeof languages, wanted);
    } else if (kind == 3 && index == 1) {
        say(maker, sizeof maker, wanted);
    } else if (kind == 3 && index == 2) {
        say(product, sizeof product, wanted);
    } else {
        refuse();
    }
}

static void standard(uint8_t request, uint16_t value, uint16_t index, uint16_t wanted) {
    enum { GET_STATUS, CLEAR_FEATURE, SET_FEATURE = 3, SET_ADDRESS = 5, GET_DESCRIPTOR, GET_CONFIGURATION = 8, SET_CONFIGURATION };
    static const uint8_t nothing[2] = {0, 0}, one[1] = {1};
    switch (request) {
        case SET_ADDRESS:
            new_address = value;  // valid once the host has heard the answer
            agree();
            break;
        case GET_DESCRIPTOR:
            descriptor(value >> 8, value, wanted);
            break;
        case SET_CONFIGURATION:
            configure();
            agree();
            break;
        case GET_CONFIGURATION:
            say(configured ? one : nothing, 1, wanted);
            break;
        case GET_STATUS:
            say(nothing, 2, wanted);
            break;
        case CLEAR_FEATURE:  // an endpoint's halt: its packets begin anew
            if ((index & 0x7F) == DATA) {
                *(index & 0x80 ? &in_data1 : &out_data1) = false;
            }
            agree();
            break;
        case SET_FEATURE:
            agree();
            break;
        default:
            refuse();
    }
}

static void of_class(uint8_t request, uint16_t wanted) {
    enum { SET_LINE_CODING = 0x20, GET_LINE_CODING, SET_CONTROL_LINE_STATE, SEND_BREAK };
    if (request == SET_LINE_CODING && wanted == sizeof line_coding) {
        takes_line_coding = true;
        hand_over(BUFFER_OUT(0), DATA1 | PACKET);
    } else if (request == GET_LINE_CODING) {
        say(line_coding, sizeof line_coding, wanted);
    } else if (request == SET_CONTROL_LINE_STATE || request == SEND_BREAK) {
        agree();  // DTR resets nothing
    } else {
        refuse();
    }
}

static void setup_received(void) {
    uint8_t p[8];
    for (uint8_t i = 0; i < sizeof p; i++) {
        p[i] = AT(SETUP_AT)[i];
    }
    const uint16_t value = p[2] | p[3] << 8, index = p[4] | p[5] << 8, wanted = p[6] | p[7] << 8;
    answer_data1 = true;
    answer_left = 0;
    new_address = 0;
    takes_line_coding = false;
    if ((p[0] & 0x60) == 0x00) {
        standard(p[1], value, index, wanted);
    } else if ((p[0] & 0x60) == 0x20) {
        of_class(p[1], wanted);
    } else {
        refuse();
    }
}

static uint32_t line_baud(void) {
    return line_coding[0] | line_coding[1] << 8 | line_coding[2] << 16 | (uint32_t)line_coding[3] << 24;
}

static void control_sent(void) {
    if (new_address) {
        REG(USB_ADDRESS) = new_address;
        new_address = 0;
    } else if (answer_left) {
        answer_on();
    } else if (REG(BUFFER_IN(0)) & LENGTH) {
        hand_over(BUFFER_OUT(0), DATA1);  // the host says that it has it all
    } else {
        to_boot_drive = baud_was_set && line_baud() == BOOT_DRIVE_BAUD;
    }
    baud_was_set = false;
}

static void control_received(void) {
    if (takes_line_coding) {
        takes_line_coding = false;
        baud_was_set = true;
        for (uint8_t i = 0; i < sizeof line_coding; i++) {
            line_coding[i] = AT(CONTROL_AT)[i];
        }
        agree();
    }
}

// ---- data

static uint16_t room(void) {
    return RING_MASK - ((ring_head - ring_tail) & RING_MASK);
}

static void packet_received(void) {
    const uint16_t length = REG(BUFFER_OUT(DATA)) & LENGTH;
    const uint16_t head = ring_head, first = length < RING - head ? length : RING - head;
    memcpy(ring + head, (const void *)AT(OUT_AT), first);
    memcpy(ring, (const void *)(AT(OUT_AT) + first), length - first);
    HAL_BARRIER();
    ring_head = (head + length) & RING_MASK;
    receiving = false;
    if (room() >= PACKET) {
        await_packet();
    }
}

void usb_interrupt(void) {
    const uint32_t why = REG(USB_INTS);
    if (why & ON_RESET) {
        REG(USB_SIE_STATUS) = WAS_RESET;
        REG(USB_ADDRESS) = 0;
        configured = sending = receiving = false;
    }
    if (why & ON_SETUP) {
        REG(USB_SIE_STATUS) = WAS_SETUP;
        setup_received();
    }
    if (why & ON_BUFFER) {
        const uint32_t done = REG(USB_BUFF_STATUS);  // two bits an endpoint: in, out
        REG(USB_BUFF_STATUS) = done;
        if (done & 1) {
            control_sent();
        }
        if (done & 2) {
            control_received();
        }
        if (done >> (2 * DATA) & 1) {
            sending = false;
        }
        if (done >> (2 * DATA + 1) & 1) {
            packet_received();
        }
    }
    awake = true;
}

// The ROM starts anew as the drive that takes UF2 files; its functions are found by two letters (DS 2.8.3).
static void become_boot_drive(void) {
    typedef void *find(const uint16_t *table, uint32_t code);
    typedef void usb_boot(uint32_t lamp, uint32_t without);
    const uint16_t *const table = (const uint16_t *)(uintptr_t)ROM16(0x14);
    usb_boot *const start = (usb_boot *)((find *)(uintptr_t)ROM16(0x18))(table, 'U' | 'B' << 8);
    start(0, 0);
}

void usb_boot_drive(bool may) {
    if (to_boot_drive) {
        to_boot_drive = false;
        if (may) {
            become_boot_drive();
        }
    }
}

uint8_t usb_get(const uint8_t **bytes) {
    static uint16_t given;  // they may be written over now
    if (given) {
        ring_tail = (ring_tail + given) & RING_MASK;
        given = 0;
        HAL_LOCK();
        if (!receiving && configured && room() >= PACKET) {
            await_packet();
        }
        HAL_UNLOCK();
    }
    const uint16_t tail = ring_tail, head = ring_head;
    const uint16_t run = (head >= tail ? head : RING) - tail;
    given = run < PACKET ? run : PACKET;
    *bytes = &ring[tail];
    if (given) {
        awake = true;  // there may be more
    }
    return given;
}

bool usb_ready(void) {
    return configured && !sending;
}

void usb_send(const uint8_t *data, uint8_t length) {
    put(IN_AT, data, length);
    sending = true;
    const bool second = in_data1;
    in_data1 = !in_data1;
    hand_over(BUFFER_IN(DATA), FULL | (second ? DATA1 : 0) | length);
}

void usb_setup(void) {
    for (uint16_t i = 0; i < 0x1000; i += 4) {
        REG(PACKETS + i) = 0;
    }
    REG(USB_MUXING) = 1 << 3 | 1 << 0;  // to the pins of the chip's own transceiver
    REG(USB_POWER) = 1 << 3 | 1 << 2;   // as if the bus's power were sensed
    REG(USB_MAIN_CTRL) = 1;
    REG(USB_SIE_CTRL) = 1 << 29;  // told of every buffer of endpoint 0
    REG(USB_INTE) = ON_BUFFER | ON_RESET | ON_SETUP;
    irq_enable(IRQ_USB, 2);
    SET(USB_SIE_CTRL) = 1 << 16;  // the pull-up: here is a device
}
#endif
