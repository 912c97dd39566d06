#include "interrupts.h"

#include <sim_avr.h>

static struct {
    uint64_t raised, entered, accepted, count, total, longest, longest_wait;
} interrupt[64];

uint64_t interrupts_raised(void) {
    const avr_int_table_t *t = &chip->interrupts;
    return t->running_ptr ? interrupt[t->running[t->running_ptr - 1]->vector & 63].accepted : 0;
}

static void on_pending(struct avr_irq_t *irq, uint32_t value, void *param) {
    (void)irq;
    if (value)
        interrupt[(intptr_t)param].raised = chip_now();
}

static void on_running(struct avr_irq_t *irq, uint32_t value, void *param) {
    (void)irq;
    intptr_t v = (intptr_t)param;
    if (value) {
        /* libsimavr enters an interrupt in no time; the chip takes these cycles to push the PC */
        unsigned entry = (unsigned)chip_board->entry_cycles;
        interrupt[v].accepted = interrupt[v].raised;
        if (chip_now() - interrupt[v].raised > interrupt[v].longest_wait)
            interrupt[v].longest_wait = chip_now() - interrupt[v].raised;
        interrupt[v].entered = chip_now();
        chip->cycle += entry;
        chip->run_cycle_count = chip->run_cycle_count > entry ? chip->run_cycle_count - entry : 1;
    } else {
        uint64_t took = chip_now() - interrupt[v].entered;
        interrupt[v].count++;
        interrupt[v].total += took;
        if (took > interrupt[v].longest)
            interrupt[v].longest = took;
    }
}

/* On silicon an interrupt whose flag is up fires when it is enabled; libsimavr only fires when the flag
 * rises. Firing late would hide a program's forgetting to clear old flags. */
static void on_enabling(avr_t *avr, avr_io_addr_t addr, uint8_t v, void *param) {
    (void)param;
    avr->data[addr] = v;
    for (int i = 0; i < avr->interrupts.vector_count; i++) {
        avr_int_vector_t *vector = avr->interrupts.vector[i];
        if (vector->enable.reg == addr && vector->raised.reg && !vector->pending && avr_regbit_get(avr, vector->enable) &&
            avr_regbit_get(avr, vector->raised))
            avr_raise_interrupt(avr, vector);
    }
}

static void watch_enabling(avr_t *avr) {
    for (int i = 0; i < avr->interrupts.vector_count; i++) {
        const avr_int_vector_t *vector = avr->interrupts.vector[i];
        if (!vector->enable.reg || vector->enable.reg == vector->raised.reg)
            continue;
        if (!avr->io[AVR_DATA_TO_IO(vector->enable.reg)].w.c)
            avr->io[AVR_DATA_TO_IO(vector->enable.reg)].w.c = on_enabling;
    }
}

void interrupts_attach(avr_t *avr, reset_kind kind) {
    (void)kind;
    for (int i = 0; i < avr->interrupts.vector_count; i++) {
        avr_int_vector_t *v = avr->interrupts.vector[i];
        avr_irq_register_notify(v->irq + AVR_INT_IRQ_PENDING, on_pending, (void *)(intptr_t)(v->vector & 63));
        avr_irq_register_notify(v->irq + AVR_INT_IRQ_RUNNING, on_running, (void *)(intptr_t)(v->vector & 63));
    }
    watch_enabling(avr);
}

void interrupts_clear(void) {
    for (int v = 0; v < 64; v++)          /* what is under way goes on */
        interrupt[v].count = interrupt[v].total = interrupt[v].longest = interrupt[v].longest_wait = 0;
}

void interrupts_json(FILE *out) {
    fprintf(out, "\"interrupts\": {");
    const char *comma = "";
    for (int v = 0; v < 64; v++) {
        if (!interrupt[v].count)
            continue;
        fprintf(out, "%s\"%d\": {\"count\": %llu, \"mean_cycles\": %.1f, \"max_cycles\": %llu, \"max_wait_cycles\": %llu}",
                comma, v, (unsigned long long)interrupt[v].count, (double)interrupt[v].total / (double)interrupt[v].count,
                (unsigned long long)interrupt[v].longest, (unsigned long long)interrupt[v].longest_wait);
        comma = ", ";
    }
    fprintf(out, "}");
}
