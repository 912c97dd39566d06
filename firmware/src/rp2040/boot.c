// What happens before main: the boot block, the vectors, the program's way into RAM.
//
// The boot ROM reads the first 256 bytes of the flash, checks their CRC-32 and runs them at 0x20041F00 (DS 2.8.1.3). They set the flash
// interface (SSI, DS 4.10) up for plain reads with command 03h, which every serial flash knows, and go on to the vectors behind them. From then
// on speed does not matter: all of the program is copied into RAM and runs there, so that no tick waits for the flash.
// image.py puts the checksum in.
#ifdef __arm__
#include "pico.h"

__asm__(
    ".section .boot2, \"ax\"\n"
    ".thumb\n"
    "    ldr r0, =0x18000000\n"        // SSI
    "    movs r1, #0\n"
    "    str r1, [r0, #0x08]\n"        // SSIENR: off while it is set up
    "    movs r1, #4\n"
    "    str r1, [r0, #0x14]\n"        // BAUDR: system clock / 4
    "    ldr r1, =0x001F0300\n"        // CTRLR0: one lane, 32 bits a frame, mode "EEPROM read"
    "    str r1, [r0, #0x00]\n"
    "    movs r1, #0\n"
    "    str r1, [r0, #0x04]\n"        // CTRLR1: one frame a read
    "    ldr r2, =0x180000F4\n"        // SPI_CTRLR0
    "    ldr r1, =0x03000218\n"        // command 03h, of 8 bits; 24 bits of address; both on one lane
    "    str r1, [r2]\n"
    "    movs r1, #1\n"
    "    str r1, [r0, #0x08]\n"        // SSIENR: on
    "    ldr r0, =0x10000100\n"        // the vectors
    "    ldr r1, =0xE000ED08\n"        // VTOR
    "    str r0, [r1]\n"
    "    ldmia r0!, {r1, r2}\n"
    "    msr msp, r1\n"
    "    bx r2\n"
    "    .ltorg\n"
    ".text\n");

typedef void (*vector)(void);

int main(void);
void start(void);
extern uint32_t ram_begin[], ram_end[], ram_image[], bss_begin[], bss_end[], stack_top[];

void __attribute__((interrupt)) pio_interrupt(void);
void __attribute__((interrupt)) timer_interrupt(void);
void __attribute__((interrupt)) uart_interrupt(void);
void __attribute__((interrupt)) usb_interrupt(void);

// Nothing is fed any more, so STEP stays low; the watchdog makes it a reset in motion: the position is lost.
__attribute__((section(".flash"), noreturn)) static void fault(void) {
    for (;;) {
    }
}

#define VECTORS                                                                                                \
    {                                                                                                          \
        [0] = (vector)stack_top, [1] = start, [2] = fault, [3] = fault, [11] = fault, [14] = fault, [15] = fault, \
        [16 + IRQ_TIMER0] = timer_interrupt, [16 + IRQ_USB] = usb_interrupt, [16 + IRQ_PIO0] = pio_interrupt, [16 + IRQ_UART0] = uart_interrupt   \
    }
__attribute__((section(".vectors"), used)) static const vector first_vectors[48] = VECTORS;
__attribute__((aligned(256))) static const vector vectors[48] = VECTORS;  // in RAM

__attribute__((section(".flash"), noreturn, optimize("no-tree-loop-distribute-patterns"))) void start(void) {
    const uint32_t *from = ram_image;
    for (uint32_t *to = ram_begin; to < ram_end; to++) {
        *to = *from++;
    }
    for (uint32_t *to = bss_begin; to < bss_end; to++) {
        *to = 0;
    }
    REG(VTOR) = (uint32_t)vectors;
    main();
    fault();
}
#endif
