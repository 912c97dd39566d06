#include "control.h"

#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "chip.h"
#include "inputs.h"
#include "line.h"
#include "pace.h"
#include "pins.h"
#include "port.h"
#include "program.h"
#include "uart.h"

enum { MAX_CLIENTS = CONTROL_FDS - 1, MAX_LATER = 64, LONGEST_LINE = 1 << 20 };

typedef struct {
    int in, out;
    char *text;
    size_t size;
} client;

bool control_quit, control_stepped;

static client clients[MAX_CLIENTS];
static int client_count;
static int listener = -1;
static const char *listener_path;
static bool quit_at_end;

static struct {
    uint64_t cycle;
    char *command;
} later[MAX_LATER];
static int later_count;

static const char HELP[] =
    "stats | clear | cycles | quit | reset power|brownout|external|watchdog | pin A0 0|1|z | switch X 1|0|auto | "
    "set-switch X at -2000 above|below [bounce 3ms] [nc|no] [pin D9] | noise [flip P] [drop P] [seed N] [dir in|out|both] | "
    "cut in|out|both | restore | after 5ms COMMAND | mark N | peek NAME|ADDRESS N | poke NAME|ADDRESS HEX | flush | "
    "bootloader MS|off | reset-on-open on|off | speed N|max | baud N|auto | send HEX | run 5ms [until HEX] [HEX]";

/* ---- replies ---- */

static void fail(FILE *reply, const char *format, ...) __attribute__((format(printf, 2, 3)));

static void fail(FILE *reply, const char *format, ...) {
    va_list values;
    va_start(values, format);
    fputs("{\"error\": \"", reply);
    vfprintf(reply, format, values);      /* words of commands: escaped below */
    fputs("\"}\n", reply);
    va_end(values);
}

static void done(FILE *reply) {
    fprintf(reply, "{\"ok\": true, \"cycle\": %llu}\n", (unsigned long long)chip_now());
}

/* ---- words of a command ---- */

static char *rest;

static const char *word(void) {
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

bool control_time(const char *text, uint64_t *cycles) {
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

static bool number(const char *text, double *v) {
    char *end;
    *v = strtod(text, &end);
    return end != text && !*end;
}

static bool integer(const char *text, long long *v) {
    char *end;
    *v = strtoll(text, &end, 0);
    return end != text && !*end;
}

/* Hexadecimal text to bytes; the number of bytes, or -1. */
static long unhex(const char *text, uint8_t *bytes, size_t room) {
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

static int directions(const char *text) {      /* bit 0: in, bit 1: out; 0: no such thing */
    return !strcmp(text, "in") ? 1 : !strcmp(text, "out") ? 2 : !strcmp(text, "both") ? 3 : 0;
}

/* ---- commands ---- */

void control_stats(FILE *out) {
    fprintf(out, "{\"ok\": true, \"board\": \"%s\", \"mcu\": \"%s\", ", chip_board->name, chip_board->mcu);
    chip_json(out);
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
        if (!strcmp(w, "at") && integer(word(), &at))
            s.at = at, placed = true;
        else if (!strcmp(w, "above") || !strcmp(w, "below"))
            s.below = *w == 'b';
        else if (!strcmp(w, "nc") || !strcmp(w, "no"))
            s.normally_closed = w[1] == 'c';
        else if (!strcmp(w, "pin"))
            s.pin = word();
        else if (strcmp(w, "bounce") || !control_time(word(), &s.bounce)) {
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
        bool good = !strcmp(w, "flip")   ? number(v, &flip)
                    : !strcmp(w, "drop") ? number(v, &drop)
                    : !strcmp(w, "seed") ? integer(v, &seed)
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
    if (!control_time(w, &wait) || !rest || !*rest)
        fail(reply, "after TIME COMMAND, not 'after %s'", w);
    else if (later_count == MAX_LATER)
        fail(reply, "%d commands are waiting already", MAX_LATER);
    else {
        later[later_count].cycle = chip_now() + wait;
        later[later_count++].command = strdup(rest);
        done(reply);
    }
}

static void do_peek(FILE *reply) {
    const char *name = word(), *size = word();
    long long address, n;
    uint8_t bytes[256];
    if (!integer(name, &address))
        address = program_symbol(name);
    if (!integer(size, &n) || n < 1 || n > (long long)sizeof bytes || !chip_peek((long)address, bytes, (int)n)) {
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
    if (!integer(name, &address))
        address = program_symbol(name);
    long n = unhex(word(), bytes, sizeof bytes);
    if (n < 1 || !chip_poke((long)address, bytes, (int)n))
        fail(reply, "poke NAME|ADDRESS HEX: not at '%s'", name);
    else
        done(reply);
}

static uint8_t outgoing[LONGEST_LINE / 2];

static void do_send(FILE *reply) {
    long n = unhex(word(), outgoing, sizeof outgoing);
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
    if (!control_stepped || !control_time(w, &cycles)) {
        fail(reply, control_stepped ? "run TIME, not 'run %s'" : "run %s: only with --speed step", w);
        return;
    }
    for (line_stop_byte = -1; *(w = word());) {
        if (!strcmp(w, "until")) {
            if (unhex(word(), &stop, 1) != 1) {
                fail(reply, "run: until HEX, one byte");
                return;
            }
            line_stop_byte = stop;
            continue;
        }
        long n = unhex(w, outgoing, sizeof outgoing);
        if (n < 0) {
            fail(reply, "run: '%.20s' is not hexadecimal", w);
            return;
        }
        line_feed(outgoing, (size_t)n);
    }
    control_run_until(chip_now() + cycles);
    line_stop_byte = -1;
    fprintf(reply, "{\"ok\": true, \"cycle\": %llu, \"out\": \"", (unsigned long long)chip_now());
    uint8_t bytes[256];
    for (size_t n; (n = line_collect(bytes, sizeof bytes));)
        for (size_t i = 0; i < n; i++)
            fprintf(reply, "%02x", bytes[i]);
    fputs("\"}\n", reply);
}

static void do_setting(const char *what, FILE *reply) {
    const char *w = word();
    double v;
    if (!strcmp(what, "bootloader") && (!strcmp(w, "off") || (number(w, &v) && v >= 0)))
        chip_bootloader_ms = !strcmp(w, "off") ? -1 : v;
    else if (!strcmp(what, "reset-on-open") && (!strcmp(w, "on") || !strcmp(w, "off")))
        port_reset_on_open = !strcmp(w, "on");
    else if (!strcmp(what, "speed") && !control_stepped && (!strcmp(w, "max") || (number(w, &v) && v > 0))) {
        pace_speed = !strcmp(w, "max") ? 0 : v;
        pace_reset();
    } else if (!strcmp(what, "baud") && (!strcmp(w, "auto") || (number(w, &v) && v > 0)))
        line_host_baud = !strcmp(w, "auto") ? 0 : v;
    else if (!strcmp(what, "mark") && number(w, &v) && v >= 0 && v <= 255)
        pins_trace_mark((uint8_t)v);
    else {
        fail(reply, "'%s %s': see help", what, w);
        return;
    }
    done(reply);
}

void control_execute(char *line, FILE *reply) {
    rest = line;
    const char *c = word();
    if (!strcmp(c, "stats"))
        control_stats(reply);
    else if (!strcmp(c, "run"))
        do_run(reply);
    else if (!strcmp(c, "send"))
        do_send(reply);
    else if (!strcmp(c, "reset"))
        do_reset(reply);
    else if (!strcmp(c, "pin"))
        do_pin(reply);
    else if (!strcmp(c, "switch"))
        do_switch(reply);
    else if (!strcmp(c, "set-switch"))
        do_set_switch(reply);
    else if (!strcmp(c, "noise"))
        do_noise(reply);
    else if (!strcmp(c, "cut"))
        do_cut(reply);
    else if (!strcmp(c, "restore"))
        do_restore(reply);
    else if (!strcmp(c, "after"))
        do_after(reply);
    else if (!strcmp(c, "peek"))
        do_peek(reply);
    else if (!strcmp(c, "poke"))
        do_poke(reply);
    else if (!strcmp(c, "cycles"))
        done(reply);
    else if (!strcmp(c, "help"))
        fprintf(reply, "{\"ok\": true, \"commands\": \"%s\"}\n", HELP);
    else if (!strcmp(c, "clear"))
        pins_clear(), uart_clear(), chip_clear(), done(reply);
    else if (!strcmp(c, "flush"))
        pins_trace_close(), done(reply);
    else if (!strcmp(c, "quit"))
        control_quit = true, done(reply);
    else if (!strcmp(c, "bootloader") || !strcmp(c, "reset-on-open") || !strcmp(c, "speed") || !strcmp(c, "baud") ||
             !strcmp(c, "mark"))
        do_setting(c, reply);
    else
        fail(reply, "no command '%s'; see help", c);
}

bool control_do(char *command) {
    char *text = NULL;
    size_t size;
    FILE *reply = open_memstream(&text, &size);
    control_execute(command, reply);
    fclose(reply);
    bool good = !strstr(text, "\"error\"");
    if (!good)
        fprintf(stderr, "simboard: %s", text);
    free(text);
    return good;
}

void control_run_until(uint64_t cycle) {
    do {
        int next = -1;
        for (int i = 0; i < later_count; i++)
            if (later[i].cycle <= cycle && (next < 0 || later[i].cycle < later[next].cycle))
                next = i;
        if (next < 0) {
            chip_run_until(cycle);
            return;
        }
        chip_run_until(later[next].cycle);
        if (chip_stop)
            return;
        char *command = later[next].command;
        later[next] = later[--later_count];
        control_do(command);
        free(command);
    } while (!control_quit);
}

/* ---- clients ---- */

static void add_client(int in, int out) {
    if (client_count == MAX_CLIENTS) {
        close(in);
        return;
    }
    clients[client_count++] = (client){.in = in, .out = out};
}

bool control_listen(const char *path) {
    struct sockaddr_un a = {.sun_family = AF_UNIX};
    if (strlen(path) >= sizeof a.sun_path) {
        errno = ENAMETOOLONG;
        return false;
    }
    strcpy(a.sun_path, path);
    listener = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    unlink(path);
    listener_path = path;
    return listener >= 0 && !bind(listener, (struct sockaddr *)&a, sizeof a) && !listen(listener, 4);
}

void control_stdin(bool until_end) {
    add_client(STDIN_FILENO, STDOUT_FILENO);
    quit_at_end = until_end;
}

void control_end(void) {
    if (listener_path)
        unlink(listener_path);
}

int control_wait_for(struct pollfd *fds) {
    int n = 0;
    if (listener >= 0)
        fds[n++] = (struct pollfd){.fd = listener, .events = POLLIN};
    for (int i = 0; i < client_count; i++)
        fds[n++] = (struct pollfd){.fd = clients[i].in, .events = POLLIN};
    return n;
}

static void answer(const client *c, char *line) {
    char *text = NULL;
    size_t size, sent = 0;
    FILE *reply = open_memstream(&text, &size);
    control_execute(line, reply);
    fclose(reply);
    while (sent < size) {
        ssize_t n = write(c->out, text + sent, size - sent);
        if (n < 0 && errno != EINTR)
            break;
        sent += n > 0 ? (size_t)n : 0;
    }
    free(text);
}

/* Read what a client has sent and answer whole lines; false: it is gone. */
static bool serve(client *c) {
    char chunk[65536];
    ssize_t n = read(c->in, chunk, sizeof chunk);
    if (n <= 0 || c->size + (size_t)n > LONGEST_LINE)
        return n < 0 && (errno == EAGAIN || errno == EINTR);
    c->text = realloc(c->text, c->size + (size_t)n);
    if (!c->text)
        abort();
    memcpy(c->text + c->size, chunk, (size_t)n);
    c->size += (size_t)n;
    size_t begin = 0;
    for (char *end; (end = memchr(c->text + begin, '\n', c->size - begin)) && !control_quit;) {
        *end = 0;
        answer(c, c->text + begin);
        begin = (size_t)(end - c->text) + 1;
    }
    memmove(c->text, c->text + begin, c->size - begin);
    c->size -= begin;
    return true;
}

void control_service(void) {
    struct pollfd fds[CONTROL_FDS];
    int n = control_wait_for(fds);
    if (poll(fds, (nfds_t)n, 0) <= 0)
        return;
    int first = listener >= 0;
    for (int i = client_count - 1; i >= 0; i--) {
        if (!fds[first + i].revents || serve(&clients[i]))
            continue;
        if (clients[i].in == STDIN_FILENO)
            control_quit |= quit_at_end;
        else
            close(clients[i].in);
        free(clients[i].text);
        memmove(&clients[i], &clients[i + 1], sizeof *clients * (size_t)(client_count - i - 1));
        client_count--;
    }
    if (first && fds[0].revents) {
        int fd = accept4(listener, NULL, NULL, SOCK_CLOEXEC);
        if (fd >= 0)
            add_client(fd, fd);
    }
}
