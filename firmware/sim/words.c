#include "words.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>

#include "boards.h"

static char *rest;

void words_begin(char *line) { rest = line; }

const char *words_rest(void) { return rest ? rest : ""; }

const char *word(void) {
    char *w;
    do
        w = strsep(&rest, " \t");
    while (w && !*w);
    if (w)                    /* what is quoted in a reply must not break its JSON */
        for (char *p = w; *p; p++)
            if (*p == '"' || *p == '\\' || !isprint((unsigned char)*p))
                *p = '?';
    return w ? w : "";
}

bool word_time(const char *text, uint64_t *cycles) {
    char *end;
    double v = strtod(text, &end);
    if (end == text || !(v >= 0) || v > 1e12)
        return false;
    if (!strcmp(end, "s"))
        v *= CLOCK_HZ;
    else if (!strcmp(end, "ms"))
        v *= CLOCK_HZ / 1e3;
    else if (!strcmp(end, "us"))
        v *= CLOCK_HZ / 1e6;
    else if (*end && strcmp(end, "cycles"))
        return false;
    *cycles = (uint64_t)(v + 0.5);
    return true;
}

bool word_number(const char *text, double *v) {
    char *end;
    *v = strtod(text, &end);
    return end != text && !*end;
}

bool word_integer(const char *text, long long *v) {
    char *end;
    *v = strtoll(text, &end, 0);
    return end != text && !*end;
}

long word_bytes(const char *text, uint8_t *bytes, size_t room) {
    size_t n = strlen(text);
    if (n % 2 || n / 2 > room)
        return -1;
    for (size_t i = 0; i < n; i += 2) {
        if (!isxdigit((unsigned char)text[i]) || !isxdigit((unsigned char)text[i + 1]))
            return -1;
        char two[3] = {text[i], text[i + 1], 0};
        bytes[i / 2] = (uint8_t)strtoul(two, NULL, 16);
    }
    return (long)(n / 2);
}
