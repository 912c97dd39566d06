#include "config.h"

#include <stddef.h>
#include <string.h>

#include "crc.h"
#include "hal.h"

struct limits limits;

enum { HEAD = 12, SERVO_LOWEST = 400, SERVO_HIGHEST = 2600 };
static const int32_t FARTHEST = 1L << 30;

enum error config_write(uint16_t offset, const uint8_t *data, uint8_t length) {
    if (offset > sizeof memory.image || length > sizeof memory.image - offset) {
        return E_VALUE;
    }
    memory.config = 0;
    memory.known = 0;
    memcpy((uint8_t *)&memory.image + offset, data, length);
    return OK;
}

static uint32_t magnitude(int32_t x) {
    return x < 0 ? 0U - (uint32_t)x : (uint32_t)x;
}

static bool axis_valid(uint8_t i) {
    const struct axis_config *axis = &memory.image.axis[i];
    if (axis->flags & ~(USED | INVERT)) {
        return false;
    }
    if (!(axis->flags & USED)) {
        return true;
    }
    if (i >= STEPPERS && (axis->lower < SERVO_LOWEST || axis->upper > SERVO_HIGHEST)) {
        return false;
    }
    return axis->lower >= -FARTHEST && axis->upper <= FARTHEST && axis->lower <= axis->home &&
           axis->home <= axis->upper && axis->max_rate > 0 && axis->max_accel > 0 && axis->max_accel < 1UL << 24;
}

static bool row_valid(uint8_t r) {
    const struct row_config *row = &memory.image.row[r];
    uint64_t largest = 0;
    for (uint8_t i = 0; i < AXES; i++) {
        const struct axis_config *axis = &memory.image.axis[i];
        if (!row->weight[i]) {
            continue;
        }
        if (!(axis->flags & USED)) {
            return false;
        }
        const uint32_t low = magnitude(axis->lower), high = magnitude(axis->upper);
        largest += (uint64_t)magnitude(row->weight[i]) * (low > high ? low : high);
    }
    return row->lower <= row->upper && largest < 1UL << 30;
}

static bool guard_valid(uint8_t n) {
    const struct guard_config *guard = &memory.image.guard[n];
    bool any = false;
    for (uint8_t i = 0; i < AXES; i++) {
        any |= guard->weight[i] != 0;
        if (guard->weight[i] && !(memory.image.axis[i].flags & USED)) {
            return false;
        }
    }
    return !(guard->flags & ~(USED | CLOSED)) && any == !!(guard->flags & USED);
}

static bool image_valid(uint16_t length) {
    const struct image *image = &memory.image;
    if (length < HEAD || image->layout != 2 || image->axes != AXES || image->rows > ROWS ||
        length != offsetof(struct image, row) + image->rows * sizeof image->row[0] ||
        (image->flags & ~(ABORT_CLOSED | ENABLE_HIGH | POWER_SENSED)) || image->step_high > STEP_HIGH_MAX ||
        image->step_low > STEP_LOW_MAX || image->dir_setup > DIR_SETUP_MAX) {
        return false;
    }
    for (uint8_t n = 0; n < SWITCHES; n++) {
        if (!guard_valid(n)) {
            return false;
        }
    }
    for (uint8_t i = 0; i < AXES; i++) {
        if (!axis_valid(i)) {
            return false;
        }
    }
    for (uint8_t r = 0; r < image->rows; r++) {
        if (!row_valid(r)) {
            return false;
        }
    }
    return true;
}

enum error config_commit(uint16_t length, uint32_t crc) {
    if (length > sizeof memory.image || crc_block(&memory.image, length) != crc || crc == 0 || !image_valid(length)) {
        return E_CONFIG_BAD;
    }
    memory.config = crc;
    config_activate();
    return OK;
}

static const float PER_SECOND = (float)(1ULL << VELOCITY_BITS) / CLOCK;  // a step a second as a velocity

static uint32_t fixed(float x, uint32_t most) {
    return x < most ? (uint32_t)x : most;
}

void config_activate(void) {
    memset(&limits, 0, sizeof limits);
    for (uint8_t i = 0; i < AXES; i++) {
        const struct axis_config *axis = &memory.image.axis[i];
        if (!memory.config || !(axis->flags & USED) || !axis->max_accel) {  // COMMIT takes no such one
            continue;
        }
        limits.used |= 1U << i;
        limits.invert |= axis->flags & INVERT ? 1U << i : 0;
        limits.top[i] = fixed(axis->max_rate * PER_SECOND, 0x7FFFFFFF);
        limits.jump[i] = fixed(axis->max_accel * (5.0F / 4 * 0.05F / 256 * PER_SECOND), JUMP_MAX - 1) + 1;
        limits.stop_time[i] = 1e3F * CLOCK / (1UL << 24) / axis->max_accel;
    }
    hal_configured();
}

bool within(int32_t lower, int32_t upper, int32_t before, int32_t after) {
    if (after < lower) {
        return after >= before;
    }
    return after <= upper || after <= before;
}

int32_t row_value(uint8_t row, const int32_t counts[AXES]) {
    uint32_t sum = 0;
    for (uint8_t i = 0; i < AXES; i++) {
        sum += (uint32_t)(int32_t)memory.image.row[row].weight[i] * (uint32_t)counts[i];
    }
    return (int32_t)sum;
}

int32_t row_slack(uint8_t row) {
    uint32_t sum = 0;
    for (uint8_t i = 0; i < AXES; i++) {
        sum += magnitude(memory.image.row[row].weight[i]);
    }
    return (int32_t)sum;
}

bool row_known(uint8_t row) {
    for (uint8_t i = 0; i < AXES; i++) {
        if (memory.image.row[row].weight[i] && !(memory.known >> i & 1)) {
            return false;
        }
    }
    return true;
}
