// Clocks, the watchdog, why the chip was reset.
#ifdef __arm__
#include "pico.h"

static void unreset(uint32_t parts) {
    CLEAR(RESETS_RESET) = parts;
    while ((REG(RESETS_DONE) & parts) != parts) {
    }
}

// crystal * multiplier / first / second (DS 2.18.2.1)
static void pll_setup(uint32_t pll, uint32_t reset, uint32_t multiplier, uint32_t first, uint32_t second) {
    enum { CS = 0x0, PWR = 0x4, FBDIV = 0x8, PRIM = 0xC };
    enum { POWER_DOWN = 1 << 0, DIVIDERS_DOWN = 1 << 3, VCO_DOWN = 1 << 5 };
    SET(RESETS_RESET) = reset;
    unreset(reset);
    REG(pll + CS) = 1;
    REG(pll + FBDIV) = multiplier;
    CLEAR(pll + PWR) = POWER_DOWN | VCO_DOWN;
    while (!(REG(pll + CS) >> 31)) {
    }
    REG(pll + PRIM) = first << 16 | second << 12;
    CLEAR(pll + PWR) = DIVIDERS_DOWN;
}

void clocks_setup(void) {
    enum { ENABLE = 1 << 11, XOSC_RANGE = 0xAA0, XOSC_ON = 0xFAB000, XOSC_MS = CRYSTAL_MHZ * 1000 / 256 + 1 };
    REG(XOSC_CTRL) = XOSC_RANGE;
    REG(XOSC_STARTUP) = XOSC_MS;
    SET(XOSC_CTRL) = XOSC_ON;
    while (!(REG(XOSC_STATUS) >> 31)) {
    }
    CLEAR(CLK_SYS_CTRL) = 1;  // off the PLL, if a watchdog reset left it there
    while (REG(CLK_SYS_SELECTED) != 1) {
    }
    REG(CLK_REF_CTRL) = 2;  // the crystal
    while (REG(CLK_REF_SELECTED) != 1 << 2) {
    }
    pll_setup(PLL_SYS, RESET_PLL_SYS, 125, 6, 2);  // 1500 MHz / 12 = SYSTEM_MHZ
    pll_setup(PLL_USB, RESET_PLL_USB, 100, 5, 5);  // 1200 MHz / 25 = 48 MHz
    REG(CLK_SYS_CTRL) = 0;                         // from the system PLL ...
    SET(CLK_SYS_CTRL) = 1;                         // ... now
    while (REG(CLK_SYS_SELECTED) != 1 << 1) {
    }
    REG(CLK_PERI_CTRL) = ENABLE;  // as the system's
    REG(CLK_USB_CTRL) = ENABLE;   // from the USB PLL
    REG(WATCHDOG_TICK) = 1 << 9 | CRYSTAL_MHZ;  // microseconds, for the timer too
    unreset(RESET_IO | RESET_PADS | RESET_PIO0 | RESET_PWM | RESET_TIMER | RESET_UART0 | RESET_USB);
}

enum { WATCHDOG_MS = 250 };

void watchdog_feed(void) {
    REG(WATCHDOG_LOAD) = 2 * 1000 * WATCHDOG_MS;  // it counts two a microsecond (DS appendix B, RP2040-E1)
}

void watchdog_start(void) {
    REG(PSM_WDSEL) = 0x1FFFF & ~3U;  // it resets all but the oscillators
    watchdog_feed();
    REG(WATCHDOG_CTRL) = 1 << 30;
}

uint8_t reset_cause(void) {
    enum { POWER_ON = 1, EXTERNAL = 2, WATCHDOG = 8 };
    enum { HAD_POWER_ON = 1 << 8, HAD_RUN = 1 << 16 };
    if (REG(WATCHDOG_REASON)) {
        return WATCHDOG;
    }
    // brown-outs count as power-on (DS 2.12.4)
    const uint32_t had = REG(CHIP_RESET);
    return (had & HAD_POWER_ON ? POWER_ON : 0) | (had & HAD_RUN ? EXTERNAL : 0);
}
#endif
