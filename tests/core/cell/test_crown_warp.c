/* The warp of crowns against brute force in double, closed forms and itself (bands, levels, orders). */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/cell/crown_warp_kernel.h"
#include "tests/core/cell/crown_kit.h"

enum { SEED = 41, LEVELS = 2 };
static const struct sv_crown_kernel *levels[LEVELS];

static int set_up(void **state)
{
    (void)state;
    levels[0] = &sv_crown_scalar;
    levels[1] = sv_crown_kernel_of(sv_simd_level());
    return 0;
}

struct picture {
    int width, height;
    float (*light)[4];
};

static struct picture picture_make(int width, int height)
{
    struct picture p = {width, height, malloc((size_t)(width * height) * sizeof *p.light)};
    for (int k = 0; k < width * height; k++)
        memcpy(p.light[k], (const float[4]){0, 0, 0, 1}, sizeof p.light[k]);
    return p;
}

static void draw_band(const struct sv_crown_kernel *kernel, const struct sv_crown_source *sources,
                      unsigned count, int first, int rows, const float *depth, struct picture *p)
{
    struct sv_crown_buffer *buffer;
    size_t at = (size_t)first * (size_t)p->width;
    assert_int_equal(sv_crown_buffer_create(p->width, first, rows, &buffer, NULL), SV_OK);
    sv_crown_splat_at(kernel, sources, count, buffer, NULL);
    sv_crown_resolve_at(kernel, sources, count, buffer, depth ? depth + at : NULL, 0.01f, p->light + at);
    sv_crown_buffer_destroy(buffer);
}

/* From bilinear on. */
static const float STEEPS[4] = {SV_CROWN_STEEP, 1, 1.3f, 3};

/* ---- against brute force ---- */

struct judged {
    long pixels, shown, unsure, filled;
    double worst;
};

/* Allowed: the weight along a row is cut to 1/256 (contrast at most 1, so 1/256); a place is right to 0.01
 * texels in each direction (2 x 0.01). */
static const double COLOR_ALLOWED = 1.0 / 256 + 0.02;

static void judge(const struct sv_crown_source *sources, unsigned count, const struct picture *p,
                  struct judged *sum)
{
    for (int row = 0; row < p->height; row++)
        for (int i = 0; i < p->width; i++) {
            struct crown_truth t;
            const float *got = p->light[row * p->width + i];
            crown_truth_of(sources, count, i, row, &t);
            sum->pixels++;
            sum->unsure += t.unsure;
            if (t.unsure)
                continue;
            sum->shown += t.any;
            for (int c = 0; c < 4; c++) {
                double expected = t.any ? t.color[c] : 0, have = c < 3 ? got[c] : 1 - got[3];
                sum->worst = fmax(sum->worst, fabs(expected - have));
                if (!(fabs(expected - have) <= COLOR_ALLOWED))
                    fail_msg("pixel (%d, %d) channel %d: %.5f, expected %.5f (allowed %.5f), texel %d at "
                             "(%.3f, %.3f)",
                             i, row, c, have, expected, COLOR_ALLOWED, t.texel, t.u, t.v);
            }
        }
}

static void test_brute_force(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(SEED, 1);
    struct judged sum = {0, 0, 0, 0, 0};
    for (int k = 0; k < 24; k++) {
        struct crown_panel panel[2];
        struct sv_crown_source sources[2];
        enum sv_cell_face face = (enum sv_cell_face)(k % SV_CELL_FACES);
        enum sv_cell_face other = face == SV_CELL_EAST   ? SV_CELL_NORTH
                                  : face == SV_CELL_DOWN ? SV_CELL_NORTH
                                                         : SV_CELL_EAST;
        struct sv_vec3 v = sv_vec3(412345.5, 4123456.25, 310);
        struct sv_vec3 offset = sv_vec3(sv_rng_range(&rng, -0.2, 0.2), sv_rng_range(&rng, -0.2, 0.2),
                                        sv_rng_range(&rng, -0.2, 0.2));
        const double turn[3] = {sv_rng_range(&rng, -0.8, 0.8), sv_rng_range(&rng, -0.3, 0.3),
                                sv_rng_range(&rng, -0.5, 0.5)};
        struct sv_camera camera =
            crown_camera(face, v, 20, offset, turn, sv_rng_range(&rng, 0.6, 1.5), 24 + k % 5, 20 + k % 7);
        for (int n = 0; n < 2; n++) {
            crown_panel_make(17 + (k * 5 + n) % 24, &panel[n]);
            crown_panel_blobs(&panel[n], &rng, 0.4, 0.2, 1.2);
            sources[n].layer = &panel[n].panel.crowns;
            sources[n].steep = STEEPS[(k + n) % 4];
            sources[n].opens = false;
            sv_crown_map(v, 20, n ? other : face, &camera, 0.1, -0.2, sources[n].m);
        }
        struct picture p = picture_make(camera.width, camera.height);
        draw_band(levels[k % LEVELS], sources, 2, 0, camera.height, NULL, &p);
        judge(sources, 2, &p, &sum);
        free(p.light);
        crown_panel_free(&panel[0]);
        crown_panel_free(&panel[1]);
    }
    printf("%ld pixels, %ld shown, %ld unsure, worst %.5f\n", sum.pixels, sum.shown, sum.unsure, sum.worst);
    assert_true(sum.shown > sum.pixels / 4 && sum.unsure < sum.pixels / 10);
}

/* ---- closed forms ---- */

static double triangle(double steep,
                       double t) /* 0 at even, 1 at odd whole numbers, as steep between as weights are */
{
    double r = t - 2 * floor(t / 2), rise = r < 1 ? r : 2 - r;
    return fmin(fmax(steep * (rise - 0.5) + 0.5, 0), 1);
}

/* Panels of one q whose coverage goes to and fro between 0 and 1 from texel to texel, along columns or rows:
 * light says where in a texel the pixel fell. Truth: the pixel's ray meets the plane at depth D / q from V.
 * Allowed: 1 / 256 of a texel is what weights are cut to, 0.01 px of rounding (a pixel is at most 4 texels
 * here: 0.04). */
static void test_plane_homography(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(SEED, 2);
    const double distance = 12.5;
    double worst = 0;
    long seen = 0;
    for (int k = 0; k < 60; k++) {
        enum sv_cell_face face = (enum sv_cell_face)(k % SV_CELL_FACES);
        struct sv_vec3 v = sv_vec3(5e5, 4.1e6, 300), right, up, forward;
        struct sv_vec3 offset = sv_vec3(sv_rng_range(&rng, -0.2, 0.2), sv_rng_range(&rng, -0.2, 0.2),
                                        sv_rng_range(&rng, -0.2, 0.2));
        const double turn[3] = {sv_rng_range(&rng, -0.5, 0.5), sv_rng_range(&rng, -0.4, 0.4),
                                sv_rng_range(&rng, -3, 3)};
        struct sv_camera camera = crown_camera(face, v, distance, offset, turn, 1.1, 67, 45);
        struct crown_panel panel;
        struct sv_crown_source source;
        double q = (k % 3 == 0 ? 1 : sv_rng_range(&rng, 0.05, 1.9)), shift = k % 2 ? 0.3 : 0;
        crown_panel_make(64, &panel);
        crown_panel_flat(&panel, (const uint8_t[4]){0, 0, 0, 0}, q);
        for (int n = 0; n < 64 * 64; n++)
            panel.room.color[n][3] = (k & 4 ? n / 64 : n % 64) & 1 ? 255 : 0;
        crown_panel_pack(&panel);
        q = panel.room.q[0] / (double)SV_PANEL_Q_ONE;
        source.layer = &panel.panel.crowns;
        source.steep = STEEPS[k / 3 % 4];
        source.opens = false;
        sv_crown_map(v, distance, face, &camera, shift, -shift, source.m);
        struct picture p = picture_make(67, 45);
        draw_band(levels[k % LEVELS], &source, 1, 0, 45, NULL, &p);
        sv_cell_face_axes(face, &right, &up, &forward);
        for (int n = 0; n < 67 * 45; n++) {
            struct sv_vec3 origin, ray, eye = sv_sub(camera.eye, v);
            sv_camera_ray(&camera, n % 67 + 0.5 + shift, n / 67 + 0.5 - shift, &origin, &ray);
            double along = (distance / q - sv_dot(eye, forward)) / sv_dot(ray, forward);
            struct sv_vec3 hit = sv_madd(eye, ray, along);
            double us = (sv_dot(hit, right) / sv_dot(hit, forward) + 1) * 32 - 0.5;
            double vs = (1 - sv_dot(hit, up) / sv_dot(hit, forward)) * 32 - 0.5;
            if (!(along > camera.near_m && us > 0 && us < 63 && vs > 0 && vs < 63))
                continue;
            double error =
                fabs(triangle((double)source.steep, k & 4 ? vs : us) - (1 - (double)p.light[n][3]));
            worst = fmax(worst, error);
            seen++;
            if (!(error <= 1.0 / 256 + 0.04 * (double)source.steep))
                fail_msg("case %d pixel (%d, %d): %.4f texels off", k, n % 67, n / 67, error);
        }
        free(p.light);
        crown_panel_free(&panel);
    }
    printf("%ld pixels, worst %.5f texels\n", seen, worst);
    assert_true(seen > 60 * 67 * 45 / 4);
}

/* One texel that shows something: light gathers around where the camera sees its place in the world, in all
 * as much as the texel's square covers there (its bilinear hat has the volume of one texel). */
static void test_single_texel(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(SEED, 3);
    for (int k = 0; k < 40; k++) {
        struct crown_panel panel;
        struct sv_crown_source source;
        struct sv_vec3 v = sv_vec3(10, -20, 30), right, up, forward;
        const double turn[3] = {sv_rng_range(&rng, -0.2, 0.2), sv_rng_range(&rng, -0.2, 0.2), 0.3};
        struct sv_vec3 offset = sv_vec3(sv_rng_range(&rng, -0.2, 0.2), sv_rng_range(&rng, -0.2, 0.2), 0.1);
        struct sv_camera camera = crown_camera(SV_CELL_NORTH, v, 20, offset, turn, 1.2, 96, 80);
        int i = 12 + k % 9, j = 11 + k % 10, at = j * 32 + i;
        double q = sv_rng_range(&rng, 0.1, 1.5), px, py, z, sum = 0, x = 0, y = 0;
        crown_panel_make(32, &panel);
        memcpy(panel.room.color[at], (const uint8_t[4]){255, 255, 255, 255}, 4);
        panel.room.q[at] = (uint16_t)(q * SV_PANEL_Q_ONE);
        crown_panel_pack(&panel);
        q = panel.room.q[at] / (double)SV_PANEL_Q_ONE;
        source.layer = &panel.panel.crowns;
        source.steep = SV_CROWN_STEEP;
        source.opens = false;
        sv_crown_map(v, 20, SV_CELL_NORTH, &camera, 0, 0, source.m);
        struct picture p = picture_make(96, 80);
        draw_band(levels[k % LEVELS], &source, 1, 0, 80, NULL, &p);
        for (int n = 0; n < 96 * 80; n++) {
            assert_float_equal(p.light[n][0], 1 - p.light[n][3], 1e-6);
            sum += (double)p.light[n][0];
            x += (double)p.light[n][0] * (n % 96 + 0.5);
            y += (double)p.light[n][0] * (n / 96 + 0.5);
        }
        sv_cell_face_axes(SV_CELL_NORTH, &right, &up, &forward);
        struct sv_vec3 tangent =
            sv_madd(sv_madd(forward, right, (2 * i + 1) / 32.0 - 1), up, 1 - (2 * j + 1) / 32.0);
        assert_true(sv_camera_project(&camera, sv_madd(v, tangent, 20 / q), &px, &py, &z));
        /* The hat is sampled at pixel centres, about 2 a texel: its centroid to a tenth of a pixel. */
        assert_true(sum > 0 && fabs(x / sum - px) < 0.1 && fabs(y / sum - py) < 0.1);
        free(p.light);
        crown_panel_free(&panel);
    }
}

/* ---- against itself ---- */

struct scene {
    struct crown_panel panel[3];
    struct sv_crown_source sources[3];
    unsigned count;
    int width, height;
};

/* Faces around a corner, seen from near V; sizes that are and are not whole tiles. */
static void scene_make(struct sv_rng *rng, int k, struct scene *s)
{
    static const enum sv_cell_face faces[3] = {SV_CELL_NORTH, SV_CELL_EAST, SV_CELL_DOWN};
    static const int sizes[6] = {16, 40, 64, 33, 100, 71};
    struct sv_vec3 v = sv_vec3(412345.5, 4123456.25, 310);
    struct sv_vec3 offset =
        sv_vec3(sv_rng_range(rng, -0.3, 0.3), sv_rng_range(rng, -0.3, 0.3), sv_rng_range(rng, -0.3, 0.3));
    const double turn[3] = {sv_rng_range(rng, -0.4, 1.2), sv_rng_range(rng, -0.7, 0.3),
                            sv_rng_range(rng, -1, 1)};
    s->count = 1 + (unsigned)k % 3;
    s->width = 30 + k * 7 % 40;
    s->height = 20 + k * 11 % 50;
    struct sv_camera camera =
        crown_camera(SV_CELL_NORTH, v, 20, offset, turn, sv_rng_range(rng, 0.2, 2.2), s->width, s->height);
    for (unsigned n = 0; n < s->count; n++) {
        crown_panel_make(sizes[(unsigned)(k + (int)n) % 6], &s->panel[n]);
        crown_panel_blobs(&s->panel[n], rng, sv_rng_range(rng, 0.05, 0.8), 0.05, 1.9);
        s->sources[n].layer = &s->panel[n].panel.crowns;
        s->sources[n].steep = STEEPS[(k + (int)n) % 4];
        s->sources[n].opens = (k + (int)n) % 3 != 0;
        sv_crown_map(v, 20, faces[n], &camera, 0.2, 0.4, s->sources[n].m);
    }
}

static void scene_free(struct scene *s)
{
    for (unsigned n = 0; n < s->count; n++)
        crown_panel_free(&s->panel[n]);
}

static float *some_depth(struct sv_rng *rng, int pixels)
{
    float *depth = malloc((size_t)pixels * sizeof *depth);
    for (int n = 0; n < pixels; n++) {
        double pick = sv_rng_unit(rng);
        depth[n] = pick < 0.5 ? 0 : pick < 0.52 ? NAN : pick < 0.54 ? INFINITY : (float)sv_rng_unit(rng);
    }
    return depth;
}

static void some_light(struct sv_rng *rng, struct picture *p)
{
    for (int n = 0; n < p->width * p->height; n++)
        for (int c = 0; c < 4; c++)
            p->light[n][c] = (float)(sv_rng_unit(rng) < 0.2 ? 0 : sv_rng_unit(rng));
}

static void assert_same(const struct picture *a, const struct picture *b, const char *what, int k)
{
    for (int n = 0; n < a->width * a->height; n++)
        if (memcmp(a->light[n], b->light[n], sizeof a->light[n]) != 0)
            fail_msg("%s, seed %d case %d, pixel (%d, %d): %a %a %a %a and %a %a %a %a", what, SEED, k,
                     n % a->width, n / a->width, (double)a->light[n][0], (double)a->light[n][1],
                     (double)a->light[n][2], (double)a->light[n][3], (double)b->light[n][0],
                     (double)b->light[n][1], (double)b->light[n][2], (double)b->light[n][3]);
}

static void test_levels_agree(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(SEED, 4);
    if (sv_simd_level() != SV_SIMD_AVX2)
        skip();
    for (int k = 0; k < 200; k++) {
        struct scene s;
        scene_make(&rng, k, &s);
        struct picture a = picture_make(s.width, s.height), b = picture_make(s.width, s.height);
        float *depth = k % 3 ? some_depth(&rng, s.width * s.height) : NULL;
        if (k % 2)
            some_light(&rng, &a);
        memcpy(b.light, a.light, (size_t)(s.width * s.height) * sizeof *a.light);
        draw_band(&sv_crown_scalar, s.sources, s.count, 0, s.height, depth, &a);
        draw_band(&sv_crown_avx2, s.sources, s.count, 0, s.height, depth, &b);
        assert_same(&a, &b, "scalar and AVX2", k);
        free(depth);
        free(a.light);
        free(b.light);
        scene_free(&s);
    }
}

/* Rings, one after the other, into one picture: bands and the whole, with and without leaving out what is
 * closed. */
static void draw_rings(const struct sv_crown_kernel *kernel, const struct scene *rings, int count, int first,
                       int rows, bool leave_out, struct picture *p)
{
    struct sv_crown_buffer *buffer;
    assert_int_equal(sv_crown_buffer_create(p->width, first, rows, &buffer, NULL), SV_OK);
    if (leave_out)
        sv_crown_buffer_close(buffer, (const float(*)[4])(p->light + (size_t)first * (size_t)p->width), NULL);
    for (int ring = 0; ring < count; ring++) {
        if (!leave_out)
            sv_crown_buffer_begin(buffer);
        sv_crown_buffer_clear(buffer);
        sv_crown_splat_at(kernel, rings[ring].sources, rings[ring].count, buffer, NULL);
        sv_crown_resolve_at(kernel, rings[ring].sources, rings[ring].count, buffer, NULL, 0,
                            p->light + (size_t)first * (size_t)p->width);
    }
    sv_crown_buffer_destroy(buffer);
}

/* Before the first ring: a disc that lets nothing through, a rim of half light, and all. */
static void put_disc(struct picture *p)
{
    for (int j = 0; j < p->height; j++)
        for (int i = 0; i < p->width; i++) {
            double r = hypot(i - 30.0, j - 34.0);
            float pass = r < 24 ? 0 : r < 26 ? 0.5f : 1;
            memcpy(p->light[j * p->width + i], (const float[4]){1 - pass, 1 - pass, 1 - pass, pass}, 16);
        }
}

static void test_bands_and_rings(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(SEED, 5);
    enum { RINGS = 40 };
    for (int k = 0; k < 12; k++) {
        static struct scene rings[RINGS];
        int count = k < 10 ? 3 : RINGS; /* many: keys' epochs begin again */
        for (int ring = 0; ring < count; ring++) {
            scene_make(&rng, k + ring, &rings[ring]);
            rings[ring].width = 70;
            rings[ring].height = 64;
        }
        struct picture whole = picture_make(70, 64), plain = picture_make(70, 64),
                       bands = picture_make(70, 64);
        const struct sv_crown_kernel *kernel = levels[k % LEVELS];
        if (k % 3 == 0) {
            put_disc(&whole);
            put_disc(&plain);
            put_disc(&bands);
        }
        draw_rings(kernel, rings, count, 0, 64, true, &whole);
        draw_rings(kernel, rings, count, 0, 64, false, &plain);
        assert_same(&plain, &whole, "with and without leaving out", k);
        for (int row = 0; row < 64;) {
            int rows = 1 + (int)sv_rng_range(&rng, 0, 64 - row);
            draw_rings(kernel, rings, count, row, rows, true, &bands);
            row += rows;
        }
        assert_same(&whole, &bands, "bands", k);
        free(whole.light);
        free(plain.light);
        free(bands.light);
        for (int ring = 0; ring < count; ring++)
            scene_free(&rings[ring]);
    }
}

/* What is left out behind closed pixels is some: a wall, then a second one. */
static void test_closed_is_left_out(void **state)
{
    (void)state;
    struct crown_panel panel;
    struct sv_crown_source source;
    struct sv_crown_stats stats[2] = {{0, 0, 0}, {0, 0, 0}};
    struct sv_crown_buffer *buffer;
    struct picture p = picture_make(64, 64);
    struct sv_camera camera = crown_camera(SV_CELL_NORTH, sv_vec3(0, 0, 0), 10, sv_vec3(0, 0, 0),
                                           (const double[3]){0, 0, 0}, 0.8, 64, 64);
    crown_panel_make(128, &panel);
    crown_panel_flat(&panel, (const uint8_t[4]){90, 90, 90, 255}, 0.8);
    source.layer = &panel.panel.crowns;
    source.steep = SV_CROWN_STEEP;
    source.opens = false;
    sv_crown_map(sv_vec3(0, 0, 0), 10, SV_CELL_NORTH, &camera, 0, 0, source.m);
    assert_int_equal(sv_crown_buffer_create(64, 0, 64, &buffer, NULL), SV_OK);
    for (int ring = 0; ring < 2; ring++) {
        sv_crown_buffer_clear(buffer);
        sv_crown_splat(&source, 1, buffer, &stats[ring]);
        sv_crown_resolve(&source, 1, buffer, NULL, 0, p.light);
    }
    assert_true(stats[0].drawn > 0 && stats[0].drawn < stats[0].tiles && stats[0].tiles == 64);
    assert_true(stats[1].tiles == 64 && stats[1].drawn == 0 && stats[1].texels == 0);
    sv_crown_buffer_begin(buffer);
    sv_crown_splat(&source, 1, buffer, &stats[1]);
    assert_int_equal(stats[1].drawn, stats[0].drawn);
    sv_crown_buffer_begin(buffer); /* light from before, which closes all but a pixel, or that too */
    for (int open = 1; open >= 0; open--) {
        p.light[20 * 64 + 20][3] = (float)open;
        stats[1].drawn = 0;
        sv_crown_buffer_close(buffer, (const float(*)[4])p.light, NULL);
        sv_crown_splat(&source, 1, buffer, &stats[1]);
        assert_true(open ? stats[1].drawn > 0 && stats[1].drawn < stats[0].drawn : stats[1].drawn == 0);
        sv_crown_buffer_begin(buffer);
    }
    sv_crown_buffer_destroy(buffer);
    free(p.light);
    crown_panel_free(&panel);
}

/* A crown before a wood whose tops are just above its own, seen from lower: it stands up into the sky. Beside
 * it the panel has the wood, which is seen where it is, and not in the sky around the crown. */
static void test_silhouette(void **state)
{
    (void)state;
    enum { SIDE = 64, CROWN = 32, WOOD = 30 };
    const double turn[3] = {0, 0, 0}, distance = 20, lower = 0.15;
    struct sv_vec3 v = sv_vec3(412345.5, 4123456.25, 310);
    struct crown_panel panel;
    struct sv_crown_source source;
    crown_panel_make(SIDE, &panel);
    for (int k = 0; k < SIDE * SIDE; k++) {
        bool crown = k / SIDE >= CROWN && k % SIDE >= 24 && k % SIDE < 40;
        if (!crown && k / SIDE < WOOD)
            continue;
        memcpy(panel.room.color[k], (const uint8_t[4]){crown ? 0 : 200, crown ? 200 : 0, 0, 255}, 4);
        panel.room.q[k] = crown ? SV_PANEL_Q_ONE : SV_PANEL_Q_ONE / 20;
    }
    crown_panel_pack(&panel);
    struct sv_camera camera =
        crown_camera(SV_CELL_NORTH, v, distance, sv_vec3(0, 0, -lower), turn, SV_PI / 2, SIDE, SIDE);
    source.layer = &panel.panel.crowns;
    source.steep = SV_CROWN_STEEP;
    source.opens = false;
    sv_crown_map(v, distance, SV_CELL_NORTH, &camera, 0, 0, source.m);
    int crown_top = (int)floor(CROWN - lower * SIDE / 2); /* 27.2: rows above have their centres in the sky */
    for (int level = 0; level < LEVELS; level++) {
        struct picture p = picture_make(SIDE, SIDE);
        draw_band(levels[level], &source, 1, 0, SIDE, NULL, &p);
        for (int k = 0; k < crown_top * SIDE; k++)
            assert_true(p.light[k][0] == 0 && p.light[k][3] == 1);
        for (int i = 26; i < 38; i++)
            assert_true(p.light[(crown_top + 2) * SIDE + i][1] > 0.5f &&
                        p.light[(crown_top + 2) * SIDE + i][0] == 0);
        for (int i = 2; i < 20; i++)
            assert_true(p.light[(WOOD + 2) * SIDE + i][0] > 0.5f);
        free(p.light);
    }
    crown_panel_free(&panel);
}

/* A leaf before a wall that goes on behind it, of which V sees a part, and a gap: as tangents from V, by the
 * planes that they stand in. From the right of V some of the wall is seen that V does not see. */
enum { OPEN_SIDE = 128 };
static const double LEAF_Q = 1.5, WALL_Q = 0.5, LEAF[4] = {-0.125, 0.125, -0.375, 0.375},
                    WALL[4] = {-0.625, 0.625, -0.625, 0.625}, GAP[4] = {0.25, 0.375, -0.625, 0.625};

/* How far inside of a box (x and y from, to) a point is; negative: outside. */
static double inside(const double box[4], double x, double y)
{
    return fmin(fmin(x - box[0], box[1] - x), fmin(y - box[2], box[3] - y));
}

static void leaf_and_wall(struct crown_panel *panel)
{
    crown_panel_make(OPEN_SIDE, panel);
    for (int k = 0; k < OPEN_SIDE * OPEN_SIDE; k++) {
        double x = 2 * (k % OPEN_SIDE + 0.5) / OPEN_SIDE - 1, y = 1 - 2 * (k / OPEN_SIDE + 0.5) / OPEN_SIDE;
        bool leaf = inside(LEAF, x, y) > 0, wall = inside(WALL, x, y) > 0 && inside(GAP, x, y) < 0;
        if (!leaf && !wall)
            continue;
        memcpy(panel->room.color[k], (const uint8_t[4]){leaf ? 200 : 0, 0, leaf ? 0 : 200, 255}, 4);
        panel->room.q[k] = (uint16_t)((leaf ? LEAF_Q : WALL_Q) * SV_PANEL_Q_ONE);
    }
    crown_panel_pack(panel);
}

/* What rays from the eye, offset D to the right of V, meet: a point of plane D / q that it sees at x is seen
 * at x + offset q from V. 1: the leaf, 2: the wall, 0: nothing, -1: within two pixels of an edge. *opened: V
 * does not see it. */
static int ray_meets(double offset, int i, int j, bool *opened)
{
    double x = 2 * (i + 0.5) / OPEN_SIDE - 1, y = 1 - 2 * (j + 0.5) / OPEN_SIDE, edge = 2 * 2.0 / OPEN_SIDE;
    double leaf = inside(LEAF, x + offset * LEAF_Q, y), at = x + offset * WALL_Q;
    double wall = fmin(inside(WALL, at, y), -inside(GAP, at, y));
    *opened = inside(LEAF, at, y) > 0 && leaf < 0;
    if (fabs(leaf) < edge || (leaf < 0 && fabs(wall) < edge))
        return -1;
    return leaf > 0 ? 1 : wall > 0 ? 2 : 0;
}

static void test_what_opens(void **state)
{
    (void)state;
    static const double offsets[] = {0.1, -0.1, 0.04};
    const double turn[3] = {0, 0, 0}, distance = 20;
    struct sv_vec3 v = sv_vec3(412345.5, 4123456.25, 310);
    struct crown_panel panel;
    leaf_and_wall(&panel);
    for (int k = 0; k < 3 * 2 * LEVELS; k++) {
        double offset = offsets[k % 3];
        struct sv_camera camera = crown_camera(SV_CELL_NORTH, v, distance, sv_vec3(offset, 0, 0), turn,
                                               SV_PI / 2, OPEN_SIDE, OPEN_SIDE);
        struct sv_crown_source source = {
            .layer = &panel.panel.crowns, .steep = SV_CROWN_STEEP, .opens = k / 3 % 2 == 1};
        struct picture p = picture_make(OPEN_SIDE, OPEN_SIDE);
        int wrong = 0, of_leaf = 0, seen_open = 0, gaps = 0;
        sv_crown_map(v, distance, SV_CELL_NORTH, &camera, 0, 0, source.m);
        draw_band(levels[k / 6], &source, 1, 0, OPEN_SIDE, NULL, &p);
        for (int n = 0; n < OPEN_SIDE * OPEN_SIDE; n++) {
            bool opened;
            int met = ray_meets(offset, n % OPEN_SIDE, n / OPEN_SIDE, &opened);
            const float *l = p.light[n];
            if (met < 0)
                continue;
            bool right = met == 0 ? l[3] > 0.99f : l[3] < 0.01f, own = met == 0 || l[met == 1 ? 0 : 2] > 0.5f;
            assert_true((right && own) || opened);
            wrong += !right;
            of_leaf += right && !own;
            seen_open += opened;
            gaps += met == 0 && inside(WALL, 2 * (n % OPEN_SIDE + 0.5) / OPEN_SIDE - 1, 0) > 0.1;
        }
        assert_true(gaps > 50 && (seen_open > 50 || fabs(offset) < 0.05));
        /* Without, the sky is seen in all that opens but corners, which are amid covered pixels: those show
         * what the panel has there, the leaf. */
        assert_int_equal(wrong, source.opens ? 0 : seen_open - of_leaf);
        assert_true(20 * of_leaf <= seen_open || fabs(offset) < 0.05);
        free(p.light);
    }
    crown_panel_free(&panel);
}

/* Opaque things in front hide, by more than the tolerance, pixel by pixel. */
static void test_depth(void **state)
{
    (void)state;
    struct crown_panel panel;
    struct sv_crown_source source;
    float depth[32 * 32];
    struct sv_camera camera = crown_camera(SV_CELL_SOUTH, sv_vec3(0, 0, 0), 10, sv_vec3(0, 0, 0),
                                           (const double[3]){0, 0, 0}, 1, 32, 32);
    crown_panel_make(64, &panel);
    crown_panel_flat(&panel, (const uint8_t[4]){90, 90, 90, 128}, 0.5);
    source.layer = &panel.panel.crowns;
    source.steep = SV_CROWN_STEEP;
    source.opens = false;
    sv_crown_map(sv_vec3(0, 0, 0), 10, SV_CELL_SOUTH, &camera, 0, 0, source.m);
    double d = camera.near_m / 20;
    for (int n = 0; n < 32 * 32; n++)
        depth[n] = (float)(d * (n % 4 == 0 ? 0 : n % 4 == 1 ? 0.9 : n % 4 == 2 ? 1.005 : 1.02));
    for (int level = 0; level < LEVELS; level++) {
        struct picture p = picture_make(32, 32);
        draw_band(levels[level], &source, 1, 0, 32, depth, &p); /* tolerance 0.01 */
        for (int n = 0; n < 32 * 32; n++) {
            double expected = n % 4 == 3 ? 1 : 1 - 128 / 255.0;
            assert_float_equal(p.light[n][3], expected, 1e-5);
        }
        free(p.light);
    }
    crown_panel_free(&panel);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_brute_force),     cmocka_unit_test(test_plane_homography),
        cmocka_unit_test(test_single_texel),    cmocka_unit_test(test_levels_agree),
        cmocka_unit_test(test_bands_and_rings), cmocka_unit_test(test_closed_is_left_out),
        cmocka_unit_test(test_depth),           cmocka_unit_test(test_silhouette),
        cmocka_unit_test(test_what_opens),
    };
    return cmocka_run_group_tests(tests, set_up, NULL);
}
