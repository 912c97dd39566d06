#include "program.h"

#include <fcntl.h>
#include <gelf.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { DATA_OFFSET = 0x800000, EEPROM_OFFSET = 0x810000 };     /* where the linker puts the data space */

elf_firmware_t program;
boot_loader loader;

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

bool loader_load(const char *hex) {
    enum { MOST = 1 << 18 };              /* the flash of an ATmega2560 */
    FILE *in = fopen(hex, "r");
    uint32_t base = 0, end = 0;
    char line[600];
    loader.at = MOST;
    loader.code = malloc(MOST);
    memset(loader.code, 0xFF, MOST);      /* as empty flash */
    while (in && fgets(line, sizeof line, in)) {
        unsigned n, at, type, b, value = 0;
        if (sscanf(line, ":%2x%4x%2x", &n, &at, &type) != 3)
            break;
        for (unsigned i = 0; i < n && sscanf(line + 9 + 2 * i, "%2x", &b) == 1; i++) {
            value = value << 8 | b;
            if (type == 0 && base + at + i < MOST)
                loader.code[base + at + i] = (uint8_t)b;
        }
        if (type == 2 || type == 4)
            base = value << (type == 2 ? 4 : 16);
        if (type == 0 && n && base + at + n <= MOST) {
            loader.at = base + at < loader.at ? base + at : loader.at;
            end = base + at + n > end ? base + at + n : end;
        }
    }
    if (in)
        fclose(in);
    loader.size = end > loader.at ? end - loader.at : 0;
    return loader.size > 0;
}

bool program_load(const char *path) {
    if (!path)
        return true;
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
