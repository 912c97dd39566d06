#include "uart.h"

#include <math.h>
#include <string.h>

#include <sim_avr.h>

#include "line.h"
#include "trace.h"

/* Data-space addresses, the same on the ATmega328P and the ATmega2560. */
enum { UCSRA = 0xC0, UCSRB = 0xC1, UCSRC = 0xC2, UBRRL = 0xC4, UBRRH = 0xC5, UDR = 0xC6 };
enum { RXC = 0x80, TXC = 0x40, UDRE = 0x20, FE = 0x10, DOR = 0x08, U2X = 0x02, MPCM = 0x01 };
enum { RXCIE = 0x80, TXCIE = 0x40, UDRIE = 0x20, RXEN = 0x10, TXEN = 0x08 };

/* Receivers tolerate about 4 % between the two clocks (data sheet table 20-2). */
static const double BAUD_TOLERANCE = 0.04;

static struct {
    avr_t *avr;
    avr_int_vector_t *rx, *udre, *tx;
    uint8_t fifo[2];
    int fifo_size;
    int shifted;              /* a whole byte waiting in the receive shift register, or -1 */
    int arriving;             /* the byte on the wire (LINE_LOST: silence), or LINE_EMPTY */
    double frame;             /* chip cycle at which the byte on the wire began */
    bool garbled;
    bool tx_busy, tx_full;
    uint8_t tx_shift, tx_buffer;
} u;

static struct {
    uint64_t received, overruns, disabled, garbled, sent, ignored_writes;
} count;

static double board_baud(void) {
    const uint8_t *d = u.avr->data;
    double divider = ((d[UBRRH] & 0x0F) << 8 | d[UBRRL]) + 1.0;
    return u.avr->frequency / ((d[UCSRA] & U2X ? 8.0 : 16.0) * divider);
}

/* The host's true rate: as given, else the standard rate that the board's divider approximates. */
static double host_baud(void) {
    static const double standard[] = {9600, 19200, 38400, 57600, 115200, 230400, 250000, 500000, 1000000, 2000000};
    double ours = board_baud();
    if (line_host_baud > 0)
        return line_host_baud;
    double best = ours, distance = 0.03;
    for (size_t i = 0; i < sizeof standard / sizeof *standard; i++) {
        double off = fabs(ours / standard[i] - 1);
        if (off < distance) {
            distance = off;
            best = standard[i];
        }
    }
    return best;
}

static bool mismatched(void) { return fabs(host_baud() / board_baud() - 1) > BAUD_TOLERANCE; }

/* RXC and UDRE interrupt as long as their condition holds; libsimavr only knows events. */
static void level(avr_int_vector_t *vector, uint8_t flag, bool on) {
    uint8_t *a = &u.avr->data[UCSRA];
    if (on) {
        *a |= flag;
        if (!vector->pending)
            avr_raise_interrupt(u.avr, vector);
    } else {
        *a &= (uint8_t)~flag;
        if (vector->pending)
            avr_clear_interrupt(u.avr, vector);
    }
}

static void levels(void) {
    level(u.rx, RXC, u.fifo_size > 0);
    level(u.udre, UDRE, !u.tx_full);
}

/* An interrupt routine ended (value 0): its condition may still hold. */
static void on_running(struct avr_irq_t *irq, uint32_t value, void *param) {
    (void)irq, (void)param;
    if (!value)
        levels();
}

static avr_cycle_count_t on_frame_end(avr_t *avr, avr_cycle_count_t when, void *param);

static avr_cycle_count_t on_frame_start(avr_t *avr, avr_cycle_count_t when, void *param) {
    (void)when, (void)param;
    u.arriving = line_next();
    if (u.arriving == LINE_EMPTY)
        return 0;
    u.garbled = mismatched();
    if (u.arriving != LINE_LOST && u.shifted >= 0) {
        u.shifted = -1;               /* overwritten in the shift register */
        avr->data[UCSRA] |= DOR;
        count.overruns++;
    }
    /* RXC rises in the middle of the stop bit */
    double end = u.frame + 9.5 * avr->frequency / host_baud();
    double wait = end - (double)avr->cycle;
    avr_cycle_timer_register(avr, wait > 1 ? (avr_cycle_count_t)wait : 1, on_frame_end, NULL);
    return 0;
}

static avr_cycle_count_t on_frame_end(avr_t *avr, avr_cycle_count_t when, void *param) {
    (void)when, (void)param;
    uint8_t *d = avr->data;
    if (u.arriving != LINE_LOST) {
        uint8_t byte = (uint8_t)u.arriving;
        trace_byte(LINE_IN, byte);
        if (u.garbled) {
            byte = (uint8_t)(byte * 37 + 0x5A);      /* anything but the byte; a framing error tells */
            d[UCSRA] |= FE;
            count.garbled++;
        }
        if (!(d[UCSRB] & RXEN)) {
            count.disabled++;
        } else if (u.fifo_size < 2) {
            u.fifo[u.fifo_size++] = byte;
            count.received++;
            levels();
        } else {
            u.shifted = byte;
            count.received++;
        }
    }
    u.frame += 10.0 * avr->frequency / host_baud();
    double wait = u.frame - (double)avr->cycle;
    avr_cycle_timer_register(avr, wait > 1 ? (avr_cycle_count_t)wait : 1, on_frame_start, NULL);
    return 0;
}

void uart_start(void) {
    if (u.arriving != LINE_EMPTY || !line_queued() || avr_cycle_timer_status(u.avr, on_frame_start, NULL))
        return;
    u.frame = (double)u.avr->cycle;
    on_frame_start(u.avr, u.avr->cycle, NULL);
}

static avr_cycle_count_t on_sent(avr_t *avr, avr_cycle_count_t when, void *param);

static void start_sending(uint8_t byte) {
    u.tx_busy = true;
    u.tx_shift = byte;
    avr_cycle_timer_register(u.avr, (avr_cycle_count_t)(10.0 * u.avr->frequency / board_baud()), on_sent, NULL);
}

static avr_cycle_count_t on_sent(avr_t *avr, avr_cycle_count_t when, void *param) {
    (void)when, (void)param;
    count.sent++;
    uint8_t byte = mismatched() ? (uint8_t)(u.tx_shift * 37 + 0x5A) : u.tx_shift;
    trace_byte(LINE_OUT, byte);
    if (line_put(byte))
        chip_stop = true;
    u.tx_busy = false;
    if (u.tx_full) {
        u.tx_full = false;
        start_sending(u.tx_buffer);
        levels();
    } else {
        avr->data[UCSRA] |= TXC;
        avr_raise_interrupt(avr, u.tx);
    }
    return 0;
}

static uint8_t read_udr(avr_t *avr, avr_io_addr_t addr, void *param) {
    (void)addr, (void)param;
    uint8_t byte = u.fifo[0];
    if (u.fifo_size) {
        u.fifo[0] = u.fifo[1];
        u.fifo_size--;
        if (u.shifted >= 0) {
            u.fifo[u.fifo_size++] = (uint8_t)u.shifted;
            u.shifted = -1;
        }
    }
    avr->data[UCSRA] &= (uint8_t)~(FE | DOR);
    levels();
    return byte;
}

static void write_udr(avr_t *avr, avr_io_addr_t addr, uint8_t v, void *param) {
    (void)addr, (void)param;
    if (!(avr->data[UCSRB] & TXEN) || u.tx_full) {
        count.ignored_writes++;
        return;
    }
    if (!u.tx_busy) {
        start_sending(v);
    } else {
        u.tx_buffer = v;
        u.tx_full = true;
    }
    levels();
}

static void write_ucsra(avr_t *avr, avr_io_addr_t addr, uint8_t v, void *param) {
    (void)addr, (void)param;
    uint8_t *a = &avr->data[UCSRA];
    if (v & TXC) {                        /* written one to clear */
        *a &= (uint8_t)~TXC;
        if (u.tx->pending)
            avr_clear_interrupt(avr, u.tx);
    }
    *a = (uint8_t)((*a & ~(U2X | MPCM)) | (v & (U2X | MPCM)));
}

static void write_ucsrb(avr_t *avr, avr_io_addr_t addr, uint8_t v, void *param) {
    (void)param;
    avr->data[addr] = v;
    if (!(v & RXEN)) {
        u.fifo_size = 0;
        u.shifted = -1;
    }
    levels();
    if ((v & TXCIE) && (avr->data[UCSRA] & TXC) && !u.tx->pending)
        avr_raise_interrupt(avr, u.tx);
}

static void write_plain(avr_t *avr, avr_io_addr_t addr, uint8_t v, void *param) {
    (void)param;
    avr->data[addr] = v;
}

static void take_register(int addr, avr_io_read_t read, avr_io_write_t write) {
    u.avr->io[AVR_DATA_TO_IO(addr)].r.c = read;
    u.avr->io[AVR_DATA_TO_IO(addr)].r.param = NULL;
    u.avr->io[AVR_DATA_TO_IO(addr)].w.c = write;
    u.avr->io[AVR_DATA_TO_IO(addr)].w.param = NULL;
}

void uart_attach(avr_t *avr, reset_kind kind) {
    (void)kind;
    memset(&u, 0, sizeof u);
    u.avr = avr;
    u.shifted = -1;
    u.arriving = LINE_EMPTY;
    u.rx = chip_vector(chip_board->vector_rx);
    u.udre = chip_vector(chip_board->vector_udre);
    u.tx = chip_vector(chip_board->vector_tx);
    take_register(UDR, read_udr, write_udr);
    take_register(UCSRA, NULL, write_ucsra);
    take_register(UCSRB, NULL, write_ucsrb);
    take_register(UCSRC, NULL, write_plain);
    take_register(UBRRL, NULL, write_plain);
    take_register(UBRRH, NULL, write_plain);
    avr->data[UCSRA] = UDRE;
    avr->data[UCSRB] = 0;
    avr->data[UCSRC] = 0x06;
    avr_irq_register_notify(u.rx->irq + AVR_INT_IRQ_RUNNING, on_running, NULL);
    avr_irq_register_notify(u.udre->irq + AVR_INT_IRQ_RUNNING, on_running, NULL);
}

size_t uart_swallow(void) {
    size_t n = line_queued();
    line_discard(LINE_IN);
    return n;
}

void uart_clear(void) { memset(&count, 0, sizeof count); }

void uart_json(FILE *out) {
    fprintf(out,
            "{\"board_baud\": %.0f, \"host_baud\": %.0f, \"received\": %llu, \"sent\": %llu, \"overruns\": %llu, "
            "\"garbled\": %llu, \"lost_receiver_off\": %llu, \"ignored_writes\": %llu}",
            board_baud(), host_baud(), (unsigned long long)count.received, (unsigned long long)count.sent,
            (unsigned long long)count.overruns, (unsigned long long)count.garbled,
            (unsigned long long)count.disabled, (unsigned long long)count.ignored_writes);
}
