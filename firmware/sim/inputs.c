#include "inputs.h"

#include <stdlib.h>
#include <string.h>

#include <avr_ioport.h>
#include <sim_avr.h>

#include "pins.h"
#include "trace.h"

enum { MAX_SWITCHES = 16 };

typedef struct {
    switch_setup set;
    char pin[8];
    char port;
    int bit;
    bool pressed;             /* where the mechanics are */
    int forced;               /* 1, 0, or -1: by position */
    uint64_t settled;         /* cycle at which the contact stops bouncing */
    bool contact;             /* closed to ground at this instant */
    uint32_t random;
} limit_switch;

static struct {
    uint8_t mask, value;      /* pins driven from outside, and their levels */
} driven[16];

static limit_switch switches[MAX_SWITCHES];
static int switch_count;

/* libsimavr applies a pull-up again at every write to the port, also over a driven pin. Its "external"
 * levels win over pull-ups, so a driven pin is one with such a level. */
static void apply(char port, int bit) {
    int p = port - 'A';
    avr_ioport_external_t levels = {.name = (unsigned long)port, .mask = driven[p].mask, .value = driven[p].value};
    avr_ioctl(chip, AVR_IOCTL_IOPORT_SET_EXTERNAL(port), &levels);
    avr_ioport_state_t now;
    if (avr_ioctl(chip, AVR_IOCTL_IOPORT_GETSTATE(port), &now))
        return;
    if (now.ddr >> bit & 1)
        return;                               /* an output: whoever shorts it loses */
    bool level = driven[p].mask >> bit & 1 ? driven[p].value >> bit & 1 : now.port >> bit & 1;
    avr_raise_irq(avr_io_getirq(chip, AVR_IOCTL_IOPORT_GETIRQ(port), bit), level);
}

static void drive(char port, int bit, int level) {
    int p = port - 'A';
    uint8_t mask = (uint8_t)(1 << bit);
    driven[p].mask = (uint8_t)(level == INPUT_RELEASED ? driven[p].mask & ~mask : driven[p].mask | mask);
    driven[p].value = (uint8_t)(level == INPUT_HIGH ? driven[p].value | mask : driven[p].value & ~mask);
    trace_input(p * 8 + bit, level == INPUT_LOW ? 0 : 1);
    apply(port, bit);
}

/* The contact connects the pin to ground; open, the pin is left to the chip's pull-up. */
static void set_contact(limit_switch *s, bool closed) {
    s->contact = closed;
    drive(s->port, s->bit, closed ? INPUT_LOW : INPUT_RELEASED);
}

static bool wanted(const limit_switch *s) { return s->pressed != s->set.normally_closed; }

void inputs_attach(avr_t *avr, reset_kind kind) {
    (void)avr, (void)kind;
    for (int p = 0; p < 16; p++)
        for (int bit = 0; bit < 8; bit++)
            if (driven[p].mask >> bit & 1)
                apply((char)('A' + p), bit);
    for (int i = 0; i < switch_count; i++)    /* the timers of bouncing contacts went with the old chip */
        set_contact(&switches[i], wanted(&switches[i]));
}

bool inputs_drive(const char *pin, int level) {
    char port;
    int bit;
    if (!board_pin(chip_board, pin, &port, &bit))
        return false;
    drive(port, bit, level);
    return true;
}

static avr_cycle_count_t on_bounce(avr_t *avr, avr_cycle_count_t when, void *param) {
    (void)avr;
    limit_switch *s = param;
    if (chip_now() >= s->settled) {
        set_contact(s, wanted(s));
        return 0;
    }
    set_contact(s, !s->contact);
    s->random = s->random * 1664525u + 1013904223u;
    return when + 800 + (s->random >> 18);    /* 50 us to 1.1 ms a chatter */
}

static void press(limit_switch *s, bool pressed) {
    if (s->pressed == pressed)
        return;
    s->pressed = pressed;
    if (!s->set.bounce) {
        set_contact(s, wanted(s));
        return;
    }
    s->settled = chip_now() + s->set.bounce;
    set_contact(s, wanted(s));
    avr_cycle_timer_register(chip, 1600, on_bounce, s);
}

static bool beyond(const limit_switch *s, int64_t position) {
    return s->set.below ? position <= s->set.at : position >= s->set.at;
}

void inputs_moved(int axis, int64_t position) {
    for (int i = 0; i < switch_count; i++)
        if (switches[i].set.axis == axis && switches[i].forced < 0)
            press(&switches[i], beyond(&switches[i], position));
}

static limit_switch *find(const char *pin) {
    char port;
    int bit;
    if (!pin || !board_pin(chip_board, pin, &port, &bit))
        return NULL;
    for (int i = 0; i < switch_count; i++)
        if (switches[i].port == port && switches[i].bit == bit)
            return &switches[i];
    if (switch_count == MAX_SWITCHES)
        return NULL;
    limit_switch *s = &switches[switch_count++];
    *s = (limit_switch){.port = port, .bit = bit, .forced = -1, .random = (uint32_t)switch_count, .set = {.axis = -1}};
    snprintf(s->pin, sizeof s->pin, "%s", pin);
    return s;
}

int inputs_set_switch(const switch_setup *set) {
    limit_switch *s = find(set->pin);
    if (!s)
        return false;
    s->set = *set;
    s->set.pin = s->pin;
    s->forced = -1;
    s->pressed = beyond(s, pins_position(set->axis));
    set_contact(s, wanted(s));
    return true;
}

bool inputs_force_switch(const char *pin, int pressed) {
    limit_switch *s = find(pin);
    if (!s)
        return false;
    s->forced = pressed;
    if (pressed < 0 && s->set.axis < 0)
        pressed = 0;
    if (pressed < 0)
        pressed = beyond(s, pins_position(s->set.axis));
    if (s->pressed == pressed)
        set_contact(s, wanted(s));
    else
        press(s, pressed);
    return true;
}

void inputs_json(FILE *out) {
    fprintf(out, "\"switches\": {");
    for (int i = 0; i < switch_count; i++)
        fprintf(out, "%s\"%s\": {\"pressed\": %s, \"closed\": %s}", i ? ", " : "", switches[i].pin,
                switches[i].pressed ? "true" : "false", switches[i].contact ? "true" : "false");
    fprintf(out, "}");
}
