/* test_relief_extremes.c - a million random extreme inputs to all of relief: eyes on, in and under reliefs,
 * lights in the plane and square to it, displ of 0, 1e9, NaN, infinite and denormal, textures of one texel,
 * texels of 1e-6 to 1e6 m, fields of view of 1 and 150 degrees, tiny pictures. What goes in and what comes
 * out lies between pages that may not be touched. Nothing that comes out is NaN or infinite, nothing crashes.
 * And tables of the error towards each singular place: it grows smoothly until the input is refused. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "core/relief/build.h"
#include "core/relief/cast.h"
#include "core/relief/lighting.h"
#include "core/relief/prewarp.h"
#include "core/relief/row_front.h"
#include "core/relief/self_shadow.h"
#include "core/relief/warp.h"
#include "tests/core/relief/extremes_kit.h"

/* ---- one input each: true unless it was refused ---- */

static bool try_point(struct sv_rng *rng)
{
    struct sv_relief r = {.frame = extremes_frame(rng), .width = 4, .height = 4};
    float displ[16] = {0};
    r.displ = displ;
    struct sv_prewarp p;
    struct sv_error error;
    struct sv_vec3 eye = extremes_eye(rng, &r);
    enum sv_status status = extremes_pick(rng, 2)
                                ? sv_prewarp_perspective(&r.frame, eye, &p, &error)
                                : sv_prewarp_parallel(&r.frame, extremes_unit(rng), &p, &error);
    if (status) {
        assert_int_equal(status, SV_EINVAL);
        return false;
    }
    for (int k = 0; k < 5; k++)
        assert_true(isfinite(p.k[k]));
    double u = 7, v = 7, us = extremes_pick(rng, 8) ? sv_rng_range(rng, -10, 10) : extremes_displ(rng, 1);
    if (sv_prewarp_point(&p, us, sv_rng_range(rng, -10, 10), extremes_displ(rng, extremes_length(rng)), &u,
                         &v))
        assert_true(isfinite(u) && isfinite(v));
    else
        assert_true(u == 7 && v == 7);
    return true;
}

static bool try_two_pass(struct sv_rng *rng)
{
    struct sv_relief r = extremes_relief(rng);
    struct sv_prewarp p;
    struct sv_warped w;
    struct sv_error error;
    enum sv_status status = extremes_pick(rng, 2)
                                ? sv_prewarp_perspective(&r.frame, extremes_eye(rng, &r), &p, &error)
                                : sv_prewarp_parallel(&r.frame, extremes_unit(rng), &p, &error);
    if (status)
        return false;
    size_t n = (size_t)r.width * (size_t)r.height;
    uint8_t(*lit)[4] = extremes_guarded(rng, EXTREMES_SLOT_IN, 4 * n);
    memset(lit, 99, 4 * n);
    struct sv_prewarp_options options = {.width = (int)extremes_pick(rng, 3) * extremes_side(rng),
                                         .height = (int)extremes_pick(rng, 3) * extremes_side(rng),
                                         .color = extremes_pick(rng, 2) ? (const uint8_t(*)[4])lit : NULL,
                                         .fill = extremes_pick(rng, 2),
                                         .order = (enum sv_prewarp_order)extremes_pick(rng, 3)};
    if (sv_prewarp_two_pass(&r, &p, &options, &w, &error))
        fail_msg("%s: %s", error.field, error.message);
    assert_true(isfinite(w.u0) && isfinite(w.v0) && isfinite(w.u1) && isfinite(w.v1));
    assert_true(w.width >= 1 && w.height >= 1 && w.u0 < w.u1 && w.v0 < w.v1 && w.holes_left <= w.holes);
    for (int t = 0; t < w.width * w.height; t++) {
        bool there = w.color[t][3] == 255;
        assert_true(isfinite(w.displ[t]) && (there || w.color[t][3] == 0));
        assert_true(there ? w.texel[t] < n : w.texel[t] == SV_WARPED_NONE);
    }
    sv_warped_finish(&w);
    return true;
}

static bool try_direct(struct sv_rng *rng)
{
    struct sv_relief r = extremes_relief(rng);
    struct sv_warp_buffer buffer = {0};
    struct sv_warp_stats stats = {0};
    struct sv_error error;
    struct sv_camera c = {.projection =
                              extremes_pick(rng, 3) ? SV_PROJECTION_PERSPECTIVE : SV_PROJECTION_ORTHOGRAPHIC,
                          .vfov_rad = sv_radians(extremes_pick(rng, 2) ? 1 : 150),
                          .ortho_height_m = extremes_length(rng),
                          .width = extremes_side(rng),
                          .height = extremes_side(rng),
                          .near_m = extremes_pick(rng, 2) ? 0.1 : 1e-6,
                          .far_m = 1e5};
    do
        c.eye = extremes_eye(rng, &r);
    while (isnan(c.eye.x));
    struct sv_vec3 to = sv_sub(sv_relief_point(&r.frame, 0.5 * r.width, 0.5 * r.height, 0), c.eye);
    double heading = atan2(to.x, to.y), pitch = atan2(to.z, hypot(to.x, to.y));
    sv_camera_aim(&c, heading + (extremes_pick(rng, 2) ? sv_rng_range(rng, -1, 1) : 0), pitch,
                  sv_rng_range(rng, -3, 3));
    struct sv_warp_source source = {.width = r.width,
                                    .height = r.height,
                                    .t = r.displ,
                                    .color = (const uint8_t(*)[4])r.color,
                                    .cut = r.cut};
    sv_warp_map_from_camera(&r.frame, &c, 0, 0, &source.map);
    size_t n = (size_t)c.width * (size_t)c.height;
    uint8_t(*rgba)[4] = extremes_guarded(rng, EXTREMES_SLOT_OUT, 4 * n);
    memset(rgba, 0, 4 * n);
    assert_int_equal(sv_warp_buffer_create(c.width, c.height, &buffer, &error), SV_OK);
    sv_warp_clear(&buffer);
    sv_warp_splat(&source, 0, &buffer, &stats);
    sv_warp_fill(&source, 1, &buffer, &stats);
    sv_warp_resolve(&source, 1, &buffer, rgba);
    for (size_t k = 0; k < n; k++) {
        bool there = buffer.texel[k] != SV_WARP_EMPTY;
        assert_true(isfinite(buffer.depth[k]) && buffer.depth[k] >= 0 && buffer.depth[k] <= 1);
        assert_true(!there || (buffer.texel[k] & SV_WARP_TEXEL_MASK) < (uint32_t)(r.width * r.height));
        double u = 0, v = 0;
        if (sv_warp_locate(&source, &buffer, (int)(k % (size_t)c.width), (int)(k / (size_t)c.width), &u, &v))
            assert_true(isfinite(u) && isfinite(v));
    }
    sv_warp_buffer_finish(&buffer);
    return true;
}

static bool try_self_shadow(struct sv_rng *rng)
{
    struct sv_relief r = extremes_relief(rng);
    size_t n = (size_t)r.width * (size_t)r.height;
    struct sv_error error;
    struct sv_self_shadow_options options = {.travel = extremes_unit(rng),
                                             .bias_m =
                                                 extremes_pick(rng, 3) ? 0 : (float)extremes_length(rng),
                                             .special_cases = extremes_pick(rng, 2),
                                             .texels_alone = extremes_pick(rng, 2)};
    uint8_t *initial = extremes_guarded(rng, EXTREMES_SLOT_IN, n),
            *lit = extremes_guarded(rng, EXTREMES_SLOT_OUT, n);
    for (size_t t = 0; t < n; t++)
        initial[t] = (uint8_t)(extremes_pick(rng, 3) ? 255 : 0);
    if (extremes_pick(rng, 2))
        options.initial = initial;
    if (extremes_pick(rng, 50) == 0)
        options.travel.x = NAN;
    memset(lit, 77, n);
    enum sv_status status = sv_self_shadow(&r, &options, lit, &error);
    if (isnan(options.travel.x)) {
        assert_int_equal(status, SV_EINVAL);
        return false;
    }
    assert_int_equal(status, SV_OK);
    for (size_t t = 0; t < n; t++) {
        assert_true(lit[t] == 0 || lit[t] == 255);
        if (sv_relief_solid(&r, t))
            assert_true(lit[t] == 0 || options.travel.z <= 0); /* from behind all is dark */
    }
    return true;
}

static bool try_row_front(struct sv_rng *rng)
{
    int width = extremes_side(rng), height = extremes_side(rng);
    size_t n = (size_t)width * (size_t)height;
    float *heights = extremes_guarded(rng, EXTREMES_SLOT_DISPL, n * 4),
          *initial = extremes_guarded(rng, EXTREMES_SLOT_IN, n * 4);
    float *shadow = extremes_guarded(rng, EXTREMES_SLOT_OUT, n * 4),
          *incoming = extremes_guarded(rng, EXTREMES_SLOT_OUT2, n * 4);
    uint8_t *lit = extremes_guarded(rng, EXTREMES_SLOT_OUT3, n);
    double scale = extremes_length(rng);
    for (size_t t = 0; t < n; t++) {
        heights[t] = extremes_displ(rng, scale);
        initial[t] = extremes_pick(rng, 2) ? SV_ROW_FRONT_NONE : extremes_displ(rng, scale);
        shadow[t] = incoming[t] = NAN;
    }
    struct sv_row_front field = {.width = width,
                                 .height = height,
                                 .dx = extremes_length(rng),
                                 .dy = extremes_length(rng),
                                 .travel = extremes_unit(rng),
                                 .height_m = heights,
                                 .initial = extremes_pick(rng, 2) ? initial : NULL,
                                 .bias_m = extremes_pick(rng, 2) ? 0 : (float)scale};
    struct sv_error error;
    if (sv_row_front(&field, shadow, incoming, lit, &error))
        fail_msg("%s: %s", error.field, error.message);
    for (size_t t = 0; t < n; t++)
        assert_true(isfinite(shadow[t]) && isfinite(incoming[t]) && (lit[t] == 0 || lit[t] == 255));
    return true;
}

/* Bodies a thousand times as long as their texels are rare: a silhouette of 4096 x 4096 texels takes a while.
 */
static bool try_cast(struct sv_rng *rng)
{
    struct sv_relief r = extremes_relief(rng);
    struct sv_silhouette s = {0};
    struct sv_error error;
    struct sv_vec3 travel = extremes_unit(rng);
    double size = sv_length(r.frame.a) * r.width + sv_length(r.frame.b) * r.height;
    double extent = extremes_pick(rng, 2000) ? size + (double)r.displ_max - (double)r.displ_min : size;
    enum sv_status status =
        sv_cast_silhouette(&r, travel, extent * pow(10, sv_rng_range(rng, -1.5, 1)), &s, &error);
    if (status) { /* a body of 1e9 m needs more texels than there are */
        assert_true(status == SV_EINVAL || status == SV_ELIMIT);
        return false;
    }
    assert_true(isfinite(s.corner.x) && isfinite(s.corner.y) && isfinite(s.corner.z) && s.width_m >= 0 &&
                isfinite(s.width_m) && isfinite(s.height_m) && isfinite(s.first_m) && isfinite(s.last_m));
    for (int t = 0; t < s.width * s.height; t++)
        assert_true(!s.first || s.coverage[t] == 0 || isfinite(s.first[t]));
    struct sv_relief other = extremes_relief(rng);
    size_t n = (size_t)other.width * (size_t)other.height;
    uint8_t *dark = extremes_guarded(rng, EXTREMES_SLOT_OUT, n);
    memset(dark, 255, n);
    status = sv_cast_shadow(&s, &other, extremes_pick(rng, 2) ? SV_CAST_PLANE : SV_CAST_HEIGHT, dark, &error);
    assert_true(status == SV_OK || status == SV_EINVAL);
    sv_cast_silhouette_finish(&s);
    const struct sv_relief *both[2] = {&r, &other};
    int order[2] = {-1, -1};
    assert_int_equal(sv_cast_order(both, 2, travel, order, &error), SV_OK);
    assert_true(order[0] + order[1] == 1 && order[0] >= 0 && order[1] >= 0);
    return true;
}

static bool try_lighting(struct sv_rng *rng)
{
    struct sv_relief r = extremes_relief(rng);
    size_t n = (size_t)r.width * (size_t)r.height;
    sv_relief_normals(&r);
    for (size_t t = 0; t < n; t++) {
        if (!sv_relief_solid(&r, t))
            continue;
        double x = r.normal[t][0], y = r.normal[t][1], z = r.normal[t][2];
        assert_true(z >= 0 && fabs(sqrt(x * x + y * y + z * z) - 32767) < 3);
    }
    struct sv_light light;
    struct sv_sun sun = {sv_rng_range(rng, 0, 7), extremes_pick(rng, 4) ? sv_rng_range(rng, -1.57, 1.57) : 0};
    sv_light_from_sun(&sun, &light);
    if (extremes_pick(rng, 3) == 0)
        light.to_sun = extremes_pick(rng, 2) ? r.frame.f : sv_normalize(r.frame.a);
    uint8_t *lit = extremes_guarded(rng, EXTREMES_SLOT_IN, n);
    uint8_t(*rgba)[4] = extremes_guarded(rng, EXTREMES_SLOT_OUT, 4 * n);
    memset(lit, 128, n);
    memset(rgba, 1, 4 * n);
    struct sv_relief_light options = {.light = &light,
                                      .frame = r.frame,
                                      .lit = extremes_pick(rng, 2) ? lit : NULL,
                                      .has_viewer = extremes_pick(rng, 2),
                                      .eye = extremes_eye(rng, &r),
                                      .specular = (float)sv_rng_range(rng, 0, 1),
                                      .shininess = extremes_pick(rng, 2) ? 1 : 1e4f};
    sv_relief_light(&r, &options, rgba);
    for (size_t t = 0; t < n; t++)
        assert_int_equal(rgba[t][3], r.color[t][3]);
    return true;
}

static bool try_depth(struct sv_rng *rng)
{
    struct sv_depth_form form = {(enum sv_depth_kind)extremes_pick(rng, 4), extremes_length(rng), 0};
    form.far_m = form.near_m * (1 + extremes_length(rng));
    double value = extremes_pick(rng, 2) ? sv_rng_unit(rng) : extremes_displ(rng, 1),
           z = sv_depth_linear(&form, value);
    double u, v, d, top = form.kind == SV_DEPTH_LINEAR ? HUGE_VAL : 1;
    assert_true(value >= 0 && value <= top ? z >= 0 : isnan(z));
    sv_depth_relief(extremes_length(rng), 512, sv_rng_range(rng, 0, 512), sv_rng_range(rng, 0, 512), z, &u,
                    &v, &d);
    assert_true(isfinite(z) ? isfinite(u) && isfinite(v) && isfinite(d) : isnan(u) && isnan(v) && isnan(d));
    int side = extremes_side(rng);
    size_t n = (size_t)side * (size_t)side;
    float *depth = extremes_guarded(rng, EXTREMES_SLOT_IN, n * 4);
    for (size_t t = 0; t < n; t++)
        depth[t] = extremes_pick(rng, 2) ? (float)sv_rng_unit(rng) : extremes_displ(rng, 1);
    struct sv_relief_frame frame = extremes_frame(rng);
    struct sv_relief r;
    struct sv_error error;
    if (sv_relief_from_depth(&frame, side, side, depth, &form, extremes_length(rng), NULL, 1, &r, &error))
        fail_msg("%s: %s", error.field, error.message);
    for (size_t t = 0; t < n; t++)
        assert_true(isfinite(r.displ[t]));
    sv_relief_finish(&r);
    return true;
}

static const struct {
    const char *name;
    bool (*one)(struct sv_rng *rng);
    long count;
} trials[] = {{"prewarp, points", try_point, 300000}, {"prewarp, two passes", try_two_pass, 120000},
              {"direct warp", try_direct, 120000},    {"self-shadow", try_self_shadow, 130000},
              {"row front", try_row_front, 130000},   {"cast shadows", try_cast, 60000},
              {"lighting", try_lighting, 80000},      {"depth conversions", try_depth, 60000}};

static void a_million_extreme_inputs(void **state)
{
    (void)state;
    long all = 0;
    for (size_t k = 0; k < sizeof trials / sizeof *trials; k++) {
        long taken = 0;
        extremes_doing = trials[k].name;
        for (extremes_case = 0; extremes_case < trials[k].count; extremes_case++) {
            struct sv_rng rng = sv_rng_seeded(EXTREMES_SEED + k, (uint64_t)extremes_case);
            taken += trials[k].one(&rng);
        }
        print_message("%-20s %7ld extreme inputs, %ld refused\n", trials[k].name, trials[k].count,
                      trials[k].count - taken);
        assert_true(taken * 2 > trials[k].count);
        all += trials[k].count;
    }
    print_message("%-20s %7ld\n", "in all", all);
    assert_true(all >= 1000000);
}

/* ---- towards the singular places ---- */

typedef long double real;

/* u_i by the ray from the eye through the texel, met with the plane. c = O - eye as the warp is given it. */
static real ray_u(const struct sv_relief_frame *f, struct sv_vec3 eye, double us, double vs, double d)
{
    real cx = (real)f->origin.x - eye.x, cy = (real)f->origin.y - eye.y, cz = (real)f->origin.z - eye.z;
    real x = us * (real)f->a.x + vs * (real)f->b.x + d * (real)f->f.x;
    real y = us * (real)f->a.y + vs * (real)f->b.y + d * (real)f->f.y;
    real z = us * (real)f->a.z + vs * (real)f->b.z + d * (real)f->f.z;
    real rx = cx + x, ry = cy + y, rz = cz + z;
    real t = (x * f->f.x + y * f->f.y + z * f->f.z) / (rx * f->f.x + ry * f->f.y + rz * f->f.z);
    real aa = (real)f->a.x * f->a.x + (real)f->a.y * f->a.y + (real)f->a.z * f->a.z;
    return ((x - t * rx) * f->a.x + (y - t * ry) * f->a.y + (z - t * rz) * f->a.z) / aa;
}

static void error_towards_the_plane(void **state)
{
    (void)state;
    enum { ROWS = 24, TRIES = 2000 };
    struct extremes_row rows[ROWS];
    struct sv_prewarp p;
    struct sv_error error;
    for (int k = 0; k <= ROWS; k++) {
        double sine = k < ROWS ? 0.9 * pow(10, -k / 4.0) : 0.5e-6;
        struct sv_rng rng = sv_rng_seeded(EXTREMES_SEED, 1000 + (uint64_t)k);
        if (k < ROWS)
            rows[k] = (struct extremes_row){sine, 0};
        for (int n = 0; n < TRIES; n++) {
            struct sv_relief_frame f = extremes_square_frame(&rng);
            double phi = sv_rng_range(&rng, 0, 2 * SV_PI), c = cos(phi), s = sin(phi),
                   flat = sqrt(1 - sine * sine);
            struct sv_vec3 side = sv_add(sv_scale(f.a, c), sv_scale(f.b, s / 1.5));
            struct sv_vec3 eye = sv_madd(sv_madd(f.origin, side, 500 * flat), f.f, 500 * sine);
            enum sv_status status = sv_prewarp_perspective(&f, eye, &p, &error);
            assert_int_equal(status, k < ROWS ? SV_OK : SV_EINVAL);
            double us = sv_rng_range(&rng, 0, 256), vs = sv_rng_range(&rng, 0, 256), u, v;
            double d = -500 * sine * sv_rng_range(&rng, 0, 3);
            if (status || !sv_prewarp_point(&p, us, vs, d, &u, &v))
                continue;
            real truth = ray_u(&f, eye, us, vs, d);
            rows[k].error = fmax(rows[k].error, (double)(fabsl(u - truth) / (1 + fabsl(truth))));
        }
    }
    extremes_judge(
        "pre-warp, eye towards the plane: sine of its angle, error of u_i in double against long double "
        "(of 1 + "
        "|u_i|); refused below 1e-6",
        "", rows, ROWS, 8, 1e-14, 1e-6);
}

static void error_towards_the_eye_s_own_plane(void **state)
{
    (void)state;
    enum { ROWS = 12, TRIES = 4000 };
    struct extremes_row rows[ROWS];
    struct sv_prewarp p;
    struct sv_error error;
    for (int k = 0; k <= ROWS; k++) {
        double tau = k < ROWS ? pow(10, -k / 4.0) : 0.0009;
        struct sv_rng rng = sv_rng_seeded(EXTREMES_SEED, 2000 + (uint64_t)k);
        if (k < ROWS)
            rows[k] = (struct extremes_row){tau, 0};
        for (int n = 0; n < TRIES; n++) {
            struct sv_relief_frame f = extremes_square_frame(&rng);
            double us = sv_rng_range(&rng, 0, 256), vs = sv_rng_range(&rng, 0, 256), u, v;
            struct sv_vec3 eye = sv_relief_point(&f, sv_rng_range(&rng, 0, 256), sv_rng_range(&rng, 0, 256),
                                                 sv_rng_range(&rng, 50, 100) * (n & 1 ? 1 : -1));
            assert_int_equal(sv_prewarp_perspective(&f, eye, &p, &error), SV_OK);
            float d = (float)((tau - 1) / p.k[2]);
            bool shown = sv_prewarp_point(&p, us, vs, d, &u, &v);
            assert_int_equal(shown, k < ROWS);
            if (!shown)
                continue;
            real truth = ray_u(&f, eye, us, vs, d);
            rows[k].error = fmax(rows[k].error, (double)fabsl(u - truth));
        }
    }
    extremes_judge("pre-warp, 1 + k3 displ towards 0: tau, error of u_i; not drawn below 2^-10", "texels",
                   rows, ROWS, 10, 1e-11, 1e-5);
}

/* The place in the picture, by long double from the same numbers. */
static void project_l(const struct sv_relief_frame *f, const struct sv_camera *c, double u, double v,
                      double d, real *px, real *py)
{
    real x = (real)f->origin.x - c->eye.x + u * (real)f->a.x + v * (real)f->b.x + d * (real)f->f.x;
    real y = (real)f->origin.y - c->eye.y + u * (real)f->a.y + v * (real)f->b.y + d * (real)f->f.y;
    real z = (real)f->origin.z - c->eye.z + u * (real)f->a.z + v * (real)f->b.z + d * (real)f->f.z;
    real depth = x * c->forward.x + y * c->forward.y + z * c->forward.z;
    real focal = 0.5L * c->height / tanl(0.5L * c->vfov_rad);
    *px = 0.5L * c->width + focal * (x * c->right.x + y * c->right.y + z * c->right.z) / depth;
    *py = 0.5L * c->height - focal * (x * c->up.x + y * c->up.y + z * c->up.z) / depth;
}

static void error_towards_the_surface(void **state)
{
    (void)state;
    enum { ROWS = 17, TRIES = 2000 };
    struct extremes_row rows[ROWS];
    for (int k = 0; k < ROWS; k++) {
        double near = pow(10, 2 - k / 2.0);
        struct sv_rng rng = sv_rng_seeded(EXTREMES_SEED, 3000 + (uint64_t)k);
        rows[k] = (struct extremes_row){near, 0};
        for (int n = 0; n < TRIES; n++) {
            struct sv_relief_frame f = extremes_square_frame(&rng);
            double u = sv_rng_range(&rng, 0, 256), v = sv_rng_range(&rng, 0, 256);
            float d = (float)sv_rng_range(&rng, -20, 20);
            struct sv_camera c = {.projection = SV_PROJECTION_PERSPECTIVE,
                                  .vfov_rad = 1,
                                  .width = 512,
                                  .height = 512,
                                  .near_m = 1e-9};
            sv_camera_aim(&c, sv_rng_range(&rng, 0, 6), sv_rng_range(&rng, -1.5, 1.5), 0);
            c.eye = sv_madd(sv_relief_point(&f, u, v, d), c.forward, -near);
            struct sv_warp_map map;
            sv_warp_map_from_camera(&f, &c, 0, 0, &map);
            double out[4];
            for (int m = 0; m < 4; m++)
                out[m] = map.m[m][0] * u + map.m[m][1] * v + map.m[m][2] * d + map.m[m][3];
            real px, py;
            project_l(&f, &c, u, v, d, &px, &py);
            /* at UTM coordinates the eye itself stands on a grid of 5e-10 m: the place may be off the picture
             */
            if (!(out[3] > 0) || fabsl(px - 256) > 256 || fabsl(py - 256) > 256)
                continue;
            double off = (double)fmaxl(fabsl(out[0] / out[3] - px), fabsl(out[1] / out[3] - py));
            rows[k].error = fmax(rows[k].error, off);
        }
    }
    extremes_judge("direct warp, eye towards the surface: m, error of the place in the picture", "px", rows,
                   ROWS, 8, 1e-10, 0.1);
}

/* Elevations from square to the plane to parallel to it; truth along one line of texels by long double. */
static void error_towards_square_and_parallel_light(void **state)
{
    (void)state;
    enum { N = 2048, FIELDS = 4 };
    static const double off_square[] = {0, 1e-9, 1e-6, 1e-3, 0.1, 1, 5, 20};
    static const double elevation[] = {45, 20, 5, 1, 0.1, 1e-3, 1e-6, 1e-9, 0};
    enum { SQUARE = sizeof off_square / sizeof *off_square, FLAT = sizeof elevation / sizeof *elevation };
    struct extremes_row wrong[SQUARE + FLAT], height[SQUARE + FLAT];
    struct sv_relief r;
    struct sv_error error;
    assert_int_equal(sv_relief_alloc(N, 1, &r, &error), SV_OK);
    r.frame =
        (struct sv_relief_frame){sv_vec3(0, 0, 0), sv_vec3(1, 0, 0), sv_vec3(0, 1, 0), sv_vec3(0, 0, 1)};
    uint8_t lit[N], lit_row[N];
    float shadow[N];
    for (int k = 0; k < SQUARE + FLAT; k++) {
        double degrees = k < SQUARE ? 90 - off_square[k] : elevation[k - SQUARE];
        /* near 90 the cosine is taken from the difference itself */
        double cosine = k < SQUARE ? sin(sv_radians(off_square[k])) : cos(sv_radians(degrees));
        double sine = k < SQUARE ? cos(sv_radians(off_square[k])) : sin(sv_radians(degrees));
        struct sv_rng rng = sv_rng_seeded(EXTREMES_SEED, 4000);
        wrong[k] = height[k] = (struct extremes_row){degrees, 0};
        long bad = 0;
        for (int n = 0; n < FIELDS; n++) {
            for (int i = 0; i < N; i++) {
                r.displ[i] = (float)(12 * sin(i * 0.02 * (n + 1)) + 5 * sin(i * 0.11) + sv_rng_unit(&rng));
                r.color[i][3] = 255;
            }
            sv_relief_measure(&r);
            struct sv_self_shadow_options options = {.travel = sv_vec3(cosine, 0, -sine)};
            struct sv_row_front field = {
                .width = N, .height = 1, .dx = 1, .dy = 1, .travel = options.travel, .height_m = r.displ};
            assert_int_equal(sv_self_shadow(&r, &options, lit, &error), SV_OK);
            assert_int_equal(sv_row_front(&field, shadow, NULL, lit_row, &error), SV_OK);
            real most = -INFINITY, in = -INFINITY;
            for (int i = 0; i < N; i++) {
                real g = (real)i * sine + (real)r.displ[i] * cosine, h = r.displ[i];
                bool dark = g < most;
                most = fmaxl(most, g);
                real top = fmaxl(h, in);
                bad += (lit[i] == 0) != dark;
                bad += (lit_row[i] == 0) != dark;
                height[k].error = fmax(height[k].error, (double)fabsl(shadow[i] - top));
                in = cosine > 0 ? top - (real)sine / cosine : -INFINITY;
            }
        }
        wrong[k].error = (double)bad / (2.0 * N * FIELDS);
    }
    extremes_judge(
        "self-shadow and row front, light from square (90) to parallel (0): degrees, share of texels that "
        "differ from "
        "long double",
        "", wrong, SQUARE + FLAT, 2, 0.002, 0.004);
    extremes_judge("row front: degrees, error of the shadow height (fields 36 m high)", "m", height,
                   SQUARE + FLAT, 10, 2e-5, 2e-3);
    sv_relief_finish(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_million_extreme_inputs),
        cmocka_unit_test(error_towards_the_plane),
        cmocka_unit_test(error_towards_the_eye_s_own_plane),
        cmocka_unit_test(error_towards_the_surface),
        cmocka_unit_test(error_towards_square_and_parallel_light),
    };
    return cmocka_run_group_tests(tests, extremes_set_up, NULL);
}
