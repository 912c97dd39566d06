#include "pins.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include <avr_ioport.h>
#include <sim_avr.h>

#include "interrupts.h"
#include "trace.h"

/* Signals are ordered so that of two edges in one port write DIR and ENABLE count before STEP. */
typedef enum { DIR, ENABLE, STEP, SERVO } signal_kind;

typedef struct {
    signal_kind kind;
    int index;                /* axis or servo */
    char name[16], pin[8];
    char port;
    uint8_t bit;
    bool idle;                /* level while nobody drives it: drivers' ENABLE is pulled up, the rest down */
    bool level;
    uint64_t changed;         /* cycle of the last edge, 0: none yet */
} signal;

typedef struct {
    uint64_t least, most;
} range;

typedef struct {
    int64_t position;
    uint64_t forward, backward;
    range high, low, setup, hold, interval, latency;
    uint64_t rose, fell, first, last;     /* cycles; 0: none */
    uint64_t short_high, short_low, short_setup, short_hold, disabled, waking;
    int step, dir, enable;                /* signal indices; enable -1: none */
} axis_state;

typedef struct {
    uint64_t pulses, rose;
    range width, period;
    uint64_t width_last;
} servo_state;

typedef struct {
    char letter;
    uint8_t watched, level, port, ddr;
    int signals[8], count;
} port_state;

enum { MAX_SIGNALS = 3 * MAX_AXES + MAX_SERVOS };

const driver drivers[] = {
    {"a4988", 1000, 1000, 200, 200, 1000},
    {"drv8825", 1900, 1900, 650, 650, 1700},
    {"tmc2209", 100, 100, 20, 20, 0},
    {0},
};

static const board *the_board;
static driver limits;                     /* in cycles, rounded up */
static signal signals[MAX_SIGNALS];
static int signal_count;
static axis_state axes[MAX_AXES];
static int axis_count;
static servo_state servos[MAX_SERVOS];
static int servo_count;
static port_state ports[16];
static int port_count;
static void (*stepped)(int axis, int64_t position);

static int cycles_of_ns(int64_t ns) { return (int)((ns * (CLOCK_HZ / 1000000) + 999) / 1000); }

static void widen(range *r, uint64_t v) {
    if (v < r->least)
        r->least = v;
    if (v > r->most)
        r->most = v;
}

static void forget(range *r) {
    r->least = UINT64_MAX;
    r->most = 0;
}

static int add_signal(signal_kind kind, int index, const char *owner, const char *what, const char *pin) {
    for (int i = 0; i < signal_count; i++)            /* one ENABLE for all axes */
        if (kind == ENABLE && signals[i].kind == ENABLE && !strcmp(signals[i].pin, pin))
            return i;
    signal *s = &signals[signal_count];
    char port;
    int bit;
    if (!board_pin(the_board, pin, &port, &bit))
        abort();
    *s = (signal){.kind = kind, .index = index, .port = port, .bit = (uint8_t)(1 << bit), .idle = kind == ENABLE};
    snprintf(s->name, sizeof s->name, "%s%s%s", owner, *what ? "." : "", what);
    snprintf(s->pin, sizeof s->pin, "%s", pin);
    s->level = s->idle;
    port_state *p = NULL;
    for (int i = 0; i < port_count; i++)
        if (ports[i].letter == port)
            p = &ports[i];
    if (!p) {
        p = &ports[port_count++];
        p->letter = port;
    }
    p->watched |= s->bit;
    if (s->idle)
        p->level |= s->bit;
    p->signals[p->count++] = signal_count;
    return signal_count++;
}

void pins_init(const board *b, const driver *d, void (*on_stepped)(int axis, int64_t position)) {
    the_board = b;
    stepped = on_stepped;
    limits = (driver){d->name, cycles_of_ns(d->high_ns), cycles_of_ns(d->low_ns), cycles_of_ns(d->setup_ns),
                      cycles_of_ns(d->hold_ns), cycles_of_ns(d->wake_us * 1000)};
    while (b->axis[axis_count].name)
        axis_count++;
    for (int i = 0; i < axis_count; i++)
        axes[i].dir = add_signal(DIR, i, b->axis[i].name, "DIR", b->axis[i].dir);
    for (int i = 0; i < axis_count; i++)
        axes[i].enable = add_signal(ENABLE, i, "ENABLE", b->axis[i].enable, b->axis[i].enable);
    for (int i = 0; i < axis_count; i++)
        axes[i].step = add_signal(STEP, i, b->axis[i].name, "STEP", b->axis[i].step);
    for (; b->servo[servo_count]; servo_count++)
        add_signal(SERVO, servo_count, b->servo[servo_count], "", b->servo[servo_count]);
    pins_clear();
}

void pins_clear(void) {
    for (int i = 0; i < axis_count; i++) {
        axis_state *a = &axes[i], kept = *a;
        memset(a, 0, sizeof *a);
        a->position = kept.position;
        a->step = kept.step, a->dir = kept.dir, a->enable = kept.enable;
        forget(&a->high), forget(&a->low), forget(&a->setup), forget(&a->hold);
        forget(&a->interval), forget(&a->latency);
    }
    for (int i = 0; i < servo_count; i++) {
        servos[i] = (servo_state){0};
        forget(&servos[i].width), forget(&servos[i].period);
    }
}

static void on_step(int index, bool level, uint64_t now) {
    axis_state *a = &axes[index];
    const signal *dir = &signals[a->dir];
    if (!level) {
        if (a->rose) {
            widen(&a->high, now - a->rose);
            a->short_high += now - a->rose < (uint64_t)limits.high_ns;
        }
        a->fell = now;
        return;
    }
    if (a->fell) {
        widen(&a->low, now - a->fell);
        a->short_low += now - a->fell < (uint64_t)limits.low_ns;
    }
    if (a->rose)
        widen(&a->interval, now - a->rose);
    if (dir->changed) {
        widen(&a->setup, now - dir->changed);
        a->short_setup += now - dir->changed < (uint64_t)limits.setup_ns;
    }
    if (a->enable >= 0) {
        const signal *e = &signals[a->enable];
        a->disabled += e->level;
        a->waking += !e->level && e->changed && now - e->changed < (uint64_t)limits.wake_us;
    }
    uint64_t raised = interrupts_raised();
    if (raised)
        widen(&a->latency, now - raised);
    a->position += dir->level ? -1 : 1;
    if (dir->level)
        a->backward++;
    else
        a->forward++;
    if (!a->first)
        a->first = now;
    a->last = a->rose = now;
    stepped(index, a->position);
}

static void on_dir(int index, uint64_t now) {
    axis_state *a = &axes[index];
    if (a->rose) {
        widen(&a->hold, now - a->rose);
        a->short_hold += now - a->rose < (uint64_t)limits.hold_ns;
    }
}

static void on_servo(int index, bool level, uint64_t now) {
    servo_state *s = &servos[index];
    if (level) {
        if (s->rose)
            widen(&s->period, now - s->rose);
        s->rose = now;
    } else if (s->rose) {
        s->width_last = now - s->rose;
        widen(&s->width, s->width_last);
        s->pulses++;
    }
}

/* The port's registers are now `port` and `ddr`: find the edges. A pin that nobody drives is at its
 * pull-up, if that is on, else at its idle level. */
static void update(port_state *p, uint8_t port, uint8_t ddr) {
    p->port = port;
    p->ddr = ddr;
    uint8_t idle = 0;
    for (int i = 0; i < p->count; i++)
        if (signals[p->signals[i]].idle)
            idle |= signals[p->signals[i]].bit;
    uint8_t level = (uint8_t)((port & ddr) | (~ddr & (port | idle)));
    uint8_t changed = (level ^ p->level) & p->watched;
    if (!changed)
        return;
    uint64_t now = chip_now();
    p->level = level;
    for (int i = 0; i < p->count; i++) {
        signal *s = &signals[p->signals[i]];
        if (!(changed & s->bit))
            continue;
        s->level = level & s->bit;
        trace_signal(p->signals[i], s->level);
        if (s->kind == DIR)
            on_dir(s->index, now);
        else if (s->kind == STEP)
            on_step(s->index, s->level, now);
        else if (s->kind == SERVO)
            on_servo(s->index, s->level, now);
        s->changed = now;
    }
}

static void on_port(struct avr_irq_t *irq, uint32_t value, void *param) {
    (void)irq;
    port_state *p = param;
    update(p, (uint8_t)value, p->ddr);
}

static void on_ddr(struct avr_irq_t *irq, uint32_t value, void *param) {
    (void)irq;
    port_state *p = param;
    update(p, p->port, (uint8_t)value);
}

void pins_attach(avr_t *avr, reset_kind kind) {
    (void)kind;
    for (int i = 0; i < port_count; i++) {
        port_state *p = &ports[i];
        update(p, 0, 0);
        avr_irq_t *irq = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(p->letter), 0);
        avr_irq_register_notify(irq + IOPORT_IRQ_REG_PORT, on_port, p);
        avr_irq_register_notify(irq + IOPORT_IRQ_DIRECTION_ALL, on_ddr, p);
    }
}

int pins_axis(const char *name) {
    for (int i = 0; i < axis_count; i++)
        if (!strcmp(the_board->axis[i].name, name))
            return i;
    return -1;
}

int64_t pins_position(int axis) { return axes[axis].position; }

bool pins_trace_to(const char *path) {
    const char *names[MAX_SIGNALS];
    for (int i = 0; i < signal_count; i++)
        names[i] = signals[i].name;
    return trace_open(path, the_board->name, names, signal_count);
}

static void put_us(FILE *out, const char *name, uint64_t cycles, bool known) {
    if (known)
        fprintf(out, "\"%s\": %.4f, ", name, (double)cycles / (CLOCK_HZ / 1e6));
    else
        fprintf(out, "\"%s\": null, ", name);
}

static void put_range(FILE *out, const char *name, const range *r) {
    char key[48];
    snprintf(key, sizeof key, "%s_min_us", name);
    put_us(out, key, r->least, r->most);
    snprintf(key, sizeof key, "%s_max_us", name);
    put_us(out, key, r->most, r->most);
}

static void axis_json(FILE *out, int i) {
    const axis_state *a = &axes[i];
    fprintf(out, "%s\"%s\": {\"net\": %" PRId64 ", \"positive\": %" PRIu64 ", \"negative\": %" PRIu64 ", ", i ? ", " : "",
            the_board->axis[i].name, a->position, a->forward, a->backward);
    fprintf(out, "\"step\": %d, \"dir\": %d, \"enabled\": %s, ", signals[a->step].level, signals[a->dir].level,
            signals[a->enable].level ? "false" : "true");
    put_range(out, "high", &a->high);
    put_range(out, "low", &a->low);
    put_range(out, "dir_setup", &a->setup);
    put_range(out, "dir_hold", &a->hold);
    put_range(out, "interval", &a->interval);
    put_range(out, "latency", &a->latency);
    put_us(out, "jitter_us", a->latency.most - a->latency.least, a->latency.most);
    if (a->interval.most)
        fprintf(out, "\"max_rate_hz\": %.1f, ", (double)CLOCK_HZ / (double)a->interval.least);
    else
        fprintf(out, "\"max_rate_hz\": null, ");
    fprintf(out, "\"first_step_cycle\": %" PRIu64 ", \"last_step_cycle\": %" PRIu64 ", ", a->first, a->last);
    fprintf(out,
            "\"violations\": {\"high\": %" PRIu64 ", \"low\": %" PRIu64 ", \"dir_setup\": %" PRIu64 ", \"dir_hold\": %" PRIu64
            ", \"disabled\": %" PRIu64 ", \"waking\": %" PRIu64 "}}",
            a->short_high, a->short_low, a->short_setup, a->short_hold, a->disabled, a->waking);
}

void pins_json(FILE *out) {
    fprintf(out, "\"driver\": \"%s\", \"axes\": {", limits.name);
    for (int i = 0; i < axis_count; i++)
        axis_json(out, i);
    fprintf(out, "}, \"servos\": {");
    for (int i = 0; i < servo_count; i++) {
        const servo_state *s = &servos[i];
        fprintf(out, "%s\"%s\": {", i ? ", " : "", the_board->servo[i]);
        put_us(out, "width_us", s->width_last, s->pulses);
        put_range(out, "width", &s->width);
        put_range(out, "period", &s->period);
        fprintf(out, "\"pulses\": %" PRIu64 "}", s->pulses);
    }
    fprintf(out, "}");
}
