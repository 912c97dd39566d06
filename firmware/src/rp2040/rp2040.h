// Registers of the RP2040 that this firmware touches. "DS" is the RP2040 datasheet (build 2023-06-14 and later), by section.
#pragma once
#include <stdbool.h>
#include <stdint.h>

#define REG(address) (*(volatile uint32_t *)(uintptr_t)(address))
// Aliases of every peripheral register that set or clear the bits written (DS 2.1.2).
#define SET(address) REG((address) + 0x2000)
#define CLEAR(address) REG((address) + 0x3000)

// Resets (DS 2.14)
#define RESETS_RESET 0x4000C000
#define RESETS_DONE 0x4000C008
enum {
    RESET_IO = 1 << 5,
    RESET_PADS = 1 << 8,
    RESET_PIO0 = 1 << 10,
    RESET_PLL_SYS = 1 << 12,
    RESET_PLL_USB = 1 << 13,
    RESET_PWM = 1 << 14,
    RESET_TIMER = 1 << 21,
    RESET_UART0 = 1 << 22,
    RESET_USB = 1 << 24,
};

// Clocks (DS 2.15), crystal oscillator (2.16), PLLs (2.18)
#define CLK_REF_CTRL 0x40008030
#define CLK_REF_SELECTED 0x40008038
#define CLK_SYS_CTRL 0x4000803C
#define CLK_SYS_SELECTED 0x40008044
#define CLK_PERI_CTRL 0x40008048
#define CLK_USB_CTRL 0x40008054
#define XOSC_CTRL 0x40024000
#define XOSC_STATUS 0x40024004
#define XOSC_STARTUP 0x4002400C
#define PLL_SYS 0x40028000
#define PLL_USB 0x4002C000

// Power-on state machine, what reset the chip, watchdog (DS 2.13, 2.12, 4.7)
#define PSM_WDSEL 0x40010008
#define CHIP_RESET 0x40064008
#define WATCHDOG_CTRL 0x40058000
#define WATCHDOG_LOAD 0x40058004
#define WATCHDOG_REASON 0x40058008
#define WATCHDOG_TICK 0x4005802C

// Timer (DS 4.6): microseconds
#define TIMER_ALARM0 0x40054010
#define TIMER_RAWL 0x40054028
#define TIMER_INTR 0x40054034
#define TIMER_INTE 0x40054038

// Pins (DS 2.19), and the processor's own way to them (2.3.1)
#define IO_CTRL(pin) (0x40014004 + 8 * (pin))
#define PAD(pin) (0x4001C004 + 4 * (pin))
enum { PAD_INPUT = 1 << 6, PAD_4MA = 1 << 4, PAD_UP = 1 << 3, PAD_SCHMITT = 1 << 1 };
enum { F_UART = 2, F_PWM = 4, F_SIO = 5, F_PIO0 = 6 };
#define SIO_IN 0xD0000004
#define SIO_OUT_SET 0xD0000014
#define SIO_OUT_CLR 0xD0000018
#define SIO_OE_SET 0xD0000024

// PIO 0, state machine 0 (DS 3.7)
#define PIO_CTRL 0x50200000
#define PIO_FSTAT 0x50200004
#define PIO_FDEBUG 0x50200008
#define PIO_TXF0 0x50200010
#define PIO_IRQ 0x50200030
#define PIO_INSTR_MEM(i) (0x50200048 + 4 * (i))
#define PIO_SM0_CLKDIV 0x502000C8
#define PIO_SM0_EXECCTRL 0x502000CC
#define PIO_SM0_SHIFTCTRL 0x502000D0
#define PIO_SM0_ADDR 0x502000D4
#define PIO_SM0_INSTR 0x502000D8
#define PIO_SM0_PINCTRL 0x502000DC
#define PIO_IRQ0_INTE 0x5020012C

// PWM (DS 4.5)
#define PWM_CSR(slice) (0x40050000 + 0x14 * (slice))
#define PWM_DIV(slice) (0x40050004 + 0x14 * (slice))
#define PWM_CC(slice) (0x4005000C + 0x14 * (slice))
#define PWM_TOP(slice) (0x40050010 + 0x14 * (slice))

// UART 0 (DS 4.2)
#define UART_DR 0x40034000
#define UART_FR 0x40034018
#define UART_IBRD 0x40034024
#define UART_FBRD 0x40034028
#define UART_LCR_H 0x4003402C
#define UART_CR 0x40034030
#define UART_IFLS 0x40034034
#define UART_IMSC 0x40034038
#define UART_ICR 0x40034044

// The processor's interrupts (DS 2.3.2, 2.4.8)
#define NVIC_ISER 0xE000E100
#define NVIC_IPR(irq) (0xE000E400 + ((irq) & ~3))
#define VTOR 0xE000ED08
enum { IRQ_TIMER0 = 0, IRQ_USB = 5, IRQ_PIO0 = 7, IRQ_UART0 = 20 };

enum { SYSTEM_MHZ = 125, CRYSTAL_MHZ = 12 };

// `priority`: 0 (first) ... 3
static inline void irq_enable(uint8_t irq, uint8_t priority) {
    const uint8_t shift = 8 * (irq & 3);
    REG(NVIC_IPR(irq)) = (REG(NVIC_IPR(irq)) & ~(0xFFUL << shift)) | (uint32_t)priority << (6 + shift);
    REG(NVIC_ISER) = 1UL << irq;
}
