#include "boards.h"

#include <ctype.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* Vector numbers: ATmega328P data sheet table 12-6, ATmega2560 data sheet table 14-1.
 * An interrupt takes 4 cycles to reach its vector, 5 where the PC has three bytes. */
#define UNO .mcu = "atmega328p", .mega = false, .entry_cycles = 4, .vector_rx = 18, .vector_udre = 19, .vector_tx = 20
#define MEGA .mcu = "atmega2560", .mega = true, .entry_cycles = 5, .vector_rx = 25, .vector_udre = 26, .vector_tx = 27

const board boards[] = {
    {
        .name = "uno_cnc_shield", UNO,      /* CNC Shield V3, A axis jumpered to D12/D13 */
        .axis = {
            {"X", "D2", "D5", "D8", "D9"},
            {"Y", "D3", "D6", "D8", "D10"},
            {"Z", "D4", "D7", "D8", "D11"},
            {"A", "D12", "D13", "D8", NULL},
            {0},
        },
        .servo = {"A3", NULL},
    },
    {
        .name = "mega_ramps14", MEGA,       /* RAMPS 1.4, its five sockets and MIN end stops */
        .axis = {
            {"X", "D54", "D55", "D38", "D3"},
            {"Y", "D60", "D61", "D56", "D14"},
            {"Z", "D46", "D48", "D62", "D18"},
            {"E0", "D26", "D28", "D24", NULL},
            {"E1", "D36", "D34", "D30", NULL},
            {0},
        },
        .servo = {"D11", "D6", "D5", "D4", NULL},
    },
    {
        .name = "uno_servos", UNO,          /* a bare Uno, RC servos on D2-D7 */
        .axis = {{0}},
        .servo = {"D2", "D3", "D4", "D5", "D6", "D7", NULL},
    },
    {0},
};

/* Arduino's own tables (variants/standard and variants/mega, pins_arduino.h): port and bit of D0, D1 ... */
static const char UNO_PINS[] = "D0D1D2D3D4D5D6D7B0B1B2B3B4B5C0C1C2C3C4C5";
static const char MEGA_PINS[] =
    "E0E1E4E5G5E3H3H4H5H6B4B5B6B7J1J0H1H0D3D2D1D0A0A1A2A3A4A5A6A7C7C6C5C4C3C2C1C0D7G2G1G0L7L6L5L4L3L2L1L0"
    "B3B2B1B0F0F1F2F3F4F5F6F7K0K1K2K3K4K5K6K7";

const board *board_find(const char *name) {
    for (const board *b = boards; b->name; b++)
        if (!strcmp(b->name, name))
            return b;
    return NULL;
}

bool board_pin(const board *b, const char *name, char *port, int *bit) {
    const char *table = b->mega ? MEGA_PINS : UNO_PINS;
    int kind = toupper((unsigned char)name[0]);
    if (kind == 'P' && isalpha((unsigned char)name[1]) && name[2] >= '0' && name[2] <= '7' && !name[3]) {
        *port = (char)toupper((unsigned char)name[1]);
        *bit = name[2] - '0';
        return true;
    }
    if ((kind != 'D' && kind != 'A') || !isdigit((unsigned char)name[1]))
        return false;
    char *end;
    size_t number = strtoul(name + 1, &end, 10) + (kind == 'A' ? (b->mega ? 54 : 14) : 0);
    if (*end || 2 * number >= strlen(table))
        return false;
    *port = table[2 * number];
    *bit = table[2 * number + 1] - '0';
    return true;
}
