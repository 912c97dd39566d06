#include "chip.h"

#include <stdlib.h>
#include <string.h>

#include <avr_eeprom.h>
#include <avr_extint.h>
#include <sim_avr.h>
#include <sim_core.h>

#include "program.h"

enum { MCUSR = 0x54, WDTCSR = 0x60 };             /* data-space addresses on both chips */
enum { WDCE = 0x10, WDE = 0x08 };
enum { BOOTLOADER_STACK = 64 };

const board *chip_board;
avr_t *chip;
bool chip_stop;
double chip_bootloader_ms = -1;

static uint64_t base;                 /* cycles before the present chip was made */
static uint64_t boot_end;             /* the bootloader runs until then */
static uint64_t random_state;
static int resets;
static reset_kind last_reset;
static uint64_t lost_in_boot;
static const chip_part *parts;

/* The SRAM between the last variable and the top is filled with a pattern; what differs later was touched. */
static uint8_t *pattern;
static long stack_floor, lowest_touched;

static uint64_t random_bits(void) {
    random_state ^= random_state >> 12;
    random_state ^= random_state << 25;
    random_state ^= random_state >> 27;
    return random_state * 0x2545F4914F6CDD1DULL;
}

static void fill_random(uint8_t *bytes, long n) {
    for (long i = 0; i < n; i++)
        bytes[i] = (uint8_t)(random_bits() >> 56);
}

uint64_t chip_now(void) { return base + (chip ? chip->cycle : 0); }

static bool alive(void) { return chip->state == cpu_Running || chip->state == cpu_Sleeping; }

const char *chip_state(void) {
    if (chip_now() < boot_end)
        return "bootloader";
    if (alive())
        return "running";
    return chip->state == cpu_Done ? "stopped" : "crashed";
}

avr_int_vector_t *chip_vector(int number) {
    for (int i = 0; i < chip->interrupts.vector_count; i++)
        if (chip->interrupts.vector[i]->vector == number)
            return chip->interrupts.vector[i];
    fprintf(stderr, "simboard: libsimavr knows no vector %d of %s\n", number, chip_board->mcu);
    exit(1);
}

static void on_sleep(avr_t *avr, avr_cycle_count_t cycles) {
    (void)avr, (void)cycles;              /* the main loop keeps the pace, libsimavr must not */
}

static void on_log(avr_t *avr, const int wanted, const char *format, va_list values) {
    if (wanted > LOG_ERROR || (avr && avr->state == cpu_Crashed))
        return;
    fputs("simboard: ", stderr);
    vfprintf(stderr, format, values);
    /* libsimavr runs on over what it cannot decode */
    if (avr && strstr(format, "CORE:"))
        avr->state = cpu_Crashed;
}

static bool in_sram(long address, int n) { return address > 0 && n > 0 && address + n - 1 <= chip->ramend; }

bool chip_peek(long address, uint8_t *bytes, int n) {
    if (!in_sram(address, n))
        return false;
    memcpy(bytes, chip->data + address, (size_t)n);
    return true;
}

bool chip_poke(long address, const uint8_t *bytes, int n) {
    if (!in_sram(address, n))
        return false;
    memcpy(chip->data + address, bytes, (size_t)n);
    return true;
}

/* Look how far the stack has ever come down; the pattern is contiguous from `stack_floor`. */
static void look_at_stack(void) {
    long a = stack_floor;
    while (a < lowest_touched && chip->data[a] == pattern[a])
        a++;
    lowest_touched = a;
}

static void paint_stack(void) {
    fill_random(chip->data + stack_floor, chip->ramend + 1 - stack_floor);
    memcpy(pattern, chip->data, chip->ramend + 1);
}

bool chip_load(const board *b, const char *elf, uint64_t seed, const chip_part *hung_on) {
    avr_global_logger_set(on_log);
    chip_board = b;
    parts = hung_on;
    random_state = seed * 0x9E3779B97F4A7C15ULL | 1;
    return program_load(elf);
}

static avr_t *make_chip(void) {
    avr_t *avr = avr_make_mcu_by_name(chip_board->mcu);
    if (!avr || avr_init(avr)) {
        fprintf(stderr, "simboard: libsimavr has no %s\n", chip_board->mcu);
        exit(1);
    }
    if (program.flashsize)
        avr_load_firmware(avr, &program);
    if (loader.code) {
        if (loader.at + loader.size > avr->flashend + 1) {
            fprintf(stderr, "simboard: the boot loader ends at 0x%x, beyond the flash\n", loader.at + loader.size);
            exit(2);
        }
        memcpy(avr->flash + loader.at, loader.code + loader.at, loader.size);
        avr->reset_pc = avr->pc = loader.at;
        avr->codeend = avr->flashend;
    }
    avr->frequency = CLOCK_HZ;
    avr->sleep = on_sleep;
    avr->run_cycle_limit = CLOCK_HZ / 100;
    avr->log = LOG_ERROR;
    /* else INT0 and INT1 cost a callback every cycle while PD2 or PD3 is low */
    for (int i = 0; i < EXTINT_COUNT; i++)
        avr_extint_set_strict_lvl_trig(avr, (uint8_t)i, 0);
    return avr;
}

static uint8_t *read_eeprom(avr_t *avr) {
    avr_eeprom_desc_t d = {.ee = malloc(avr->e2end + 1), .offset = 0, .size = avr->e2end + 1};
    if (d.ee)
        avr_ioctl(avr, AVR_IOCTL_EEPROM_GET, &d);
    return d.ee;
}

/* A reset makes a new chip and carries over what survives on silicon. libsimavr's own avr_reset() forgets
 * its cycle timers, leaves half of the peripherals as they were and sets no reset flag. */
void chip_reset(reset_kind kind) {
    static const uint8_t flag[] = {[RESET_POWER] = 1, [RESET_EXTERNAL] = 2, [RESET_BROWNOUT] = 4, [RESET_WATCHDOG] = 8};
    avr_t *old = chip;
    uint64_t now = chip_now();
    avr_t *avr = make_chip();
    long sram = avr->ioend + 1, top = avr->ramend;
    bool powered = old && kind != RESET_POWER && kind != RESET_BROWNOUT;

    if (!pattern) {
        pattern = calloc(1, (size_t)top + 1);
        long end = program_symbol("_end");
        stack_floor = end > 0 ? end : sram;
        lowest_touched = top + 1;
    }
    if (old)
        look_at_stack();
    uint8_t flags = flag[kind];
    if (old && kind != RESET_POWER)
        flags |= old->data[MCUSR];        /* flags stay until the program clears them */
    if (powered)
        memcpy(avr->data + sram, old->data + sram, (size_t)(top + 1 - sram));
    else
        fill_random(avr->data + sram, top + 1 - sram);
    if (old) {
        if (loader.code)                  /* which may have written it */
            memcpy(avr->flash, old->flash, old->flashend + 1);
        avr_eeprom_desc_t d = {.ee = read_eeprom(old), .offset = 0, .size = old->e2end + 1};
        avr_ioctl(avr, AVR_IOCTL_EEPROM_SET, &d);
        free(d.ee);
        avr_terminate(old);
        free(old);
    }
    base = now;
    avr->cycle = 0;
    chip = avr;
    if (!powered)
        paint_stack();
    boot_end = now;
    if (chip_bootloader_ms >= 0) {
        flags = 0;
        fill_random(avr->data + top + 1 - BOOTLOADER_STACK, BOOTLOADER_STACK);
        memcpy(pattern + top + 1 - BOOTLOADER_STACK, avr->data + top + 1 - BOOTLOADER_STACK, BOOTLOADER_STACK);
        if (kind == RESET_EXTERNAL)
            boot_end = now + (uint64_t)(chip_bootloader_ms * (CLOCK_HZ / 1000));
    }
    avr->data[MCUSR] = flags;
    resets++;
    last_reset = kind;

    for (const chip_part *p = parts; p->attach; p++)
        p->attach(avr, kind);
    /* After a watchdog reset the watchdog stays on at its shortest time (16 ms) until the program turns it
     * off: a program that forgets to is reset for ever. Bootloaders turn it off. */
    if (kind == RESET_WATCHDOG && chip_bootloader_ms < 0) {
        avr_io_write_t write = avr->io[AVR_DATA_TO_IO(WDTCSR)].w.c;
        void *param = avr->io[AVR_DATA_TO_IO(WDTCSR)].w.param;
        write(avr, WDTCSR, WDCE | WDE, param);
        write(avr, WDTCSR, WDE, param);
    }
}

static avr_cycle_count_t on_slice_end(avr_t *avr, avr_cycle_count_t when, void *param) {
    (void)avr, (void)when, (void)param;   /* makes libsimavr come back to us at this cycle, also from sleep */
    return 0;
}

void chip_run_until(uint64_t end) {
    chip_stop = false;
    while (chip_now() < end && !chip_stop) {
        if (chip_now() < boot_end || !alive()) {
            uint64_t until = alive() && boot_end < end ? boot_end : end;
            for (const chip_part *p = parts; p->attach; p++)
                lost_in_boot += p->swallow ? p->swallow() : 0;
            base += until - chip_now();
            continue;
        }
        avr_cycle_timer_register(chip, end - chip_now(), on_slice_end, NULL);
        for (const chip_part *p = parts; p->attach; p++)
            if (p->start)
                p->start();
        while (chip_now() < end && !chip_stop && alive() && chip->run == avr_callback_run_raw)
            avr_run(chip);
        if (chip->run != avr_callback_run_raw)
            chip_reset(RESET_WATCHDOG);   /* libsimavr's watchdog asks for a reset by this hook */
    }
    avr_cycle_timer_cancel(chip, on_slice_end, NULL);
}

void chip_json(FILE *out) {
    static const char *kinds[] = {"power", "brownout", "external", "watchdog"};
    look_at_stack();
    fprintf(out, "\"cycle\": %llu, \"seconds\": %.9f, \"state\": \"%s\", \"resets\": %d, \"last_reset\": \"%s\", ",
            (unsigned long long)chip_now(), (double)chip_now() / CLOCK_HZ, chip_state(), resets, kinds[last_reset]);
    fprintf(out, "\"lost_in_bootloader\": %llu, ", (unsigned long long)lost_in_boot);
    fprintf(out, "\"memory\": {\"flash\": %u, \"ram\": %d, \"variables\": %ld, \"stack_never_touched\": %ld}",
            program.flashsize, chip->ramend - chip->ioend, stack_floor - chip->ioend - 1, lowest_touched - stack_floor);
}
