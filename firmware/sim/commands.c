#include "commands.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "chip.h"
#include "inputs.h"
#include "interrupts.h"
#include "line.h"
#include "pace.h"
#include "pins.h"
#include "port.h"
#include "program.h"
#include "schedule.h"
#include "trace.h"
#include "uart.h"
#include "words.h"

static const char HELP[] =
    "stats | clear | cycles | quit | reset power|brownout|external|watchdog | pin A0 0|1|z | switch X 1|0|auto | "
    "set-switch X at -2000 above|below [bounce 3ms] [nc|no] [pin D9] | noise [flip P] [drop P] [seed N] [dir in|out|both] | "
    "cut in|out|both | restore | after 5ms COMMAND | mark N | peek NAME|ADDRESS N | poke NAME|ADDRESS HEX | flush | "
    "bootloader MS|off | reset-on-open on|off | speed N|max | patience MS|off | baud N|auto | send HEX | run 5ms [until HEX] [HEX]";

static void fail(FILE *reply, const char *format, ...) __attribute__((format(printf, 2, 3)));

static void fail(FILE *reply, const char *format, ...) {
    va_list values;
    va_start(values, format);
    fputs("{\"error\": \"", reply);
    vfprintf(reply, format, values);
    fputs("\"}\n", reply);
    va_end(values);
}

static void done(FILE *reply) {
    fprintf(reply, "{\"ok\": true, \"cycle\": %llu}\n", (unsigned long long)chip_now());
}

static int directions(const char *text) {      /* bit 0: in, bit 1: out; 0: no such thing */
    return !strcmp(text, "in") ? 1 : !strcmp(text, "out") ? 2 : !strcmp(text, "both") ? 3 : 0;
}

void commands_stats(FILE *out) {
    fprintf(out, "{\"ok\": true, \"board\": \"%s\", \"mcu\": \"%s\", ", chip_board->name, chip_board->mcu);
    chip_json(out);
    fputs(", ", out), interrupts_json(out);
    fputs(", \"uart\": ", out), uart_json(out);
    fputs(", \"line\": ", out), line_json(out);
    fputs(", ", out), pins_json(out);
    fputs(", ", out), inputs_json(out);
    fputs(", \"port\": ", out), port_json(out);
    fputs(", \"pace\": ", out), pace_json(out);
    fputs("}\n", out);
}

static void do_reset(FILE *reply) {
    static const char *kinds[] = {"power", "brownout", "external", "watchdog"};
    const char *kind = word();
    for (int k = 0; k < 4; k++)
        if (!strcmp(kind, kinds[k])) {
            chip_reset((reset_kind)k);
            done(reply);
            return;
        }
    fail(reply, "reset power, brownout, external or watchdog, not '%s'", kind);
}

static void do_pin(FILE *reply) {
    const char *pin = word(), *level = word();
    int value = !strcmp(level, "0") ? INPUT_LOW : !strcmp(level, "1") ? INPUT_HIGH : INPUT_RELEASED;
    if (value == INPUT_RELEASED && strcmp(level, "z"))
        fail(reply, "pin NAME 0, 1 or z (released), not '%s'", level);
    else if (!inputs_drive(pin, value))
        fail(reply, "%s has no pin '%s'", chip_board->name, pin);
    else
        done(reply);
}

/* The pin of a switch that is named by its axis or by the pin itself. */
static const char *switch_pin(const char *name) {
    int axis = pins_axis(name);
    return axis >= 0 ? chip_board->axis[axis].limit : name;
}

static void do_switch(FILE *reply) {
    const char *name = word(), *state = word(), *pin = switch_pin(name);
    int pressed = !strcmp(state, "1") ? 1 : !strcmp(state, "0") ? 0 : -1;
    if (pressed < 0 && strcmp(state, "auto"))
        fail(reply, "switch NAME 1, 0 or auto, not '%s'", state);
    else if (!pin || !inputs_force_switch(pin, pressed))
        fail(reply, "%s has no switch '%s'", chip_board->name, name);
    else
        done(reply);
}

static void do_set_switch(FILE *reply) {
    const char *name = word();
    switch_setup s = {.axis = pins_axis(name), .pin = switch_pin(name)};
    if (s.axis < 0) {
        fail(reply, "%s has no axis '%s'", chip_board->name, name);
        return;
    }
    bool placed = false;
    for (const char *w; *(w = word());) {
        long long at;
        if (!strcmp(w, "at") && word_integer(word(), &at))
            s.at = at, placed = true;
        else if (!strcmp(w, "above") || !strcmp(w, "below"))
            s.below = *w == 'b';
        else if (!strcmp(w, "nc") || !strcmp(w, "no"))
            s.normally_closed = w[1] == 'c';
        else if (!strcmp(w, "pin"))
            s.pin = word();
        else if (strcmp(w, "bounce") || !word_time(word(), &s.bounce)) {
            fail(reply, "set-switch: '%s' or what follows it; see help", w);
            return;
        }
    }
    if (!placed)
        fail(reply, "set-switch wants: at STEPS");
    else if (!s.pin || !inputs_set_switch(&s))
        fail(reply, "axis %s of %s has no limit pin of its own; add: pin NAME", name, chip_board->name);
    else
        done(reply);
}

static void do_noise(FILE *reply) {
    double flip = 0, drop = 0;
    long long seed = 1;
    int ways = 3;
    for (const char *w; *(w = word());) {
        const char *v = word();
        bool good = !strcmp(w, "flip")   ? word_number(v, &flip)
                    : !strcmp(w, "drop") ? word_number(v, &drop)
                    : !strcmp(w, "seed") ? word_integer(v, &seed)
                    : !strcmp(w, "dir")  ? (ways = directions(v)) != 0
                                         : false;
        if (!good || flip < 0 || flip > 1 || drop < 0 || drop > 1) {
            fail(reply, "noise: '%s %s'; see help", w, v);
            return;
        }
    }
    for (int way = 0; way < 2; way++)
        if (ways >> way & 1) {
            line_way[way].flip = flip;
            line_way[way].drop = drop;
            line_seed(way, (uint64_t)seed);
        }
    done(reply);
}

static void do_cut(FILE *reply) {
    const char *w = word();
    int ways = directions(w);
    for (int way = 0; way < 2; way++)
        if (ways >> way & 1)
            line_way[way].cut = true;
    if (ways)
        done(reply);
    else
        fail(reply, "cut in, out or both, not '%s'", w);
}

static void do_restore(FILE *reply) {
    for (int way = 0; way < 2; way++) {
        line_way[way].cut = false;
        line_way[way].flip = line_way[way].drop = 0;
    }
    done(reply);
}

static void do_after(FILE *reply) {
    uint64_t wait;
    const char *w = word();
    if (!word_time(w, &wait) || !*words_rest())
        fail(reply, "after TIME COMMAND, not 'after %s'", w);
    else if (!schedule_later(chip_now() + wait, words_rest()))
        fail(reply, "too many commands are waiting already");
    else
        done(reply);
}

static void do_peek(FILE *reply) {
    const char *name = word(), *size = word();
    long long address, n;
    uint8_t bytes[256];
    if (!word_integer(name, &address))
        address = program_symbol(name);
    if (!word_integer(size, &n) || n < 1 || n > (long long)sizeof bytes || !chip_peek((long)address, bytes, (int)n)) {
        fail(reply, "peek: no %s bytes at '%s'", size, name);
        return;
    }
    fprintf(reply, "{\"ok\": true, \"address\": %lld, \"bytes\": \"", address);
    for (int i = 0; i < n; i++)
        fprintf(reply, "%02x", bytes[i]);
    fputs("\"}\n", reply);
}

static void do_poke(FILE *reply) {
    const char *name = word();
    long long address;
    uint8_t bytes[256];
    if (!word_integer(name, &address))
        address = program_symbol(name);
    long n = word_bytes(word(), bytes, sizeof bytes);
    if (n < 1 || !chip_poke((long)address, bytes, (int)n))
        fail(reply, "poke NAME|ADDRESS HEX: not at '%s'", name);
    else
        done(reply);
}

static uint8_t outgoing[COMMANDS_MOST_BYTES];

static void do_send(FILE *reply) {
    long n = word_bytes(word(), outgoing, sizeof outgoing);
    if (n < 0) {
        fail(reply, "send HEX");
        return;
    }
    line_feed(outgoing, (size_t)n);
    pace_host_spoke();
    done(reply);
}

static void do_run(FILE *reply) {
    uint64_t cycles;
    const char *w = word();
    uint8_t stop;
    if (!pace_stepped || !word_time(w, &cycles)) {
        fail(reply, pace_stepped ? "run TIME, not 'run %s'" : "run %s: only with --speed step", w);
        return;
    }
    for (line_stop_byte = -1; *(w = word());) {
        if (!strcmp(w, "until")) {
            if (word_bytes(word(), &stop, 1) != 1) {
                fail(reply, "run: until HEX, one byte");
                return;
            }
            line_stop_byte = stop;
            continue;
        }
        long n = word_bytes(w, outgoing, sizeof outgoing);
        if (n < 0) {
            fail(reply, "run: '%.20s' is not hexadecimal", w);
            return;
        }
        line_feed(outgoing, (size_t)n);
    }
    schedule_run_until(chip_now() + cycles, commands_do);
    line_stop_byte = -1;
    fprintf(reply, "{\"ok\": true, \"cycle\": %llu, \"out\": \"", (unsigned long long)chip_now());
    uint8_t bytes[256];
    for (size_t n; (n = line_collect(bytes, sizeof bytes));)
        for (size_t i = 0; i < n; i++)
            fprintf(reply, "%02x", bytes[i]);
    fputs("\"}\n", reply);
}

/* "off" and a number of at least `least`, or just the number where `off` is NULL. */
static bool setting(FILE *reply, const char *off, double if_off, double least, double most, double *v) {
    const char *w = word();
    if (off && !strcmp(w, off))
        *v = if_off;
    else if (!word_number(w, v) || *v < least || *v > most) {
        fail(reply, "%s%sa number from %g to %g, not '%s'", off ? off : "", off ? " or " : "", least, most, w);
        return false;
    }
    done(reply);
    return true;
}

static void do_mark(FILE *reply) {
    double v;
    if (setting(reply, NULL, 0, 0, 255, &v))
        trace_mark((uint8_t)v);
}

static void do_speed(FILE *reply) {
    double v;
    if (pace_stepped)
        fail(reply, "the board was started with --speed step");
    else if (setting(reply, "max", 0, 1e-3, 1e3, &v)) {
        pace_speed = v;
        pace_reset();
    }
}

static void do_patience(FILE *reply) {
    double v;
    if (setting(reply, "off", 0, 0, 1e5, &v))
        pace_patience = (uint64_t)(v * (CLOCK_HZ / 1e3));
}

static void do_baud(FILE *reply) {
    double v;
    if (setting(reply, "auto", 0, 300, 4e6, &v))
        line_host_baud = v;
}

static void do_bootloader(FILE *reply) {
    double v;
    if (setting(reply, "off", -1, 0, 1e5, &v))
        chip_bootloader_ms = v;
}

static void do_reset_on_open(FILE *reply) {
    const char *w = word();
    if (strcmp(w, "on") && strcmp(w, "off")) {
        fail(reply, "reset-on-open on or off, not '%s'", w);
        return;
    }
    port_reset_on_open = !strcmp(w, "on");
    done(reply);
}

static void do_cycles(FILE *reply) { done(reply); }

static void do_help(FILE *reply) { fprintf(reply, "{\"ok\": true, \"commands\": \"%s\"}\n", HELP); }

static void do_clear(FILE *reply) {
    pins_clear();
    uart_clear();
    interrupts_clear();
    done(reply);
}

static void do_flush(FILE *reply) {
    trace_flush();
    done(reply);
}

static void do_quit(FILE *reply) {
    schedule_quit = true;
    done(reply);
}

void commands_execute(char *line, FILE *reply) {
    static const struct {
        const char *name;
        void (*run)(FILE *reply);
    } commands[] = {
        {"stats", commands_stats}, {"run", do_run}, {"send", do_send}, {"reset", do_reset}, {"pin", do_pin},
        {"switch", do_switch}, {"set-switch", do_set_switch}, {"noise", do_noise}, {"cut", do_cut},
        {"restore", do_restore}, {"after", do_after}, {"peek", do_peek}, {"poke", do_poke}, {"cycles", do_cycles},
        {"help", do_help}, {"clear", do_clear}, {"flush", do_flush}, {"quit", do_quit}, {"mark", do_mark},
        {"speed", do_speed}, {"patience", do_patience}, {"baud", do_baud}, {"bootloader", do_bootloader},
        {"reset-on-open", do_reset_on_open},
    };
    words_begin(line);
    const char *name = word();
    for (size_t i = 0; i < sizeof commands / sizeof *commands; i++)
        if (!strcmp(name, commands[i].name)) {
            commands[i].run(reply);
            return;
        }
    fail(reply, "no command '%s'; see help", name);
}

bool commands_do(char *line) {
    char *text = NULL;
    size_t size;
    FILE *reply = open_memstream(&text, &size);
    commands_execute(line, reply);
    fclose(reply);
    bool good = !strstr(text, "\"error\"");
    if (!good)
        fprintf(stderr, "simboard: %s", text);
    free(text);
    return good;
}
