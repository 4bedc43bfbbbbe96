/* test_relief_extremes.c - a million random extreme inputs to all of relief: eyes on, in and under reliefs,
 * lights in the plane and square to it, displ of 0, 1e9, NaN, infinite and denormal, textures of one texel,
 * texels of 1e-6 to 1e6 m, fields of view of 1 and 150 degrees, tiny pictures. What goes in and what comes
 * out lies between pages that may not be touched. Nothing that comes out is NaN or infinite, nothing crashes.
 * And tables of the error towards each singular place: it grows smoothly until the input is refused. */
#include <setjmp.h>
#include <signal.h>
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
#include "core/relief/build.h"
#include "core/relief/cast.h"
#include "core/relief/lighting.h"
#include "core/relief/prewarp.h"
#include "core/relief/row_front.h"
#include "core/relief/self_shadow.h"
#include "core/relief/warp.h"

enum { SEED = 97 };

/* ---- buffers between guard pages ---- */

enum { SLOT_DISPL, SLOT_COLOR, SLOT_NORMAL, SLOT_IN, SLOT_IN2, SLOT_OUT, SLOT_OUT2, SLOT_OUT3, SLOTS };
enum { PAGE = 4096, SLOT_PAGES = 2 };
static char *slots[SLOTS];

static const char *volatile doing = ""; /* for the handler of a fault */
static volatile long current;

static void on_fault(int number)
{
    char text[128];
    int n = snprintf(text, sizeof text, "signal %d in %s, seed %d, case %ld\n", number, doing, SEED, current);
    ssize_t written = write(STDERR_FILENO, text, (size_t)n);
    _exit(written > 0 ? 3 : 4);
}

static int set_up(void **state)
{
    (void)state;
    sv_color_init();
    signal(SIGSEGV, on_fault);
    signal(SIGBUS, on_fault);
    signal(SIGFPE, on_fault);
    for (int k = 0; k < SLOTS; k++) {
        char *p = mmap(NULL, (SLOT_PAGES + 2) * PAGE, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        if (p == MAP_FAILED || mprotect(p + PAGE, SLOT_PAGES * PAGE, PROT_READ | PROT_WRITE))
            return -1;
        slots[k] = p + PAGE;
    }
    return 0;
}

/* `bytes` that end (or begin) at a page that may not be touched. */
static void *guarded(struct sv_rng *rng, int slot, size_t bytes)
{
    assert_true(bytes <= SLOT_PAGES * PAGE);
    return sv_rng_next(rng) & 1 ? slots[slot] + SLOT_PAGES * PAGE - bytes : slots[slot];
}

/* ---- extreme values ---- */

static uint32_t pick(struct sv_rng *rng, uint32_t n)
{
    return (uint32_t)(sv_rng_next(rng) % n);
}

static double any_length(struct sv_rng *rng)
{
    static const double named[] = {1e-6, 1, 1e6};
    return pick(rng, 3) ? pow(10, sv_rng_range(rng, -6, 6)) : named[pick(rng, 3)];
}

static float any_displ(struct sv_rng *rng, double scale)
{
    static const float named[] = {0,     -0.0f,    1e9f,     -1e9f,     1e-42f, -1e-42f, NAN,
                                  3e38f, -3.4e38f, INFINITY, -INFINITY, 1e-30f, 1e6f,    -1e6f};
    if (pick(rng, 4) == 0)
        return named[pick(rng, sizeof named / sizeof *named)];
    return (float)(scale * sv_rng_range(rng, -20, 20));
}

static struct sv_vec3 any_unit(struct sv_rng *rng)
{
    static const double axis[6][3] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
    if (pick(rng, 3) == 0) {
        const double *a = axis[pick(rng, 6)];
        return sv_vec3(a[0], a[1], a[2]);
    }
    double z = sv_rng_range(rng, -1, 1), phi = sv_rng_range(rng, 0, 2 * SV_PI), r = sqrt(1 - z * z);
    return sv_vec3(r * cos(phi), r * sin(phi), z);
}

static struct sv_relief_frame any_frame(struct sv_rng *rng)
{
    struct sv_relief_frame f;
    struct sv_vec3 x, y;
    do {
        x = any_unit(rng);
        y = sv_cross(x, any_unit(rng));
    } while (sv_length(y) < 0.01);
    y = sv_normalize(y);
    f.a = sv_scale(x, any_length(rng));
    f.b = sv_scale(y, any_length(rng));
    f.f = sv_scale(sv_normalize(sv_cross(x, y)), sv_rng_next(rng) & 1 ? 1 : -1);
    f.origin = pick(rng, 3) ? sv_vec3(0, 0, 0) : sv_vec3(500000.25, 4e6, sv_rng_range(rng, -100, 100));
    return f;
}

static int any_side(struct sv_rng *rng)
{
    return pick(rng, 4) == 0 ? 1 : (int)(1 + pick(rng, pick(rng, 8) ? 6 : 16));
}

/* Arrays are guarded; nothing to free. */
static struct sv_relief any_relief(struct sv_rng *rng)
{
    struct sv_relief r = {.frame = any_frame(rng), .width = any_side(rng), .height = any_side(rng)};
    size_t n = (size_t)r.width * (size_t)r.height;
    double scale = pick(rng, 3) ? sv_length(r.frame.a) : any_length(rng);
    r.displ = guarded(rng, SLOT_DISPL, n * sizeof *r.displ);
    r.color = guarded(rng, SLOT_COLOR, n * sizeof *r.color);
    r.normal = guarded(rng, SLOT_NORMAL, n * sizeof *r.normal);
    bool tame = pick(rng, 4) == 0, see_through = pick(rng, 3) == 0;
    for (size_t t = 0; t < n; t++) {
        r.displ[t] = tame ? (float)(scale * sv_rng_range(rng, -3, 3)) : any_displ(rng, scale);
        for (int c = 0; c < 4; c++) {
            r.color[t][c] = (uint8_t)sv_rng_next(rng);
            r.normal[t][c] = (int16_t)sv_rng_next(rng);
        }
        if (!see_through)
            r.color[t][3] = 255;
    }
    r.cut = pick(rng, 3) == 0 ? INFINITY : (float)(scale * sv_rng_range(rng, 0.1, 10));
    sv_relief_measure(&r);
    return r;
}

/* On the plane, on a texel, a hair beside it, under it, far away, anywhere, NaN. */
static struct sv_vec3 any_eye(struct sv_rng *rng, const struct sv_relief *r)
{
    double u = sv_rng_range(rng, -1, r->width + 1.0), v = sv_rng_range(rng, -1, r->height + 1.0);
    double size = sv_length(r->frame.a) * r->width + sv_length(r->frame.b) * r->height, d = 0;
    size_t t = pick(rng, (uint32_t)(r->width * r->height));
    switch (pick(rng, 7)) { /* 0: on the plane */
    case 1:
        d = isfinite(r->displ[t]) ? r->displ[t] : 0;
        break;
    case 2:
        d = size * pow(10, sv_rng_range(rng, -12, 0));
        break;
    case 3:
        d = -size * pow(10, sv_rng_range(rng, -12, 0));
        break;
    case 4:
        d = size * pow(10, sv_rng_range(rng, 0, 6));
        break;
    case 5:
        return sv_madd(r->frame.origin, any_unit(rng), size * pow(10, sv_rng_range(rng, -6, 6)));
    case 6:
        d = pick(rng, 4) ? size : NAN;
    }
    return sv_relief_point(&r->frame, u, v, d);
}

/* ---- one input each: true unless it was refused ---- */

static bool try_point(struct sv_rng *rng)
{
    struct sv_relief r = {.frame = any_frame(rng), .width = 4, .height = 4};
    float displ[16] = {0};
    r.displ = displ;
    struct sv_prewarp p;
    struct sv_error error;
    struct sv_vec3 eye = any_eye(rng, &r);
    enum sv_status status = pick(rng, 2) ? sv_prewarp_perspective(&r.frame, eye, &p, &error)
                                         : sv_prewarp_parallel(&r.frame, any_unit(rng), &p, &error);
    if (status) {
        assert_int_equal(status, SV_EINVAL);
        return false;
    }
    for (int k = 0; k < 5; k++)
        assert_true(isfinite(p.k[k]));
    double u = 7, v = 7, us = pick(rng, 8) ? sv_rng_range(rng, -10, 10) : any_displ(rng, 1);
    if (sv_prewarp_point(&p, us, sv_rng_range(rng, -10, 10), any_displ(rng, any_length(rng)), &u, &v))
        assert_true(isfinite(u) && isfinite(v));
    else
        assert_true(u == 7 && v == 7);
    return true;
}

static bool try_two_pass(struct sv_rng *rng)
{
    struct sv_relief r = any_relief(rng);
    struct sv_prewarp p;
    struct sv_warped w;
    struct sv_error error;
    enum sv_status status = pick(rng, 2) ? sv_prewarp_perspective(&r.frame, any_eye(rng, &r), &p, &error)
                                         : sv_prewarp_parallel(&r.frame, any_unit(rng), &p, &error);
    if (status)
        return false;
    size_t n = (size_t)r.width * (size_t)r.height;
    uint8_t(*lit)[4] = guarded(rng, SLOT_IN, 4 * n);
    memset(lit, 99, 4 * n);
    struct sv_prewarp_options options = {.width = (int)pick(rng, 3) * any_side(rng),
                                         .height = (int)pick(rng, 3) * any_side(rng),
                                         .color = pick(rng, 2) ? (const uint8_t(*)[4])lit : NULL,
                                         .fill = pick(rng, 2),
                                         .order = (enum sv_prewarp_order)pick(rng, 3)};
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
    struct sv_relief r = any_relief(rng);
    struct sv_warp_buffer buffer = {0};
    struct sv_warp_stats stats = {0};
    struct sv_error error;
    struct sv_camera c = {.projection = pick(rng, 3) ? SV_PROJECTION_PERSPECTIVE : SV_PROJECTION_ORTHOGRAPHIC,
                          .vfov_rad = sv_radians(pick(rng, 2) ? 1 : 150),
                          .ortho_height_m = any_length(rng),
                          .width = any_side(rng),
                          .height = any_side(rng),
                          .near_m = pick(rng, 2) ? 0.1 : 1e-6,
                          .far_m = 1e5};
    do
        c.eye = any_eye(rng, &r);
    while (isnan(c.eye.x));
    struct sv_vec3 to = sv_sub(sv_relief_point(&r.frame, 0.5 * r.width, 0.5 * r.height, 0), c.eye);
    double heading = atan2(to.x, to.y), pitch = atan2(to.z, hypot(to.x, to.y));
    sv_camera_aim(&c, heading + (pick(rng, 2) ? sv_rng_range(rng, -1, 1) : 0), pitch,
                  sv_rng_range(rng, -3, 3));
    struct sv_warp_source source = {.width = r.width,
                                    .height = r.height,
                                    .t = r.displ,
                                    .color = (const uint8_t(*)[4])r.color,
                                    .cut = r.cut};
    sv_warp_map_from_camera(&r.frame, &c, 0, 0, &source.map);
    size_t n = (size_t)c.width * (size_t)c.height;
    uint8_t(*rgba)[4] = guarded(rng, SLOT_OUT, 4 * n);
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
    struct sv_relief r = any_relief(rng);
    size_t n = (size_t)r.width * (size_t)r.height;
    struct sv_error error;
    struct sv_self_shadow_options options = {.travel = any_unit(rng),
                                             .bias_m = pick(rng, 3) ? 0 : (float)any_length(rng),
                                             .special_cases = pick(rng, 2),
                                             .texels_alone = pick(rng, 2)};
    uint8_t *initial = guarded(rng, SLOT_IN, n), *lit = guarded(rng, SLOT_OUT, n);
    for (size_t t = 0; t < n; t++)
        initial[t] = (uint8_t)(pick(rng, 3) ? 255 : 0);
    if (pick(rng, 2))
        options.initial = initial;
    if (pick(rng, 50) == 0)
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
    int width = any_side(rng), height = any_side(rng);
    size_t n = (size_t)width * (size_t)height;
    float *heights = guarded(rng, SLOT_DISPL, n * 4), *initial = guarded(rng, SLOT_IN, n * 4);
    float *shadow = guarded(rng, SLOT_OUT, n * 4), *incoming = guarded(rng, SLOT_OUT2, n * 4);
    uint8_t *lit = guarded(rng, SLOT_OUT3, n);
    double scale = any_length(rng);
    for (size_t t = 0; t < n; t++) {
        heights[t] = any_displ(rng, scale);
        initial[t] = pick(rng, 2) ? SV_ROW_FRONT_NONE : any_displ(rng, scale);
        shadow[t] = incoming[t] = NAN;
    }
    struct sv_row_front field = {.width = width,
                                 .height = height,
                                 .dx = any_length(rng),
                                 .dy = any_length(rng),
                                 .travel = any_unit(rng),
                                 .height_m = heights,
                                 .initial = pick(rng, 2) ? initial : NULL,
                                 .bias_m = pick(rng, 2) ? 0 : (float)scale};
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
    struct sv_relief r = any_relief(rng);
    struct sv_silhouette s = {0};
    struct sv_error error;
    struct sv_vec3 travel = any_unit(rng);
    double size = sv_length(r.frame.a) * r.width + sv_length(r.frame.b) * r.height;
    double extent = pick(rng, 2000) ? size + (double)r.displ_max - (double)r.displ_min : size;
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
    struct sv_relief other = any_relief(rng);
    size_t n = (size_t)other.width * (size_t)other.height;
    uint8_t *dark = guarded(rng, SLOT_OUT, n);
    memset(dark, 255, n);
    status = sv_cast_shadow(&s, &other, pick(rng, 2) ? SV_CAST_PLANE : SV_CAST_HEIGHT, dark, &error);
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
    struct sv_relief r = any_relief(rng);
    size_t n = (size_t)r.width * (size_t)r.height;
    sv_relief_normals(&r);
    for (size_t t = 0; t < n; t++) {
        if (!sv_relief_solid(&r, t))
            continue;
        double x = r.normal[t][0], y = r.normal[t][1], z = r.normal[t][2];
        assert_true(z >= 0 && fabs(sqrt(x * x + y * y + z * z) - 32767) < 3);
    }
    struct sv_light light;
    struct sv_sun sun = {sv_rng_range(rng, 0, 7), pick(rng, 4) ? sv_rng_range(rng, -1.57, 1.57) : 0};
    sv_light_from_sun(&sun, &light);
    if (pick(rng, 3) == 0)
        light.to_sun = pick(rng, 2) ? r.frame.f : sv_normalize(r.frame.a);
    uint8_t *lit = guarded(rng, SLOT_IN, n);
    uint8_t(*rgba)[4] = guarded(rng, SLOT_OUT, 4 * n);
    memset(lit, 128, n);
    memset(rgba, 1, 4 * n);
    struct sv_relief_light options = {.light = &light,
                                      .frame = r.frame,
                                      .lit = pick(rng, 2) ? lit : NULL,
                                      .has_viewer = pick(rng, 2),
                                      .eye = any_eye(rng, &r),
                                      .specular = (float)sv_rng_range(rng, 0, 1),
                                      .shininess = pick(rng, 2) ? 1 : 1e4f};
    sv_relief_light(&r, &options, rgba);
    for (size_t t = 0; t < n; t++)
        assert_int_equal(rgba[t][3], r.color[t][3]);
    return true;
}

static bool try_depth(struct sv_rng *rng)
{
    struct sv_depth_form form = {(enum sv_depth_kind)pick(rng, 4), any_length(rng), 0};
    form.far_m = form.near_m * (1 + any_length(rng));
    double value = pick(rng, 2) ? sv_rng_unit(rng) : any_displ(rng, 1), z = sv_depth_linear(&form, value);
    double u, v, d, top = form.kind == SV_DEPTH_LINEAR ? HUGE_VAL : 1;
    assert_true(value >= 0 && value <= top ? z >= 0 : isnan(z));
    sv_depth_relief(any_length(rng), 512, sv_rng_range(rng, 0, 512), sv_rng_range(rng, 0, 512), z, &u, &v,
                    &d);
    assert_true(isfinite(z) ? isfinite(u) && isfinite(v) && isfinite(d) : isnan(u) && isnan(v) && isnan(d));
    int side = any_side(rng);
    size_t n = (size_t)side * (size_t)side;
    float *depth = guarded(rng, SLOT_IN, n * 4);
    for (size_t t = 0; t < n; t++)
        depth[t] = pick(rng, 2) ? (float)sv_rng_unit(rng) : any_displ(rng, 1);
    struct sv_relief_frame frame = any_frame(rng);
    struct sv_relief r;
    struct sv_error error;
    if (sv_relief_from_depth(&frame, side, side, depth, &form, any_length(rng), NULL, 1, &r, &error))
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
        doing = trials[k].name;
        for (current = 0; current < trials[k].count; current++) {
            struct sv_rng rng = sv_rng_seeded(SEED + k, (uint64_t)current);
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

struct row {
    double at;    /* the parameter that goes to its singular value */
    double error; /* the largest seen */
};

/* Prints a table; between neighbours the error may grow by `factor` at most (errors below `floor_error` count
 * as that), and stays below `bound` everywhere. */
static void judge(const char *what, const char *unit, const struct row *rows, int count, double factor,
                  double floor_error, double bound)
{
    print_message("%s\n", what);
    double before = 0;
    for (int k = 0; k < count; k++) {
        double now = fmax(rows[k].error, floor_error);
        print_message("  %12.4g   %10.3g %s%s\n", rows[k].at, rows[k].error, unit,
                      k > 0 && now > before * factor ? "   JUMPS" : "");
        assert_true(isfinite(rows[k].error));
        assert_true(k == 0 || now <= before * factor);
        assert_true(rows[k].error < bound);
        before = now;
    }
}

static struct sv_relief_frame square_frame(struct sv_rng *rng)
{
    struct sv_relief_frame f = any_frame(rng);
    f.a = sv_normalize(f.a);
    f.b = sv_scale(sv_normalize(f.b), 1.5);
    return f;
}

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
    struct row rows[ROWS];
    struct sv_prewarp p;
    struct sv_error error;
    for (int k = 0; k <= ROWS; k++) {
        double sine = k < ROWS ? 0.9 * pow(10, -k / 4.0) : 0.5e-6;
        struct sv_rng rng = sv_rng_seeded(SEED, 1000 + (uint64_t)k);
        if (k < ROWS)
            rows[k] = (struct row){sine, 0};
        for (int n = 0; n < TRIES; n++) {
            struct sv_relief_frame f = square_frame(&rng);
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
    judge("pre-warp, eye towards the plane: sine of its angle, error of u_i in double against long double "
          "(of 1 + "
          "|u_i|); refused below 1e-6",
          "", rows, ROWS, 8, 1e-14, 1e-6);
}

static void error_towards_the_eye_s_own_plane(void **state)
{
    (void)state;
    enum { ROWS = 12, TRIES = 4000 };
    struct row rows[ROWS];
    struct sv_prewarp p;
    struct sv_error error;
    for (int k = 0; k <= ROWS; k++) {
        double tau = k < ROWS ? pow(10, -k / 4.0) : 0.0009;
        struct sv_rng rng = sv_rng_seeded(SEED, 2000 + (uint64_t)k);
        if (k < ROWS)
            rows[k] = (struct row){tau, 0};
        for (int n = 0; n < TRIES; n++) {
            struct sv_relief_frame f = square_frame(&rng);
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
    judge("pre-warp, 1 + k3 displ towards 0: tau, error of u_i; not drawn below 2^-10", "texels", rows, ROWS,
          10, 1e-11, 1e-5);
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
    struct row rows[ROWS];
    for (int k = 0; k < ROWS; k++) {
        double near = pow(10, 2 - k / 2.0);
        struct sv_rng rng = sv_rng_seeded(SEED, 3000 + (uint64_t)k);
        rows[k] = (struct row){near, 0};
        for (int n = 0; n < TRIES; n++) {
            struct sv_relief_frame f = square_frame(&rng);
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
    judge("direct warp, eye towards the surface: m, error of the place in the picture", "px", rows, ROWS, 8,
          1e-10, 0.1);
}

/* Elevations from square to the plane to parallel to it; truth along one line of texels by long double. */
static void error_towards_square_and_parallel_light(void **state)
{
    (void)state;
    enum { N = 2048, FIELDS = 4 };
    static const double off_square[] = {0, 1e-9, 1e-6, 1e-3, 0.1, 1, 5, 20};
    static const double elevation[] = {45, 20, 5, 1, 0.1, 1e-3, 1e-6, 1e-9, 0};
    enum { SQUARE = sizeof off_square / sizeof *off_square, FLAT = sizeof elevation / sizeof *elevation };
    struct row wrong[SQUARE + FLAT], height[SQUARE + FLAT];
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
        struct sv_rng rng = sv_rng_seeded(SEED, 4000);
        wrong[k] = height[k] = (struct row){degrees, 0};
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
    judge("self-shadow and row front, light from square (90) to parallel (0): degrees, share of texels that "
          "differ from "
          "long double",
          "", wrong, SQUARE + FLAT, 2, 0.002, 0.004);
    judge("row front: degrees, error of the shadow height (fields 36 m high)", "m", height, SQUARE + FLAT, 10,
          2e-5, 2e-3);
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
    return cmocka_run_group_tests(tests, set_up, NULL);
}
