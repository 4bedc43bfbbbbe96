/* test_prewarp_draw.c - the plane drawn with the warped texture: pictures and depths against rays and against
 * the direct warp, reliefs and a polygon in one depth buffer, near planes, and eyes behind. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "core/base/color.h"
#include "core/gl/context.h"
#include "core/gl/functions.h"
#include "core/gl/program.h"
#include "core/gl/target.h"
#include "core/relief/draw_prewarp.h"
#include "core/relief/lighting.h"
#include "core/relief/warp.h"
#include "tests/core/relief/named_reliefs.h"
#include "tests/core/relief/ray_march.h"

struct fixture {
    struct sv_gl_context *context;
    struct sv_prewarp_draw *draw;
};

static int set_up(void **state)
{
    static struct fixture f;
    struct sv_error error;
    sv_color_init();
    if (sv_gl_context_create(&f.context, &error) || sv_prewarp_draw_create(&f.draw, &error)) {
        print_error("%s: %s\n", error.field, error.message);
        return -1;
    }
    *state = &f;
    return 0;
}

static int tear_down(void **state)
{
    struct fixture *f = *state;
    sv_prewarp_draw_destroy(f->draw);
    sv_gl_context_destroy(f->context);
    return 0;
}

struct picture {
    struct sv_gl_target *target;
    struct sv_gl_frame frame;
    struct sv_image layer[SV_LAYER_COUNT];
};

static void picture_begin(struct picture *p, const struct sv_camera *camera)
{
    struct sv_error error;
    memset(p, 0, sizeof *p);
    p->frame.camera = *camera;
    if (sv_gl_target_create(camera->width, camera->height, (1u << SV_LAYER_COUNT) - 1, &p->target, &error) ||
        sv_gl_frame_begin(&p->frame, &error))
        fail_msg("%s", error.message);
    sv_gl_target_begin(p->target);
}

static void picture_read(struct picture *p)
{
    static const struct {
        int channels;
        enum sv_pixel_type type;
    } form[SV_LAYER_COUNT] = {[SV_LAYER_COLOR] = {4, SV_PIXEL_U8},
                              [SV_LAYER_ID] = {1, SV_PIXEL_U32},
                              [SV_LAYER_NORMAL] = {3, SV_PIXEL_F32},
                              [SV_LAYER_DEPTH] = {1, SV_PIXEL_F32}};
    struct sv_error error;
    for (int k = 0; k < SV_LAYER_COUNT; k++)
        if (sv_image_alloc(p->frame.camera.width, p->frame.camera.height, form[k].channels, form[k].type,
                           &p->layer[k], &error) ||
            sv_gl_target_read(p->target, (enum sv_layer)k, &p->layer[k], &error))
            fail_msg("%s", error.message);
}

static void picture_finish(struct picture *p)
{
    for (int k = 0; k < SV_LAYER_COUNT; k++)
        sv_image_free(&p->layer[k]);
    sv_gl_target_destroy(p->target);
}

/* Warps and draws a relief into the picture that was begun; finer: samples a texel. */
static void draw_relief(struct fixture *f, struct picture *p, const struct sv_relief *r, int finer,
                        uint32_t id)
{
    const struct sv_camera *c = &p->frame.camera;
    struct sv_prewarp prewarp;
    struct sv_warped w;
    struct sv_error error;
    struct sv_prewarp_options options = {.fill = true};
    enum sv_status status = c->projection == SV_PROJECTION_ORTHOGRAPHIC
                                ? sv_prewarp_parallel(&r->frame, c->forward, &prewarp, &error)
                                : sv_prewarp_perspective(&r->frame, c->eye, &prewarp, &error);
    if (status || sv_prewarp_two_pass(r, &prewarp, &options, &w, &error))
        fail_msg("%s: %s", error.field, error.message);
    if (finer > 1) {
        options.width = w.width * finer;
        options.height = w.height * finer;
        sv_warped_finish(&w);
        assert_int_equal(sv_prewarp_two_pass(r, &prewarp, &options, &w, &error), SV_OK);
    }
    struct sv_prewarp_plane plane = {&r->frame, r->cut, id};
    if (sv_prewarp_draw_upload(f->draw, &w, r, &error) ||
        sv_prewarp_draw_plane(f->draw, &p->frame, &plane, &error))
        fail_msg("%s: %s", error.field, error.message);
    sv_warped_finish(&w);
}

/* ---- against rays and the direct warp ---- */

struct tally {
    long pixels, off, off_direct, missing, extra, depth_off;
    double depth_worst; /* metres off, in texels, where the ray sees the same surface all around */
};

/* True where the eight neighbours of the ray see displ within `cut` of its own: no edge near. */
static bool calm(const struct ray_field *field, const struct sv_camera *c, int x, int y, double displ,
                 double cut)
{
    for (int k = 0; k < 9; k++) {
        struct ray_seen s;
        ray_march(field, c, x + 0.5 + (k % 3 - 1) * 1.5, y + 0.5 + (k / 3 - 1) * 1.5, &s);
        if (s.kind != RAY_SURFACE || fabs(s.displ - displ) > cut)
            return false;
    }
    return true;
}

static double depth_m(const struct sv_camera *c, double window)
{
    return c->projection == SV_PROJECTION_ORTHOGRAPHIC ? c->far_m * (1 - window) : c->near_m / window;
}

static void direct_warp(const struct sv_relief *r, const struct sv_camera *c, uint8_t (*rgba)[4])
{
    struct sv_warp_buffer buffer = {0};
    struct sv_warp_stats stats = {0};
    struct sv_error error;
    struct sv_warp_source source = {.width = r->width,
                                    .height = r->height,
                                    .t = r->displ,
                                    .color = (const uint8_t(*)[4])r->color,
                                    .cut = r->cut};
    sv_warp_map_from_camera(&r->frame, c, 0, 0, &source.map);
    assert_int_equal(sv_warp_buffer_create(c->width, c->height, &buffer, &error), SV_OK);
    sv_warp_clear(&buffer);
    sv_warp_splat(&source, 0, &buffer, &stats);
    sv_warp_fill(&source, 1, &buffer, &stats);
    sv_warp_resolve(&source, 1, &buffer, rgba);
    sv_warp_buffer_finish(&buffer);
}

static int most_apart(const uint8_t *a, const double *b)
{
    double most = 0;
    for (int c = 0; c < 3; c++)
        most = fmax(most, fabs(a[c] - b[c]));
    return (int)most;
}

static void tally_picture(const struct sv_relief *r, const struct picture *p, struct tally *t)
{
    const struct sv_camera *c = &p->frame.camera;
    size_t n = (size_t)c->width * (size_t)c->height;
    uint8_t(*direct)[4] = calloc(n, 4);
    struct ray_field *field = ray_field_create(r);
    double texel = fmin(sv_length(r->frame.a), sv_length(r->frame.b));
    direct_warp(r, c, direct);
    for (int y = 0; y < c->height; y++)
        for (int x = 0; x < c->width; x++) {
            size_t at = (size_t)y * (size_t)c->width + (size_t)x;
            const uint8_t *rgba = (const uint8_t *)p->layer[SV_LAYER_COLOR].data + 4 * at;
            struct ray_seen seen;
            ray_march(field, c, x + 0.5, y + 0.5, &seen);
            bool there = seen.kind != RAY_NOTHING, ours = rgba[3] != 0;
            t->pixels += there || ours;
            t->missing += there && !ours;
            t->extra += ours && !there;
            t->off += there && ours && most_apart(rgba, seen.rgb) > 8;
            double other[3] = {direct[at][0], direct[at][1], direct[at][2]};
            t->off_direct += ours && direct[at][3] && most_apart(rgba, other) > 8;
            if (!ours || seen.kind != RAY_SURFACE || !calm(field, c, x, y, seen.displ, 4 * texel))
                continue;
            double off =
                fabs(depth_m(c, ((const float *)p->layer[SV_LAYER_DEPTH].data)[at]) - seen.depth_m) / texel;
            t->depth_worst = fmax(t->depth_worst, off);
            t->depth_off += off > 0.5;
        }
    ray_field_destroy(field);
    free(direct);
}

static void pictures_and_depths(void **state)
{
    struct fixture *f = *state;
    static const struct {
        double angle, azimuth, magnification;
        bool parallel;
        int finer;
    } looks[] = {{0.1, 0.5, 1, false, 1}, {0.5, 2.5, 1.5, false, 1}, {0.5, 2.5, 1.5, false, 2},
                 {0.5, 4.0, 1, true, 2},  {1.05, 1.2, 1, false, 2},  {1.05, 5.0, 1, true, 2},
                 {2.6, 0.7, 1, false, 2}, {2.4, 3.9, 1, true, 2}};
    static const char *const kind[3] = {"smooth", "stepped", "noisy"};
    for (size_t n = 0; n < sizeof looks / sizeof *looks; n++)
        for (int m = 0; m < 3; m++) {
            struct tally t = {0};
            for (int k = 0; k < NAMED_COUNT; k++) {
                struct sv_relief r;
                if (named_relief_kind(k) != (enum named_kind)m)
                    continue;
                named_relief_make(k, &r);
                if (r.width > 2 && r.width <= 96 && r.height <= 96) {
                    struct sv_camera camera;
                    struct picture p;
                    named_relief_camera(&r, looks[n].angle, looks[n].azimuth, looks[n].magnification,
                                        looks[n].parallel, &camera);
                    picture_begin(&p, &camera);
                    draw_relief(f, &p, &r, looks[n].finer, 7);
                    picture_read(&p);
                    tally_picture(&r, &p, &t);
                    picture_finish(&p);
                }
                sv_relief_finish(&r);
            }
            double all = t.pixels > 0 ? 100.0 / (double)t.pixels : 0;
            print_message(
                "%-8s %5.1f degrees, %-11s x%.1f, %d samples a texel: off %6.3f %%, from the direct "
                "warp %6.3f %%, missing %6.3f, extra %6.3f of %ld; depth off by more than half a "
                "texel %ld, worst %.3f texels\n",
                kind[m], sv_degrees(looks[n].angle), looks[n].parallel ? "parallel" : "perspective",
                looks[n].magnification, looks[n].finer, (double)t.off * all, (double)t.off_direct * all,
                (double)t.missing * all, (double)t.extra * all, t.pixels, t.depth_off, t.depth_worst);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pictures_and_depths),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
