// Credit, sequence numbers, images of a configuration, and what replies say of their session.
#include "core.h"

static void credit_and_duplicates(void) {
    fresh(7);
    struct host_segment s[8];
    for (int k = 0; k < 8; k++) {
        s[k] = (struct host_segment){.ticks = 200, .interval = 16000, .steps = {10}};
    }
    int32_t at[AXES] = {0};
    uint8_t free = QUEUE_SLOTS;
    while (free >= 8) {
        const struct ack ack = host_motion(1, 0, at, 8, s);
        CHECK(ack.error == OK && ack.free == free - 8);
        free = ack.free;
        at[0] += 80;
        bench_payload(host_frame, host_length);  // the same again: a lost ACK makes the host do that
        uint8_t answer[300];
        CHECK(bench_answer(answer, sizeof answer) == 10 && answer[1] == host_next && answer[5] == free);
    }
    CHECK(free == 0 && host_motion(1, 0, at, 1, s).error == E_CREDIT);
    host_wait_idle(20000);
    CHECK(host_status(0).ack.error == E_CREDIT);
}

static void free_slots_are_told_unasked(void) {
    fresh(8);
    struct host_segment s[10];
    for (int k = 0; k < 10; k++) {
        s[k] = (struct host_segment){.ticks = 100, .interval = 1600, .steps = {10}};
    }
    int32_t at[AXES] = {0};
    for (unsigned sent = 0; sent + 10 <= QUEUE_SLOTS; sent += 10) {
        CHECK(host_motion(1, sent + 20 > QUEUE_SLOTS ? HOST_END : 0, at, 10, s).error == OK);
        at[0] += 100;
    }
    uint8_t answer[300], before = QUEUE_SLOTS / 10 * 10;
    before = QUEUE_SLOTS - before;
    int told = 0;
    for (int ms = 0; ms < 2000 && motion.state != IDLE; ms++) {
        bench_run(1000);
        if (bench_answer(answer, sizeof answer)) {
            CHECK(answer[0] == 0x83 && answer[5] >= before + QUEUE_SLOTS / 4);
            before = answer[5];
            told++;
        }
        session.silent = 0;
    }
    CHECK(told >= 3);
}

static void lost_bytes_are_told_at_once(void) {
    uint8_t answer[300];
    fresh(86);
    hal_spilled = true;
    bench_run(1000);
    CHECK(bench_answer(answer, sizeof answer) == 10 && answer[0] == 0x83 && answer[1] == host_next);
    CHECK(answer[2] == OK && answer[3] == E_SPILL);
    CHECK(host_status(0).ack.error == OK && host_status(0).ack.detail == 0);
}

static void spoil(struct image *image, int how) {
    struct axis_config *axis = &image->axis[1], *servo = &image->axis[STEPPERS];
    image->rows = 1;
    image->row[0] = (struct row_config){-5, 5, {1, 1}};
    switch (how) {
        case 0: image->layout = 1; break;
        case 1: image->axes = AXES - 1; break;
        case 2: image->rows = ROWS + 1; break;
        case 3: image->flags = 8; break;
        case 4: image->step_high = 81; break;
        case 5: image->step_low = 51; break;
        case 6: image->dir_setup = 101; break;
        case 7: axis->flags = 4 | USED; break;
        case 8: axis->lower = -(1 << 30) - 1; break;
        case 9: axis->upper = (1 << 30) + 1; break;
        case 10: axis->home = axis->upper + 1; break;
        case 11: axis->home = axis->lower - 1; break;
        case 12: axis->max_rate = 0; break;
        case 13: axis->max_accel = 0; break;
        case 14: axis->max_accel = 1 << 24; break;
        case 15: servo->lower = 399; break;
        case 16: servo->upper = 2601; break;
        case 17: image->row[0].lower = 6; break;
        case 18: image->row[0].weight[1] = 10737; axis->upper = 100001; break;  // 10737 · 100001 > 2³⁰
        case 19: axis->flags = 0; break;                                        // a row's axis is not used
        default: break;
    }
}

static void broken_images_are_refused(void) {
    for (int how = 0; how <= 20; how++) {
        struct image image = host_image();
        uint8_t body[6];
        spoil(&image, how);
        bench_power();
        host_hello(1);
        const uint16_t length = offsetof(struct image, row) + sizeof image.row[0];
        for (uint16_t at = 0; at < length; at += 50) {
            uint8_t chunk[52] = {at, at >> 8};
            const uint8_t n = length - at < 50 ? length - at : 50;
            memcpy(chunk + 2, (const uint8_t *)&image + at, n);
            CHECK(host_order(0x10, chunk, n + 2).error == OK);
        }
        put32(put16(body, length), crc_block(&image, length));
        CHECK(host_order(0x11, body, 6).error == (how < 20 ? E_CONFIG_BAD : OK));
        CHECK((memory.config != 0) == (how == 20));
    }
}

static void replies_carry_the_session(void) {
    fresh(88);
    host_hello(0xABCD1234);
    CHECK(host_status(0).ack.session == 0x1234 && host_hold().session == 0x1234);
    bench_reset(0);
    CHECK(host_status(0).ack.session == 0);
}

void test_sessions(void) {
    credit_and_duplicates();
    free_slots_are_told_unasked();
    broken_images_are_refused();
    lost_bytes_are_told_at_once();
    replies_carry_the_session();
}
