/* test_prewarp_draw.c - the plane drawn with the warped texture: pictures and depths against rays and against
 * the direct warp, reliefs and a polygon in one depth buffer, near planes, and eyes behind. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "core/base/color.h"
#include "core/base/hash.h"
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

static bool empty_about(const struct ray_field *field, const struct sv_camera *c, int x, int y)
{
    for (int k = 0; k < 9; k++) {
        struct ray_seen s;
        ray_march(field, c, x + 0.5 + (k % 3 - 1) * 1.5, y + 0.5 + (k / 3 - 1) * 1.5, &s);
        if (s.kind == RAY_SURFACE)
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
    } looks[] = {{0.1, 0.5, 1, false, 1},   {0.5, 2.5, 1.5, false, 1}, {0.5, 2.5, 1.5, false, 2},
                 {0.5, 2.5, 1.5, false, 4}, {0.5, 4.0, 1, true, 2},    {1.05, 1.2, 1, false, 2},
                 {1.05, 5.0, 1, true, 2},   {2.6, 0.7, 1, false, 2},   {2.4, 3.9, 1, true, 2}};
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
            if (m == NAMED_NOISY)
                continue;
            /* one sample a texel: resampling twice blurs features of three texels; two or more are judged */
            double limit = looks[n].finer == 1 ? 8 : looks[n].finer == 4 || m == NAMED_SMOOTH ? 1 : 5;
            assert_true((double)t.off * all < limit);
            assert_true((double)t.missing * all < 1 && (double)t.extra * all < 1);
            assert_true(t.depth_off * 200 < t.pixels);
            assert_true(looks[n].angle > 1.6 || t.depth_worst < 0.05);
        }
}

/* ---- composition ---- */

static const char polygon_vertex[] = "#include \"frame.glsl\"\n"
                                     "layout(location = 0) uniform vec3 corner[4];\n"
                                     "void main()\n{\n    gl_Position = clip_from_local * "
                                     "vec4(corner[gl_VertexID], 1.0);\n}\n";
static const char polygon_fragment[] = "layout(location = 0) out vec4 color;\n"
                                       "layout(location = 1) out uint id;\n"
                                       "layout(location = 2) out vec4 normal;\n"
                                       "void main()\n{\n    color = vec4(1.0);\n    id = 9u;\n"
                                       "    normal = vec4(0.0);\n}\n";

static void draw_polygon(const struct picture *p, const struct sv_vec3 corner[4])
{
    unsigned program;
    GLuint array;
    struct sv_error error;
    float xyz[12];
    for (int k = 0; k < 4; k++) {
        struct sv_vec3 local = sv_sub(corner[k], p->frame.camera.eye);
        xyz[3 * k] = (float)local.x;
        xyz[3 * k + 1] = (float)local.y;
        xyz[3 * k + 2] = (float)local.z;
    }
    assert_int_equal(sv_gl_program_create_text(polygon_vertex, polygon_fragment, &program, &error), SV_OK);
    gl.GenVertexArrays(1, &array);
    gl.BindVertexArray(array);
    gl.UseProgram(program);
    gl.Uniform3fv(0, 4, xyz);
    gl.DrawArrays(GL_TRIANGLE_STRIP, 0, 4);
    gl.DeleteVertexArrays(1, &array);
    gl.DeleteProgram(program);
}

/* Gentle waves about a plane through `middle` along a and b. */
static struct sv_relief wavy(struct sv_vec3 middle, struct sv_vec3 a, struct sv_vec3 b, double phase)
{
    enum { N = 96 };
    struct sv_relief r;
    struct sv_error error;
    assert_int_equal(sv_relief_alloc(N, N, &r, &error), SV_OK);
    r.cut = 2;
    r.frame.a = sv_scale(sv_normalize(a), 0.1);
    r.frame.b = sv_scale(sv_normalize(b), 0.1);
    r.frame.f = sv_normalize(sv_cross(a, b));
    r.frame.origin = sv_madd(sv_madd(middle, r.frame.a, -0.5 * N), r.frame.b, -0.5 * N);
    for (int t = 0; t < N * N; t++) {
        uint8_t color[4] = {(uint8_t)(t % N * 2), (uint8_t)(t / N * 2), (uint8_t)(80 * phase), 255};
        r.displ[t] = (float)(0.4 * sin(phase + (t % N) * 0.15) * cos(phase + (t / N) * 0.12));
        memcpy(r.color[t], color, 4);
    }
    sv_relief_measure(&r);
    sv_relief_normals(&r);
    return r;
}

/* INFINITY beside it, NaN near its outline. */
static double polygon_depth(const struct sv_camera *c, const struct sv_vec3 corner[4], double px, double py)
{
    struct sv_vec3 origin, direction,
        n = sv_cross(sv_sub(corner[1], corner[0]), sv_sub(corner[2], corner[0]));
    sv_camera_ray(c, px, py, &origin, &direction);
    struct sv_vec3 to = sv_sub(sv_sub(corner[0], c->eye), origin);
    double z = sv_dot(to, n) / sv_dot(direction, n);
    struct sv_vec3 hit = sv_sub(sv_madd(origin, direction, z), sv_sub(corner[0], c->eye));
    struct sv_vec3 u = sv_sub(corner[1], corner[0]), v = sv_sub(corner[2], corner[0]);
    double s = sv_dot(hit, u) / sv_dot(u, u), t = sv_dot(hit, v) / sv_dot(v, v);
    double out = fmax(fmax(-s, s - 1), fmax(-t, t - 1));
    return fabs(out) < 0.02 ? NAN : z > 0 && out < 0 ? z : INFINITY;
}

static void reliefs_and_a_polygon_compose(void **state)
{
    struct fixture *f = *state;
    struct sv_vec3 at = sv_vec3(500000, 4000000, 100);
    struct sv_relief one = wavy(at, sv_vec3(1, 0, 0), sv_vec3(0, 0.8, 0.6), 0.3);
    struct sv_relief two = wavy(at, sv_vec3(0.5, 0.2, 0.9), sv_vec3(0.2, 1, -1.0 / 3), 1.1);
    struct sv_vec3 corner[4];
    for (int k = 0; k < 4; k++)
        corner[k] =
            sv_madd(sv_madd(at, sv_vec3(0.6, -0.8, 0), k & 1 ? 5 : -5), sv_vec3(0, 0, 1), k >> 1 ? 4 : -4);
    int views = 0;
    long wrong = 0, seen = 0, by_id[10] = {0}, normals = 0, normals_off = 0;
    for (int n = 0; n < 12; n++) {
        struct sv_camera c = {.projection =
                                  n % 3 == 2 ? SV_PROJECTION_ORTHOGRAPHIC : SV_PROJECTION_PERSPECTIVE,
                              .vfov_rad = 0.8,
                              .ortho_height_m = 11,
                              .width = 160,
                              .height = 160,
                              .near_m = 0.1,
                              .far_m = 100};
        sv_camera_aim(&c, n * 0.52 + 0.1, n % 4 * 0.3 - 0.5, 0.2 * n);
        c.eye = sv_madd(at, c.forward, -14);
        /* a plane seen edge-on is a line: the paper's way has nothing to draw there (0.13 degrees at n = 0)
         */
        if (fabs(sv_dot(c.forward, one.frame.f)) < 0.1 || fabs(sv_dot(c.forward, two.frame.f)) < 0.1)
            continue;
        views++;
        struct picture p;
        picture_begin(&p, &c);
        draw_relief(f, &p, &one, 2, 3);
        draw_polygon(&p, corner);
        draw_relief(f, &p, &two, 2, 4);
        picture_read(&p);
        struct ray_field *fields[2] = {ray_field_create(&one), ray_field_create(&two)};
        for (int y = 0; y < c.height; y++)
            for (int x = 0; x < c.width; x++) {
                double z[3] = {INFINITY, INFINITY, polygon_depth(&c, corner, x + 0.5, y + 0.5)};
                struct ray_seen s[2];
                for (int k = 0; k < 2; k++) {
                    ray_march(fields[k], &c, x + 0.5, y + 0.5, &s[k]);
                    z[k] = s[k].kind == RAY_SURFACE ? s[k].depth_m : INFINITY;
                }
                int best = z[0] <= z[1] && z[0] <= z[2] ? 0 : z[1] <= z[2] ? 1 : 2;
                double rest = fmin(best == 0 ? z[1] : z[0], best == 2 ? z[1] : z[2]);
                /* judged where nothing else is within 2 cm of it, and no outline is near */
                if (isnan(z[2]) || isinf(z[best]) || rest - z[best] < 0.02)
                    continue;
                bool still = true;
                for (int k = 0; k < 2; k++)
                    still &= s[k].kind == RAY_SURFACE ? calm(fields[k], &c, x, y, s[k].displ, 0.2)
                                                      : empty_about(fields[k], &c, x, y);
                if (!still)
                    continue;
                size_t k = (size_t)y * (size_t)c.width + (size_t)x;
                uint32_t id = ((const uint32_t *)p.layer[SV_LAYER_ID].data)[k];
                static const uint32_t ids[3] = {3, 4, 9};
                seen++;
                by_id[ids[best]]++;
                wrong += id != ids[best];
                if (best == 2 || id != ids[best])
                    continue;
                const struct sv_relief *r = best ? &two : &one;
                const float *got = (const float *)p.layer[SV_LAYER_NORMAL].data + 3 * k;
                size_t t = (size_t)s[best].v * (size_t)r->width + (size_t)s[best].u;
                const int16_t *m = r->normal[t];
                struct sv_vec3 w =
                    sv_madd(sv_madd(sv_scale(sv_normalize(r->frame.a), m[0]), sv_normalize(r->frame.b), m[1]),
                            r->frame.f, m[2]);
                double along = sv_dot(sv_normalize(w), sv_normalize(sv_vec3(got[0], got[1], got[2])));
                normals++;
                normals_off += along < cos(0.1);
            }
        ray_field_destroy(fields[0]);
        ray_field_destroy(fields[1]);
        picture_finish(&p);
    }
    print_message("composition at UTM coordinates: %d views, %ld pixels judged (%ld, %ld, polygon %ld), %ld "
                  "show the wrong one; "
                  "normals off by more than 0.1 rad: %ld of %ld\n",
                  views, seen, by_id[3], by_id[4], by_id[9], wrong, normals_off, normals);
    assert_true(by_id[3] > 5000 && by_id[4] > 5000 && by_id[9] > 5000);
    assert_true(wrong * 10000 <= seen * 5);
    assert_true(normals_off * 100 <= normals);
    sv_relief_finish(&one);
    sv_relief_finish(&two);
}

/* The plane stands nearer than the near plane, what it shows does not: nothing is cut. And where the texels
 * themselves come too near, nothing is drawn. */
static void near_planes_cut_texels_not_planes(void **state)
{
    struct fixture *f = *state;
    struct sv_relief r = wavy(sv_vec3(0, 0, 0), sv_vec3(1, 0, 0), sv_vec3(0, 1, 0), 0.3);
    for (int n = 0; n < 2; n++) {
        for (int t = 0; t < r.width * r.height; t++)
            r.displ[t] = n ? 0.45f : -5;
        sv_relief_measure(&r);
        struct sv_camera c = {
            .projection = SV_PROJECTION_PERSPECTIVE, .vfov_rad = 0.5, .width = 64, .height = 64, .near_m = 1};
        sv_camera_aim(&c, 0, -SV_PI / 2, 0);
        c.eye = sv_vec3(0, 0, 0.5);
        struct picture p;
        picture_begin(&p, &c);
        draw_relief(f, &p, &r, 1, 5);
        picture_read(&p);
        int drawn = 0;
        for (int k = 0; k < 64 * 64; k++) {
            bool there = ((const uint32_t *)p.layer[SV_LAYER_ID].data)[k] == 5;
            drawn += there;
            double z = c.near_m / ((const float *)p.layer[SV_LAYER_DEPTH].data)[k];
            assert_true(!there || fabs(z - 5.5) < 1e-4);
        }
        assert_int_equal(drawn, n ? 0 : 64 * 64);
        picture_finish(&p);
    }
    sv_relief_finish(&r);
}

static double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

/* The three costs of the paper's way apart, best of nine; nothing depends on them. The picture is the same
 * each time: the textures are reused. */
static void warp_upload_and_draw_apart(void **state)
{
    struct fixture *f = *state;
    struct sv_relief r = wavy(sv_vec3(0, 0, 0), sv_vec3(1, 0, 0), sv_vec3(0, 1, 0), 0.3);
    struct sv_camera c = {
        .projection = SV_PROJECTION_PERSPECTIVE, .vfov_rad = 0.7, .width = 512, .height = 512, .near_m = 0.1};
    struct sv_prewarp prewarp;
    struct sv_error error;
    double best[3] = {1e9, 1e9, 1e9};
    uint64_t first = 0;
    sv_camera_aim(&c, 0.4, -1, 0);
    c.eye = sv_scale(c.forward, -14);
    for (int n = 0; n < 9; n++) {
        struct picture p;
        struct sv_warped w;
        struct sv_prewarp_options options = {.fill = true};
        struct sv_prewarp_plane plane = {&r.frame, r.cut, 1};
        picture_begin(&p, &c);
        gl.Finish();
        double t[4] = {now_ms(), 0, 0, 0};
        assert_int_equal(sv_prewarp_perspective(&r.frame, c.eye, &prewarp, &error), SV_OK);
        assert_int_equal(sv_prewarp_two_pass(&r, &prewarp, &options, &w, &error), SV_OK);
        t[1] = now_ms();
        assert_int_equal(sv_prewarp_draw_upload(f->draw, &w, NULL, &error), SV_OK);
        gl.Finish();
        t[2] = now_ms();
        assert_int_equal(sv_prewarp_draw_plane(f->draw, &p.frame, &plane, &error), SV_OK);
        gl.Finish();
        t[3] = now_ms();
        for (int k = 0; k < 3; k++)
            best[k] = fmin(best[k], t[k + 1] - t[k]);
        picture_read(&p);
        uint64_t sum = sv_hash_bytes(SV_HASH_INIT, p.layer[SV_LAYER_COLOR].data, 512 * 512 * 4);
        first = n ? first : sum;
        assert_true(sum == first);
        sv_warped_finish(&w);
        picture_finish(&p);
    }
    print_message("96 x 96 texels in 512 x 512 px: warp %.2f, upload %.2f, draw %.2f ms (best of nine)\n",
                  best[0], best[1], best[2]);
    sv_relief_finish(&r);
}

static void refusals(void **state)
{
    struct fixture *f = *state;
    struct sv_relief r = wavy(sv_vec3(0, 0, 0), sv_vec3(1, 0, 0), sv_vec3(0, 1, 0), 0.3);
    struct sv_camera c = {
        .projection = SV_PROJECTION_PERSPECTIVE, .vfov_rad = 0.5, .width = 8, .height = 8, .near_m = 1};
    struct sv_prewarp_plane plane = {&r.frame, r.cut, 1};
    struct sv_prewarp_draw *fresh;
    struct sv_error error;
    struct picture p;
    sv_camera_aim(&c, 0, 0, 0);
    picture_begin(&p, &c);
    assert_int_equal(sv_prewarp_draw_plane(f->draw, &p.frame, &plane, &error), SV_EINVAL); /* eye in it */
    assert_string_equal(error.field, "camera");
    assert_int_equal(sv_prewarp_draw_create(&fresh, &error), SV_OK);
    p.frame.camera.eye.z = 1;
    assert_int_equal(sv_prewarp_draw_plane(fresh, &p.frame, &plane, &error), SV_EINVAL);
    assert_string_equal(error.field, "prewarp");
    sv_prewarp_draw_destroy(fresh);
    sv_prewarp_draw_destroy(NULL);
    picture_finish(&p);
    sv_relief_finish(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pictures_and_depths),
        cmocka_unit_test(reliefs_and_a_polygon_compose),
        cmocka_unit_test(near_planes_cut_texels_not_planes),
        cmocka_unit_test(warp_upload_and_draw_apart),
        cmocka_unit_test(refusals),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
