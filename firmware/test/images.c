#include "images.h"

#include <stddef.h>
#include <string.h>

#include "../src/core/config.h"
#include "chance.h"
#include "host.h"

uint16_t image_length(const struct image *image) {
    return offsetof(struct image, row) + (image->rows <= ROWS ? image->rows : ROWS) * sizeof image->row[0];
}

// Here and there at its ends.
struct image sound_image(const bool *below) {
    struct image image = host_image();
    image.flags = rnd(8);
    image.step_high = rnd(2) ? STEP_HIGH_MAX : rnd(STEP_HIGH_MAX);
    image.step_low = rnd(STEP_LOW_MAX + 1);
    image.dir_setup = rnd(DIR_SETUP_MAX + 1);
    image.wake = rnd(3);
    for (uint8_t i = 0; i < AXES; i++) {
        struct axis_config *axis = &image.axis[i];
        axis->flags = USED | (rnd(2) ? INVERT : 0);
        axis->max_accel = rnd(8) ? 100000 + rnd(300000) : (1UL << 24) - 1;
        if (i < STEPPERS) {
            axis->lower = rnd(8) ? between(-4000, -200) : -(1 << 30);
            axis->upper = rnd(8) ? between(200, 4000) : 1 << 30;
            axis->home = rnd(2) ? 0 : axis->lower;
            if (rnd(8) == 0) {
                *axis = (struct axis_config){0};  // unused
            }
        }
    }
    for (uint8_t n = 0; n < SWITCHES; n++) {
        const uint8_t i = axis_of(n);
        if (image.axis[i].flags && rnd(3)) {
            image.guard[n].flags = USED | (rnd(2) ? CLOSED : 0);
            image.guard[n].weight[i] = below[n] ? -1 - (int8_t)rnd(127) : 1 + (int8_t)rnd(127);
            const uint8_t other = rnd(STEPPERS);
            if (other != i && image.axis[other].flags && rnd(4) == 0) {
                image.guard[n].weight[other] = between(-3, 3);
            }
        }
    }
    image.rows = rnd(ROWS + 1);
    for (uint8_t r = 0; r < image.rows; r++) {
        image.row[r].lower = -between(0, 200000);
        image.row[r].upper = between(0, 200000);
        for (uint8_t i = 0; i < STEPPERS; i++) {
            const bool small = image.axis[i].flags && image.axis[i].upper <= 4000 && image.axis[i].lower >= -4000;
            image.row[r].weight[i] = small && rnd(2) ? between(-100, 100) : 0;
        }
    }
    return image;
}

void spoil_image(struct image *image) {
    struct axis_config *axis = &image->axis[rnd(AXES)], *stepper = &image->axis[rnd(STEPPERS)], *servo = &image->axis[AXES - 1];
    const struct axis_config sound = {USED, -100, 100, 0, 1000, 1000};
    switch (rnd(SWITCHES ? 21 : 18)) {
        case 0: image->layout = rnd(2) ? 1 : 3; break;
        case 1: image->axes += rnd(2) ? 1 : -1; break;
        case 2: image->rows = ROWS + 1; break;
        case 3: image->flags |= 8 << rnd(5); break;
        case 4: image->step_high = between(STEP_HIGH_MAX + 1, 255); break;
        case 5: image->step_low = between(STEP_LOW_MAX + 1, 255); break;
        case 6: image->dir_setup = between(DIR_SETUP_MAX + 1, 255); break;
        case 7: axis->flags |= 4 << rnd(6); break;
        case 8: *stepper = sound; stepper->lower = -(1 << 30) - 1; break;
        case 9: *stepper = sound; stepper->upper = (1 << 30) + 1; break;
        case 10: *stepper = sound; stepper->home = -101; break;
        case 11: *stepper = sound; stepper->home = 101; break;
        case 12: *stepper = sound; stepper->max_rate = 0; break;
        case 13: *stepper = sound; stepper->max_accel = rnd(2) ? 0 : 1UL << 24; break;
        case 14: servo->lower = 399; break;
        case 15: servo->upper = 2601; break;
        case 16:
            image->rows = 1;
            memset(&image->row[0], 0, sizeof image->row[0]);
            image->row[0].lower = 1;
            break;
        case 17:  // a weight of an axis that is not used, or too great
            image->rows = 1;
            memset(&image->row[0], 0, sizeof image->row[0]);
            image->row[0].weight[0] = 32767;
            image->axis[0] = rnd(2) ? (struct axis_config){0} : (struct axis_config){USED, -(1 << 30), 100, 0, 1000, 1000};
            for (uint8_t n = 0; n < SWITCHES; n++) {
                image->guard[n].weight[0] = 0;
                image->guard[n].flags &= ~USED;
                memset(image->guard[n].weight, 0, sizeof image->guard[n].weight);
            }
            break;
        case 18: image->guard[rnd(SWITCHES)].flags |= 4 << rnd(6); break;
        case 19: image->guard[rnd(SWITCHES)].flags ^= USED; break;
        default:
            image->axis[0] = (struct axis_config){0};
            image->guard[0] = (struct guard_config){.flags = USED, .weight = {1}};
    }
}
