/* simboard: a board with the compiled firmware, behind a pseudo-terminal. See README.md. */
#include <errno.h>
#include <getopt.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "chip.h"
#include "commands.h"
#include "control.h"
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

static const char USAGE[] =
    "usage: simboard --board uno_cnc_shield|mega_ramps14|uno_servos --elf FILE [options]\n"
    "  --link PATH          a name (symbolic link) for the serial port\n"
    "  --control PATH       take commands from this UNIX socket, one a line, answered in JSON\n"
    "  --stdin              take commands from standard input and end with it\n"
    "  --speed N|max|step   simulated per real second (1); as fast as the host keeps talking; or only by `run`\n"
    "  --ahead MS           with --speed max: free run after the host's last byte (50)\n"
    "  --patience MS        simulated time waits for a host that has the port open and is silent for so long (0: never)\n"
    "  --loader FILE        a real boot loader (Intel HEX), which every reset starts; without --elf the flash is empty\n"
    "  --bootloader MS      a bootloader that hides MCUSR and, after an external reset, takes MS\n"
    "  --no-reset-on-open   opening the port does not reset the board\n"
    "  --driver NAME        timing to hold: a4988 (default), drv8825, tmc2209\n"
    "  --do COMMAND         carry out a command of the control channel at the start; repeatable\n"
    "  --baud N             the host's true baud rate (default: the standard rate nearest to the board's)\n"
    "  --trace FILE         record every edge (format: README.md)\n"
    "  --stats FILE         write the figures there at the end\n"
    "  --seed N             of the SRAM's contents at power-on (1)\n"
    "  --quiet              do not say where the port is\n";

/* Simulated time between two looks at the port: 8 bytes at 250000 baud arrive in it. */
enum { SLICE = CLOCK_HZ / 4000 };

/* In the order in which a reset puts them to a new chip: the pins' edges are known before the inputs drive. */
static const chip_part parts[] = {
    {.attach = interrupts_attach},
    {.attach = uart_attach, .start = uart_start, .swallow = uart_swallow},
    {.attach = pins_attach},
    {.attach = inputs_attach},
    {.attach = trace_reset},
    {0},
};

static volatile sig_atomic_t interrupted;

static void on_signal(int number) {
    (void)number;
    interrupted = 1;
}

static void die(const char *what, const char *why) {
    fprintf(stderr, "simboard: %s: %s\n", what, why);
    exit(2);
}

static double positive(const char *name, const char *text) {
    char *end;
    double v = strtod(text, &end);
    if (end == text || *end || !(v >= 0))
        die(name, "a number of at least 0 is wanted");
    return v;
}

static void wait_ns(int64_t ns) {
    struct pollfd fds[CONTROL_FDS + 2];
    int n = control_wait_for(fds);
    n += port_wait_for(fds + n);
    struct timespec t = {.tv_sec = ns / 1000000000, .tv_nsec = ns % 1000000000};
    ppoll(fds, (nfds_t)n, ns < 0 ? NULL : &t, NULL);
}

static void service(void) {
    bool was_there = pace_host_is_there;
    bool spoke = !pace_stepped && port_service();
    pace_host_is_there = port_is_open();
    if (spoke || (pace_host_is_there && !was_there))
        pace_host_spoke();
    control_service();
}

static void loop(void) {
    pace_reset();
    while (!schedule_quit && !interrupted) {
        if (pace_stepped) {
            wait_ns(-1);
            service();
            continue;
        }
        schedule_run_until(chip_now() + SLICE, commands_do);
        service();
        for (int64_t ns; (ns = pace_wait()) > 0 && !schedule_quit && !interrupted;) {
            wait_ns(ns);
            service();
        }
    }
}

int main(int argc, char **argv) {
    enum { BOARD = 1, ELF, LINK, CONTROL, STDIN, SPEED, AHEAD, PATIENCE, BOOT, LOADER, NO_RESET, DRIVER, DO, BAUD, TRACE, STATS, SEED, QUIET, HELP };
    static const struct option options[] = {
        {"board", 1, 0, BOARD}, {"elf", 1, 0, ELF}, {"link", 1, 0, LINK}, {"control", 1, 0, CONTROL},
        {"stdin", 0, 0, STDIN}, {"speed", 1, 0, SPEED}, {"ahead", 1, 0, AHEAD}, {"patience", 1, 0, PATIENCE}, {"bootloader", 1, 0, BOOT},
        {"loader", 1, 0, LOADER},
        {"no-reset-on-open", 0, 0, NO_RESET}, {"driver", 1, 0, DRIVER}, {"do", 1, 0, DO}, {"baud", 1, 0, BAUD},
        {"trace", 1, 0, TRACE}, {"stats", 1, 0, STATS}, {"seed", 1, 0, SEED}, {"quiet", 0, 0, QUIET},
        {"help", 0, 0, HELP}, {0},
    };
    const board *b = NULL;
    const driver *d = drivers;
    const char *elf = NULL, *link = NULL, *control = NULL, *trace = NULL, *stats = NULL;
    char *commands[64];
    int command_count = 0;
    bool from_stdin = false, quiet = false;
    uint64_t seed = 1;
    for (int o; (o = getopt_long(argc, argv, "h", options, NULL)) != -1;) {
        switch (o) {
        case BOARD:
            if (!(b = board_find(optarg)))
                die(optarg, "no such board; there are uno_cnc_shield, mega_ramps14, uno_servos");
            break;
        case ELF: elf = optarg; break;
        case LINK: link = optarg; break;
        case CONTROL: control = optarg; break;
        case STDIN: from_stdin = true; break;
        case SPEED:
            pace_stepped = !strcmp(optarg, "step");
            pace_speed = !strcmp(optarg, "max") || pace_stepped ? 0 : positive("--speed", optarg);
            break;
        case AHEAD: pace_ahead = (uint64_t)(positive("--ahead", optarg) * (CLOCK_HZ / 1e3)); break;
        case PATIENCE: pace_patience = (uint64_t)(positive("--patience", optarg) * (CLOCK_HZ / 1e3)); break;
        case BOOT: chip_bootloader_ms = positive("--bootloader", optarg); break;
        case LOADER:
            if (!loader_load(optarg))
                die(optarg, "no boot loader in Intel HEX in it");
            break;
        case NO_RESET: port_reset_on_open = false; break;
        case DRIVER:
            for (d = drivers; d->name && strcmp(d->name, optarg);)
                d++;
            if (!d->name)
                die(optarg, "no such driver; there are a4988, drv8825, tmc2209");
            break;
        case DO:
            if (command_count == 64)
                die("--do", "too many");
            commands[command_count++] = optarg;
            break;
        case BAUD: line_host_baud = positive("--baud", optarg); break;
        case TRACE: trace = optarg; break;
        case STATS: stats = optarg; break;
        case SEED: seed = (uint64_t)positive("--seed", optarg); break;
        case QUIET: quiet = true; break;
        case HELP: case 'h': fputs(USAGE, stdout); return 0;
        default: fputs(USAGE, stderr); return 2;
        }
    }
    if (!b || (!elf && !loader.code) || optind < argc) {
        fputs(USAGE, stderr);
        return 2;
    }
    if (elf && access(elf, R_OK))
        die(elf, strerror(errno));
    if (!chip_load(b, elf, seed, parts))
        die(elf, "no program for an AVR in it");
    pins_init(b, d, inputs_moved);
    if (trace && !pins_trace_to(trace))
        die(trace, strerror(errno));
    chip_reset(RESET_POWER);
    for (int i = 0; i < command_count; i++)
        if (!commands_do(commands[i]))
            return 2;
    if (!port_start(link))
        die("serial port", strerror(errno));
    if (control && !control_listen(control))
        die(control, strerror(errno));
    if (from_stdin || isatty(STDIN_FILENO))
        control_stdin(from_stdin);
    struct sigaction act = {.sa_handler = on_signal};
    sigaction(SIGINT, &act, NULL);
    sigaction(SIGTERM, &act, NULL);
    sigaction(SIGHUP, &act, NULL);  // a closed terminal: the link must go, its device may become another's
    signal(SIGPIPE, SIG_IGN);
    if (from_stdin)
        printf("{\"board\": \"%s\", \"port\": \"%s\"}\n", b->name, port_path());
    else if (!quiet)
        printf("%s runs behind %s (Ctrl-C ends it; type help for what it can do to the board). Try:\n\n"
               "    armkin send robots/three_dof.yaml -30 5 -5 --port %s --assume-home\n\n",
               b->name, port_path(), port_path());
    fflush(stdout);
    loop();
    trace_flush();
    port_end();
    control_end();
    if (stats) {
        FILE *out = fopen(stats, "w");
        if (!out)
            die(stats, strerror(errno));
        commands_stats(out);
        fclose(out);
    }
    return !strcmp(chip_state(), "crashed");
}
