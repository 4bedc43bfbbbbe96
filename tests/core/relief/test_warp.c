/* test_warp.c - the direct warp against brute force: every cell's triangles tested against every pixel centre
 * in long double; places, colours, holes. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "core/relief/warp_kernel.h"
#include "tests/core/relief/warp_scenes.h"

static const struct sv_vec3 place = {.x = 412345.5, .y = 4123456.25, .z = 310};

/* --- maps --- */

/* clip coordinates are O(1) times w; sums of products of size |eye - O| / w * 1e-16: 1e-6 px leaves a factor
 * of 100. */
static void test_map_is_the_camera(void **state)
{
    (void)state;
    uint64_t seed = 7;
    int seen = 0;
    double worst = 0, worst_d = 0;
    for (int round = 0; round < 20000; round++) {
        struct sv_vec3 front =
            sv_vec3(scene_uniform(&seed, -1, 1), scene_uniform(&seed, -1, 1), scene_uniform(&seed, -1, 1));
        struct sv_relief_frame frame = scene_frame(64, 32, place, front);
        frame.a = sv_scale(frame.a, scene_uniform(&seed, 0.1, 3));
        frame.b = sv_scale(frame.b, scene_uniform(&seed, -3, -0.1));
        struct sv_camera camera = scene_camera(
            &frame, place, scene_uniform(&seed, 20, 2000), scene_uniform(&seed, 0, 1.4),
            scene_uniform(&seed, -3, 3), scene_uniform(&seed, -3, 3), 640, 360, scene_uniform(&seed, 0.1, 9));
        camera.projection = round & 1 ? SV_PROJECTION_ORTHOGRAPHIC : SV_PROJECTION_PERSPECTIVE;
        double sx = scene_uniform(&seed, -0.49, 0.49), sy = scene_uniform(&seed, -0.49, 0.49);
        struct sv_warp_map map;
        sv_warp_map_from_camera(&frame, &camera, sx, sy, &map);
        double u = scene_uniform(&seed, 0, 64), v = scene_uniform(&seed, 0, 32),
               t = scene_uniform(&seed, -9, 9), h[4];
        for (int k = 0; k < 4; k++)
            h[k] = map.m[k][0] * u + map.m[k][1] * v + map.m[k][2] * t + map.m[k][3];
        double px, py, z;
        if (!sv_camera_project(&camera, sv_relief_point(&frame, u, v, t), &px, &py, &z))
            continue;
        double depth = round & 1 ? (1 - h[2] / h[3]) * camera.far_m : camera.near_m / (h[2] / h[3]);
        seen++;
        worst = fmax(worst, fmax(fabs(h[0] / h[3] + sx - px), fabs(h[1] / h[3] + sy - py)));
        worst_d = fmax(worst_d, fabs(depth - z));
    }
    print_message("map against sv_camera_project: %d points, worst %.2g px, %.2g m of depth\n", seen, worst,
                  worst_d);
    assert_true(seen > 15000);
    assert_true(worst < 1e-6 && worst_d < 1e-8);
}

/* --- coverage against brute force --- */

typedef long double real;
struct point {
    real x, y, d;
};

static bool true_project(const struct sv_warp_source *s, real u, real v, real t, struct point *p)
{
    real h[4];
    for (int k = 0; k < 4; k++)
        h[k] = s->map.m[k][0] * u + s->map.m[k][1] * v + s->map.m[k][2] * t + s->map.m[k][3];
    if (!(h[3] > 0))
        return false;
    *p = (struct point){h[0] / h[3], h[1] / h[3], h[2] / h[3]};
    return p->d >= 0 && p->d <= 1;
}

struct truth {
    int width, height;
    real *nearest; /* of surfaces that cover the centre well inside; < 0: none */
    real *allowed; /* the largest d that any surface within `grow` px has; < 0: none */
    real grow;
};

/* How far inside of the triangle (px; negative: outside) a place is. */
static real inside_by(const struct point p[3], real x, real y)
{
    real best = 1e30L;
    real turn = (p[1].x - p[0].x) * (p[2].y - p[0].y) - (p[2].x - p[0].x) * (p[1].y - p[0].y) < 0 ? -1 : 1;
    for (int k = 0; k < 3; k++) {
        const struct point *a = &p[k], *b = &p[(k + 1) % 3];
        real ex = b->x - a->x, ey = b->y - a->y, length = hypotl(ex, ey);
        if (length > 0)
            best = fminl(best, turn * (ex * (y - a->y) - ey * (x - a->x)) / length);
    }
    return best;
}

static int clipped(real v, int size)
{
    return v < 0 ? 0 : v > size ? size : (int)v;
}

/* A triangle of a patch whose d runs from low to high: what is drawn of it lies between. */
static void truth_triangle(struct truth *truth, const struct point *a, const struct point *b,
                           const struct point *c, real low, real high)
{
    const struct point p[3] = {*a, *b, *c};
    real x0 = fminl(a->x, fminl(b->x, c->x)) - truth->grow, x1 = fmaxl(a->x, fmaxl(b->x, c->x)) + truth->grow;
    real y0 = fminl(a->y, fminl(b->y, c->y)) - truth->grow, y1 = fmaxl(a->y, fmaxl(b->y, c->y)) + truth->grow;
    for (int j = clipped(y0 - 1, truth->height); j < clipped(y1 + 1, truth->height); j++)
        for (int i = clipped(x0 - 1, truth->width); i < clipped(x1 + 1, truth->width); i++) {
            real x = i + 0.5L, y = j + 0.5L;
            if (x < x0 || x > x1 || y < y0 || y > y1)
                continue;
            size_t at = (size_t)j * (size_t)truth->width + (size_t)i;
            real by = inside_by(p, x, y);
            if (by >= -truth->grow)
                truth->allowed[at] = fmaxl(truth->allowed[at], high);
            if (by >= 1e-3L)
                truth->nearest[at] = fmaxl(truth->nearest[at], low);
        }
}

static void truth_patch(struct truth *truth, const struct point p[4])
{
    real low = fminl(fminl(p[0].d, p[1].d), fminl(p[2].d, p[3].d));
    real high = fmaxl(fmaxl(p[0].d, p[1].d), fmaxl(p[2].d, p[3].d));
    truth_triangle(truth, &p[0], &p[1], &p[2], low, high);
    truth_triangle(truth, &p[0], &p[2], &p[3], low, high);
}

static bool is_joined(const struct sv_warp_source *s, int i0, int j0, int i1, int j1)
{
    size_t a = (size_t)j0 * (size_t)s->width + (size_t)i0, b = (size_t)j1 * (size_t)s->width + (size_t)i1;
    return fabsf(s->t[a] - s->t[b]) <= s->cut && s->color[a][3] >= 128 && s->color[b][3] >= 128;
}

static bool is_there(const struct sv_warp_source *s, int i, int j)
{
    size_t at = (size_t)j * (size_t)s->width + (size_t)i;
    return i >= 0 && j >= 0 && i < s->width && j < s->height && s->color[at][3] >= 128 && isfinite(s->t[at]);
}

/* Cell (i, j) by the words of warp.h: two triangles when it is whole; else of each texel its quarter, to the
 * middles of the edges (at the mean t where joined) and to the cell's middle (at the mean of what hangs
 * together). */
static void truth_cell(const struct sv_warp_source *s, int i, int j, struct truth *truth)
{
    bool there[4], edge[4][4] = {{false}};
    real t[4] = {0};
    unsigned set[4];
    for (int k = 0; k < 4; k++) {
        int c = i + (k & 1), r = j + (k >> 1);
        there[k] = is_there(s, c, r);
        t[k] = there[k] ? s->t[(size_t)r * (size_t)s->width + (size_t)c] : 0;
        set[k] = 1u << k;
    }
    for (int a = 0; a < 4; a++)
        for (int way = 1; way <= 2; way++) {
            int b = a ^ way;
            edge[a][b] =
                there[a] && there[b] && is_joined(s, i + (a & 1), j + (a >> 1), i + (b & 1), j + (b >> 1));
        }
    for (int pass = 0; pass < 4; pass++)
        for (int a = 0; a < 4; a++)
            for (int b = 0; b < 4; b++)
                set[a] |= edge[a][b] ? set[b] : 0;
    struct point p[4];
    real u = i + 0.5L, v = j + 0.5L;
    if (edge[0][1] && edge[0][2] && edge[1][3] && edge[2][3]) {
        if (true_project(s, u, v, t[0], &p[0]) && true_project(s, u + 1, v, t[1], &p[1]) &&
            true_project(s, u + 1, v + 1, t[3], &p[2]) && true_project(s, u, v + 1, t[2], &p[3]))
            truth_patch(truth, p);
        return;
    }
    for (int k = 0; k < 4; k++) {
        real sum = 0, n = 0, ku = u + (k & 1), kv = v + (k >> 1);
        for (int b = 0; b < 4; b++)
            if (set[k] >> b & 1) {
                sum += t[b];
                n++;
            }
        if (there[k] && true_project(s, ku, kv, t[k], &p[0]) &&
            true_project(s, u + 0.5L, kv, edge[k][k ^ 1] ? (t[k] + t[k ^ 1]) / 2 : t[k], &p[1]) &&
            true_project(s, u + 0.5L, v + 0.5L, sum / n, &p[2]) &&
            true_project(s, ku, v + 0.5L, edge[k][k ^ 2] ? (t[k] + t[k ^ 2]) / 2 : t[k], &p[3]))
            truth_patch(truth, p);
    }
}

struct verdict {
    long covered, drawn, pin_holes, grown, behind, before;
};

static void judge(const struct sv_warp_source *s, int width, int height, real grow, enum sv_simd level,
                  struct verdict *v)
{
    size_t n = (size_t)width * (size_t)height;
    struct truth truth = {width, height, malloc(n * sizeof(real)), malloc(n * sizeof(real)), grow};
    struct sv_warp_buffer buffer;
    struct sv_warp_stats stats = {0};
    assert_int_equal(sv_warp_buffer_create(width, height, &buffer, NULL), SV_OK);
    for (size_t i = 0; i < n; i++)
        truth.nearest[i] = truth.allowed[i] = -1;
    for (int j = -1; j < s->height; j++)
        for (int i = -1; i < s->width; i++)
            truth_cell(s, i, j, &truth);
    sv_warp_splat_at(level, s, 0, &buffer, &stats);
    long drawn = 0;
    for (size_t i = 0; i < n; i++) {
        bool holds = buffer.texel[i] != SV_WARP_EMPTY;
        drawn += holds;
        v->covered += truth.nearest[i] >= 0;
        v->pin_holes += truth.nearest[i] >= 0 && !holds;
        v->grown += holds && truth.allowed[i] < 0;
        /* float positions are right to 2^-24 of sums: 1e-5 of a depth is far above that */
        v->behind += holds && truth.nearest[i] >= 0 && buffer.depth[i] < truth.nearest[i] * (1 - 1e-5L);
        v->before += holds && truth.allowed[i] >= 0 && buffer.depth[i] > truth.allowed[i] * (1 + 1e-5L);
    }
    assert_int_equal(drawn, stats.pixels);
    v->drawn += drawn;
    free(truth.nearest);
    free(truth.allowed);
    sv_warp_buffer_finish(&buffer);
}

static void check_shape(enum scene_shape shape, real grow_texel, const char *name)
{
    static const double px[] = {0.3, 0.7, 1.0, 1.5, 2.5, 4.0, 8.0};
    uint64_t seed = 11;
    for (size_t m = 0; m < sizeof px / sizeof *px; m++) {
        struct verdict v = {0};
        for (int pose = 0; pose < 8; pose++) {
            int side = px[m] > 3 ? 14 : px[m] > 1.2 ? 32 : 60;
            struct sv_warp_source s =
                posed(shape, side, side - 3, scene_uniform(&seed, 0, 1.35), scene_uniform(&seed, -3, 3),
                      scene_uniform(&seed, -3, 3), px[m], 72, seed);
            judge(&s, 72, 72, fmaxl(0.02L, grow_texel * px[m]), (enum sv_simd)(pose % level_count()), &v);
            scene_finish(&s);
        }
        print_message("%s at %.1f px a texel: %ld covered, %ld drawn, pin-holes %ld, grown %ld, too far %ld, "
                      "too near %ld\n",
                      name, px[m], v.covered, v.drawn, v.pin_holes, v.grown, v.behind, v.before);
        assert_true(v.covered > 500);
        assert_int_equal(v.pin_holes, 0);
        assert_int_equal(v.grown, 0);
        assert_int_equal(v.behind, 0);
        assert_int_equal(v.before, 0);
    }
}

/* A fast cell may be drawn SV_WARP_TWIST = 1/8 of a texel too wide, up to 6 px in size: less than half a
 * pixel up to 4 px a texel, and exact beyond. Perspective may make a texel up to twice as large as in the
 * middle. */
static void test_smooth_has_no_pin_holes(void **state)
{
    (void)state;
    check_shape(SCENE_FLAT, 0.016L, "flat");
    check_shape(SCENE_SMOOTH, 0.125L, "smooth");
    check_shape(SCENE_STEPPED, 0.125L, "stepped");
}

static void test_noise_has_no_pin_holes(void **state)
{
    (void)state;
    check_shape(SCENE_NOISE, 0.125L, "noise");
}

/* Footprints: a lone texel and a 1 x 1 texture cover half a texel to each side: to 1/64 of a texel
 * where that is small (6 px: 0.1 px), exactly where it is large. */
static void test_footprints(void **state)
{
    (void)state;
    uint64_t seed = 5;
    struct verdict v = {0};
    for (int round = 0; round < 60; round++) {
        int width = round < 20 ? 1 : 1 + (int)scene_uniform(&seed, 0, 9);
        int height = round < 20 ? 1 : 1 + (int)scene_uniform(&seed, 0, 9);
        struct sv_warp_source s =
            posed(SCENE_FLAT, width, height, scene_uniform(&seed, 0, 1.2), scene_uniform(&seed, -3, 3),
                  scene_uniform(&seed, -3, 3), scene_uniform(&seed, 0.6, 30), 64, seed);
        uint8_t(*color)[4] = (uint8_t(*)[4])(uintptr_t)s.color;
        float *t = (float *)(uintptr_t)s.t;
        for (int k = 0; k < width * height; k++) {
            color[k][3] = width > 1 && scene_uniform(&seed, 0, 1) < 0.3 ? 127 : 128;
            t[k] = width > 1 && scene_uniform(&seed, 0, 1) < 0.3 ? 5.0f : 0; /* torn from the others */
        }
        judge(&s, 64, 64, 0.1L, (enum sv_simd)(round % level_count()), &v);
        scene_finish(&s);
    }
    print_message("footprints: %ld covered, %ld drawn, pin-holes %ld, grown %ld, too far %ld, too near %ld\n",
                  v.covered, v.drawn, v.pin_holes, v.grown, v.behind, v.before);
    assert_true(v.covered > 5000);
    assert_int_equal(v.pin_holes + v.grown + v.behind + v.before, 0);
}

/* --- places and colours --- */

static real bilinear_t(const struct sv_warp_source *s, real u, real v)
{
    int i = (int)floorl(u - 0.5L), j = (int)floorl(v - 0.5L);
    i = i < 0 ? 0 : i > s->width - 2 ? s->width - 2 : i;
    j = j < 0 ? 0 : j > s->height - 2 ? s->height - 2 : j;
    real a = u - 0.5L - i, b = v - 0.5L - j;
    const float *t = s->t + (size_t)j * (size_t)s->width + (size_t)i;
    return (t[0] * (1 - a) + t[1] * a) * (1 - b) + (t[s->width] * (1 - a) + t[s->width + 1] * a) * b;
}

/* Splat, resolve, locate on smooth reliefs: the located place projects back to the pixel's centre within 0.01
 * texel, and the colour is the bilinear one there. place[] holds 1/256 and 1/128 texel; colours run over less
 * than 6 levels a texel: 2 levels are rounding and place together. */
static void test_locate_and_resolve(void **state)
{
    (void)state;
    uint64_t seed = 3;
    double worst_texel = 0, worst_level = 0, worst_depth = 0;
    long seen = 0;
    for (int round = 0; round < 24; round++) {
        double px = scene_uniform(&seed, 0.5, 9);
        struct sv_warp_source s =
            posed(SCENE_SMOOTH, 64, 60, scene_uniform(&seed, 0, 1), scene_uniform(&seed, -3, 3),
                  scene_uniform(&seed, -3, 3), px, 128, seed);
        uint8_t(*color)[4] = (uint8_t(*)[4])(uintptr_t)s.color;
        for (int k = 0; k < 64 * 60; k++)
            color[k][2] = (uint8_t)(k % 64 + k / 64);
        struct sv_warp_buffer buffer;
        struct sv_warp_stats stats = {0};
        static uint8_t rgba[128 * 128][4];
        static float depth[128 * 128];
        assert_int_equal(sv_warp_buffer_create(128, 128, &buffer, NULL), SV_OK);
        enum sv_simd level = (enum sv_simd)(round % level_count());
        sv_warp_splat_at(level, &s, 0, &buffer, &stats);
        sv_warp_resolve_at(level, &s, 1, &buffer, rgba);
        sv_warp_resolve_depth(&s, &buffer, depth);
        for (int p = 0; p < 128 * 128; p++) {
            double u, v;
            if (!sv_warp_locate(&s, &buffer, p % 128, p / 128, &u, &v) || !(buffer.place[p] & 1))
                continue;
            struct point here, right, down;
            real t = bilinear_t(&s, u, v);
            if (!true_project(&s, u, v, t, &here) ||
                !true_project(&s, u + 0.01L, v, bilinear_t(&s, u + 0.01L, v), &right) ||
                !true_project(&s, u, v + 0.01L, bilinear_t(&s, u, v + 0.01L), &down))
                continue;
            real ax = (right.x - here.x) * 100, ay = (right.y - here.y) * 100, bx = (down.x - here.x) * 100;
            real by = (down.y - here.y) * 100, det = ax * by - ay * bx, x = p % 128 + 0.5L - here.x;
            real y = p / 128 + 0.5L - here.y;
            if (fabsl(det) < 0.2L * px * px)
                continue; /* nearly edge-on: a place is not well defined by a pixel */
            seen++;
            worst_texel = fmax(worst_texel, (double)(fabsl(x * by - y * bx) / fabsl(det)));
            worst_texel = fmax(worst_texel, (double)(fabsl(y * ax - x * ay) / fabsl(det)));
            worst_depth = fmax(worst_depth, (double)fabsl(depth[p] / here.d - 1));
            double level_u = 255 * u / 64, level_v = 255 * v / 60, level_b = u - 0.5 + v - 0.5;
            worst_level = fmax(worst_level, fabs(rgba[p][0] - level_u));
            worst_level = fmax(worst_level, fabs(rgba[p][1] - level_v));
            worst_level = fmax(worst_level, fabs(rgba[p][2] - level_b));
        }
        scene_finish(&s);
        sv_warp_buffer_finish(&buffer);
    }
    print_message("%ld pixels: located to %.4f texel, refined depth to %.2g, colours to %.2f levels\n", seen,
                  worst_texel, worst_depth, worst_level);
    assert_true(seen > 50000);
    assert_true(worst_texel < 0.01);
    /* half of 1 / 128 texel, on a surface that recedes by up to 5 texels a texel some 100 texels away */
    assert_true(worst_depth < 3e-4);
    assert_true(worst_level < 2);
}

static void test_resolve_int16(void **state)
{
    (void)state;
    struct sv_warp_source s = posed(SCENE_STEPPED, 40, 40, 0.4, 0.3, 0.2, 2.3, 96, 1);
    struct sv_warp_buffer buffer;
    struct sv_warp_stats stats = {0};
    int16_t(*image)[4] = malloc(1600 * sizeof *image);
    int16_t(*out)[4] = calloc(96 * 96, sizeof *out);
    for (int k = 0; k < 1600; k++)
        for (int c = 0; c < 4; c++)
            image[k][c] = (int16_t)(c == 0   ? 32767
                                    : c == 1 ? -32768
                                    : c == 2 ? 500 * (k % 40)
                                             : 500 * (k / 40));
    const int16_t(*images[1])[4] = {(const void *)image};
    assert_int_equal(sv_warp_buffer_create(96, 96, &buffer, NULL), SV_OK);
    sv_warp_splat(&s, 0, &buffer, &stats);
    sv_warp_fill(&s, 1, &buffer, &stats);
    sv_warp_resolve_int16(&s, images, 1, &buffer, out);
    double worst = 0;
    for (int p = 0; p < 96 * 96; p++) {
        double u, v;
        if (!sv_warp_locate(&s, &buffer, p % 96, p / 96, &u, &v)) {
            assert_int_equal(out[p][0], 0);
            continue;
        }
        assert_true(out[p][0] >= 32766 && out[p][1] <= -32767);
        if (buffer.place[p] & 1) /* 500 a texel: 1/256 and 1/128 texel are 2 and 4 */
            worst = fmax(worst, fmax(fabs(out[p][2] - 500 * (u - 0.5)), fabs(out[p][3] - 500 * (v - 0.5))));
    }
    print_message("four-channel images: worst %.2f of 500 a texel\n", worst);
    assert_true(worst < 10);
    free(image);
    free(out);
    scene_finish(&s);
    sv_warp_buffer_finish(&buffer);
}

/* --- holes --- */

/* A red square stands before a green plane; beyond them on the right is nothing (empty texels). */
static struct sv_warp_source step_source(double angle, double turn)
{
    struct sv_warp_source s = posed(SCENE_FLAT, 64, 64, angle, turn, 0, 1.4, 128, 1);
    uint8_t(*color)[4] = (uint8_t(*)[4])(uintptr_t)s.color;
    float *t = (float *)(uintptr_t)s.t;
    for (int j = 0; j < 64; j++)
        for (int i = 0; i < 64; i++) {
            bool near = i >= 20 && i < 36 && j >= 24 && j < 40;
            uint8_t rgba[4] = {near ? 255 : 0, near ? 0 : 255, 0, i < 56 ? 255 : 0};
            memcpy(color[j * 64 + i], rgba, 4);
            t[j * 64 + i] = near ? 9.0f : 0;
        }
    return s;
}

static void test_fill_takes_the_far_side(void **state)
{
    (void)state;
    for (int pose = 0; pose < 8; pose++) {
        struct sv_warp_source s = step_source(0.6, pose * 0.7853981633974483 + 0.1),
                              flat = step_source(0.6, pose * 0.7853981633974483 + 0.1);
        float *t = (float *)(uintptr_t)flat.t;
        for (int k = 0; k < 64 * 64; k++)
            t[k] = 0;
        struct sv_warp_buffer buffer, plain;
        struct sv_warp_stats stats = {0}, other = {0};
        static uint8_t rgba[128 * 128][4];
        memset(rgba, 0, sizeof rgba);
        assert_int_equal(sv_warp_buffer_create(128, 128, &buffer, NULL), SV_OK);
        assert_int_equal(sv_warp_buffer_create(128, 128, &plain, NULL), SV_OK);
        sv_warp_splat(&s, 0, &buffer, &stats);
        sv_warp_splat(&flat, 0, &plain, &other); /* the far plane alone, whole: what the holes should show */
        long open = 0, outside = 0, left = 0, wrong = 0;
        for (int p = 0; p < 128 * 128; p++)
            open += buffer.texel[p] == SV_WARP_EMPTY && plain.texel[p] != SV_WARP_EMPTY;
        sv_warp_fill(&s, 1, &buffer, &stats);
        sv_warp_resolve(&s, 1, &buffer, rgba);
        for (int p = 0; p < 128 * 128; p++) {
            bool filled = buffer.texel[p] != SV_WARP_EMPTY && (buffer.texel[p] & SV_WARP_FILLED);
            left += buffer.texel[p] == SV_WARP_EMPTY && plain.texel[p] != SV_WARP_EMPTY;
            outside += filled && plain.texel[p] == SV_WARP_EMPTY;
            wrong += filled && (rgba[p][0] != 0 || rgba[p][1] != 255);
            if (filled) /* the far plane's depth, as near as the texel at the wall's foot has it */
                assert_true(fabsf(buffer.depth[p] / plain.depth[p] - 1) < 0.12f);
        }
        print_message("step, pose %d: %ld pixels open, %u holes found, %ld left, %ld outside, %ld not of the "
                      "far side\n",
                      pose, open, stats.holes, left, outside, wrong);
        assert_true(open > 50);
        assert_int_equal(stats.holes, open);
        assert_int_equal(stats.holes_left, 0);
        assert_int_equal(left + outside + wrong, 0);
        scene_finish(&s);
        scene_finish(&flat);
        sv_warp_buffer_finish(&buffer);
        sv_warp_buffer_finish(&plain);
    }
}

/* Another source that is drawn there is no hole, however far it is. */
static void test_fill_leaves_surfaces(void **state)
{
    (void)state;
    struct sv_warp_source both[2] = {step_source(0.6, 0.9), step_source(0.6, 0.9)};
    float *t = (float *)(uintptr_t)both[1].t;
    for (int k = 0; k < 64 * 64; k++)
        t[k] = -30;
    struct sv_warp_buffer buffer;
    struct sv_warp_stats stats = {0};
    assert_int_equal(sv_warp_buffer_create(128, 128, &buffer, NULL), SV_OK);
    sv_warp_splat(&both[0], 0, &buffer, &stats);
    sv_warp_splat(&both[1], 1, &buffer, &stats);
    sv_warp_fill(both, 2, &buffer, &stats);
    int second = 0;
    for (int p = 0; p < 128 * 128; p++)
        second += buffer.texel[p] != SV_WARP_EMPTY && buffer.texel[p] >> SV_WARP_TEXEL_BITS == 1;
    print_message("a second source behind: %d pixels of it, %u holes\n", second, stats.holes);
    assert_true(second > 500);
    for (int k = 0; k < 2; k++)
        scene_finish(&both[k]);
    assert_true(stats.holes < 50);
    sv_warp_buffer_finish(&buffer);
}

/* --- order --- */

/* Columns drawn from right to left give the same picture: two halves of a relief in either order. */
static void test_order_does_not_matter(void **state)
{
    (void)state;
    struct sv_warp_source s[2];
    for (int k = 0; k < 2; k++)
        s[k] = posed(SCENE_STEPPED, 60, 60, 0.5 + 0.3 * k, 0.3, 0.2, 1.3, 96, 1);
    struct sv_warp_buffer a, b;
    struct sv_warp_stats stats = {0};
    assert_int_equal(sv_warp_buffer_create(96, 96, &a, NULL), SV_OK);
    assert_int_equal(sv_warp_buffer_create(96, 96, &b, NULL), SV_OK);
    for (unsigned k = 0; k < 2; k++) {
        sv_warp_splat(&s[k], k, &a, &stats);
        sv_warp_splat(&s[1 - k], 1 - k, &b, &stats);
    }
    assert_memory_equal(a.depth, b.depth, 96 * 96 * sizeof(float));
    assert_memory_equal(a.texel, b.texel, 96 * 96 * sizeof(uint32_t));
    for (int k = 0; k < 2; k++)
        scene_finish(&s[k]);
    sv_warp_buffer_finish(&a);
    sv_warp_buffer_finish(&b);
}

static void draw_all(enum sv_simd level, const struct sv_warp_source *s, struct sv_warp_buffer *buffer,
                     uint8_t (*rgba)[4])
{
    struct sv_warp_stats stats = {0};
    memset(rgba, 0, (size_t)buffer->width * (size_t)buffer->height * 4);
    sv_warp_clear(buffer);
    sv_warp_splat_at(level, s, 0, buffer, &stats);
    sv_warp_fill(s, 1, buffer, &stats);
    sv_warp_resolve_at(level, s, 1, buffer, rgba);
}

/* Rows first .. end - 1 are those of the whole, others empty. */
static void assert_band(const struct sv_warp_buffer *whole, uint8_t (*const whole_rgba)[4],
                        const struct sv_warp_buffer *band, uint8_t (*const rgba)[4], int first, int end)
{
    size_t p = (size_t)first * (size_t)band->width, n = (size_t)(end - first) * (size_t)band->width;
    assert_memory_equal(whole->depth + p, band->depth + p, n * sizeof *band->depth);
    assert_memory_equal(whole->texel + p, band->texel + p, n * sizeof *band->texel);
    assert_memory_equal(whole_rgba + p, rgba + p, 4 * n);
    for (size_t k = 0; k < (size_t)band->width * (size_t)band->height; k++)
        assert_true((k >= p && k < p + n) || band->texel[k] == SV_WARP_EMPTY);
}

/* Bit for bit, cut anywhere, small cells and large, at every level; and of a part of the rows of a source
 * that has all that the band shows. */
static void test_bands(void **state)
{
    (void)state;
    enum { SIDE = 96, ROUNDS = 24 };
    static uint8_t whole_rgba[SIDE * SIDE][4], rgba[SIDE * SIDE][4];
    struct sv_warp_buffer whole, band;
    uint64_t seed = 11;
    assert_int_equal(sv_warp_buffer_create(SIDE, SIDE, &whole, NULL), SV_OK);
    assert_int_equal(sv_warp_buffer_create(SIDE, SIDE, &band, NULL), SV_OK);
    for (int round = 0; round < ROUNDS; round++) {
        struct sv_warp_source s =
            posed((enum scene_shape)(round % 4), 70, 60, scene_uniform(&seed, 0, 1.2),
                  scene_uniform(&seed, -3, 3), scene_uniform(&seed, -1, 1),
                  round % 3 == 0 ? 9 : scene_uniform(&seed, 0.5, 4), SIDE, (uint64_t)round);
        for (int level = 0; level < level_count(); level++) {
            int first = 0, end;
            draw_all((enum sv_simd)level, &s, &whole, whole_rgba);
            for (; first < SIDE; first = end) {
                end = first + 1 + (int)scene_uniform(&seed, 0, 40);
                end = end < SIDE ? end : SIDE;
                sv_warp_buffer_limit(&band, first, end);
                draw_all((enum sv_simd)level, &s, &band, rgba);
                assert_band(&whole, whole_rgba, &band, rgba, first, end);
            }
        }
        scene_finish(&s);
    }
    sv_warp_buffer_finish(&whole);
    sv_warp_buffer_finish(&band);
}

/* A source of rows 20 .. 59 shows, from the 22nd on, what one of all of them shows, to the bit. */
static void test_a_part_of_the_rows(void **state)
{
    (void)state;
    enum { SIDE = 96, ROW0 = 20 };
    static uint8_t whole_rgba[SIDE * SIDE][4], rgba[SIDE * SIDE][4];
    struct sv_warp_buffer whole, part;
    int compared = 0;
    assert_int_equal(sv_warp_buffer_create(SIDE, SIDE, &whole, NULL), SV_OK);
    assert_int_equal(sv_warp_buffer_create(SIDE, SIDE, &part, NULL), SV_OK);
    for (int shape = SCENE_FLAT; shape <= SCENE_NOISE; shape++) {
        struct sv_warp_source s = posed((enum scene_shape)shape, 70, 60, 0.5, 0.7, 0.3, 1.3, SIDE, 5), t = s;
        t.row0 = ROW0;
        t.height -= ROW0;
        t.t += ROW0 * s.width;
        t.color += ROW0 * s.width;
        draw_all(sv_simd_level(), &s, &whole, whole_rgba);
        draw_all(sv_simd_level(), &t, &part, rgba);
        for (int p = 0; p < SIDE * SIDE; p++) {
            uint32_t texel = whole.texel[p], row = (texel & SV_WARP_TEXEL_MASK) / (uint32_t)s.width;
            if (texel == SV_WARP_EMPTY || texel & SV_WARP_FILLED || row < ROW0 + 2)
                continue;
            assert_int_equal(part.texel[p], texel - (uint32_t)(ROW0 * s.width));
            assert_memory_equal(&part.depth[p], &whole.depth[p], sizeof *whole.depth);
            assert_memory_equal(rgba[p], whole_rgba[p], 4);
            compared++;
        }
        scene_finish(&s);
    }
    assert_true(compared > SIDE * SIDE);
    sv_warp_buffer_finish(&whole);
    sv_warp_buffer_finish(&part);
}

/* --- parts out of the picture --- */

static void draw_filled(enum sv_simd level, const struct sv_warp_source *s, struct sv_warp_buffer *buffer,
                        struct sv_warp_stats *stats)
{
    assert_int_equal(sv_warp_buffer_create(64, 48, buffer, NULL), SV_OK);
    memset(buffer->place, 0, 64 * 48 * sizeof *buffer->place);
    if (s->row0 > 2)
        sv_warp_buffer_limit(buffer, 11, 37);
    sv_warp_splat_at(level, s, 3, buffer, stats);
    sv_warp_fill(s - 3, 4, buffer, stats);
}

/* Leaving out what cannot be seen changes nothing, and leaves most of a source out that is seen from near: at
 * all angles, from behind, from within (texels behind the eye), more than one strip wide. */
static void test_parts_out_of_the_picture(void **state)
{
    (void)state;
    static const enum scene_shape shapes[] = {SCENE_SMOOTH, SCENE_STEPPED, SCENE_NOISE};
    uint64_t texels = 0, all_texels = 0;
    for (int k = 0; k < 90; k++) {
        struct sv_warp_source s[4];
        double angle = 0.07 * k - 3, texel_px = k % 4 ? 3 + k % 7 : 0.5;
        s[3] = posed(shapes[k % 3], 300 + k % 2 * 25, 40 + k, angle, 0.3 * k, 0.2 * k, texel_px, 64,
                     (uint64_t)k);
        float *t = (float *)(uintptr_t)s[3].t;
        s[3].row0 = k % 6;
        for (int n = 0; n < s[3].width * s[3].height; n++)
            t[n] = fabsf(t[n]);
        for (int a = 0; a < 4; a++) /* off the middle, and into it */
            s[3].map.m[a][3] += 90 * s[3].map.m[a][0] + (k % 5 == 0 ? 300 * s[3].map.m[a][2] : 0);
        for (int level = 0; level < level_count(); level++) {
            struct sv_warp_buffer whole, parts;
            struct sv_warp_stats stats = {0}, all = {0};
            s[3].t_most = 0;
            draw_filled((enum sv_simd)level, &s[3], &whole, &all);
            for (int n = 0; n < s[3].width * s[3].height; n++)
                s[3].t_most = fmaxf(s[3].t_most, t[n]);
            draw_filled((enum sv_simd)level, &s[3], &parts, &stats);
            assert_memory_equal(whole.depth, parts.depth, 64 * 48 * sizeof *whole.depth);
            assert_memory_equal(whole.texel, parts.texel, 64 * 48 * sizeof *whole.texel);
            assert_memory_equal(whole.place, parts.place, 64 * 48 * sizeof *whole.place);
            assert_true(stats.texels <= all.texels && stats.pixels == all.pixels);
            texels += stats.texels;
            all_texels += all.texels;
            sv_warp_buffer_finish(&whole);
            sv_warp_buffer_finish(&parts);
        }
        scene_finish(&s[3]);
    }
    print_message("looked at %.3f of all texels\n", (double)texels / (double)all_texels);
    assert_true(texels > 0 && texels < all_texels / 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_map_is_the_camera),       cmocka_unit_test(test_smooth_has_no_pin_holes),
        cmocka_unit_test(test_noise_has_no_pin_holes),  cmocka_unit_test(test_footprints),
        cmocka_unit_test(test_locate_and_resolve),      cmocka_unit_test(test_resolve_int16),
        cmocka_unit_test(test_fill_takes_the_far_side), cmocka_unit_test(test_fill_leaves_surfaces),
        cmocka_unit_test(test_order_does_not_matter),   cmocka_unit_test(test_bands),
        cmocka_unit_test(test_a_part_of_the_rows),      cmocka_unit_test(test_parts_out_of_the_picture),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
