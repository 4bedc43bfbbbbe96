/* test_sweep.c - the ground of a cell's faces against a ray through every triangle of the field, in double;
 * every kernel, and blocks passed over or not, bit for bit; edges of the field, samples off the texels'
 * centres. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/base/simd.h"
#include "core/cell/sweep_kernel.h"

enum { FW = 45, FH = 38, N_MAX = 53 };

static float heights[FW * FH];

/* Hills of 12 to 20 cells with noise: many silhouettes, few slopes beyond 45 degrees. */
static struct sv_heightfield make_field(struct sv_rng *rng, double dx, double dy, double hills_m,
                                        double noise_m)
{
    struct sv_heightfield f = {.width = FW,
                               .height = FH,
                               .x0 = 471234.5,
                               .y0 = 9123456.75,
                               .dx = dx,
                               .dy = dy,
                               .z0 = 1500,
                               .h_min = INFINITY,
                               .h_max = -INFINITY,
                               .h = heights};
    for (int j = 0; j < FH; j++)
        for (int i = 0; i < FW; i++) {
            float v = (float)(hills_m * sin(i * 0.45) * cos(j * 0.51) + sv_rng_range(rng, -noise_m, noise_m));
            heights[j * FW + i] = v;
            f.h_min = fminf(f.h_min, v);
            f.h_max = fmaxf(f.h_max, v);
        }
    return f;
}

/* ---- brute force ---- */

static struct sv_vec3 corner(const struct sv_heightfield *f, struct sv_vec3 v, int i, int j)
{
    return sv_sub(sv_vec3(f->x0 + i * f->dx, f->y0 + j * f->dy, f->z0 + (double)f->h[j * f->width + i]), v);
}

/* Depth at which the ray d from 0 meets the triangle (Moeller and Trumbore 1997), or infinity. */
static double hit(struct sv_vec3 d, struct sv_vec3 a, struct sv_vec3 b, struct sv_vec3 c, bool *from_above)
{
    struct sv_vec3 e1 = sv_sub(b, a), e2 = sv_sub(c, a), p = sv_cross(d, e2), n = sv_cross(e1, e2);
    double det = sv_dot(e1, p);
    if (det == 0)
        return INFINITY;
    struct sv_vec3 s = sv_scale(a, -1), q = sv_cross(s, e1);
    double u = sv_dot(s, p) / det, w = sv_dot(d, q) / det, t = sv_dot(e2, q) / det;
    *from_above = (n.z > 0 ? 1 : -1) * sv_dot(n, d) < 0;
    return u >= 0 && w >= 0 && u + w <= 1 ? t : INFINITY;
}

/* 0 where nothing or the underside is met first. */
static double truth(const struct sv_sweep *s, double i, double j)
{
    struct sv_vec3 right, up, forward;
    sv_cell_face_axes(s->face, &right, &up, &forward);
    double xs = s->reach * (2 * (i + 0.5 + s->shift_x) / s->size - 1),
           ys = s->reach * (1 - 2 * (j + 0.5 + s->shift_y) / s->size);
    struct sv_vec3 d = sv_madd(sv_madd(forward, right, xs), up, ys);
    const struct sv_heightfield *f = s->field;
    double best = INFINITY;
    bool shown = false, above = false;
    for (int b = 0; b + 1 < f->height; b++)
        for (int a = 0; a + 1 < f->width; a++) {
            struct sv_vec3 p00 = corner(f, s->v, a, b), p10 = corner(f, s->v, a + 1, b),
                           p01 = corner(f, s->v, a, b + 1), p11 = corner(f, s->v, a + 1, b + 1);
            for (int k = 0; k < 2; k++) {
                bool anti = (a + b) & 1;
                double t = k ? hit(d, anti ? p10 : p00, p11, p01, &above)
                             : hit(d, p00, p10, anti ? p01 : p11, &above);
                if (t >= s->distance_m && t < best) {
                    best = t;
                    shown = above;
                }
            }
        }
    return shown ? s->distance_m / best : 0;
}

/* Rounding: places to 2^-20 of a cell here, tangents to 2^-22, so that q is off by 1e-5 of itself but where
 * the ground is seen at a grazing angle; 1e-3 is what is asked for. Texels whose centre is within 1e-3 texel
 * of a silhouette may have either side of it. */
static bool agrees(const struct sv_sweep *s, int i, int j, float q)
{
    for (int k = 0; k < 9; k++) {
        int order[9] = {4, 0, 1, 2, 3, 5, 6, 7, 8};
        double t = truth(s, i + (order[k] % 3 - 1) * 1e-3, j + (order[k] / 3 - 1) * 1e-3);
        if (fabs(t - (double)q) <= 1e-3 * t)
            return true;
    }
    return false;
}

static int compare(const struct sv_sweep *s, const float *q, int *ground, int *wrong)
{
    for (int j = 0; j < s->size; j++)
        for (int i = 0; i < s->size; i++) {
            float here = q[j * s->size + i];
            *ground += here > 0;
            assert_true(here >= 0 && here <= 1);
            if (!agrees(s, i, j, here)) {
                if (++*wrong < 20)
                    print_message("face %d, D %g, texel %d %d: q %.7g, truth %.7g\n", (int)s->face,
                                  s->distance_m, i, j, (double)here, truth(s, i, j));
            }
        }
    return *wrong;
}

/* All kernels, with blocks and without. */
static void same_bits(const struct sv_sweep *s, const float *q)
{
    static float other[N_MAX * N_MAX];
    struct sv_sweep plain = *s;
    plain.blocks = NULL;
    size_t bytes = (size_t)s->size * (size_t)s->size * sizeof *q;
    sv_sweep(&plain, other);
    assert_memory_equal(q, other, bytes);
    if (s->face == SV_CELL_DOWN || s->face == SV_CELL_UP)
        return;
    for (int k = 0; k < 2; k++) {
        sv_sweep_by(k ? s : &plain, sv_sweep_columns_scalar, other);
        assert_memory_equal(q, other, bytes);
        if (sv_simd_level() == SV_SIMD_AVX2) {
            sv_sweep_by(k ? s : &plain, sv_sweep_columns_avx2, other);
            assert_memory_equal(q, other, bytes);
        }
    }
}

static void run(struct sv_rng *rng, const struct sv_heightfield *f, double x, double y, double above,
                double d, int n, bool shift, int *ground, int *wrong)
{
    static float q[N_MAX * N_MAX];
    struct sv_sweep_blocks *blocks;
    struct sv_error error;
    double z = f->z0;
    sv_heightfield_height(f, x, y, &z);
    assert_int_equal(sv_sweep_blocks_create(f, &blocks, &error), SV_OK);
    for (int face = 0; face < SV_CELL_FACES; face++) {
        struct sv_sweep s = {.field = f,
                             .blocks = blocks,
                             .v = {x, y, z + above},
                             .distance_m = d,
                             .face = (enum sv_cell_face)face,
                             .size = n,
                             .reach = shift ? sv_rng_range(rng, 1, 1.25) : 1};
        if (shift) {
            s.shift_x = sv_rng_range(rng, -0.5, 0.5);
            s.shift_y = sv_rng_range(rng, -0.5, 0.5);
        }
        memset(q, 0xff, sizeof q);
        sv_sweep(&s, q);
        same_bits(&s, q);
        compare(&s, q, ground, wrong);
    }
    sv_sweep_blocks_destroy(blocks);
}

static void test_truth(void **state)
{
    (void)state;
    static const double spacing[3][2] = {{10, 10}, {12, 5}, {4, 11}};
    struct sv_rng rng = sv_rng_seeded(7, 1);
    int ground = 0, wrong = 0, count = getenv("SV_TEST_FULL") ? 60 : 9;
    for (int k = 0; k < count; k++) {
        struct sv_heightfield f = make_field(&rng, spacing[k % 3][0], spacing[k % 3][1],
                                             sv_rng_range(&rng, 2, 30), sv_rng_range(&rng, 0, 6));
        double x = sv_rng_range(&rng, f.x0, sv_heightfield_x1(&f)),
               y = sv_rng_range(&rng, f.y0, sv_heightfield_y1(&f));
        double above = exp(sv_rng_range(&rng, log(1.7), log(120)));
        run(&rng, &f, x, y, above, above * sv_rng_range(&rng, 0.1, 0.9), (int)sv_rng_range(&rng, 17, 40),
            k & 1, &ground, &wrong);
    }
    print_message("%d texels of ground, %d wrong\n", ground, wrong);
    assert_true(ground > 1000 * count && wrong * 1000 <= ground);
}

/* Eyes outside of the field and on its border, on lines and corners of samples; faces of 1, 7, 8, 9 texels.
 */
static void test_borders(void **state)
{
    (void)state;
    static const double at[][2] = {{-3, 10}, {20, 60}, {44, 37},   {0, 0},
                                   {22, 0},  {22, 18}, {22.5, 18}, {70, 18.5}};
    static const int sizes[] = {24, 1, 7, 8, 9, 16, 17, 24};
    struct sv_rng rng = sv_rng_seeded(8, 1);
    int ground = 0, wrong = 0;
    for (size_t k = 0; k < sizeof at / sizeof at[0]; k++) {
        struct sv_heightfield f = make_field(&rng, 10, 10, 8, 2);
        run(&rng, &f, f.x0 + at[k][0] * f.dx, f.y0 + at[k][1] * f.dy, 30, 8, sizes[k], k & 1, &ground,
            &wrong);
    }
    print_message("%d texels of ground, %d wrong\n", ground, wrong);
    assert_true(ground > 1000 && wrong * 1000 <= ground);
}

/* A plane: q = D (ys - slope along the ray) / -h, affine over the face; and nothing above the horizon. */
static void test_plane(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(9, 1);
    struct sv_heightfield f = make_field(&rng, 10, 10, 0, 0);
    static float q[32 * 32];
    for (int face = SV_CELL_EAST; face <= SV_CELL_SOUTH; face++) {
        struct sv_sweep s = {.field = &f,
                             .v = {f.x0 + 220, f.y0 + 185, f.z0 + 8},
                             .distance_m = 5,
                             .face = (enum sv_cell_face)face,
                             .size = 32,
                             .reach = 1};
        sv_sweep(&s, q);
        for (int j = 0; j < 32; j++)
            for (int i = 0; i < 32; i++) {
                double ys = 1 - 2 * (j + 0.5) / 32, xs = 2 * (i + 0.5) / 32 - 1, want = -ys * 5 / 8;
                double far = face & 1 ? 185 : 220, side = face & 1 ? 220 : 185; /* the field's borders */
                if (ys > 0 || want < 5 / far || want < 5 * fabs(xs) / side)
                    want = 0;
                assert_true(fabs((double)q[j * 32 + i] - want) <= 1e-6);
            }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_plane), cmocka_unit_test(test_truth),
                                       cmocka_unit_test(test_borders)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
