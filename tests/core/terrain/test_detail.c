/* test_detail.c - the ground's detail: its mean, its ends. That what is drawn is the same: test_ground.c. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/base/vec.h"
#include "core/terrain/detail.h"

static int set_up(void **state)
{
    struct sv_error error;
    (void)state;
    return sv_terrain_detail_init(&error) ? -1 : 0;
}

/* Over a large area the detail multiplies by 1 on average, at every size of pixel. */
static void mean_is_one(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(5, 1);
    for (double pixel_m = 0.01; pixel_m < 20; pixel_m *= 3) {
        double sum = 0;
        int n = 40000;
        for (int k = 0; k < n; k++) {
            float albedo[3] = {0.06f, 0.10f, 0.03f};
            sv_terrain_detail_apply(sv_rng_range(&rng, 0, 5000), sv_rng_range(&rng, 0, 5000), pixel_m, 1, 40,
                                    albedo);
            sum += (double)albedo[1] / 0.10;
        }
        assert_true(fabs(sum / n - 1) < 0.01); /* deviation of the mean: 0.5 / 200 = 0.0025 */
    }
}

/* From a scale's end on nothing of it is left, and just below its visible range there is something. */
static void scales_end_where_they_say(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(6, 1);
    assert_true(sv_terrain_detail_end_m(SV_DETAIL_BROAD, 5) == 0);
    for (double texel_m = 0.3; texel_m < 300; texel_m *= 2) {
        double end = 0;
        for (int k = 0; k < SV_DETAIL_COUNT; k++)
            end = fmax(end, sv_terrain_detail_end_m((enum sv_terrain_detail_scale)k, texel_m));
        double seen = 0;
        for (int k = 0; k < 200; k++) {
            float far_off[3] = {0.1f, 0.1f, 0.05f}, near_by[3] = {0.1f, 0.1f, 0.05f};
            double x = sv_rng_range(&rng, 0, 1e6), y = sv_rng_range(&rng, 0, 1e6);
            sv_terrain_detail_apply(x, y, end * 1.0001, 1, texel_m, far_off);
            sv_terrain_detail_apply(x, y, end * 0.2, 1, texel_m, near_by);
            assert_true(fabsf(far_off[1] - 0.1f) < 1e-6f);
            seen += fabs((double)near_by[1] - 0.1);
        }
        assert_true(seen / 200 > 1e-4);
    }
}

static void odd_numbers_change_nothing(void **state)
{
    (void)state;
    const double odd[] = {(double)NAN, (double)INFINITY, -(double)INFINITY, 1e308, 0};
    for (int k = 0; k < 5; k++)
        for (int at = 0; at < 5; at++) {
            double v[5] = {5, 5, 0.1, 1, 10};
            float albedo[3] = {0.1f, 0.2f, 0.05f};
            v[at] = odd[k];
            sv_terrain_detail_apply(v[0], v[1], v[2], v[3], v[4], albedo);
            for (int c = 0; c < 3; c++)
                assert_true(albedo[c] >= 0 && albedo[c] < 2);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(mean_is_one),
        cmocka_unit_test(scales_end_where_they_say),
        cmocka_unit_test(odd_numbers_change_nothing),
    };
    return cmocka_run_group_tests(tests, set_up, NULL);
}
