#include "program.h"

#include <fcntl.h>
#include <gelf.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { DATA_OFFSET = 0x800000, EEPROM_OFFSET = 0x810000 };     /* where the linker puts the data space */

elf_firmware_t program;

static struct {
    char *name;
    long address;
} *symbols;
static int symbol_count;

static void read_symbols(Elf *elf) {
    Elf_Scn *section = NULL;
    GElf_Shdr header;
    while ((section = elf_nextscn(elf, section))) {
        if (!gelf_getshdr(section, &header) || header.sh_type != SHT_SYMTAB)
            continue;
        Elf_Data *data = elf_getdata(section, NULL);
        int n = (int)(header.sh_size / header.sh_entsize);
        symbols = calloc((size_t)n, sizeof *symbols);
        for (int i = 0; i < n; i++) {
            GElf_Sym symbol;
            gelf_getsym(data, i, &symbol);
            const char *name = elf_strptr(elf, header.sh_link, symbol.st_name);
            if (!name || symbol.st_value < DATA_OFFSET || symbol.st_value >= EEPROM_OFFSET)
                continue;
            symbols[symbol_count].name = strdup(name);
            symbols[symbol_count++].address = (long)(symbol.st_value - DATA_OFFSET);
        }
        return;
    }
}

bool program_load(const char *path) {
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    elf_version(EV_CURRENT);
    Elf *elf = fd < 0 ? NULL : elf_begin(fd, ELF_C_READ, NULL);
    bool good = elf && elf_kind(elf) == ELF_K_ELF;
    if (good)
        read_symbols(elf);
    if (elf)
        elf_end(elf);
    if (fd >= 0)
        close(fd);
    return good && !elf_read_firmware(path, &program) && program.flashsize > 0;
}

long program_symbol(const char *name) {
    for (int i = 0; i < symbol_count; i++)
        if (!strcmp(symbols[i].name, name))
            return symbols[i].address;
    return -1;
}
