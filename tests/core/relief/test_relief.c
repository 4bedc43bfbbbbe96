/* Relief textures as data: what alloc gives, what a frame must be, what is counted, and the inverse of X(u,
 * v). */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/relief/relief.h"

static void alloc_gives_empty_texels(void **state)
{
    (void)state;
    static const int sizes[][2] = {
        {1, 1}, {1, SV_RELIEF_SIDE_MAX}, {SV_RELIEF_SIDE_MAX, 1}, {3, 5}, {257, 129}};
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++) {
        struct sv_relief r;
        assert_int_equal(sv_relief_alloc(sizes[k][0], sizes[k][1], &r, NULL), SV_OK);
        size_t texels = (size_t)sizes[k][0] * (size_t)sizes[k][1];
        assert_true(isinf(r.cut) && r.solid_count == 0);
        for (size_t t = 0; t < texels; t++) {
            assert_false(sv_relief_solid(&r, t));
            /* Every element is its own memory: write all arrays, then read back. */
            r.displ[t] = (float)t;
            r.color[t][0] = (uint8_t)t, r.color[t][3] = 255;
            r.normal[t][3] = (int16_t)(t & 0x7fff);
        }
        for (size_t t = 0; t < texels; t++)
            assert_true(r.displ[t] == (float)t && r.color[t][0] == (uint8_t)t && r.color[t][3] == 255 &&
                        r.normal[t][0] == 0 && r.normal[t][3] == (int16_t)(t & 0x7fff));
        sv_relief_finish(&r);
        assert_null(r.displ);
        sv_relief_finish(&r);
    }
}

static void sizes_out_of_range_are_named(void **state)
{
    (void)state;
    static const int wrong[][2] = {
        {0, 4}, {-1, 4}, {SV_RELIEF_SIDE_MAX + 1, 4}, {4, 0}, {4, SV_RELIEF_SIDE_MAX + 1}};
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
        struct sv_relief r;
        struct sv_error e;
        memset(&r, 0x5a, sizeof r);
        struct sv_relief before = r;
        assert_int_equal(sv_relief_alloc(wrong[k][0], wrong[k][1], &r, &e), SV_EINVAL);
        assert_string_equal(e.field, k < 3 ? "width" : "height");
        assert_non_null(strstr(e.message, "8192"));
        assert_memory_equal(&r, &before, sizeof r);
    }
}

static void borrowed_arrays_are_left_alone(void **state)
{
    (void)state;
    float displ[1] = {3};
    uint8_t color[1][4] = {{1, 2, 3, 255}};
    struct sv_relief r = {.width = 1, .height = 1, .displ = displ, .color = color};
    sv_relief_measure(&r);
    assert_true(r.solid_count == 1 && r.displ_min == 3 && r.displ_max == 3);
    sv_relief_finish(&r);
    assert_true(displ[0] == 3);
}

static void solid_texels_alone_are_measured(void **state)
{
    (void)state;
    struct sv_relief r;
    assert_int_equal(sv_relief_alloc(3, 2, &r, NULL), SV_OK);
    static const float displ[6] = {-2, 1e30f, NAN, 7, INFINITY, -INFINITY};
    static const uint8_t alpha[6] = {128, 127, 255, 255, 255, 255};
    for (int k = 0; k < 6; k++) {
        r.displ[k] = displ[k];
        r.color[k][3] = alpha[k];
    }
    sv_relief_measure(&r);
    assert_true(r.solid_count == 2 && r.displ_min == -2 && r.displ_max == 7);
    r.color[0][3] = r.color[3][3] = 0;
    sv_relief_measure(&r);
    assert_true(r.solid_count == 0 && r.displ_min == 0 && r.displ_max == 0);
    sv_relief_finish(&r);
}

static struct sv_vec3 random_unit(struct sv_rng *rng)
{
    double z = sv_rng_range(rng, -1, 1), a = sv_rng_range(rng, 0, 2 * SV_PI), s = sqrt(1 - z * z);
    return sv_vec3(s * cos(a), s * sin(a), z);
}

static struct sv_relief_frame random_frame(struct sv_rng *rng)
{
    struct sv_vec3 f = random_unit(rng), a = sv_normalize(sv_cross(f, random_unit(rng))), b = sv_cross(f, a);
    double hand = sv_rng_unit(rng) < 0.5 ? 1 : -1;
    return (struct sv_relief_frame){sv_scale(random_unit(rng), sv_rng_range(rng, 0, 5e6)),
                                    sv_scale(a, pow(10, sv_rng_range(rng, -3, 3))),
                                    sv_scale(b, hand * pow(10, sv_rng_range(rng, -3, 3))), f};
}

static void frames_that_are_none_are_named(void **state)
{
    (void)state;
    const struct sv_relief_frame good = {{1, 2, 3}, {2, 0, 0}, {0, 0.5, 0}, {0, 0, -1}};
    struct sv_error e;
    assert_int_equal(sv_relief_frame_check(&good, &e), SV_OK);
    static const double bad[] = {NAN, INFINITY, -INFINITY};
    for (size_t k = 0; k < 3; k++)
        for (int part = 0; part < 12; part++) {
            static const char *const names[4] = {"frame.origin", "frame.a", "frame.b", "frame.f"};
            struct sv_relief_frame f = good;
            struct sv_vec3 *v[4] = {&f.origin, &f.a, &f.b, &f.f};
            double *at[3] = {&v[part / 3]->x, &v[part / 3]->y, &v[part / 3]->z};
            *at[part % 3] = bad[k];
            assert_int_equal(sv_relief_frame_check(&f, &e), SV_EINVAL);
            assert_string_equal(e.field, names[part / 3]);
        }
    const struct {
        struct sv_relief_frame frame;
        const char *field;
    } wrong[] = {
        {{{0, 0, 0}, {0, 0, 0}, {0, 1, 0}, {0, 0, 1}}, "frame.a"},
        {{{0, 0, 0}, {1, 0, 0}, {0, 1e-200, 0}, {0, 0, 1}}, "frame.b"},
        {{{0, 0, 0}, {1e200, 0, 0}, {0, 1, 0}, {0, 0, 1}}, "frame.a"},
        {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1.00001}}, "frame.f"},
        {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 0}}, "frame.f"},
        {{{0, 0, 0}, {1, 0, 0}, {1e-5, 1, 0}, {0, 0, 1}}, "frame.b"},
        {{{0, 0, 0}, {1, 0, 1e-5}, {0, 1, 0}, {0, 0, 1}}, "frame.f"},
        {{{0, 0, 0}, {1, 0, 0}, {0, 1000, 0.01}, {0, 0, 1}}, "frame.f"},
    };
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
        assert_int_equal(sv_relief_frame_check(&wrong[k].frame, &e), SV_EINVAL);
        assert_string_equal(e.field, wrong[k].field);
    }
}

static void locate_is_the_inverse(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(3, 1);
    double worst = 0;
    for (int k = 0; k < 20000; k++) {
        struct sv_relief_frame f = random_frame(&rng);
        assert_int_equal(sv_relief_frame_check(&f, NULL), SV_OK);
        double u = sv_rng_range(&rng, -9000, 9000), v = sv_rng_range(&rng, -9000, 9000),
               d = sv_rng_range(&rng, -1e4, 1e4);
        double gu, gv, gd;
        sv_relief_locate(&f, sv_relief_point(&f, u, v, d), &gu, &gv, &gd);
        /* The place itself is rounded to ulp(5e6 + 9e6) = 2e-9 m; the frame's own axes are square to 1e-16,
         * which lever by up to 9e6 m against texels of down to 1e-3 m. */
        double side = fmin(sv_length(f.a), sv_length(f.b)),
               span = sv_length(f.origin) + 9000 * (sv_length(f.a) + sv_length(f.b)) + 1e4;
        double error = fmax(fmax(fabs(gu - u), fabs(gv - v)) * side, fabs(gd - d)) / (span * 0x1p-52);
        worst = fmax(worst, error);
    }
    print_message("locate: worst error %.2f ulp of the farthest coordinate\n", worst);
    assert_true(worst < 8);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(alloc_gives_empty_texels),       cmocka_unit_test(sizes_out_of_range_are_named),
        cmocka_unit_test(borrowed_arrays_are_left_alone), cmocka_unit_test(solid_texels_alone_are_measured),
        cmocka_unit_test(frames_that_are_none_are_named), cmocka_unit_test(locate_is_the_inverse),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
