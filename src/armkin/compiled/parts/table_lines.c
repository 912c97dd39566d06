/* Columns as lines of text; numbers as Python's repr prints them: the fewest digits that read back to the same double, by
   Schubfach (R. Giulietti, The Schubfach way to render doubles, 2020), of those the nearest. */
#include <stdint.h>
#include <string.h>

const char arm_content[] = "@content@";

enum { ARM_LEAST = @least@ }; /* power of ten of the first row */
static const uint64_t powers[@count@][2] = { /* 10^k as 128 bits, rounded up: high, low */
@powers@
};

static const char pairs[] = "@pairs@";

static uint64_t product(uint64_t a, uint64_t b, uint64_t *low)
{
#ifdef __SIZEOF_INT128__
    __extension__ const unsigned __int128 p = (unsigned __int128)a * b;
    *low = (uint64_t)p;
    return (uint64_t)(p >> 64);
#else
    const uint64_t a0 = (uint32_t)a, a1 = a >> 32, b0 = (uint32_t)b, b1 = b >> 32;
    const uint64_t p00 = a0 * b0, p01 = a0 * b1, p10 = a1 * b0;
    const uint64_t middle = (p00 >> 32) + (uint32_t)p01 + (uint32_t)p10;
    *low = middle << 32 | (uint32_t)p00;
    return a1 * b1 + (p01 >> 32) + (p10 >> 32) + (middle >> 32);
#endif
}

/* The product's high part, with a last bit that says whether anything follows. */
static uint64_t to_odd(const uint64_t *g, uint64_t c)
{
    uint64_t none, low, high;
    const uint64_t carried = product(g[1], c, &none);
    high = product(g[0], c, &low);
    low += carried;
    high += low < carried;
    return high | (low > 1);
}

/* A finite double above 0 as digits * 10^power. */
static uint64_t shortest(uint64_t bits, int *power)
{
    const uint64_t fraction = bits & 0xFFFFFFFFFFFFFULL;
    const int exponent = (int)(bits >> 52 & 0x7FF), closer = fraction == 0 && exponent > 1;
    const uint64_t c = exponent ? fraction | 1ULL << 52 : fraction;
    const int q = exponent ? exponent - 1075 : -1074, odd = (int)(c & 1);
    const int64_t scaled = (int64_t)q * 1262611 - (closer ? 524031 : 0);
    const int k = (int)(scaled >> 22);
    const int h = q + (int)((int64_t)-k * 1741647 >> 19) + 1;
    const uint64_t *g = powers[-k - ARM_LEAST];
    const uint64_t lower = to_odd(g, (4 * c - 2 + closer) << h) + odd;
    const uint64_t middle = to_odd(g, (4 * c) << h), upper = to_odd(g, (4 * c + 2) << h) - odd;
    const uint64_t s = middle / 4;
    if (s >= 10) {
        const uint64_t ten = s / 10;
        const int below = lower <= 40 * ten, above = 40 * ten + 40 <= upper;
        if (below != above) {
            *power = k + 1;
            return ten + above;
        }
    }
    *power = k;
    {
        const int below = lower <= 4 * s, above = 4 * s + 4 <= upper;
        const uint64_t half = 4 * s + 2;
        if (below != above)
            return s + above;
        return s + (middle > half || (middle == half && (s & 1)));
    }
}

static char *copied(char *to, const char *from, int64_t size)
{
    memcpy(to, from, (size_t)size);
    return to + size;
}

/* The digits of a number, the last one before `end`; how many there are. */
static int written(char *end, uint64_t value)
{
    char *to = end;
    uint32_t rest;
    for (; value >> 32; value /= 100000000) { /* eight at once: divisions of 64 bits are slow */
        uint32_t eight = (uint32_t)(value % 100000000);
        int i;
        for (i = 0; i < 4; i++, eight /= 100)
            memcpy(to -= 2, pairs + 2 * (eight % 100), 2);
    }
    for (rest = (uint32_t)value; rest > 9; rest /= 100)
        memcpy(to -= 2, pairs + 2 * (rest % 100), 2);
    if (rest || to == end)
        *--to = (char)('0' + rest);
    return (int)(end - to);
}

/* Up to 20 characters, of a text with room behind it: a copy of one size is quicker than one that depends. */
static char *few(char *to, const char *from, int size)
{
    memcpy(to, from, 20);
    return to + size;
}

static char *whole(char *to, uint64_t value)
{
    char text[40];
    const int count = written(text + 20, value);
    return few(to, text + 20 - count, count);
}

static char *number(char *to, double value)
{
    uint64_t bits, digits;
    int power, count = 0, point, i;
    char text[40];
    memcpy(&bits, &value, 8);
    if (bits >> 63)
        *to++ = '-';
    bits &= ~(1ULL << 63);
    if (bits == 0)
        return copied(to, "0.0", 3);
    if (bits == 0x7FFULL << 52)
        return copied(to, "inf", 3);
    digits = shortest(bits, &power);
    while (digits % 10 == 0) {
        digits /= 10;
        power++;
    }
    count = written(text + 20, digits);
    point = count + power; /* digits before the decimal point */
    if (point > 16 || point < -3) {
        const char *first = text + 20 - count;
        *to++ = *first++;
        if (count > 1) {
            *to++ = '.';
            to = few(to, first, count - 1);
        }
        *to++ = 'e';
        *to++ = point - 1 < 0 ? '-' : '+';
        i = point - 1 < 0 ? 1 - point : point - 1;
        if (i < 10)
            *to++ = '0';
        return whole(to, (uint64_t)i);
    }
    if (point <= 0) {
        to = copied(to, "0.000", 2 - point);
        return few(to, text + 20 - count, count);
    }
    if (point >= count) {
        to = few(to, text + 20 - count, count);
        for (i = count; i < point; i++)
            *to++ = '0';
        return copied(to, ".0", 2);
    }
    to = few(to, text + 20 - count, point);
    *to++ = '.';
    return few(to, text + 20 - count + point, count - point);
}

/* Lines of columns: kind 0 doubles, 1 whole numbers, 2 flags, 3 words by number; data: where each column's values
   stand. words: all texts that stand in cells and between them; of column c, ends[first[c]] and on are where its
   texts begin: what stands before it, what is there for nan, then its words (-1: nan's). The texts before column
   `columns` end a line. Returns how many characters were written. */
int64_t arm_lines(int64_t rows, int columns, const int *kind, const void *const *data, const char *words,
    const int64_t *ends, const int64_t *first, char *out)
{
    char *to = out;
    int64_t row;
    int c;
    for (row = 0; row < rows; row++) {
        for (c = 0; c < columns; c++) {
            const int64_t *at = ends + first[c];
            int64_t word = 1;
            to = copied(to, words + at[0], at[1] - at[0]);
            if (kind[c] == 0) {
                const double value = ((const double *)data[c])[row];
                if (value == value) {
                    to = number(to, value);
                    continue;
                }
            } else if (kind[c] == 1) {
                const int64_t value = ((const int64_t *)data[c])[row];
                if (value < 0)
                    *to++ = '-';
                to = whole(to, value < 0 ? 0 - (uint64_t)value : (uint64_t)value);
                continue;
            } else if (kind[c] == 2)
                word = 2 + ((const uint8_t *)data[c])[row];
            else
                word = 2 + ((const int64_t *)data[c])[row];
            to = copied(to, words + at[word], at[word + 1] - at[word]);
        }
        to = copied(to, words + ends[first[columns]], ends[first[columns] + 1] - ends[first[columns]]);
    }
    return to - out;
}
