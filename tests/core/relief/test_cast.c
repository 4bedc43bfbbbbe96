/* test_cast.c - shadows of reliefs on reliefs (paper 1, 3.3.2) against a march of each receiver texel's ray
 * through the caster's bilinear surface, in double and in the caster's own axes; order of priority;
 * pin-holes; what is defined at the singular places. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/relief/cast.h"

enum { N = 96 };

typedef double (*shape)(double x, double y); /* -1 .. 1 across; NaN: empty */

static double flat(double x, double y)
{
    (void)x, (void)y;
    return 0;
}
static double disc(double x, double y)
{
    return x * x + y * y < 0.8 ? 0 : NAN;
}
static double ring(double x, double y)
{
    double r = hypot(x, y);
    return r < 0.9 && r > 0.45 ? 3 : NAN;
}
static double dome(double x, double y)
{
    double r = 1 - x * x - y * y;
    return r > 0 ? 14 * sqrt(r) : NAN;
}
static double steps(double x, double y)
{
    return 4 * floor(2.5 * x) + 3 * floor(2 * y);
}
static double waves(double x, double y)
{
    return 4 * sin(7 * x) * cos(5 * y);
}
static double blocks(double x, double y)
{
    return ((int)floor(4 * x + 8) + (int)floor(4 * y + 8)) & 1 ? 9 : -3;
}

static struct sv_vec3 turned(struct sv_vec3 p, double yaw, double tilt)
{
    struct sv_vec3 q = sv_vec3(p.x, p.y * cos(tilt) - p.z * sin(tilt), p.y * sin(tilt) + p.z * cos(tilt));
    return sv_vec3(q.x * cos(yaw) - q.y * sin(yaw), q.x * sin(yaw) + q.y * cos(yaw), q.z);
}

struct stand {
    shape shape;
    struct sv_vec3 middle;
    double yaw, tilt; /* degrees; 0, 0: f up */
    double texel_a, texel_b;
};

static struct sv_relief build(const struct stand *s)
{
    struct sv_relief r;
    assert_int_equal(sv_relief_alloc(N, N, &r, NULL), SV_OK);
    double yaw = sv_radians(s->yaw), tilt = sv_radians(s->tilt);
    r.frame.a = sv_scale(turned(sv_vec3(1, 0, 0), yaw, tilt), s->texel_a);
    r.frame.b = sv_scale(turned(sv_vec3(0, 1, 0), yaw, tilt), s->texel_b);
    r.frame.f = turned(sv_vec3(0, 0, 1), yaw, tilt);
    r.frame.origin = sv_madd(sv_madd(s->middle, r.frame.a, -0.5 * N), r.frame.b, -0.5 * N);
    for (int j = 0; j < N; j++)
        for (int i = 0; i < N; i++) {
            double d = s->shape(2 * (i + 0.5) / N - 1, 2 * (j + 0.5) / N - 1);
            r.displ[j * N + i] = isnan(d) ? 0 : (float)d;
            r.color[j * N + i][3] = isnan(d) ? 0 : 255;
        }
    sv_relief_measure(&r);
    return r;
}

static double displ_of(const struct sv_relief *r, int i, int j)
{
    size_t at = (size_t)j * (size_t)r->width + (size_t)i;
    return i >= 0 && j >= 0 && i < r->width && j < r->height && r->color[at][3] >= 128 ? (double)r->displ[at]
                                                                                       : NAN;
}

/* The caster's surface at (u, v): bilinear between centres; about a hole each texel's own box; NaN where
 * nothing is. */
static double surface(const struct sv_relief *r, double u, double v)
{
    double x = u - 0.5, y = v - 0.5;
    int i = (int)floor(x), j = (int)floor(y);
    double p = x - i, q = y - j, a = displ_of(r, i, j), b = displ_of(r, i + 1, j), c = displ_of(r, i, j + 1),
           d = displ_of(r, i + 1, j + 1);
    if (isnan(a) || isnan(b) || isnan(c) || isnan(d))
        return p < 0.5 ? (q < 0.5 ? a : c) : (q < 0.5 ? b : d);
    return (a * (1 - p) + b * p) * (1 - q) + (c * (1 - p) + d * p) * q;
}

/* Does the way from place to the light cross the caster's surface? */
static bool hidden(const struct sv_relief *r, struct sv_vec3 place, struct sv_vec3 travel)
{
    double u, v, d, u1, v1, d1, lo = 0, hi = 1e9;
    sv_relief_locate(&r->frame, place, &u, &v, &d);
    sv_relief_locate(&r->frame, sv_sub(place, travel), &u1, &v1, &d1);
    double at[3] = {u, v, d}, by[3] = {u1 - u, v1 - v, d1 - d};
    double low[3] = {0, 0, (double)r->displ_min - 0.01},
           high[3] = {r->width, r->height, (double)r->displ_max + 0.01};
    for (int k = 0; k < 3; k++) {
        if (fabs(by[k]) < 1e-12) {
            if (at[k] < low[k] || at[k] > high[k])
                return false;
            continue;
        }
        double t0 = (low[k] - at[k]) / by[k], t1 = (high[k] - at[k]) / by[k];
        lo = fmax(lo, fmin(t0, t1));
        hi = fmin(hi, fmax(t0, t1));
    }
    if (lo >= hi)
        return false;
    double fastest = fmax(fmax(fabs(by[0]), fabs(by[1])), 1e-9), step = fmin(0.05 / fastest, (hi - lo) / 4);
    double before = NAN;
    for (double t = lo;; t = fmin(t + step, hi)) {
        double s = surface(r, at[0] + t * by[0], at[1] + t * by[1]), above = at[2] + t * by[2] - s;
        if (above * before <= 0)
            return true;
        before = above;
        if (t >= hi)
            return false;
    }
}

struct configuration {
    const char *name;
    struct stand caster, receiver;
    struct sv_vec3 light;
};

static const struct configuration configurations[] = {
    {"plate over plate", {flat, {0, 0, 60}, 0, 0, .5, .5}, {flat, {20, 0, 0}, 0, 0, 1, 1}, {.3, .1, -1}},
    {"plate over plate, low light",
     {flat, {0, 0, 12}, 0, 0, .5, .5},
     {flat, {40, 5, 0}, 0, 0, 1, 1},
     {1, .2, -.35}},
    {"light square to both", {disc, {3, 4, 40}, 0, 0, .6, .6}, {flat, {0, 0, 0}, 0, 0, 1, 1}, {0, 0, -1}},
    {"disc over plate", {disc, {0, 0, 50}, 20, 0, .6, .6}, {flat, {20, 10, 0}, 0, 0, 1, 1}, {.5, .2, -1}},
    {"ring over plate", {ring, {0, 0, 50}, 0, 0, .7, .7}, {flat, {20, 10, 0}, 0, 0, 1, 1}, {.5, .3, -1}},
    {"ring over dome", {ring, {0, 0, 60}, 0, 0, .7, .7}, {dome, {20, 10, 0}, 0, 0, 1, 1}, {.4, .3, -1}},
    {"dome over plate", {dome, {0, 0, 40}, 0, 0, .7, .7}, {flat, {20, 10, 0}, 0, 0, 1, 1}, {.6, .2, -1}},
    {"dome over steps", {dome, {0, 0, 40}, 0, 0, .6, .6}, {steps, {20, 10, 0}, 0, 0, 1, 1}, {.6, .2, -1}},
    {"steps over plate", {steps, {0, 0, 50}, 0, 0, .6, .6}, {flat, {25, 5, 0}, 0, 0, 1, 1}, {.6, .2, -1}},
    {"steps over steps", {steps, {0, 0, 50}, 30, 0, .6, .6}, {steps, {25, 5, 0}, 0, 0, 1, 1}, {.5, .3, -1}},
    {"blocks over waves", {blocks, {0, 0, 50}, 0, 0, .6, .6}, {waves, {25, 5, 0}, 0, 0, 1, 1}, {.5, .3, -1}},
    {"tilted plate over plate",
     {flat, {0, 0, 50}, 30, 40, .6, .6},
     {flat, {20, 10, 0}, 0, 0, 1, 1},
     {.5, .3, -1}},
    {"tilted steps over dome",
     {steps, {0, 0, 60}, 30, 40, .5, .5},
     {dome, {20, 10, 0}, 0, 0, 1, 1},
     {.5, .3, -1}},
    {"plate over tilted waves",
     {flat, {0, 0, 70}, 0, 0, .5, .5},
     {waves, {10, 0, 0}, 50, 35, 1, 1},
     {.2, .3, -1}},
    {"upright plate on plate",
     {flat, {-20, 0, 24}, 90, 90, .5, .5},
     {flat, {20, 0, 0}, 0, 0, 1, 1},
     {1, .2, -.8}},
    {"upright dome on plate",
     {dome, {-20, 0, 30}, 90, 90, .5, .5},
     {flat, {20, 0, 0}, 0, 0, 1, 1},
     {1, .1, -.7}},
    {"upright waves on steps",
     {waves, {-30, 0, 40}, 90, 90, .5, .5},
     {steps, {20, 0, 0}, 0, 0, 1, 1},
     {1, .1, -.7}},
    {"plate on upright plate",
     {flat, {0, 0, 40}, 0, 0, .5, .5},
     {flat, {40, 0, 10}, 90, 90, 1, 1},
     {1, .1, -.6}},
    {"a face of a box on the next",
     {blocks, {0, 0, 48}, 0, 0, .6, .6},
     {waves, {44, 0, 0}, 90, 90, 1, 1},
     {.8, .1, -1}},
    {"crossing plates", {flat, {0, 0, 0}, 0, 50, 1, 1}, {flat, {0, 0, 0}, 0, 0, 1, 1}, {.2, .6, -1}},
    {"crossing dome", {dome, {0, 0, -5}, 0, 0, .8, .8}, {flat, {5, 0, 0}, 0, 0, 1, 1}, {.7, .1, -1}},
    {"texels 1:3 over plate",
     {waves, {0, 0, 50}, 10, 0, .3, .9},
     {flat, {20, 10, 0}, 0, 0, 1, 1.5},
     {.5, .2, -1}},
    {"caster seen from behind",
     {dome, {0, 0, 50}, 0, 180, .7, .7},
     {flat, {20, 10, 0}, 0, 0, 1, 1},
     {.5, .2, -1}},
    {"caster nearly edge-on",
     {waves, {0, 0, 50}, 0, 55, .7, .7},
     {flat, {0, 45, 0}, 0, 0, 1, 1},
     {0, 1, -1.2}},
    {"far away, large numbers",
     {dome, {500000, 4000000, 900}, 0, 0, .7, .7},
     {waves, {500020, 4000010, 850}, 0, 0, 1, 1},
     {.5, .2, -1}},
    {"caster behind receiver", {flat, {0, 0, -40}, 0, 0, 1, 1}, {waves, {0, 0, 0}, 0, 0, 1, 1}, {.2, .1, -1}},
};
enum { CONFIGURATIONS = sizeof configurations / sizeof configurations[0] };

static double agreement(const struct sv_relief *r, const uint8_t *truth, const uint8_t *dark)
{
    int same = 0, all = 0;
    for (int t = 0; t < N * N; t++)
        if (sv_relief_solid(r, (size_t)t)) {
            all++;
            same += truth[t] == dark[t];
        }
    return 100.0 * same / all;
}

static void cast_agrees_with_the_truth(void **state)
{
    (void)state;
    static uint8_t truth[N * N], dark[N * N];
    int missed = 0;
    double worst = 100, mean = 0;
    printf("%-30s %7s %9s %9s\n", "shadow of A on B", "dark %", "height %", "plane %");
    for (int k = 0; k < (int)CONFIGURATIONS; k++) {
        const struct configuration *c = &configurations[k];
        struct sv_relief a = build(&c->caster), b = build(&c->receiver);
        struct sv_vec3 l = sv_normalize(c->light);
        int hid = 0;
        for (int t = 0; t < N * N; t++) {
            struct sv_vec3 x =
                sv_relief_point(&b.frame, t % N + 0.5, (double)(t / N) + 0.5, (double)b.displ[t]);
            bool solid = sv_relief_solid(&b, (size_t)t), h = solid && hidden(&a, x, l);
            truth[t] = h ? 0 : 255;
            hid += h;
        }
        struct sv_silhouette s;
        double texel = fmin(c->caster.texel_a, c->caster.texel_b), score[2];
        assert_int_equal(sv_cast_silhouette(&a, l, texel, &s, NULL), SV_OK);
        for (int form = 0; form < 2; form++) {
            memset(dark, 255, sizeof dark);
            assert_int_equal(sv_cast_shadow(&s, &b, form ? SV_CAST_PLANE : SV_CAST_HEIGHT, dark, NULL),
                             SV_OK);
            score[form] = agreement(&b, truth, dark);
        }
        printf("%-30s %7.1f %9.2f %9.2f\n", c->name, 100.0 * hid / (N * N), score[0], score[1]);
        missed += score[0] < 97;
        worst = fmin(worst, score[0]);
        mean += score[0] / CONFIGURATIONS;
        sv_cast_silhouette_finish(&s);
        sv_relief_finish(&a);
        sv_relief_finish(&b);
    }
    printf("height form over %d configurations: worst %.2f %%, mean %.2f %%\n", (int)CONFIGURATIONS, worst,
           mean);
    assert_int_equal(missed, 0);
}

/* Marks what is not covered and can be reached from the picture's corner; returns how many pixels it marked.
 */
static int flood(const struct sv_silhouette *s, uint8_t *mark, int *stack)
{
    int n = 0, marked = 0, size = s->width * s->height;
    stack[n++] = 0;
    mark[0] = 1;
    while (n > 0) {
        int at = stack[--n];
        const int next[4] = {at % s->width ? at - 1 : -1, (at + 1) % s->width ? at + 1 : -1, at - s->width,
                             at + s->width};
        marked++;
        for (int k = 0; k < 4; k++)
            if (next[k] >= 0 && next[k] < size && !mark[next[k]] && !s->coverage[next[k]]) {
                mark[next[k]] = 1;
                stack[n++] = next[k];
            }
    }
    return marked;
}

/* A slanted, curved skin, magnified up to nine pixels a texel: what is not covered is outside. */
static void silhouettes_have_no_pin_holes(void **state)
{
    (void)state;
    int pixels = 0, holes = 0;
    for (int k = 0; k < 12; k++) {
        struct stand stand = {k & 1 ? waves : dome, {3, 4, 5}, 30.0 * k, 7.0 * k, 1, 1};
        struct sv_relief r = build(&stand);
        for (int t = 0; t < N * N; t++)
            r.color[t][3] = 255;
        sv_relief_measure(&r);
        struct sv_silhouette s;
        assert_int_equal(sv_cast_silhouette(&r, sv_normalize(sv_vec3(.2, .1, -1)), 0.11 + 0.1 * k, &s, NULL),
                         SV_OK);
        size_t n = (size_t)s.width * (size_t)s.height;
        uint8_t *mark = calloc(n, 1);
        int *stack = malloc(n * sizeof *stack), covered = 0;
        for (size_t t = 0; t < n; t++) {
            covered += s.coverage[t] != 0;
            assert_true(s.coverage[t] ? s.first[t] >= -1e-3f && s.first[t] <= (float)s.last_m + 1e-3f
                                      : s.first[t] == INFINITY);
        }
        holes += (int)n - covered - flood(&s, mark, stack);
        pixels += covered;
        free(mark);
        free(stack);
        sv_cast_silhouette_finish(&s);
        sv_relief_finish(&r);
    }
    printf("%d pixels covered, %d pin-holes\n", pixels, holes);
    assert_int_equal(holes, 0);
}

static void order_is_by_nearness_to_the_light(void **state)
{
    (void)state;
    struct stand stand[4] = {{flat, {0, 0, 5}, 0, 0, 1, 1},
                             {flat, {0, 0, 50}, 0, 0, 1, 1},
                             {flat, {0, 0, 5}, 90, 0, 1, 1},
                             {flat, {0, 0, -7}, 0, 0, 1, 1}};
    struct sv_relief r[4];
    const struct sv_relief *list[4];
    for (int k = 0; k < 4; k++) {
        r[k] = build(&stand[k]);
        list[k] = &r[k];
    }
    int order[4];
    static const int down[4] = {1, 0, 2, 3}, up[4] = {3, 0, 2, 1}; /* 0 and 2 tie: by index */
    assert_int_equal(sv_cast_order(list, 4, sv_vec3(0, 0, -1), order, NULL), SV_OK);
    assert_memory_equal(order, down, sizeof down);
    assert_int_equal(sv_cast_order(list, 4, sv_vec3(0, 0, 1), order, NULL), SV_OK);
    assert_memory_equal(order, up, sizeof up);
    for (int t = 0; t < N * N; t++)
        r[1].color[t][3] = 0;
    sv_relief_measure(&r[1]); /* empty: last */
    assert_int_equal(sv_cast_order(list, 4, sv_vec3(0, 0, -1), order, NULL), SV_OK);
    assert_int_equal(order[3], 1);
    struct sv_error e;
    assert_int_equal(sv_cast_order(list, 4, sv_vec3(0, 0, 2), order, &e), SV_EINVAL);
    assert_string_equal(e.field, "travel");
    /* an empty caster shades nothing, an empty receiver is not shaded */
    struct sv_silhouette s;
    static uint8_t dark[N * N];
    memset(dark, 255, sizeof dark);
    assert_int_equal(sv_cast_silhouette(&r[1], sv_vec3(0, 0, -1), 1, &s, NULL), SV_OK);
    assert_int_equal(sv_cast_shadow(&s, &r[0], SV_CAST_HEIGHT, dark, NULL), SV_OK);
    sv_cast_silhouette_finish(&s);
    assert_int_equal(sv_cast_silhouette(&r[0], sv_vec3(0, 0, 1), 1, &s, NULL), SV_OK);
    assert_int_equal(sv_cast_shadow(&s, &r[1], SV_CAST_HEIGHT, dark, NULL), SV_OK);
    for (int t = 0; t < N * N; t++)
        assert_int_equal(dark[t], 255);
    sv_cast_silhouette_finish(&s);
    assert_int_equal(sv_cast_silhouette(&r[0], sv_vec3(0, 0, -1), 0, &s, &e), SV_EINVAL);
    assert_string_equal(e.field, "texel_m");
    for (int k = 0; k < 4; k++)
        sv_relief_finish(&r[k]);
}

/* The receiver's plane holds the light, or the caster's does: finite answers, bytes 0 or 255, nothing written
 * outside. */
static void extremes_are_answered(void **state)
{
    (void)state;
    static const float odd[] = {0, 1, -3, 1e9f, -1e9f, 1e-40f, NAN, INFINITY, -INFINITY, 7};
    struct sv_rng rng = sv_rng_seeded(77, 2);
    for (int k = 0; k < 20000; k++) {
        float displ[2][36];
        uint8_t color[2][36][4], dark[36];
        struct sv_relief r[2];
        for (int n = 0; n < 2; n++) {
            double yaw = sv_rng_range(&rng, 0, 7),
                   tilt = k % 3 ? sv_rng_range(&rng, 0, 7) : SV_PI / 2 * (k % 4);
            double scale = pow(10, sv_rng_range(&rng, -5, 5));
            r[n] = (struct sv_relief){
                .frame = {.origin = sv_vec3(sv_rng_range(&rng, -9, 9), 1, 2),
                          .a = sv_scale(turned(sv_vec3(1, 0, 0), yaw, tilt), scale),
                          .b = sv_scale(turned(sv_vec3(0, 1, 0), yaw, tilt), k % 2 ? scale : 1),
                          .f = turned(sv_vec3(0, 0, k % 7 ? 1 : -1), yaw, tilt)},
                .width = 1 + (int)(sv_rng_next(&rng) % 6),
                .height = 1 + (int)(sv_rng_next(&rng) % 6),
                .displ = displ[n],
                .color = color[n],
                .cut = k % 5 ? INFINITY : 1};
            for (int t = 0; t < 36; t++) {
                displ[n][t] = k % 2 ? odd[sv_rng_next(&rng) % 10] : (float)sv_rng_range(&rng, -2, 2);
                color[n][t][3] = sv_rng_next(&rng) % 5 ? 255 : 0;
            }
            sv_relief_measure(&r[n]);
        }
        struct sv_vec3 l =
            sv_vec3(sv_rng_range(&rng, -1, 1), sv_rng_range(&rng, -1, 1), sv_rng_range(&rng, -1, 1));
        if (k % 4 == 0)
            l = sv_vec3(0, 0, k & 8 ? 1 : -1);
        if (k % 9 == 0)
            l = r[0].frame.a;
        struct sv_silhouette s;
        /* about 40 pixels a side: the extent is a few texels, or the displ */
        double reach = sv_length(r[0].frame.a) + sv_length(r[0].frame.b) + (double)r[0].displ_max -
                       (double)r[0].displ_min;
        assert_int_equal(sv_cast_silhouette(&r[0], sv_normalize(l), reach / 8, &s, NULL), SV_OK);
        memset(dark, 255, sizeof dark);
        assert_int_equal(sv_cast_shadow(&s, &r[1], k % 2 ? SV_CAST_HEIGHT : SV_CAST_PLANE, dark, NULL),
                         SV_OK);
        for (int t = 0; t < 36; t++)
            assert_true(dark[t] == 255 ||
                        (dark[t] == 0 && t < r[1].width * r[1].height && sv_relief_solid(&r[1], (size_t)t)));
        for (int t = 0; t < s.width * s.height; t++)
            assert_true(!isnan(s.first[t]) && (s.coverage[t] == 255) == isfinite(s.first[t]));
        sv_cast_silhouette_finish(&s);
    }
}

/* A body k times as large has a silhouette k times as large: up to the largest displ that there are, where
 * depths, which are up to twice that, are held at 1e38 m; nothing covered is infinite. */
static void vast_bodies_are_cast_like_small_ones(void **state)
{
    (void)state;
    enum { SIDE = 24 };
    static const double scales[] = {1, 1e9, 1e25, 6e36, 3e37};
    static const double lights[][3] = {{0.3, 0.2, -1}, {-0.5, 0.4, 0.6}, {0, 0, -1}, {1, 0.3, 0.02}};
    for (size_t n = 0; n < sizeof lights / sizeof *lights; n++) {
        struct sv_silhouette small = {0};
        for (size_t k = 0; k < sizeof scales / sizeof *scales; k++) {
            struct sv_silhouette s;
            struct sv_relief r;
            double scale = scales[k];
            long off = 0, covered = 0, held = 0;
            assert_int_equal(sv_relief_alloc(SIDE, SIDE, &r, NULL), SV_OK);
            r.frame =
                (struct sv_relief_frame){{0, 0, 0}, {scale, 0, 0}, {0, scale, 0}, {0, 0, n & 1 ? -1 : 1}};
            for (int t = 0; t < SIDE * SIDE; t++) {
                r.displ[t] = (float)(scale * (11 * sin(0.4 * (t % SIDE)) * cos(0.3 * (t / SIDE))));
                r.color[t][3] = 255;
            }
            sv_relief_measure(&r);
            struct sv_vec3 l = sv_normalize(sv_vec3(lights[n][0], lights[n][1], lights[n][2]));
            assert_int_equal(sv_cast_silhouette(&r, l, 0.25 * scale, &s, NULL), SV_OK);
            if (k == 0)
                small = s;
            assert_true(s.width == small.width && s.height == small.height);
            for (int t = 0; t < s.width * s.height; t++) {
                bool there = s.coverage[t] == 255;
                assert_true(there == isfinite(s.first[t]));
                covered += there;
                if (there != (small.coverage[t] == 255)) {
                    off++;
                    continue;
                }
                double want = fmin(scale * (double)small.first[t], 1e38);
                held += there && want == 1e38;
                /* a cell may reach from before to beyond: what is between its corners is a mean of both */
                bool beyond = want + 5 * scale > 1e38;
                off += there &&
                       (beyond ? (double)s.first[t] > 1e38 : fabs((double)s.first[t] - want) > 1e-4 * scale);
            }
            printf("light %zu, scale %g: %ld pixels, %ld held, %ld otherwise\n", n, scale, covered, held,
                   off);
            assert_true(covered > 1000 && off * 500 <= covered);
            sv_relief_finish(&r);
            if (k > 0)
                sv_cast_silhouette_finish(&s);
        }
        sv_cast_silhouette_finish(&small);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cast_agrees_with_the_truth),
        cmocka_unit_test(silhouettes_have_no_pin_holes),
        cmocka_unit_test(order_is_by_nearness_to_the_light),
        cmocka_unit_test(extremes_are_answered),
        cmocka_unit_test(vast_bodies_are_cast_like_small_ones),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
