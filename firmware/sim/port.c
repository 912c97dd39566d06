#include "port.h"

#include <errno.h>
#include <fcntl.h>
#include <pty.h>
#include <stdlib.h>
#include <string.h>
#include <sys/inotify.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

#include "chip.h"
#include "line.h"

/* What a USB serial chip holds for the board; more stays with the host's kernel. */
enum { USB_BUFFER = 64 };

bool port_reset_on_open = true;

static int master = -1, watch = -1;
static char device[128], *link_name;
static bool is_open;
static int users;             /* open descriptions of the port */
static uint64_t opened, unread;

static void make_raw(void) {
    struct termios t;
    if (!tcgetattr(master, &t)) {
        cfmakeraw(&t);
        tcsetattr(master, TCSANOW, &t);
    }
}

bool port_start(const char *link) {
    int slave;
    if (openpty(&master, &slave, device, NULL, NULL))
        return false;
    make_raw();
    close(slave);             /* from here on a hang-up on the master says: nobody has the port open */
    fcntl(master, F_SETFL, fcntl(master, F_GETFL) | O_NONBLOCK);
    fcntl(master, F_SETFD, FD_CLOEXEC);
    watch = inotify_init1(IN_NONBLOCK | IN_CLOEXEC);
    if (watch < 0 || inotify_add_watch(watch, device, IN_OPEN | IN_CLOSE) < 0)
        return false;
    if (link) {
        struct stat s;
        if (!lstat(link, &s) && !S_ISLNK(s.st_mode)) {
            fprintf(stderr, "simboard: %s exists and is no symbolic link\n", link);
            return false;
        }
        unlink(link);
        if (symlink(device, link)) {
            fprintf(stderr, "simboard: %s: %s\n", link, strerror(errno));
            return false;
        }
        link_name = strdup(link);
    }
    return true;
}

void port_end(void) {
    char target[128] = "";
    if (link_name && readlink(link_name, target, sizeof target - 1) > 0 && !strcmp(target, device))
        unlink(link_name);
}

const char *port_path(void) { return link_name ? link_name : device; }

int port_wait_for(struct pollfd *fds) {
    int n = 0;
    if (watch >= 0)
        fds[n++] = (struct pollfd){.fd = watch, .events = POLLIN};
    if (is_open && line_queued() < USB_BUFFER)
        fds[n++] = (struct pollfd){.fd = master, .events = POLLIN};
    return n;
}

static void on_open(void) {
    is_open = true;
    opened++;
    line_discard(LINE_OUT);
    if (port_reset_on_open)
        chip_reset(RESET_EXTERNAL);
}

/* inotify tells of every opening and closing, also of those between two looks; a hang-up on the master
 * is the truth about now (two openings in a row may arrive as one event). */
void port_look(void) {
    if (master < 0)
        return;
    char events[4096] __attribute__((aligned(__alignof__(struct inotify_event))));
    ssize_t n;
    while ((n = read(watch, events, sizeof events)) > 0) {
        for (char *p = events; p < events + n;) {
            const struct inotify_event *e = (const struct inotify_event *)p;
            p += sizeof *e + e->len;
            if (e->mask & IN_OPEN) {
                if (users++ == 0)
                    on_open();
            } else if ((e->mask & IN_CLOSE) && users > 0) {
                users--;
            }
        }
    }
    struct pollfd now = {.fd = master};
    poll(&now, 1, 0);
    if (now.revents & POLLHUP)
        users = 0;
    else if (users == 0 && is_open)   /* not open yet: its event comes, and on_open() with it */
        users = 1;
    if (users == 0 && is_open && !line_queued()) {
        is_open = false;
        make_raw();
    }
}

static bool read_host(void) {
    bool any = false;
    uint8_t bytes[USB_BUFFER];
    for (size_t room; (room = line_queued()) < USB_BUFFER;) {
        ssize_t n = read(master, bytes, USB_BUFFER - room);
        if (n <= 0)
            break;            /* nothing (EAGAIN), or closed and drained (EIO) */
        line_feed(bytes, (size_t)n);
        any = true;
    }
    return any;
}

static void write_host(void) {
    static uint8_t bytes[4096];
    static size_t held;
    held += line_collect(bytes + held, sizeof bytes - held);
    if (users == 0) {
        unread += held;       /* nobody listens: gone, as behind a USB chip */
        held = 0;
    }
    if (!held)
        return;
    ssize_t n = write(master, bytes, held);
    if (n > 0) {
        memmove(bytes, bytes + n, held - (size_t)n);
        held -= (size_t)n;
    } else if (held == sizeof bytes) {
        unread += held;       /* the host does not read: its kernel's buffer and ours are full */
        held = 0;
    }
}

bool port_service(void) {
    if (master < 0)
        return false;
    port_look();
    bool any = is_open && read_host();
    write_host();
    return any;
}

bool port_is_open(void) { return users > 0; }

void port_json(FILE *out) {
    fprintf(out, "{\"path\": \"%s\", \"open\": %s, \"opened\": %llu, \"unread\": %llu}", port_path(),
            users ? "true" : "false", (unsigned long long)opened, (unsigned long long)unread);
}
