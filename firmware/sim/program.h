/* The compiled program: its code for libsimavr, its variables by name. */
#ifndef SIM_PROGRAM_H
#define SIM_PROGRAM_H

#include <stdbool.h>
#include <sim_avr.h>
#include <sim_elf.h>

extern elf_firmware_t program;

/* NULL: the flash is empty. */
bool program_load(const char *elf);

/* A boot loader, at the top of the flash: every reset starts it. */
typedef struct {
    uint8_t *code;                        /* the whole flash; NULL: there is none */
    uint32_t at, size;                    /* where it starts, and its length */
} boot_loader;

extern boot_loader loader;

bool loader_load(const char *hex);


/* Data-space address of a variable or linker symbol, -1 if there is none. libsimavr keeps no linker symbols. */
long program_symbol(const char *name);

#endif
