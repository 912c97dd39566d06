#include "control.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "commands.h"
#include "port.h"
#include "schedule.h"

enum { MAX_CLIENTS = CONTROL_FDS - 1 };
enum { LONGEST_LINE = 2 * COMMANDS_MOST_BYTES };       /* characters */

typedef struct {
    int in, out;
    char *text;
    size_t size;
} client;

static client clients[MAX_CLIENTS];
static int client_count;
static int listener = -1;
static const char *listener_path;
static bool quit_at_end;

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
    port_look();              /* what the test did to the port before it asked happens before the answer */
    FILE *reply = open_memstream(&text, &size);
    commands_execute(line, reply);
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
    for (char *end; (end = memchr(c->text + begin, '\n', c->size - begin)) && !schedule_quit;) {
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
            schedule_quit |= quit_at_end;
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
