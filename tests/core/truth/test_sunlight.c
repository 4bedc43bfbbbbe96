/* test_sunlight.c - sunlight on the ground texel by texel, against geometry in closed form, sample by sample:
 * a sheet of known size on a stem of no width over flat ground, whole or masked. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/frames.h"
#include "core/truth/sunlight.h"
#include "tests/core/truth/sheet_kit.h"
#include "tests/core/view/scene_kit.h"

enum { SIDE = 200 };
static const double CX = 600064, CY = 4000064, HEIGHT = 6, HALF = 3;

/* Whether a point of the ground is in the sheet's shadow: 1, 0, or -1 within 3 mm of its border, 15 of the
 * mask's blurred one. */
static int in_shadow(double x, double y, struct sv_vec3 sun, double rotation, bool masked)
{
    struct sv_vec3 at = sv_vec3(x - CX + sun.x / sun.z * HEIGHT, y - CY + sun.y / sun.z * HEIGHT, 0);
    at = sv_rotate_clockwise(at, -rotation);
    double edge = fmax(fabs(at.x), fabs(at.y)) - HALF;
    if (fabs(edge) < 0.003 || (masked && edge < 0 && fabs(at.x) < 0.15))
        return -1;
    return edge < 0 && (!masked || at.x < 0);
}

static void sheet_case(double azimuth_deg, double elevation_deg, double rotation_deg, bool masked,
                       double texel_m, int samples)
{
    struct sv_scene *scene = sheet_kit_flat_scene();
    struct sv_tree *tree = sv_arena_alloc(scene->arena, 1, sizeof *tree);
    *tree = (struct sv_tree){.x = CX,
                             .y = CY,
                             .z = kit_surface(&scene->terrain.field, CX, CY),
                             .height_m = (float)HEIGHT,
                             .rotation_rad = (float)sv_radians(rotation_deg)};
    sheet_kit_put(scene, HALF / HEIGHT, tree, masked);
    struct sv_truth *truth;
    struct sv_error error = {0};
    assert_int_equal(sv_truth_create(scene, &truth, &error), SV_OK);
    struct sv_vec3 sun = sv_direction(sv_radians(azimuth_deg), sv_radians(elevation_deg));
    struct sv_light light = {.to_sun = sun};
    /* About the middle of the shadow, from a corner far off, as pages count. */
    double x0 = 600000.5, y0 = 3999999.25, mx = CX - sun.x / sun.z * HEIGHT, my = CY - sun.y / sun.z * HEIGHT;
    int i0 = (int)((mx - x0) / texel_m) - SIDE / 2, j0 = (int)((my - y0) / texel_m) - SIDE / 2;
    struct sv_truth_lattice lattice = {.x0 = x0,
                                       .y0 = y0,
                                       .texel_m = texel_m,
                                       .first = i0,
                                       .count = SIDE,
                                       .samples = samples,
                                       .trees = true};
    long told = 0, partly = 0, dark = 0;
    for (int j = 0; j < SIDE; j++) {
        uint8_t row[SIDE], bare[SIDE];
        sv_truth_sunlight_row(truth, &light, &lattice, j0 + j, row);
        struct sv_truth_lattice other = lattice;
        other.trees = false;
        sv_truth_sunlight_row(truth, &light, &other, j0 + j, bare);
        for (int i = 0; i < SIDE; i++) {
            int shaded = 0, sure = 1;
            for (int k = 0; k < samples; k++) {
                double dx, dy;
                sv_camera_sample_offset(samples, k, &dx, &dy);
                int s = in_shadow(x0 + (i0 + i + 0.5 + dx) * texel_m, y0 + (j0 + j + 0.5 + dy) * texel_m, sun,
                                  sv_radians(rotation_deg), masked);
                sure &= s >= 0;
                shaded += s > 0;
            }
            assert_int_equal(bare[i], 255);
            if (!sure)
                continue;
            told++;
            partly += shaded > 0 && shaded < samples;
            dark += shaded == samples;
            if (row[i] != (int)lrint(255.0 * (samples - shaded) / samples))
                fail_msg("texel %d, %d: %d of 255, %d of %d samples are in shadow", i, j, row[i], shaded,
                         samples);
        }
    }
    print_message("%ld texels, %ld dark, %ld partly\n", told, dark, partly);
    assert_true(told > SIDE * SIDE * 3 / 4 && dark > 50 && (samples == 1 || partly > 20));
    /* A texel is the same wherever its row begins and however long it is. */
    for (int j = 0; j < SIDE; j += 7) {
        uint8_t row[SIDE], part[31];
        sv_truth_sunlight_row(truth, &light, &lattice, j0 + j, row);
        struct sv_truth_lattice other = lattice;
        other.first = i0 + 50 + j;
        other.count = 31 < SIDE - 50 - j ? 31 : SIDE - 50 - j;
        if (other.count <= 0)
            break;
        sv_truth_sunlight_row(truth, &light, &other, j0 + j, part);
        assert_memory_equal(row + 50 + j, part, (size_t)other.count);
    }
    sv_truth_destroy(truth);
    kit_free(scene);
}

static void sheets(void **state)
{
    (void)state;
    sheet_case(135, 45, 10, false, 0.25, 16);
    sheet_case(0, 30, 20, false, 0.0625, 4);
    sheet_case(287, 25, 75, false, 0.03125, 1);
    sheet_case(40, 60, 33, false, 0.4, 64);
    sheet_case(160, 40, 5, true, 0.2, 16);
    sheet_case(250, 30, 50, true, 0.0625, 4);
}

/* A sun at or below the horizon lights nothing; beyond the field is what is at its border. */
static void night_and_beyond(void **state)
{
    (void)state;
    struct sv_scene *scene = sheet_kit_flat_scene();
    struct sv_truth *truth;
    struct sv_error error = {0};
    assert_int_equal(sv_truth_create(scene, &truth, &error), SV_OK);
    struct sv_truth_lattice lattice = {
        .x0 = 600000, .y0 = 4e6, .texel_m = 2, .first = -40, .count = SIDE, .samples = 4, .trees = true};
    uint8_t row[SIDE];
    for (int j = -5; j < 80; j += 17)
        for (int k = 0; k < 3; k++) {
            static const double elevations[3] = {-20, 0, 50};
            struct sv_light light = {.to_sun = sv_direction(1, sv_radians(elevations[k]))};
            sv_truth_sunlight_row(truth, &light, &lattice, j, row);
            for (int i = 0; i < SIDE; i++)
                assert_int_equal(row[i], k == 2 ? 255 : 0);
        }
    sv_truth_destroy(truth);
    kit_free(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(sheets), cmocka_unit_test(night_and_beyond)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
