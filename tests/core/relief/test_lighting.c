/* test_lighting.c - normals of paper 1's (5), (6) against surfaces whose normals are known, the printed (5)
 * failing where the corrected one holds; light against the rule of core/scene/light.h evaluated in double;
 * AVX2 against scalar. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>
#include <cmocka.h>

#include "core/base/color.h"
#include "core/base/rng.h"
#include "core/base/simd.h"
#include "core/relief/lighting.h"
#include "core/relief/lighting_kernel.h"

static struct sv_vec3 random_unit(struct sv_rng *rng)
{
    for (;;) {
        struct sv_vec3 v =
            sv_vec3(sv_rng_range(rng, -1, 1), sv_rng_range(rng, -1, 1), sv_rng_range(rng, -1, 1));
        double n = sv_length(v);
        if (n > 0.1 && n < 1)
            return sv_scale(v, 1 / n);
    }
}

/* A frame of either handedness with a and b of different lengths. */
static struct sv_relief_frame random_frame(struct sv_rng *rng)
{
    struct sv_vec3 f = random_unit(rng), a = sv_normalize(sv_cross(f, random_unit(rng))), b = sv_cross(f, a);
    if (sv_rng_unit(rng) < 0.5)
        b = sv_scale(b, -1);
    return (struct sv_relief_frame){.origin = sv_vec3(sv_rng_range(rng, -9, 9), 3, -2),
                                    .a = sv_scale(a, exp(sv_rng_range(rng, -3, 3))),
                                    .b = sv_scale(b, exp(sv_rng_range(rng, -3, 3))),
                                    .f = f};
}

static struct sv_relief make(const struct sv_relief_frame *frame, int width, int height)
{
    struct sv_relief r;
    assert_int_equal(sv_relief_alloc(width, height, &r, NULL), SV_OK);
    r.frame = *frame;
    memset(r.color, 200, (size_t)width * (size_t)height * 4);
    return r;
}

static struct sv_vec3 stored(const struct sv_relief *r, size_t k)
{
    return sv_vec3(r->normal[k][0] / 32767.0, r->normal[k][1] / 32767.0, r->normal[k][2] / 32767.0);
}

/* Angle between, rad; by the chord, which keeps small angles exact. */
static double angle(struct sv_vec3 p, struct sv_vec3 q)
{
    return 2 * asin(fmin(1, 0.5 * sv_length(sv_sub(sv_normalize(p), sv_normalize(q)))));
}

/* A plane's differences are exact everywhere, one-sided ones too: normals to the step of int16 (1.5 / 32767).
 */
static void test_planes(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(31, 0);
    double worst = 0, worst_printed = 0;
    for (int round = 0; round < 200; round++) {
        struct sv_relief_frame frame = random_frame(&rng);
        double a = sv_length(frame.a), b = sv_length(frame.b);
        double pu = tan(sv_rng_range(&rng, -1.4, 1.4)),
               pv = tan(sv_rng_range(&rng, -1.4, 1.4)); /* per metre */
        struct sv_relief r = make(&frame, 1 + round % 7, 1 + round % 5);
        for (int j = 0; j < r.height; j++)
            for (int i = 0; i < r.width; i++)
                r.displ[j * r.width + i] = (float)(pu * a * (i + 0.5) + pv * b * (j + 0.5));
        sv_relief_normals(&r);
        /* A side of one texel has no difference: flat along it. */
        double qu = r.width > 1 ? pu : 0, qv = r.height > 1 ? pv : 0;
        struct sv_vec3 truth = sv_vec3(-qu, -qv, 1);
        struct sv_vec3 printed = sv_vec3(-2 * b * a * qu, -2 * a * b * qv, a * b);
        for (size_t k = 0; k < (size_t)r.width * (size_t)r.height; k++)
            worst = fmax(worst, angle(stored(&r, k), truth));
        worst_printed = fmax(worst_printed, angle(printed, truth));
        sv_relief_finish(&r);
    }
    printf("planes: worst angle %.2e rad; (5) as printed, signs mended: %.3f rad\n", worst, worst_printed);
    assert_true(worst < 1e-4);
    assert_true(worst_printed > 0.2);
}

/* Central differences of a quadratic are exact inside; at the border the one-sided one is off by one second
 * difference. */
static void test_curved(void **state)
{
    (void)state;
    struct sv_relief_frame frame = {.a = {0.5, 0, 0}, .b = {0, 0.25, 0}, .f = {0, 0, 1}};
    struct sv_relief r = make(&frame, 33, 21);
    for (int j = 0; j < 21; j++)
        for (int i = 0; i < 33; i++) {
            double x = 0.5 * (i + 0.5), y = 0.25 * (j + 0.5);
            r.displ[j * 33 + i] = (float)(0.05 * x * x - 0.1 * x * y + 0.02 * y * y);
        }
    sv_relief_normals(&r);
    double inside = 0, border = 0;
    for (int j = 0; j < 21; j++)
        for (int i = 0; i < 33; i++) {
            double x = 0.5 * (i + 0.5), y = 0.25 * (j + 0.5);
            double off = angle(stored(&r, (size_t)(j * 33 + i)),
                               sv_vec3(-(0.1 * x - 0.1 * y), -(-0.1 * x + 0.04 * y), 1));
            bool edge = i == 0 || j == 0 || i == 32 || j == 20;
            *(edge ? &border : &inside) = fmax(edge ? border : inside, off);
        }
    printf("quadratic: inside %.2e rad, border %.2e rad\n", inside, border);
    assert_true(inside < 1e-4);
    assert_true(border < 0.05); /* 0.1 * half a texel of 0.5 m, and 0.1 across */
    sv_relief_finish(&r);
}

/* Two ramps with a step and a gap between: no normal may know of the other side. */
static void test_torn(void **state)
{
    (void)state;
    struct sv_relief_frame frame = {.a = {1, 0, 0}, .b = {0, -1, 0}, .f = {0, 0, 1}};
    struct sv_relief r = make(&frame, 12, 3);
    r.cut = 2;
    for (int j = 0; j < 3; j++)
        for (int i = 0; i < 12; i++) {
            r.displ[j * 12 + i] = i < 4 ? 0.5f * (float)i : 50 - 0.25f * (float)i;
            if (i == 8)
                r.color[j * 12 + i][3] = j == 1 ? 0 : 127;
            if (i == 8 && j == 2) {
                r.color[j * 12 + i][3] = 255;
                r.displ[j * 12 + i] = NAN;
            }
        }
    memset(r.normal, 77, 36 * sizeof *r.normal);
    sv_relief_normals(&r);
    for (int j = 0; j < 3; j++)
        for (int i = 0; i < 12; i++) {
            const int16_t *n = r.normal[j * 12 + i];
            assert_int_equal(n[3], 77 * 257); /* occlusion is left alone */
            if (i == 8)
                assert_int_equal(n[0], 77 * 257); /* and so are empty texels */
            else
                assert_true(angle(stored(&r, (size_t)(j * 12 + i)), sv_vec3(i < 4 ? -0.5 : 0.25, 0, 1)) <
                            1e-4);
        }
    /* Slopes beyond float's squares stay unit vectors. */
    r.cut = INFINITY;
    r.displ[0] = 3e38f, r.displ[1] = -3e38f;
    sv_relief_normals(&r);
    assert_true(fabs(sv_length(stored(&r, 0)) - 1) < 1e-3);
    sv_relief_finish(&r);
}

static struct sv_relief random_relief(struct sv_rng *rng, int width, int height)
{
    struct sv_relief_frame frame = random_frame(rng);
    struct sv_relief r = make(&frame, width, height);
    for (size_t k = 0; k < (size_t)width * (size_t)height; k++) {
        struct sv_vec3 n = random_unit(rng);
        r.displ[k] = (float)sv_rng_range(rng, -5, 5);
        r.normal[k][0] = (int16_t)lrint(n.x * 32767);
        r.normal[k][1] = (int16_t)lrint(n.y * 32767);
        r.normal[k][2] = (int16_t)lrint(fabs(n.z) * 32767);
        r.normal[k][3] = (int16_t)(32767 * sv_rng_unit(rng));
        for (int c = 0; c < 4; c++)
            r.color[k][c] = (uint8_t)(sv_rng_next(rng) >> 56);
    }
    return r;
}

static struct sv_relief_light random_light(struct sv_rng *rng, const struct sv_relief *r,
                                           struct sv_light *light)
{
    const struct sv_sun sun = {sv_rng_range(rng, 0, 7), sv_rng_range(rng, -0.1, 1.57)};
    sv_light_from_sun(&sun, light);
    return (struct sv_relief_light){.light = light,
                                    .frame = r->frame,
                                    .has_viewer = true,
                                    .eye = sv_add(r->frame.origin, sv_scale(random_unit(rng), 60)),
                                    .specular = sv_rng_unit(rng) < 0.5 ? 0 : (float)sv_rng_unit(rng),
                                    .shininess = (float)exp(sv_rng_range(rng, 0, 6))};
}

/* light.h's rule for one texel in double: code values before rounding. */
static void truth_code(const struct sv_relief *r, const struct sv_relief_light *o, size_t k, double code[3])
{
    const struct sv_relief_frame *f = &o->frame;
    struct sv_vec3 m = stored(r, k), n = sv_scale(sv_normalize(f->a), m.x);
    n = sv_madd(sv_madd(n, sv_normalize(f->b), m.y), f->f, m.z);
    double u = (double)(k % (size_t)r->width) + 0.5, v = (double)(k / (size_t)r->width) + 0.5;
    struct sv_vec3 at = sv_relief_point(f, u, v, (double)r->displ[k]);
    struct sv_vec3 view = sv_normalize(sv_sub(o->eye, at)), l = o->light->to_sun;
    double visible = o->lit ? o->lit[k] / 255.0 : 1, n_l = fmax(0, sv_dot(n, l)), shine = 0;
    if (o->has_viewer && n_l > 0 && sv_dot(n, view) > 0)
        shine = (double)o->specular * pow(sv_dot(n, sv_normalize(sv_add(l, view))), (double)o->shininess);
    for (int c = 0; c < 3; c++) {
        double s = r->color[k][c] / 255.0, albedo = s <= 0.04045 ? s / 12.92 : pow((s + 0.055) / 1.055, 2.4);
        double ground = (double)o->light->ground_rgb[c], sky = (double)o->light->sky_rgb[c];
        double ambient = (ground + (sky - ground) * (0.5 + 0.5 * n.z)) * r->normal[k][3] / 32767.0;
        double sun = (double)o->light->sun_rgb[c] * visible;
        double e = (albedo * (sun * n_l + ambient) + sun * shine) * (double)SV_LIGHT_EXPOSURE, t = 2 * e - 1;
        double tone = e > 0.5 ? 0.5 + 0.5 * t / (1 + t) : fmax(0, e);
        code[c] = 255 * (tone <= 0.0031308 ? 12.92 * tone : 1.055 * pow(tone, 1 / 2.4) - 0.055);
    }
}

/* Rounding is 0.5; float sums of a dozen terms and powf to an exponent of 400 add a few hundredths of a
 * level; the vector form of the sRGB curve 0.2 (lighting_avx2.c). */
static void test_rule(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(7, 0);
    double worst = 0;
    for (int round = 0; round < 60; round++) {
        struct sv_relief r = random_relief(&rng, 37, 19);
        struct sv_light light;
        struct sv_relief_light o = random_light(&rng, &r, &light);
        uint8_t lit[37 * 19], rgba[37 * 19][4];
        for (size_t k = 0; k < sizeof lit; k++)
            lit[k] = (uint8_t)(sv_rng_next(&rng) >> 56);
        o.lit = round % 3 ? lit : NULL;
        sv_relief_light(&r, &o, rgba);
        for (size_t k = 0; k < sizeof lit; k++) {
            double code[3];
            if (r.color[k][3] < 128) {
                assert_memory_equal(rgba[k], r.color[k], 4);
                continue;
            }
            truth_code(&r, &o, k, code);
            assert_int_equal(rgba[k][3], r.color[k][3]);
            for (int c = 0; c < 3; c++)
                worst = fmax(worst, fabs(rgba[k][c] - code[c]));
        }
        sv_relief_finish(&r);
    }
    printf("light against the rule in double: worst %.3f levels (0.5 is rounding), level %d\n", worst,
           (int)sv_simd_level());
    assert_true(worst < 0.8);
}

/* Without specular light and in shade the rule of light.c itself, called. */
static void test_light_c(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(70, 0);
    for (int round = 0; round < 20; round++) {
        struct sv_relief r = random_relief(&rng, 16, 4);
        struct sv_light light;
        struct sv_relief_light o = random_light(&rng, &r, &light);
        uint8_t rgba[64][4];
        o.specular = 0;
        sv_relief_light(&r, &o, rgba);
        for (size_t k = 0; k < 64; k++) {
            struct sv_vec3 m = stored(&r, k), n = sv_scale(sv_normalize(o.frame.a), m.x);
            n = sv_madd(sv_madd(n, sv_normalize(o.frame.b), m.y), o.frame.f, m.z);
            float albedo[3], rgb[3];
            for (int c = 0; c < 3; c++)
                albedo[c] = sv_linear_from_srgb8[r.color[k][c]];
            sv_light_surface(&light, n, albedo, (float)r.normal[k][3] / 32767, 1, rgb);
            for (int c = 0; c < 3 && r.color[k][3] >= 128; c++)
                assert_true(abs(rgba[k][c] - sv_srgb8_from_linear(rgb[c])) <= 1);
        }
        sv_relief_finish(&r);
    }
}

/* Memory that ends (or begins) at a page that may not be touched. */
struct guarded {
    unsigned char *map, *at;
    size_t bytes;
};

static struct guarded guard(size_t bytes, bool at_end)
{
    size_t page = (size_t)sysconf(_SC_PAGESIZE), body = (bytes + page - 1) / page * page;
    struct guarded g = {.bytes = body + 2 * page};
    g.map = mmap(NULL, g.bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    assert_true(g.map != MAP_FAILED);
    assert_int_equal(mprotect(g.map, page, PROT_NONE), 0);
    assert_int_equal(mprotect(g.map + page + body, page, PROT_NONE), 0);
    g.at = at_end ? g.map + page + body - bytes : g.map + page;
    return g;
}

static float odd_float(struct sv_rng *rng)
{
    static const float ODD[] = {NAN, INFINITY, -INFINITY, 1e-40f, -0.0f, 3e38f, 0, 1};
    return ODD[sv_rng_next(rng) >> 61];
}

/* Two rows of `width` texels between guard pages, with every kind of number in them, both ways. */
static void compare_rows(struct sv_rng *rng, int width, bool at_end, bool specular, bool lit, bool planes,
                         int *worst)
{
    size_t n = 2 * (size_t)width;
    struct guarded color = guard(4 * n, at_end), normal = guard(8 * n, at_end), displ = guard(4 * n, at_end),
                   share = guard(n, at_end), wide = guard(4 * n, at_end), plane = guard(8 * n, at_end);
    uint8_t plain[2 * 33][4];
    struct sv_relief r = random_relief(rng, 8, 9);
    struct sv_light light;
    struct sv_relief_light o = random_light(rng, &r, &light);
    struct sv_relief_light_row row = {.shininess = o.shininess, .specular = specular, .pitch = {0.5f, 0.25f}};
    memcpy(color.at, r.color, 4 * n);
    memcpy(normal.at, r.normal, 8 * n);
    for (size_t k = 0; k < n; k++) {
        float value = sv_rng_unit(rng) < 0.3 ? odd_float(rng) : r.displ[k];
        memcpy(displ.at + 4 * k, &value, 4);
        share.at[k] = (uint8_t)(sv_rng_next(rng) >> 56);
    }
    for (int c = 0; c < 3; c++) {
        row.sun_unit[c] = (float[]){0.48f, -0.6f, 0.64f}[c];
        row.to_sun[c] = row.sun_unit[c] / 32767;
        row.up[c] = (float[]){0.1f, 0.2f, 0.4f}[c] / 32767;
        row.sun[c] = light.sun_rgb[c] * SV_LIGHT_EXPOSURE / 255;
        row.ground[c] = light.ground_rgb[c] * SV_LIGHT_EXPOSURE / 32767;
        row.ground_sky[c] = (light.sky_rgb[c] - light.ground_rgb[c]) * SV_LIGHT_EXPOSURE / 32767;
        row.mirror[c] = 0.6f * row.sun[c];
        row.eye[c] = sv_rng_unit(rng) < 0.1 ? odd_float(rng) : (float)sv_rng_range(rng, -20, 20);
    }
    struct sv_relief_light_sheet sheet = {.width = width,
                                          .color = (const uint8_t(*)[4])(const void *)color.at,
                                          .normal = (const int16_t(*)[4])(const void *)normal.at,
                                          .displ = (const float *)(const void *)displ.at,
                                          .lit = lit ? share.at : NULL,
                                          .rgba = plain};
    for (size_t c = 0; planes && c < 4; c++) {
        sheet.plane[c] = (const int16_t *)(const void *)plane.at + c * n;
        for (size_t k = 0; k < n; k++)
            memcpy(plane.at + 2 * (c * n + k), &r.normal[k][c], 2);
    }
    struct sv_relief_eight list[SV_RELIEF_LIST_ROOM];
    int first = 0, count = sv_relief_list_eights(NULL, width, 2, &first, list);
    assert_int_equal(count, 2 * ((width + 7) / 8));
    sv_relief_light_scalar(&row, &sheet, list, count);
    sheet.rgba = (uint8_t(*)[4])(void *)wide.at;
    sv_relief_light_avx2(&row, &sheet, list, count);
    for (size_t k = 0; k < 4 * n; k++) {
        int off = abs(wide.at[k] - plain[k / 4][k % 4]);
        if (off > 1)
            fail_msg("width %d texel %zu channel %zu: avx2 %d, scalar %d", width, k / 4, k % 4, wide.at[k],
                     plain[k / 4][k % 4]);
        *worst = off > *worst ? off : *worst;
    }
    sv_relief_finish(&r);
    const struct guarded all[] = {color, normal, displ, share, wide, plane};
    for (size_t k = 0; k < sizeof all / sizeof *all; k++)
        munmap(all[k].map, all[k].bytes);
}

static void test_avx2_is_scalar(void **state)
{
    (void)state;
    if (sv_simd_level() < SV_SIMD_AVX2) {
        printf("skipped: no AVX2 here\n");
        skip();
    }
    sv_color_init();
    struct sv_rng rng = sv_rng_seeded(99, 0);
    static const int WIDTHS[] = {8, 9, 15, 16, 17, 31, 33};
    int worst = 0;
    for (int round = 0; round < 400; round++)
        for (size_t c = 0; c < sizeof WIDTHS / sizeof *WIDTHS; c++)
            compare_rows(&rng, WIDTHS[c], round & 1, round & 2, round & 4, round & 8, &worst);
    printf("avx2 against scalar: worst %d level\n", worst);
}

/* What is needed is listed, in whole eights where the row has as many, and nothing beyond it. */
static void test_lists(void **state)
{
    (void)state;
    enum { HEIGHT = 200 };
    struct sv_rng rng = sv_rng_seeded(12, 0);
    for (int width = 1; width <= 40; width++) {
        const int stride = (width + 7) / 8;
        static uint8_t groups[HEIGHT * 5], done[HEIGHT * 40];
        memset(done, 0, sizeof done);
        for (int k = 0; k < stride * HEIGHT; k++)
            groups[k] = sv_rng_unit(&rng) < 0.6;
        for (int row = 0, before; row < HEIGHT;) {
            struct sv_relief_eight list[SV_RELIEF_LIST_ROOM];
            before = row;
            int n = sv_relief_list_eights(groups, width, HEIGHT, &row, list);
            assert_true(n <= SV_RELIEF_LIST_ROOM && row > before && (n >= SV_RELIEF_LIST || row == HEIGHT));
            for (int k = 0; k < n; k++) {
                assert_true(list[k].row >= before && list[k].row < row && list[k].column >= 0);
                assert_true(list[k].column + 8 <= width || (list[k].column == 0 && width < 8));
                for (int i = list[k].column; i < list[k].column + 8 && i < width; i++)
                    done[list[k].row * width + i] = 1;
            }
        }
        for (int k = 0; k < width * HEIGHT; k++) {
            const uint8_t *of_row = groups + k / width * stride;
            int i = k % width;
            bool last = width >= 8 && i >= width - 8 && of_row[stride - 1];
            assert_int_equal(done[k], of_row[i / 8] || last);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lists),          cmocka_unit_test(test_planes), cmocka_unit_test(test_curved),
        cmocka_unit_test(test_torn),           cmocka_unit_test(test_rule),   cmocka_unit_test(test_light_c),
        cmocka_unit_test(test_avx2_is_scalar),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
