/* test_panel_ground.c - the ground panel: its map against the camera's own projection of the points that
 * texels stand for; its colours against the shading of a drawn picture's pixel at the same place; where it is
 * empty. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "core/base/arena.h"
#include "core/base/color.h"
#include "core/base/rng.h"
#include "core/cell/panel_ground.h"
#include "core/terrain/coloring.h"

enum { FW = 97, FH = 90, N = 40 };

static struct sv_arena *arena;
static struct sv_terrain terrain;
static struct sv_ground *ground;

static int set_up(void **state)
{
    (void)state;
    struct sv_error error;
    sv_color_init();
    if (sv_arena_create(1 << 26, &arena, &error))
        return -1;
    float *h = sv_arena_alloc(arena, FW * FH, sizeof *h);
    for (int j = 0; j < FH; j++)
        for (int i = 0; i < FW; i++)
            h[j * FW + i] = (float)(20 * sin(i * 0.2) * cos(j * 0.23));
    terrain.field = (struct sv_heightfield){.width = FW,
                                            .height = FH,
                                            .x0 = 471234.5,
                                            .y0 = 9123456.75,
                                            .dx = 6,
                                            .dy = 6,
                                            .z0 = 1500,
                                            .h_min = -20,
                                            .h_max = 20,
                                            .h = h};
    if (sv_terrain_color(&terrain, NULL, 47, arena, &error) || sv_ground_create(&terrain, &ground, &error)) {
        print_error("%s\n", error.message);
        return -1;
    }
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    sv_ground_destroy(ground);
    sv_arena_destroy(arena);
    return 0;
}

static struct sv_sweep sweep_of(int face, double reach)
{
    const struct sv_heightfield *f = &terrain.field;
    return (struct sv_sweep){.field = f,
                             .v = {f->x0 + 280, f->y0 + 260, f->z0 + 40},
                             .distance_m = 15,
                             .face = (enum sv_cell_face)face,
                             .size = N,
                             .reach = reach};
}

/* The world point of texel coordinates (u, v) with q, from the definition of a face. */
static struct sv_vec3 point_of(const struct sv_sweep *s, double u, double v, double q)
{
    struct sv_vec3 right, up, forward;
    sv_cell_face_axes(s->face, &right, &up, &forward);
    double z = s->distance_m / q;
    struct sv_vec3 d =
        sv_madd(sv_madd(forward, right, s->reach * (2 * u / N - 1)), up, s->reach * (1 - 2 * v / N));
    return sv_madd(s->v, d, z);
}

static void test_map(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(3, 1);
    int seen = 0;
    for (int k = 0; k < 600; k++) {
        struct sv_sweep s = sweep_of(k % SV_CELL_FACES, k & 1 ? 1 : 1.1);
        struct sv_camera c = {
            .eye = s.v, .vfov_rad = sv_rng_range(&rng, 0.4, 1.8), .width = 64, .height = 50, .near_m = 0.1};
        c.eye.x += sv_rng_range(&rng, -6, 6);
        c.eye.z += sv_rng_range(&rng, -6, 6);
        sv_camera_aim(&c, sv_rng_range(&rng, 0, 6.28), sv_rng_range(&rng, -1.5, 1.5),
                      sv_rng_range(&rng, -1, 1));
        struct sv_warp_map map;
        sv_panel_ground_map(&s, &c, 0.25, -0.125, &map);
        double u[4] = {sv_rng_range(&rng, 0, N), sv_rng_range(&rng, 0, N), sv_rng_range(&rng, 0.001, 1), 1},
               x, y, z, r[4] = {0};
        for (int a = 0; a < 4; a++)
            for (int b = 0; b < 4; b++)
                r[a] += map.m[a][b] * u[b];
        bool in_front = sv_camera_project(&c, point_of(&s, u[0], u[1], u[2]), &x, &y, &z);
        if (!in_front)
            continue;
        /* Double throughout; world coordinates of 9e6 round to 2e-9 m, at 1 m and 100 px of focal length and
         * more: 1e-6 px. */
        seen++;
        assert_true(r[3] > 0);
        assert_true(fabs(r[0] / r[3] - (x - 0.25)) <= 1e-6 * (1 + fabs(x)) &&
                    fabs(r[1] / r[3] - (y + 0.125)) <= 1e-6 * (1 + fabs(y)));
        assert_true(fabs(r[2] / r[3] - c.near_m / z) <= 1e-6);
    }
    assert_true(seen > 200);
}

/* Each texel beside the pixel of a small picture whose centre looks at the very place, from V, with pixels as
 * fine: light, normal, detail and mip level are those of drawn ground. */
static void test_color(void **state)
{
    (void)state;
    static float q[N * N];
    static uint8_t color[N * N][4];
    struct sv_light light;
    struct sv_sun sun = {2, 0.7};
    sv_light_from_sun(&sun, &light);
    int ground_texels = 0, differ = 0;
    for (int face = 0; face < SV_CELL_FACES; face++) {
        struct sv_panel_ground_options o = {.sweep = sweep_of(face, 1), .ground = ground, .light = &light};
        sv_panel_ground_make(&o, q, color);
        for (int k = 0; k < N * N; k++) {
            assert_int_equal(color[k][3], q[k] > 0 ? 255 : 0);
            if (!(q[k] > 0) || k % 7)
                continue;
            struct sv_camera c = sv_panel_ground_camera(&o.sweep);
            double z, u = k % N + 0.5, v = k / N + 0.5;
            struct sv_vec3 p = point_of(&o.sweep, u, v, (double)q[k]);
            assert_true(sv_heightfield_height(&terrain.field, p.x, p.y, &z) && fabs(z - p.z) < 0.02);
            c.width = c.height = 1; /* that texel alone: the camera's axis is shifted by the sample's place */
            c.vfov_rad = 2 * atan(1.0 / N);
            c.near_m = 0.1;
            float depth = (float)(0.1 * (double)q[k] / o.sweep.distance_m);
            uint8_t pixel[4];
            struct sv_ground_view view = {.camera = &c,
                                          .light = &light,
                                          .shift_x_px = u - 0.5 * N,
                                          .shift_y_px = v - 0.5 * N,
                                          .depth = &depth};
            sv_ground_shade(ground, &view, pixel);
            ground_texels++;
            for (int a = 0; a < 3; a++)
                differ += abs(pixel[a] - color[k][a]) > 2; /* places in float, a mip level's edge */
        }
    }
    assert_true(ground_texels > 300);
    assert_true(differ * 100 <= ground_texels);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_map), cmocka_unit_test(test_color)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
