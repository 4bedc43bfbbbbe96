/* test_shadow_window.c - windows of sunlight: ground against the triangles it is cut from, casts of a disc
 * and a box on flat, sloped and stepped ground against exact geometry and against the direct formula, SIMD
 * against scalar with guard pages, seams, the choice of windows. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <cmocka.h>

#include "core/base/frames.h"
#include "core/base/rng.h"
#include "core/base/simd.h"
#include "core/terrain/shadow_cast.h"
#include "core/terrain/shadow_window.h"

enum { SIDE = SV_SHADOW_WINDOW_SIDE, FIELD = 129 };

static const double X0 = 497512.25, Y0 = 5203410.5, Z0 = 812.5;

typedef double ground_of(double x, double y); /* m, from the field's corner, above z0 */

static double flat(double x, double y)
{
    return 0 * x + 0 * y + 2;
}
static double sloped(double x, double y)
{
    return 0.35 * x - 0.2 * y + 10;
}
static double stepped(double x, double y)
{
    return (x > 130 ? 9 : 0) + (y > 140 ? -4 : 0);
}
static double hills(double x, double y)
{
    return 12 * sin(x / 19) * cos(y / 27) + 4 * sin(x / 7 + y / 11);
}

static struct sv_heightfield make_field(ground_of *of, double dx, double dy)
{
    struct sv_heightfield f = {
        .width = FIELD, .height = FIELD - 20, .x0 = X0, .y0 = Y0, .dx = dx, .dy = dy, .z0 = Z0};
    float *h = malloc(sizeof *h * FIELD * FIELD);
    assert_non_null(h);
    f.h_min = INFINITY;
    f.h_max = -INFINITY;
    for (int j = 0; j < f.height; j++)
        for (int i = 0; i < f.width; i++) {
            float v = (float)of(i * dx, j * dy);
            h[j * f.width + i] = v;
            f.h_min = fminf(f.h_min, v);
            f.h_max = fmaxf(f.h_max, v);
        }
    f.h = h;
    return f;
}

static void drop_field(struct sv_heightfield *f)
{
    free((void *)(uintptr_t)f->h);
}

static struct sv_shadow_window window; /* one for all tests */

static int setup(void **state)
{
    (void)state;
    struct sv_error error;
    return sv_shadow_window_alloc(&window, SV_SHADOW_WINDOW_SIDE, &error) == SV_OK ? 0 : -1;
}
static int teardown(void **state)
{
    (void)state;
    sv_shadow_window_finish(&window);
    return 0;
}

static struct sv_vec3 texel_place(const struct sv_shadow_window *w, int i, int j)
{
    return sv_vec3(w->x0 + (i + 0.5) * w->texel_m, w->y0 + (j + 0.5) * w->texel_m,
                   w->z0 + (double)w->ground[(size_t)j * SIDE + (size_t)i]);
}

/* ---- ground ---- */

static void ground_is_the_surface(void **state)
{
    (void)state;
    struct sv_heightfield f = make_field(hills, 2, 3);
    static const double texels[] = {0.125, 0.3, 0.5, 2.7};
    for (size_t k = 0; k < sizeof texels / sizeof texels[0]; k++) {
        struct sv_shadow_place place = {X0 - 3.21, Y0 + 17.7, texels[k]};
        sv_shadow_window_fill(&window, &f, NULL, place);
        double most = 0;
        long inside = 0;
        for (int j = 0; j < SIDE; j += 3)
            for (int i = 0; i < SIDE; i++) {
                struct sv_vec3 p = texel_place(&window, i, j);
                double z;
                assert_true(isfinite(p.z));
                const float *b = window.blocks[j / SV_SHADOW_WINDOW_BLOCK * (SV_SHADOW_WINDOW_SIDE / SV_SHADOW_WINDOW_BLOCK) +
                                               i / SV_SHADOW_WINDOW_BLOCK];
                float g = window.ground[(size_t)j * SIDE + (size_t)i];
                assert_true(g >= b[0] && g <= b[1] && g >= window.ground_min && g <= window.ground_max);
                if (!sv_heightfield_height(&f, p.x, p.y, &z))
                    continue;
                inside++;
                most = fmax(most, fabs(z - p.z));
            }
        printf("texels of %.3f m: %ld on the field, off the surface by %.2g m at most\n", texels[k], inside,
               most);
        assert_true(inside > 3000 && most < 1e-4);
    }
    drop_field(&f);
}

/* ---- casts ---- */

enum body { DISC, BOX };

/* A disc or a box's outline square to the light, its middle at (0, 0, 10) from the body's place. */
struct shape {
    enum body body;
    int texels;
    uint8_t *coverage;
    float *first;
    struct sv_silhouette silhouette;
};

static const double RADIUS = 4, HALF_WIDE = 5, HALF_HIGH = 2.5, MIDDLE = 10;

static bool in_shape(enum body body, double right, double up)
{
    return body == DISC ? right * right + up * up < RADIUS * RADIUS
                        : fabs(right) < HALF_WIDE && fabs(up) < HALF_HIGH;
}

static struct shape make_shape(enum body body, int texels, struct sv_vec3 to_sun, bool with_first)
{
    struct shape s = {.body = body, .texels = texels, .coverage = malloc((size_t)texels * (size_t)texels)};
    assert_non_null(s.coverage);
    double side = 12, texel = side / texels;
    for (int j = 0; j < texels; j++)
        for (int i = 0; i < texels; i++) {
            int in = 0;
            for (int k = 0; k < 64; k++)
                in += in_shape(body, (i + (k % 8 + 0.5) / 8) * texel - side / 2,
                               side / 2 - (j + (k / 8 + 0.5) / 8) * texel);
            s.coverage[j * texels + i] = (uint8_t)(in * 255 / 64);
        }
    struct sv_vec3 right = sv_vec3(to_sun.y, -to_sun.x, 0);
    right = sv_length(right) > 1e-9 ? sv_normalize(right) : sv_vec3(1, 0, 0);
    struct sv_vec3 down = sv_cross(right, to_sun); /* right x up = to the sun */
    if (down.z > 0)
        down = sv_scale(down, -1);
    struct sv_vec3 corner = sv_madd(sv_madd(sv_vec3(0, 0, MIDDLE), right, -side / 2), down, -side / 2);
    if (with_first) {
        s.first = malloc(sizeof *s.first * (size_t)texels * (size_t)texels);
        assert_non_null(s.first);
        for (int k = 0; k < texels * texels; k++)
            s.first[k] = -0.01f;
    }
    s.silhouette = (struct sv_silhouette){.width = texels,
                                          .height = texels,
                                          .coverage = s.coverage,
                                          .first = s.first,
                                          .corner = corner,
                                          .right = right,
                                          .down = down,
                                          .travel = sv_scale(to_sun, -1),
                                          .width_m = side,
                                          .height_m = side,
                                          .first_m = -0.01,
                                          .last_m = 0.01};
    return s;
}

static void drop_shape(struct shape *s)
{
    free(s->coverage);
    free(s->first);
}

/* Whether the body at `place` keeps the sun from p; `near_edge` (m): how far its ray passes from the outline
 * is not known better than that. -1: the ground itself is in between. */
static int shaded(const struct sv_shadow_window *w, const struct shape *s, struct sv_vec3 place, double scale,
                  struct sv_vec3 p)
{
    struct sv_vec3 l = s->silhouette.travel,
                   from = sv_sub(p, sv_madd(place, sv_vec3(0, 0, 1), MIDDLE * scale));
    double depth = sv_dot(from, l);
    if (depth < 0)
        return 0;
    if (!in_shape(s->body, sv_dot(from, s->silhouette.right) / scale,
                  -sv_dot(from, s->silhouette.down) / scale))
        return 0;
    for (double t = 2 * w->texel_m; t < depth; t += 0.5 * w->texel_m) {
        double i = (p.x - t * l.x - w->x0) / w->texel_m, j = (p.y - t * l.y - w->y0) / w->texel_m;
        if (!(i >= 0 && j >= 0 && i < SIDE && j < SIDE))
            break;
        if ((double)w->ground[(size_t)j * SIDE + (size_t)i] + w->z0 > p.z - t * l.z + 0.05)
            return -1;
    }
    return 1;
}

struct cast_case {
    ground_of *ground;
    const char *name;
    enum body body;
    double azimuth_deg, elevation_deg, texel_m, scale;
    int texels;
};

/* Counts over the whole window, so that a bound that is too narrow shows. */
static void check_cast(const struct cast_case *c, long *wrong, long *all)
{
    struct sv_heightfield f = make_field(c->ground, 2, 2);
    struct sv_vec3 to_sun = sv_direction(sv_radians(c->azimuth_deg), sv_radians(c->elevation_deg));
    struct shape s = make_shape(c->body, c->texels, to_sun, c->scale > 1);
    sv_shadow_window_fill(
        &window, &f, NULL,
        (struct sv_shadow_place){X0 + 128 - 512 * c->texel_m, Y0 + 108 - 512 * c->texel_m, c->texel_m});
    struct sv_vec3 place = sv_vec3(X0 + 119.3, Y0 + 104.1, 0);
    assert_true(sv_heightfield_height(&f, place.x, place.y, &place.z));
    sv_shadow_window_cast(&window, &s.silhouette, place, c->scale);
    long dark = 0, off = 0;
    for (int j = 0; j < SIDE; j++)
        for (int i = 0; i < SIDE; i++) {
            int want = shaded(&window, &s, place, c->scale, texel_place(&window, i, j));
            bool got = window.light[(size_t)j * SIDE + (size_t)i] < 128;
            if (want < 0)
                continue;
            dark += want;
            off += want != got;
        }
    printf("%-8s %s sun %5.1f / %4.1f, texels of %.3f m, scale %.1f: %6ld shaded, %.2f %% differ\n", c->name,
           c->body == DISC ? "disc" : "box ", c->azimuth_deg, c->elevation_deg, c->texel_m, c->scale, dark,
           dark ? 100.0 * (double)off / (double)dark : 0);
    assert_true(dark > 0);
    *wrong += off;
    *all += dark;
    assert_true(off <= 0.03 * (double)dark + 2);
    drop_shape(&s);
    drop_field(&f);
}

static void casts_against_geometry(void **state)
{
    (void)state;
    static const struct {
        ground_of *of;
        const char *name;
    } grounds[] = {{flat, "flat"}, {sloped, "sloped"}, {stepped, "stepped"}, {hills, "hills"}};
    static const double suns[][2] = {{0, 20},   {90, 30},   {137, 25}, {180, 50}, {222.5, 12},
                                     {270, 45}, {301, 7.5}, {45, 89},  {45, 90},  {10, 70}};
    long wrong = 0, all = 0;
    for (size_t g = 0; g < 4; g++)
        for (size_t k = 0; k < sizeof suns / sizeof suns[0]; k++) {
            struct cast_case c = {grounds[g].of, grounds[g].name, (g + k) % 2 ? BOX : DISC,  suns[k][0],
                                  suns[k][1],    0.125,           k % 3 || k == 6 ? 1 : 1.7, 256};
            check_cast(&c, &wrong, &all);
        }
    printf("all: %.2f %% of %ld texels differ\n", 100.0 * (double)wrong / (double)all, all);
}

/* Texels coarser than the silhouette's: no edge is met, but as much light is lost as by fine ones. */
static void coarse_casts_keep_the_area(void **state)
{
    (void)state;
    struct sv_heightfield f = make_field(flat, 2, 2);
    static const double texels[] = {0.125, 0.5, 1, 2, 4};
    for (int sun = 0; sun < 3; sun++) {
        double elevation = sv_radians(20 + 25 * sun), first = 0;
        struct sv_vec3 to_sun = sv_direction(sv_radians(60 + 100 * sun), elevation);
        struct shape s = make_shape(DISC, 128, to_sun, false);
        for (size_t k = 0; k < sizeof texels / sizeof texels[0]; k++) {
            double area = 0;
            enum { PLACES = 16 };
            for (int n = 0; n < PLACES; n++) {
                double m = texels[k];
                sv_shadow_window_fill(&window, &f, NULL,
                                      (struct sv_shadow_place){X0 + 128 - 512 * m, Y0 + 108 - 512 * m, m});
                struct sv_vec3 place =
                    sv_vec3(X0 + 119.3 + n % 4 * m / 4, Y0 + 104.1 + n / 4 * m / 4, Z0 + 2);
                sv_shadow_window_cast(&window, &s.silhouette, place, 1);
                for (size_t i = 0; i < (size_t)SIDE * SIDE; i++)
                    area += (255 - window.light[i]) / 255.0 * m * m / PLACES;
            }
            double want = SV_PI * RADIUS * RADIUS / sin(elevation);
            first = k ? first : area;
            printf("sun at %.0f, texels of %.3f m: shadow of %.2f m2, expected %.2f\n", sv_degrees(elevation),
                   texels[k], area, want);
            assert_true(fabs(area / want - 1) < (texels[k] <= 1 ? 0.02 : 0.06));
        }
        drop_shape(&s);
    }
    drop_field(&f);
}

/* Rows by increments, in float and within bounds, against the formula of silhouette.h in double at every
 * texel. */
static void rows_are_the_formula(void **state)
{
    (void)state;
    struct sv_heightfield f = make_field(hills, 2, 2);
    struct sv_rng rng = sv_rng_seeded(5, 5);
    long touched = 0, wrong = 0;
    for (int round = 0; round < 6; round++) {
        struct sv_vec3 to_sun =
            sv_direction(sv_rng_range(&rng, 0, 6.28), sv_radians(sv_rng_range(&rng, 8, 80)));
        struct shape s = make_shape(round % 2 ? BOX : DISC, 64, to_sun, round % 3 == 0);
        double m = 0.125, scale = sv_rng_range(&rng, 0.7, 2);
        sv_shadow_window_fill(&window, &f, NULL,
                              (struct sv_shadow_place){X0 + 128 - 512 * m, Y0 + 108 - 512 * m, m});
        struct sv_vec3 place =
            sv_vec3(X0 + sv_rng_range(&rng, 100, 150), Y0 + sv_rng_range(&rng, 90, 120), Z0 + 5);
        sv_shadow_window_cast(&window, &s.silhouette, place, scale);
        const struct sv_silhouette *sil = &s.silhouette;
        struct sv_shadow_cast direct = {
            .coverage = sil->coverage, .width = 64, .height = 64, .first_d = -0.01f};
        for (int j = 0; j < SIDE; j++)
            for (int i = 0; i < SIDE; i++) {
                struct sv_vec3 p = texel_place(&window, i, j);
                if (shaded(&window, &s, place, scale * 1.5, p) < 0) /* a hill may end the shadow before */
                    continue;
                struct sv_vec3 q = sv_sub(sv_scale(sv_sub(p, place), 1 / scale), sil->corner);
                double a = sv_dot(q, sil->right) / sil->width_m * 64 - 0.5;
                double b = sv_dot(q, sil->down) / sil->height_m * 64 - 0.5;
                float cover =
                    sv_shadow_cast_coverage(&direct, (float)a, (float)b, (float)sv_dot(q, sil->travel));
                int want = sv_shadow_darken(255, (unsigned)(cover + 0.5f));
                int got = window.light[(size_t)j * SIDE + (size_t)i];
                touched += want < 255;
                wrong += abs(want - got) > 2;
            }
        drop_shape(&s);
    }
    printf("%ld texels, %ld off by more than 2 of 255\n", touched, wrong);
    assert_true(touched > 10000 && wrong * 1000 <= touched);
    drop_field(&f);
}

static void hostile_casts(void **state)
{
    (void)state;
    struct sv_heightfield f = make_field(flat, 2, 2);
    sv_shadow_window_fill(&window, &f, NULL, (struct sv_shadow_place){X0, Y0, 0.25});
    struct shape s = make_shape(DISC, 32, sv_direction(1, 0.5), false);
    static const double odd[] = {0, -1, NAN, INFINITY, -INFINITY, 1e300, 1e-300, -0.0};
    for (size_t a = 0; a < 8; a++)
        for (size_t b = 0; b < 8; b++)
            for (int k = 0; k < 10; k++) {
                struct sv_silhouette x = s.silhouette;
                struct sv_vec3 place = sv_vec3(X0 + 100, Y0 + 100, Z0);
                double scale = 1, *at[] = {&place.x,    &place.y,   &place.z,   &scale,     &x.corner.x,
                                           &x.travel.z, &x.width_m, &x.first_m, &x.right.x, &x.down.y};
                *at[k] = odd[a];
                *at[(k + 3) % 10] = odd[b];
                sv_shadow_window_cast(&window, &x, place, scale);
            }
    struct sv_silhouette below = s.silhouette;
    memset(window.light, 255, (size_t)SIDE * SIDE);
    below.travel.z = -below.travel.z;
    sv_shadow_window_cast(&window, &below, sv_vec3(X0 + 100, Y0 + 100, Z0), 1);
    sv_shadow_window_cast(&window, &s.silhouette, sv_vec3(X0 + 100, Y0 + 1e6, Z0), 1);
    for (size_t i = 0; i < (size_t)SIDE * SIDE; i++)
        assert_int_equal(window.light[i], 255);
    drop_shape(&s);
    drop_field(&f);
}

/* ---- SIMD ---- */

static void *guarded(size_t bytes, bool at_end, void **base, size_t *whole)
{
    size_t page = 4096, body = (bytes + page - 1) / page * page;
    *whole = body + 2 * page;
    char *p = mmap(NULL, *whole, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    assert_true(p != MAP_FAILED);
    assert_int_equal(mprotect(p, page, PROT_NONE), 0);
    assert_int_equal(mprotect(p + page + body, page, PROT_NONE), 0);
    *base = p;
    return at_end ? p + page + body - bytes : p + page;
}

static void simd_is_scalar(void **state)
{
    (void)state;
    if (sv_simd_level() < SV_SIMD_AVX2) {
        printf("skipped: no AVX2 here\n");
        skip();
    }
    struct sv_rng rng = sv_rng_seeded(11, 3);
    static const float odd[] = {NAN, INFINITY, -INFINITY, 1e-40f, -0.0f, 1e30f};
    for (int round = 0; round < 4000; round++) {
        int w = 1 + (int)sv_rng_range(&rng, 0, 40), h = 1 + (int)sv_rng_range(&rng, 0, 40);
        int count = round % 36;
        size_t whole[4];
        void *base[4];
        bool end = round & 1;
        uint8_t *coverage = guarded((size_t)w * (size_t)h, end, &base[0], &whole[0]);
        float *first = guarded((size_t)w * (size_t)h * 4, end, &base[1], &whole[1]);
        float *ground = guarded((size_t)count * 4, end, &base[2], &whole[2]);
        uint8_t *light = guarded((size_t)count, end, &base[3], &whole[3]);
        uint8_t plain[64];
        for (int k = 0; k < w * h; k++) {
            coverage[k] = (uint8_t)sv_rng_range(&rng, 0, 256);
            first[k] = (float)sv_rng_range(&rng, -3, 3);
        }
        for (int k = 0; k < count; k++) {
            ground[k] = (float)sv_rng_range(&rng, -2, 2);
            if (round % 7 == 0 && k % 5 == 0)
                ground[k] = odd[(k + round) % 6];
            plain[k] = light[k] = (uint8_t)(round % 3 ? sv_rng_range(&rng, 0, 256) : k % 9 == 0);
        }
        struct sv_shadow_cast c = {coverage,
                                   round % 2 ? first : NULL,
                                   w,
                                   h,
                                   (float)sv_rng_range(&rng, -2, 2),
                                   (float)sv_rng_range(&rng, -2, 2),
                                   (float)sv_rng_range(&rng, -2, 2),
                                   (float)sv_rng_range(&rng, -1, 1),
                                   (float)sv_rng_range(&rng, -1, 1),
                                   (float)sv_rng_range(&rng, -3, 3),
                                   (float)sv_rng_range(&rng, -1, 1),
                                   1 + round % 4,
                                   1 + round / 4 % 3,
                                   {0},
                                   {0},
                                   0};
        sv_shadow_cast_spread(&c, sv_rng_range(&rng, 0, 5), sv_rng_range(&rng, 0, 4));
        float s = (float)sv_rng_range(&rng, -10, w + 10), t = (float)sv_rng_range(&rng, -10, h + 10);
        sv_shadow_cast_row_scalar(&c, s, t, 1, count, ground, plain);
        sv_shadow_cast_row_avx2(&c, s, t, 1, count, ground, light);
        for (int k = 0; k < count; k++)
            if (plain[k] != light[k])
                fail_msg("round %d, %d x %d, texel %d of %d: scalar %d, AVX2 %d", round, w, h, k, count,
                         plain[k], light[k]);
        for (int k = 0; k < 4; k++)
            munmap(base[k], whole[k]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ground_is_the_surface),
        cmocka_unit_test(casts_against_geometry),
        cmocka_unit_test(coarse_casts_keep_the_area),
        cmocka_unit_test(rows_are_the_formula),
        cmocka_unit_test(hostile_casts),
        cmocka_unit_test(simd_is_scalar),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
