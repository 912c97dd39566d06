// A second Raspberry Pi Pico that looks at a board's pins: eight of them, sampled 125 million times a second, and the table that the emulator prints.
//
//   GP2 ... GP5  STEP of X Y Z A      GP6 ... GP9  their DIR      GND to GND; 3.3 V at most: docs/boards.md has the dividers for 5 V
//
// State machine 0 of PIO 0 takes a sample a cycle, four to a word; DMA writes the words into a ring. The processor passes over words that
// are as the one before with 3.3 of the 4 cycles that each takes to come, and keeps the others in a log; what is left of its time goes
// into the edges of that log. When the pins have been still for 20 ms a line of JSON goes out over the USB. The byte `c` from there clears all.
#ifdef __arm__
#include <string.h>

#include "../src/rp2040/pico.h"

enum { AXES_SEEN = 4, FIRST_PIN = 2, PINS = 8, PER_WORD = 4, PER_US = SYSTEM_MHZ };
enum { WORDS = 8192, BLOCK_WORDS = 32, STILL_WORDS = 20000 * PER_US / PER_WORD, RISES = 64, LOG = 16384, NEAR = WORDS / 16 };

#define DMA_READ 0x50000000  // channel 0 (DS 2.5.7)
#define DMA_WRITE 0x50000004
#define DMA_COUNT 0x50000008
#define DMA_CTRL 0x5000000C
#define DMA_ABORT 0x50000444
#define PIO_RXF0 0x50200020
enum { DMA_EN = 1, DMA_WORD = 2 << 2, DMA_INCR_WRITE = 1 << 5, DMA_RING_32K = 15 << 6, DMA_RING_WRITE = 1 << 10, DREQ_PIO0_RX0 = 4 << 15 };
enum { RX_STALLED = 1 };  // FDEBUG: a sample was lost
enum { RESET_DMA = 1 << 2, IN_PINS_8 = 0x4008 };

static uint32_t ring[WORDS] __attribute__((aligned(4 * WORDS)));

// Words that were not as the one before, and their numbers; written by look(), read by work().
static struct {
    uint32_t number, word;
} entries[LOG];
static uint32_t logged, worked;

// What is known of an axis; times in samples.
struct seen {
    uint32_t rise, fall, turn;  // when last
    bool rose, fell, turned;
    uint32_t positive, negative;
    uint32_t high, low, setup, hold, interval;  // the least
    uint32_t rises[RISES];                      // of steady runs: when
    uint8_t filled;
    uint32_t off;  // the farthest from an even grid
    uint32_t runs;
};
static struct seen seen[AXES_SEEN];
static uint8_t level;    // of the pins, as worked out
static uint32_t same;    // a word of pins as they were last looked at
static uint32_t lost;    // times that samples were lost
static uint32_t at;      // words taken
static uint32_t changed;  // the words taken when there was an edge last
static bool told;

volatile bool awake;

void pio_interrupt(void) {
}

void timer_interrupt(void) {
}

void uart_interrupt(void) {
}

static uint32_t written(void) {  // words, since the start
    return 0xFFFFFFFF - REG(DMA_COUNT);
}

static void least(uint32_t *x, uint32_t now, uint32_t then) {
    if (now - then < *x) {
        *x = now - then;
    }
}

// The farthest that a run's rises are from an even grid between its first and its last, if the speed is the same in both halves.
static void steady(struct seen *s) {
    enum { PARTS = 8 };  // of a sample, in which the grid is laid
    const uint32_t *t = s->rises, whole = t[RISES - 1] - t[0];
    const uint32_t period = (whole * PARTS + (RISES - 1) / 2) / (RISES - 1), half = (period * (RISES / 2)) / PARTS;
    const int32_t difference = (int32_t)(t[RISES / 2] - t[0] - half);
    s->filled = 0;
    if (whole >> 28 || (difference < 0 ? -difference : difference) > (int32_t)(whole / 64)) {
        return;
    }
    s->runs++;
    uint32_t wanted = PARTS / 2;
    for (uint8_t i = 1; i < RISES - 1; i++) {
        wanted += period;
        const uint32_t place = t[i] - t[0], grid = wanted / PARTS;
        const uint32_t off = place > grid ? place - grid : grid - place;
        s->off = off > s->off ? off : s->off;
    }
}

static void step_edge(struct seen *s, bool high, bool back, uint32_t now) {
    if (!high) {
        if (s->rose) {
            least(&s->high, now, s->rise);
        }
        s->fall = now;
        s->fell = true;
        return;
    }
    if (s->rose) {
        least(&s->interval, now, s->rise);
    }
    if (s->fell) {
        least(&s->low, now, s->fall);
    }
    if (s->turned) {
        least(&s->setup, now, s->turn);
    }
    s->positive += !back;
    s->negative += back;
    s->rise = now;
    s->rose = true;
    s->rises[s->filled++] = now;
    if (s->filled == RISES) {
        steady(s);
    }
}

static void edges(uint8_t pins, uint32_t now) {
    const uint8_t turned = pins ^ level;
    for (uint8_t i = 0; i < AXES_SEEN; i++) {
        struct seen *s = &seen[i];
        if (turned >> (AXES_SEEN + i) & 1) {
            if (s->rose) {
                least(&s->hold, now, s->rise);
            }
            s->turn = now;
            s->turned = true;
        }
        if (turned >> i & 1) {
            step_edge(s, pins >> i & 1, pins >> (AXES_SEEN + i) & 1, now);
        }
    }
    level = pins;
}

static void word_changed(uint32_t word, uint32_t number) {
    for (uint8_t k = 0; k < PER_WORD; k++, word >>= 8) {
        if ((uint8_t)word != level) {
            edges(word, number * PER_WORD + k);
        }
    }
}

// From p, whose number is even by four, to `end`, by 32: the first four words of which one is not `like`, or end.
// Four words take 13 cycles of the 16 in which they come.
__attribute__((naked, noinline)) static const uint32_t *pass(const uint32_t *p, uint32_t like, const uint32_t *end) {
    (void)p;
    (void)like;
    (void)end;
    __asm__ volatile(
        "push {r4, r5, r6}\n"
        "movs r3, #112\n"  // into the middle, where p is not at a block's begin: 18 bytes of program for 16 of words
        "ands r3, r0\n"
        "lsrs r4, r3, #3\n"
        "adds r3, r3, r4\n"
        "adr r4, 1f\n"
        "adds r4, r4, r3\n"
        "adds r4, #1\n"
        "bx r4\n"
        ".balign 4\n"
        "1:\n"
        ".rept 8\n"
        "ldmia r0!, {r3, r4, r5, r6}\n"
        "cmp r3, r1\n"
        "bne 2f\n"
        "cmp r4, r1\n"
        "bne 2f\n"
        "cmp r5, r1\n"
        "bne 2f\n"
        "cmp r6, r1\n"
        "bne 2f\n"
        ".endr\n"
        "cmp r0, r2\n"
        "bne 1b\n"
        "b 3f\n"
        "2: subs r0, #16\n"
        "3: pop {r4, r5, r6}\n"
        "bx lr\n");
}

// The words up to `end`, in one piece of the ring: those with an edge into the log.
static void look(uint32_t end) {
    const uint32_t *p = &ring[at % WORDS], *const past = p + (end - at);
    while ((p = pass(p, same, past)) != past) {
        for (uint8_t i = 0; i < 4; i++) {
            const uint32_t word = p[i];
            if (word != same) {
                entries[logged % LOG].number = end - (uint32_t)(past - p) + i;
                entries[logged++ % LOG].word = word;
                same = (word >> 24) * 0x01010101UL;
                changed = end;
                told = false;
            }
        }
        p += 4;
        if (p == past) {
            break;
        }
    }
    at = end;
}

static void work(void) {
    word_changed(entries[worked % LOG].word, entries[worked % LOG].number);
    worked++;
}

// ---- the table

static char text[160];
static uint8_t size;

static void put(const char *s) {
    while (*s && size < sizeof text) {
        text[size++] = *s++;
    }
}

static void put_number(uint32_t x, uint8_t least_digits) {
    char digits[11], *d = digits + 10;
    *d = 0;
    do {
        *--d = '0' + x % 10;
        x /= 10;
    } while (x || digits + 10 - d < least_digits);
    put(d);
}

static void put_time(const char *name, uint32_t samples, bool known) {
    put(name);
    if (!known) {
        put("null");
        return;
    }
    put_number(samples / PER_US, 1);
    put(".");
    put_number(samples % PER_US * 1000 / PER_US, 3);
}

static void send(void) {
    for (uint8_t done = 0; done < size;) {
        const uint8_t length = size - done < 63 ? size - done : 63;
        const uint32_t begun = REG(TIMER_RAWL);
        while (!usb_ready()) {
            if (REG(TIMER_RAWL) - begun > 100000) {  // nobody listens
                size = 0;
                return;
            }
        }
        usb_send((const uint8_t *)text + done, length);
        done += length;
    }
    size = 0;
}

static void tell(void) {
    put("{\"axes\": {");
    for (uint8_t i = 0; i < AXES_SEEN; i++) {
        const struct seen *s = &seen[i];
        char name[] = "\"X\": {\"net\": ";
        name[1] = "XYZA"[i];
        put(name);
        if (s->negative > s->positive) {
            put("-");
        }
        put_number(s->negative > s->positive ? s->negative - s->positive : s->positive - s->negative, 1);
        put(", \"positive\": ");
        put_number(s->positive, 1);
        put(", \"negative\": ");
        put_number(s->negative, 1);
        send();
        put_time(", \"high_min_us\": ", s->high, s->high != UINT32_MAX);
        put_time(", \"low_min_us\": ", s->low, s->low != UINT32_MAX);
        put_time(", \"dir_setup_min_us\": ", s->setup, s->setup != UINT32_MAX);
        put_time(", \"dir_hold_min_us\": ", s->hold, s->hold != UINT32_MAX);
        send();
        put_time(", \"interval_min_us\": ", s->interval, s->interval != UINT32_MAX);
        put_time(", \"off_grid_us\": ", s->off, s->runs > 0);
        put(", \"steady_runs\": ");
        put_number(s->runs, 1);
        put(i + 1 < AXES_SEEN ? "}, " : "}}, \"lost\": ");
        send();
    }
    put_number(lost, 1);
    put("}\n");
    send();
    told = true;
}

// ---- sampling

static void clear(void) {
    memset(seen, 0, sizeof seen);
    for (uint8_t i = 0; i < AXES_SEEN; i++) {
        seen[i].high = seen[i].low = seen[i].setup = seen[i].hold = seen[i].interval = UINT32_MAX;
    }
    lost = 0;
    told = true;
}

// From now on; what the edges before were is forgotten, counts are kept.
static void sample(void) {
    REG(PIO_CTRL) = 0;
    REG(DMA_ABORT) = 1;
    while (REG(DMA_ABORT) & 1) {
    }
    while (!(REG(PIO_FSTAT) & 1 << 8)) {
        (void)REG(PIO_RXF0);
    }
    REG(PIO_FDEBUG) = RX_STALLED;
    REG(DMA_READ) = PIO_RXF0;
    REG(DMA_WRITE) = (uint32_t)(uintptr_t)ring;
    REG(DMA_COUNT) = 0xFFFFFFFF;  // words: 137 s
    REG(DMA_CTRL) = DREQ_PIO0_RX0 | DMA_RING_WRITE | DMA_RING_32K | DMA_INCR_WRITE | DMA_WORD | DMA_EN;
    for (uint8_t i = 0; i < AXES_SEEN; i++) {
        seen[i].rose = seen[i].fell = seen[i].turned = false;
        seen[i].filled = 0;
    }
    at = changed = logged = worked = 0;
    level = REG(SIO_IN) >> FIRST_PIN;
    same = level * 0x01010101UL;
    REG(PIO_CTRL) = 1 << 4 | 1;
}

static void setup(void) {
    enum { CLEAR_PAD = 1 << 7, WRAP_TOP = 12, FJOIN_RX = 1UL << 31, IN_RIGHT = 1 << 18, AUTOPUSH = 1 << 16, IN_BASE = 15 };
    CLEAR(RESETS_RESET) = RESET_DMA;
    while (!(REG(RESETS_DONE) & RESET_DMA)) {
    }
    for (uint8_t i = 0; i < PINS; i++) {
        pin_function(FIRST_PIN + i, F_PIO0, PAD_INPUT | PAD_SCHMITT);
    }
    REG(PIO_INSTR_MEM(0)) = IN_PINS_8;
    REG(PIO_SM0_CLKDIV) = 1 << 16;
    REG(PIO_SM0_EXECCTRL) = 0 << WRAP_TOP;
    REG(PIO_SM0_SHIFTCTRL) = FJOIN_RX | IN_RIGHT | AUTOPUSH;
    REG(PIO_SM0_PINCTRL) = FIRST_PIN << IN_BASE;
}

void pin_function(uint8_t pin, uint8_t function, uint8_t pad) {
    REG(PAD(pin)) = pad;
    REG(IO_CTRL(pin)) = function;
}

__attribute__((noinline)) int main(void) {
    clocks_setup();
    usb_setup();
    setup();
    clear();
    sample();
    for (;;) {
        const uint32_t waiting = written() - at;
        if (waiting > WORDS - 2 * BLOCK_WORDS || REG(PIO_FDEBUG) & RX_STALLED || logged - worked > LOG - waiting) {
            lost++;  // more edges than this processor has time for
            sample();
            continue;
        }
        if (waiting >= BLOCK_WORDS) {
            const uint32_t piece = WORDS - at % WORDS, most = waiting / BLOCK_WORDS * BLOCK_WORDS;
            look(at + (most < piece ? most : piece));
        }
        if (waiting < NEAR && worked != logged) {
            work();
            continue;
        }
        const uint8_t *bytes;
        usb_boot_drive(true);
        if (usb_get(&bytes) && *bytes == 'c') {
            clear();
        }
        if (at - changed > STILL_WORDS) {
            if (!told) {
                while (worked != logged) {
                    work();
                }
                tell();
                sample();
            }
            changed = at - STILL_WORDS;
        }
    }
}
#endif
