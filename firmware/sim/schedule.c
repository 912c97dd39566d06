#include "schedule.h"

#include <stdlib.h>
#include <string.h>

#include "chip.h"

enum { MAX_LATER = 64 };

bool schedule_quit;

static struct {
    uint64_t cycle;
    char *command;
} later[MAX_LATER];
static int later_count;

bool schedule_later(uint64_t cycle, const char *command) {
    if (later_count == MAX_LATER)
        return false;
    later[later_count].cycle = cycle;
    later[later_count++].command = strdup(command);
    return true;
}

void schedule_run_until(uint64_t cycle, bool (*carry_out)(char *command)) {
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
        carry_out(command);
        free(command);
    } while (!schedule_quit);
}
