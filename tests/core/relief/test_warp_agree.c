/* Three ways to see a relief, and one truth: positions over ten thousand random pairs of relief and camera,
 * and pictures of the named reliefs, against the ray march. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/noise.h"
#include "core/relief/prewarp.h"
#include "core/relief/warp.h"
#include "core/relief/warp_kernel.h"
#include "tests/core/relief/named_reliefs.h"
#include "tests/core/relief/warp_pictures.h"

/* ---- positions ---- */

enum { PAIRS = 10000, POINTS = 8, PIXELS = 12 };
#define TEXELS_ALLOWED 0.01

struct position_errors {
    double map, prewarp, splat[3];
    uint64_t points, hidden, pixels, left_out;
};

static struct sv_vec3 random_unit(struct sv_rng *rng)
{
    double z = sv_rng_range(rng, -1, 1), a = sv_rng_range(rng, 0, 2 * SV_PI), s = sqrt(1 - z * z);
    return sv_vec3(s * cos(a), s * sin(a), z);
}

/* Any size from 1 x 1, any frame of either hand at any place on Earth, any displ that one skin may have. */
static void random_relief(struct sv_rng *rng, struct sv_relief *r)
{
    int width = 1 + (int)(16 * sv_rng_unit(rng)), height = 1 + (int)(16 * sv_rng_unit(rng));
    struct sv_vec3 f = random_unit(rng), a = sv_normalize(sv_cross(f, random_unit(rng))), b = sv_cross(f, a);
    double size = pow(10, sv_rng_range(rng, -1.5, 1.5)), unequal = sv_rng_range(rng, 0.4, 2.5);
    double amplitude = sv_rng_range(rng, 0, 3) * size, tilt = sv_rng_range(rng, -0.5, 0.5) * size;
    uint64_t seed = sv_rng_next(rng);
    assert_int_equal(sv_relief_alloc(width, height, r, NULL), SV_OK);
    r->frame = (struct sv_relief_frame){
        sv_scale(random_unit(rng), pow(10, sv_rng_range(rng, 0, 6.7))), sv_scale(a, size),
        sv_scale(b, sv_rng_unit(rng) < 0.5 ? size * unequal : -size * unequal), f};
    for (int j = 0; j < height; j++)
        for (int i = 0; i < width; i++) {
            size_t k = (size_t)j * (size_t)width + (size_t)i;
            r->displ[k] = (float)(amplitude * sv_noise_at(seed, i / 5.0, j / 5.0).v + tilt * i);
            r->color[k][3] = 255;
        }
    sv_relief_measure(r);
}

/* Perspective or parallel, from in front or from behind, up to 80 degrees off the normal, any roll. */
static struct sv_camera random_camera(struct sv_rng *rng, const struct sv_relief *r)
{
    const struct sv_relief_frame *f = &r->frame;
    double width = r->width * sv_length(f->a), height = r->height * sv_length(f->b),
           size = fmax(width, height);
    double angle = sv_radians(sv_rng_range(rng, 0, 80)), azimuth = sv_rng_range(rng, 0, 2 * SV_PI);
    double thick = (double)r->displ_max - (double)r->displ_min, side = sv_rng_unit(rng) < 0.8 ? 1 : -1;
    double distance = (size + thick) * sv_rng_range(rng, 0.8, 6);
    struct sv_vec3 a = sv_normalize(f->a), b = sv_normalize(f->b);
    struct sv_vec3 to_eye = sv_madd(sv_scale(f->f, side * cos(angle)),
                                    sv_madd(sv_scale(a, cos(azimuth)), b, sin(azimuth)), sin(angle));
    struct sv_vec3 middle = sv_relief_point(f, 0.5 * r->width, 0.5 * r->height,
                                            0.5 * ((double)r->displ_min + (double)r->displ_max));
    struct sv_camera c = {
        .eye = sv_madd(middle, to_eye, distance), .forward = sv_scale(to_eye, -1), .width = 32, .height = 24};
    c.right = sv_normalize(sv_cross(c.forward, random_unit(rng)));
    c.up = sv_cross(c.right, c.forward);
    c.projection = sv_rng_unit(rng) < 0.5 ? SV_PROJECTION_PERSPECTIVE : SV_PROJECTION_ORTHOGRAPHIC;
    c.vfov_rad = 2 * atan(0.6 * size / distance);
    c.ortho_height_m = 1.2 * size;
    c.near_m = 0.01 * distance;
    c.far_m = 3 * distance;
    return c;
}

/* How far from (u, v) the ray at the picture place (px, py) lands; NaN: another surface is in front there. */
static double texels_off(const struct ray_field *field, const struct ray_view *view, double px, double py,
                         double u, double v)
{
    struct ray_seen seen;
    ray_march_view(field, view, px, py, &seen);
    return seen.kind == RAY_SURFACE ? fmax(fabs(seen.u - u), fabs(seen.v - v)) : NAN;
}

static void compare_points(struct sv_rng *rng, const struct sv_relief *r, const struct ray_field *field,
                           const struct sv_camera *c, struct position_errors *e)
{
    struct sv_warp_map map;
    struct ray_view view;
    struct sv_prewarp prewarp;
    struct sv_error error;
    bool parallel = c->projection == SV_PROJECTION_ORTHOGRAPHIC;
    ray_view_init(field, c, &view);
    sv_warp_map_from_camera(&r->frame, c, 0, 0, &map);
    assert_int_equal(parallel ? sv_prewarp_parallel(&r->frame, c->forward, &prewarp, &error)
                              : sv_prewarp_perspective(&r->frame, c->eye, &prewarp, &error),
                     SV_OK);
    for (int k = 0; k < POINTS; k++) {
        double u = sv_rng_range(rng, 0.01, r->width - 0.01), v = sv_rng_range(rng, 0.01, r->height - 0.01),
               displ, rgb[3];
        double px, py, z, ui, vi, w[4];
        assert_true(ray_surface_at(field, u, v, &displ, rgb));
        if (!sv_camera_project(c, sv_relief_point(&r->frame, u, v, displ), &px, &py, &z) ||
            !(texels_off(field, &view, px, py, u, v) < 1e-4)) {
            e->hidden++;
            continue;
        }
        e->points++;
        for (int n = 0; n < 4; n++)
            w[n] = map.m[n][0] * u + map.m[n][1] * v + map.m[n][2] * displ + map.m[n][3];
        double off = texels_off(field, &view, w[0] / w[3], w[1] / w[3], u, v);
        e->map = fmax(e->map, isnan(off) ? 99 : off);
        assert_true(sv_prewarp_point(&prewarp, u, v, displ, &ui, &vi));
        /* The plane's point may lie before the near plane: only its direction counts, so no
         * sv_camera_project. */
        struct sv_vec3 d = sv_sub(sv_relief_point(&r->frame, ui, vi, 0), c->eye);
        double focal = sv_camera_focal_px(c) / (parallel ? 1 : sv_dot(d, c->forward));
        off = texels_off(field, &view, 0.5 * c->width + focal * sv_dot(d, c->right),
                         0.5 * c->height - focal * sv_dot(d, c->up), u, v);
        e->prewarp = fmax(e->prewarp, isnan(off) ? 99 : off);
    }
}

/* No occlusion decides at a pixel when all about it (within 0.7 px) one sheet is seen: rays beside it land
 * beside it. */
static bool alone(const struct ray_field *field, const struct ray_view *view, int i, int j,
                  struct ray_seen *seen)
{
    ray_march_view(field, view, i + 0.5, j + 0.5, seen);
    if (seen->kind != RAY_SURFACE)
        return false;
    double step = 0;
    for (int k = 0; k < 8; k++) {
        struct ray_seen near, mid;
        double x = 0.7 * cos(k * SV_PI / 4), y = 0.7 * sin(k * SV_PI / 4);
        ray_march_view(field, view, i + 0.5 + x, j + 0.5 + y, &near);
        ray_march_view(field, view, i + 0.5 + 0.5 * x, j + 0.5 + 0.5 * y, &mid);
        if (near.kind != RAY_SURFACE || mid.kind != RAY_SURFACE)
            return false;
        /* On one sheet the ray half way lands about half way. */
        double far_off = fmax(fabs(near.u - seen->u), fabs(near.v - seen->v));
        double bend = fmax(fabs(near.u + seen->u - 2 * mid.u), fabs(near.v + seen->v - 2 * mid.v));
        if (bend > 0.25 * far_off)
            return false;
        step = fmax(step, far_off);
    }
    return step < 8;
}

/* A pixel that some point of the surface falls into. */
static bool random_pixel(struct sv_rng *rng, const struct sv_relief *r, const struct ray_field *field,
                         const struct sv_camera *c, int *i, int *j)
{
    double displ, rgb[3], px, py, z, u = sv_rng_range(rng, 0, r->width), v = sv_rng_range(rng, 0, r->height);
    if (!ray_surface_at(field, u, v, &displ, rgb) ||
        !sv_camera_project(c, sv_relief_point(&r->frame, u, v, displ), &px, &py, &z) ||
        !(px >= 0 && py >= 0 && px < c->width && py < c->height))
        return false;
    *i = (int)px;
    *j = (int)py;
    return true;
}

static void compare_pixels(struct sv_rng *rng, const struct sv_relief *r, const struct ray_field *field,
                           const struct sv_camera *c, struct sv_warp_buffer *buffers,
                           struct position_errors *e)
{
    struct sv_warp_source source = {.width = r->width,
                                    .height = r->height,
                                    .t = r->displ,
                                    .color = (const uint8_t(*)[4])r->color,
                                    .cut = r->cut};
    struct sv_warp_stats stats = {0};
    struct ray_view view;
    ray_view_init(field, c, &view);
    sv_warp_map_from_camera(&r->frame, c, 0, 0, &source.map);
    for (int level = 0; level <= (int)sv_simd_level(); level++) {
        sv_warp_clear(&buffers[level]);
        sv_warp_splat_at((enum sv_simd)level, &source, 0, &buffers[level], &stats);
    }
    for (int k = 0; k < PIXELS; k++) {
        int i, j;
        struct ray_seen seen;
        if (!random_pixel(rng, r, field, c, &i, &j) || !alone(field, &view, i, j, &seen)) {
            e->left_out++;
            continue;
        }
        e->pixels++;
        for (int level = 0; level <= (int)sv_simd_level(); level++) {
            double u, v;
            bool there = sv_warp_locate(&source, &buffers[level], i, j, &u, &v);
            double off = there ? fmax(fabs(u - seen.u), fabs(v - seen.v)) : 99;
            e->splat[level] = fmax(e->splat[level], off);
        }
    }
}

static void positions_agree(void **state)
{
    (void)state;
    struct position_errors e = {0};
    struct sv_warp_buffer buffers[3];
    for (int k = 0; k < 3; k++)
        assert_int_equal(sv_warp_buffer_create(32, 24, &buffers[k], NULL), SV_OK);
    for (int k = 0; k < PAIRS; k++) {
        struct sv_rng rng = sv_rng_seeded(31, (uint64_t)k);
        struct sv_relief r;
        double before = fmax(fmax(e.map, e.prewarp), e.splat[0]);
        random_relief(&rng, &r);
        struct sv_camera c = random_camera(&rng, &r);
        struct ray_field *field = ray_field_create(&r);
        compare_points(&rng, &r, field, &c, &e);
        compare_pixels(&rng, &r, field, &c, buffers, &e);
        double now = fmax(fmax(e.map, e.prewarp), e.splat[0]);
        if (now > before && now > TEXELS_ALLOWED)
            print_message("pair %d: %d x %d texels: map %.2e, prewarp %.2e, splat %.2e texels\n", k, r.width,
                          r.height, e.map, e.prewarp, e.splat[0]);
        ray_field_destroy(field);
        sv_relief_finish(&r);
    }
    for (int k = 0; k < 3; k++)
        sv_warp_buffer_finish(&buffers[k]);
    print_message("%d pairs: %llu points (%llu hidden): map %.2e, pre-warp %.2e texels\n", PAIRS,
                  (unsigned long long)e.points, (unsigned long long)e.hidden, e.map, e.prewarp);
    print_message("%llu pixels (%llu left out): scalar %.2e, SSE2 %.2e, AVX2 %.2e texels\n",
                  (unsigned long long)e.pixels, (unsigned long long)e.left_out, e.splat[0], e.splat[1],
                  e.splat[2]);
    assert_true(e.points > 4 * PAIRS && e.pixels > 4 * PAIRS);
    assert_true(e.map < TEXELS_ALLOWED && e.prewarp < TEXELS_ALLOWED);
    for (int k = 0; k < 3; k++)
        assert_true(e.splat[k] < TEXELS_ALLOWED);
}

/* ---- pictures ---- */

struct eye {
    double angle_deg, azimuth_deg, magnification;
    bool parallel;
};
static const struct eye eyes[] = {{0, 0, 1.5, false},   {15, 40, 1, false},   {30, 200, 1.5, false},
                                  {30, 110, 1.5, true}, {60, 70, 1.5, false}, {60, 250, 1.5, true}};
enum { EYES = sizeof eyes / sizeof *eyes, WAYS = 4, COARSE = 1, LEVELS = 8 };
static const char *const ways[WAYS] = {"two-pass on its plane", "two-pass, 1 sample/texel", "two-pass, 6",
                                       "direct"};

/* Reliefs of a few texels make pictures of a few pixels: they are judged all together. */
enum { PIXELS_ENOUGH = 1000 };

struct tally {
    double differ[WAYS], without_holes[WAYS]; /* worst share over reliefs */
    int worst[WAYS];
    struct warp_difference small[WAYS];
};

static double percent(uint32_t part, uint32_t whole)
{
    return whole ? 100.0 * part / whole : 0;
}

static void count(struct tally *tally, int way, int k, const struct warp_difference *d)
{
    if (d->pixels < PIXELS_ENOUGH) {
        tally->small[way].pixels += d->pixels;
        tally->small[way].differ += d->differ;
        return;
    }
    double share = percent(d->differ, d->pixels);
    if (share > tally->differ[way])
        tally->differ[way] = share, tally->worst[way] = k;
    tally->without_holes[way] = fmax(tally->without_holes[way], percent(d->differ - d->in_hole, d->pixels));
}

static void compare_ways(int k, const struct sv_relief *r, const struct ray_field *field,
                         const struct eye *eye, struct tally *tally)
{
    struct sv_camera c;
    struct warp_picture truth, on_plane, pictures[WAYS], level;
    named_relief_camera(r, sv_radians(eye->angle_deg), sv_radians(eye->azimuth_deg), eye->magnification,
                        eye->parallel, &c);
    warp_picture_truth(field, &c, &truth);
    warp_picture_on_plane(r, field, &c, &on_plane, &pictures[0]);
    warp_picture_prewarp(r, &c, 1, &pictures[1]);
    warp_picture_prewarp(r, &c, 6, &pictures[2]);
    warp_picture_direct(r, &c, SV_SIMD_SCALAR, &pictures[3]);
    print_message("%-24s %2.0f %s", named_relief_name(k), eye->angle_deg, eye->parallel ? "par" : "   ");
    for (int w = 0; w < WAYS; w++) {
        struct warp_difference d = warp_picture_compare(w == 0 ? &on_plane : &truth, &pictures[w], LEVELS);
        double share = percent(d.differ, d.pixels), without = percent(d.differ - d.in_hole, d.pixels);
        if (w == 0)
            print_message(" %4d x %-4d holes %5.2f |", c.width, c.height, percent(truth.holes, truth.shown));
        print_message(" %6.2f %6.2f, %5.2f > %4.2f |", share, without,
                      percent(pictures[w].holes, pictures[w].shown),
                      percent(pictures[w].holes_left, pictures[w].shown));
        count(tally, w, k, &d);
    }
    print_message("\n");
    for (int l = 1; l <= (int)sv_simd_level(); l++) {
        warp_picture_direct(r, &c, (enum sv_simd)l, &level);
        struct warp_difference d = warp_picture_compare(&pictures[3], &level, 1);
        assert_int_equal(d.differ, 0);
        assert_int_equal(level.holes, pictures[3].holes);
        warp_picture_finish(&level);
    }
    for (int w = 0; w < WAYS; w++)
        warp_picture_finish(&pictures[w]);
    warp_picture_finish(&on_plane);
    warp_picture_finish(&truth);
}

static void report(const char *kind, const char *eye, const struct tally *t)
{
    for (int w = 0; w < WAYS; w++)
        print_message(
            "%-8s %s: worst by %-26s %6.2f %% (%s), without holes %6.2f %%; in small pictures %u of %u px\n",
            kind, eye, ways[w], t->differ[w], named_relief_name(t->worst[w]), t->without_holes[w],
            t->small[w].differ, t->small[w].pixels);
}

static void pictures_agree(void **state)
{
    (void)state;
    static const char *const kinds[3] = {"smooth", "stepped", "noisy"};
    static struct tally tally[3][2];
    /* A plain run takes the square eye, 30 degrees and 60 degrees; SV_TEST_FULL=1 the other three, too. */
    const char *all = getenv("SV_TEST_FULL");
    size_t step = all && strcmp(all, "1") == 0 ? 1 : 2;
    print_message("columns: pixels that differ by more than %d levels from the ray march, the same without "
                  "its holes, holes "
                  "before > after filling (two-pass: of its samples); all in %%\n",
                  LEVELS);
    print_message("ways: %s | %s | %s | %s\n", ways[0], ways[1], ways[2], ways[3]);
    for (int k = 0; k < NAMED_COUNT; k++) {
        struct sv_relief r;
        named_relief_make(k, &r);
        struct ray_field *field = ray_field_create(&r);
        for (size_t n = 0; n < EYES; n += step)
            compare_ways(k, &r, field, &eyes[n], &tally[named_relief_kind(k)][eyes[n].angle_deg > 30]);
        ray_field_destroy(field);
        sv_relief_finish(&r);
    }
    for (int kind = 0; kind < 3; kind++)
        for (int far = 0; far < 2; far++)
            report(kinds[kind], far ? "at 60 degrees" : "within 30     ", &tally[kind][far]);
    for (int kind = NAMED_SMOOTH; kind <= NAMED_STEPPED; kind++)
        for (int w = 0; w < WAYS; w++) {
            if (w == COARSE)
                continue;
            assert_true(tally[kind][0].differ[w] <= 1);
            assert_true(tally[kind][1].differ[w] <= 5);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(positions_agree),
        cmocka_unit_test(pictures_agree),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
