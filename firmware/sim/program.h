/* The compiled program: its code for libsimavr, its variables by name. */
#ifndef SIM_PROGRAM_H
#define SIM_PROGRAM_H

#include <stdbool.h>
#include <sim_avr.h>
#include <sim_elf.h>

extern elf_firmware_t program;

bool program_load(const char *elf);

/* Data-space address of a variable or linker symbol, -1 if there is none. libsimavr keeps no linker symbols. */
long program_symbol(const char *name);

#endif
