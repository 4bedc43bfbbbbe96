/* test_draw.c - the drawn terrain against brute force: depth at full detail against a ray through every
 * triangle of the field, holes at every level of detail, normals, ids, depth alone. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "core/base/color.h"
#include "core/base/frames.h"
#include "core/base/rng.h"
#include "core/gl/context.h"
#include "core/gl/target.h"
#include "core/scene/id.h"
#include "core/terrain/coloring.h"
#include "core/terrain/draw.h"

enum { W = 64, H = 48, FW = 45, FH = 38, ALL = (1 << SV_LAYER_COUNT) - 1 };

struct fixture {
    struct sv_gl_context *context;
    struct sv_arena *arena;
    struct sv_terrain terrain;
    struct sv_terrain_draw *draw;
    struct sv_gl_target *target;
};

static struct sv_heightfield make_field(struct sv_arena *arena)
{
    struct sv_rng rng = sv_rng_seeded(4, 4);
    float *h = sv_arena_alloc(arena, FW * FH, sizeof *h);
    struct sv_heightfield f = {.width = FW,
                               .height = FH,
                               .x0 = 471234.5,
                               .y0 = 9123456.75,
                               .dx = 12,
                               .dy = 9,
                               .z0 = 1500,
                               .h_min = INFINITY,
                               .h_max = -INFINITY,
                               .h = h};
    assert_non_null(h);
    for (int j = 0; j < FH; j++)
        for (int i = 0; i < FW; i++) {
            float v = (float)(45 * sin(i * 0.25) * cos(j * 0.31) + sv_rng_range(&rng, -5, 5));
            h[j * FW + i] = v;
            f.h_min = fminf(f.h_min, v);
            f.h_max = fmaxf(f.h_max, v);
        }
    return f;
}

static int set_up(void **state)
{
    static struct fixture f;
    struct sv_error error;
    if (sv_gl_context_create(&f.context, &error) || sv_arena_create(1 << 26, &f.arena, &error) ||
        sv_gl_target_create(W, H, ALL, &f.target, &error)) {
        print_error("%s\n", error.message);
        return -1;
    }
    f.terrain.field = make_field(f.arena);
    if (sv_terrain_color(&f.terrain, NULL, 47, f.arena, &error) ||
        sv_terrain_draw_create(&f.terrain, NULL, &f.draw, &error)) {
        print_error("%s\n", error.message);
        return -1;
    }
    *state = &f;
    return 0;
}

static int tear_down(void **state)
{
    struct fixture *f = *state;
    sv_terrain_draw_destroy(f->draw);
    sv_terrain_draw_destroy(NULL);
    sv_gl_target_destroy(f->target);
    sv_arena_destroy(f->arena);
    sv_gl_context_destroy(f->context);
    return 0;
}

static struct sv_gl_frame random_frame(const struct sv_heightfield *f, struct sv_rng *rng, bool orthographic)
{
    struct sv_gl_frame frame = {
        .camera = {
            .vfov_rad = sv_radians(sv_rng_range(rng, 15, 100)), .width = W, .height = H, .near_m = 0.1}};
    double x = sv_rng_range(rng, f->x0, sv_heightfield_x1(f)),
           y = sv_rng_range(rng, f->y0, sv_heightfield_y1(f)), z = 0;
    assert_true(sv_heightfield_height(f, x, y, &z));
    frame.camera.eye = sv_vec3(x, y, z + exp(sv_rng_range(rng, log(1.7), log(400))));
    if (orthographic) {
        frame.camera.projection = SV_PROJECTION_ORTHOGRAPHIC;
        frame.camera.ortho_height_m = sv_rng_range(rng, 20, 400);
        frame.camera.far_m = 5000;
        frame.camera.eye.z += 300;
    }
    sv_camera_aim(&frame.camera, sv_rng_range(rng, 0, 2 * SV_PI),
                  sv_rng_range(rng, -1.4, orthographic ? -0.6 : 0.1), sv_rng_range(rng, -0.2, 0.2));
    struct sv_sun sun = {2, 0.7};
    sv_light_from_sun(&sun, &frame.light);
    return frame;
}

static struct sv_terrain_draw_stats draw(struct fixture *f, struct sv_gl_frame *frame, double error_px,
                                         bool depth_only)
{
    struct sv_terrain_draw_stats stats;
    struct sv_error error;
    if (sv_gl_frame_begin(frame, &error))
        fail_msg("%s", error.message);
    sv_gl_target_begin(f->target);
    if (sv_terrain_draw(f->draw, frame, error_px, depth_only, &stats, &error))
        fail_msg("%s", error.message);
    return stats;
}

static void read_layer(struct fixture *f, enum sv_layer layer, int channels, enum sv_pixel_type type,
                       void *data)
{
    struct sv_image image = {W, H, channels, type, data};
    struct sv_error error;
    if (sv_gl_target_read(f->target, layer, &image, &error))
        fail_msg("%s", error.message);
}

/* ---- brute force ---- */

static struct sv_vec3 corner(const struct sv_heightfield *f, struct sv_vec3 eye, int i, int j)
{
    return sv_sub(sv_vec3(f->x0 + i * f->dx, f->y0 + j * f->dy, f->z0 + (double)f->h[j * f->width + i]), eye);
}

/* Ray parameter where it meets a triangle (Moller and Trumbore 1997), infinite when it does not. */
static double meet(struct sv_vec3 o, struct sv_vec3 d, struct sv_vec3 a, struct sv_vec3 b, struct sv_vec3 c)
{
    struct sv_vec3 e1 = sv_sub(b, a), e2 = sv_sub(c, a), p = sv_cross(d, e2), s = sv_sub(o, a),
                   q = sv_cross(s, e1);
    double det = sv_dot(e1, p), u = sv_dot(s, p) / det, v = sv_dot(d, q) / det, t = sv_dot(e2, q) / det;
    return u >= -1e-12 && v >= -1e-12 && u + v <= 1 + 1e-12 && t > 0 ? t : (double)INFINITY;
}

static double march(const struct sv_heightfield *f, const struct sv_camera *c, double px, double py)
{
    struct sv_vec3 o, d;
    double nearest = (double)INFINITY;
    sv_camera_ray(c, px, py, &o, &d);
    for (int j = 0; j + 1 < f->height; j++)
        for (int i = 0; i + 1 < f->width; i++) {
            struct sv_vec3 ll = corner(f, c->eye, i, j), lr = corner(f, c->eye, i + 1, j);
            struct sv_vec3 ul = corner(f, c->eye, i, j + 1), ur = corner(f, c->eye, i + 1, j + 1);
            bool even = (i + j) % 2 == 0;
            double t = even ? fmin(meet(o, d, ll, lr, ur), meet(o, d, ll, ur, ul))
                            : fmin(meet(o, d, ll, lr, ul), meet(o, d, lr, ur, ul));
            nearest = t >= (c->projection ? 0 : c->near_m) && t < nearest ? t : nearest;
        }
    return nearest;
}

static void march_all(const struct sv_heightfield *f, const struct sv_camera *c, double depth[W * H])
{
    for (int j = 0; j < H; j++)
        for (int i = 0; i < W; i++)
            depth[j * W + i] = march(f, c, i + 0.5, j + 0.5);
}

/* Whether all pixels within `radius` show terrain and depth does not jump by more than a fifth between
 * neighbours. */
static bool away_from_silhouettes(const double depth[W * H], int i, int j, int radius, bool jumps_count)
{
    for (int b = j - radius; b <= j + radius; b++)
        for (int a = i - radius; a <= i + radius; a++) {
            if (a < 0 || b < 0 || a >= W || b >= H)
                continue;
            double d = depth[b * W + a], right = a + 1 < W ? depth[b * W + a + 1] : d;
            double below = b + 1 < H ? depth[(b + 1) * W + a] : d;
            if (!isfinite(d))
                return false;
            if (jumps_count &&
                (fabs(right - d) > 0.2 * fmin(d, right) || fabs(below - d) > 0.2 * fmin(d, below)))
                return false;
        }
    return true;
}

static double depth_of(const struct sv_camera *c, float d)
{
    if (d == 0)
        return (double)INFINITY;
    return c->projection ? c->far_m * (1 - (double)d) : c->near_m / (double)d;
}

/* ---- tests ---- */

static void depth_is_that_of_the_surface(void **state)
{
    struct fixture *f = *state;
    struct sv_rng rng = sv_rng_seeded(9, 9);
    static double truth[W * H];
    static float got[W * H];
    int compared = 0;
    for (int pose = 0; pose < 20; pose++) {
        struct sv_gl_frame frame = random_frame(&f->terrain.field, &rng, pose % 5 == 4);
        draw(f, &frame, 0, false);
        read_layer(f, SV_LAYER_DEPTH, 1, SV_PIXEL_F32, got);
        march_all(&f->terrain.field, &frame.camera, truth);
        for (int k = 0; k < W * H; k++) {
            if (!away_from_silhouettes(truth, k % W, k / W, 2, true))
                continue;
            double d = depth_of(&frame.camera, got[k]);
            if (!(fabs(d - truth[k]) <= fmax(0.001 * truth[k], 0.05)))
                fail_msg("pose %d, pixel (%d, %d): %.6g m by ray, %.6g m drawn", pose, k % W, k / W, truth[k],
                         d);
            compared++;
        }
    }
    assert_true(compared > 20 * W * H / 10);
}

/* At any level of detail a pixel that rays say is inside the terrain is covered: no crack lets the clear
 * colour through. */
static void no_level_of_detail_has_holes(void **state)
{
    struct fixture *f = *state;
    static const double errors_px[] = {0, 0.5, 1, 2, 5};
    struct sv_rng rng = sv_rng_seeded(12, 1);
    static double truth[W * H];
    static uint32_t ids[W * H];
    int covered = 0;
    for (int pose = 0; pose < 15; pose++) {
        struct sv_gl_frame frame = random_frame(&f->terrain.field, &rng, false);
        march_all(&f->terrain.field, &frame.camera, truth);
        for (int e = 0; e < 5; e++) {
            struct sv_terrain_draw_stats stats = draw(f, &frame, errors_px[e], false);
            assert_true(stats.max_error_px <= errors_px[e]);
            read_layer(f, SV_LAYER_ID, 1, SV_PIXEL_U32, ids);
            int radius = 1 + (int)ceil(errors_px[e]);
            for (int k = 0; k < W * H; k++) {
                if (!away_from_silhouettes(truth, k % W, k / W, radius, false))
                    continue;
                if (ids[k] != SV_ID_TERRAIN)
                    fail_msg("pose %d, error %g px: hole at (%d, %d)", pose, errors_px[e], k % W, k / W);
                covered++;
            }
        }
    }
    assert_true(covered > 15 * 5 * W * H / 10);
}

/* Depth alone is the same depth; ids and normals stay empty, and colour is never touched. */
static void depth_alone(void **state)
{
    struct fixture *f = *state;
    struct sv_rng rng = sv_rng_seeded(3, 1);
    static float depth[W * H], alone[W * H], normals[W * H * 3];
    static uint32_t ids[W * H], alone_ids[W * H];
    static uint8_t color[W * H * 4];
    int ground = 0;
    for (int pose = 0; pose < 6; pose++) {
        struct sv_gl_frame frame = random_frame(&f->terrain.field, &rng, pose == 5);
        draw(f, &frame, 1, false);
        read_layer(f, SV_LAYER_DEPTH, 1, SV_PIXEL_F32, depth);
        read_layer(f, SV_LAYER_ID, 1, SV_PIXEL_U32, ids);
        draw(f, &frame, 1, true);
        read_layer(f, SV_LAYER_DEPTH, 1, SV_PIXEL_F32, alone);
        read_layer(f, SV_LAYER_ID, 1, SV_PIXEL_U32, alone_ids);
        read_layer(f, SV_LAYER_NORMAL, 3, SV_PIXEL_F32, normals);
        read_layer(f, SV_LAYER_COLOR, 4, SV_PIXEL_U8, color);
        assert_memory_equal(depth, alone, sizeof depth);
        for (int k = 0; k < W * H; k++) {
            assert_int_equal(ids[k] == SV_ID_TERRAIN, depth[k] > 0);
            assert_true(alone_ids[k] == SV_ID_SKY && normals[3 * k] == 0 && normals[3 * k + 2] == 0);
            assert_true(color[4 * k] == 0 && color[4 * k + 3] == 0);
            ground += depth[k] > 0;
        }
    }
    assert_true(ground > 6 * W * H / 4);
}

/* Looking straight down from an orthographic eye, a pixel at a sample has that sample's smooth normal (8-bit
 * texture: 0.008 in x and y), and the picture is not mirrored: columns go east, rows south. */
static void normals_are_those_of_the_samples(void **state)
{
    struct fixture *f = *state;
    const struct sv_heightfield *field = &f->terrain.field;
    static float normals[W * H * 3];
    struct sv_gl_frame frame = {.camera = {.projection = SV_PROJECTION_ORTHOGRAPHIC,
                                           .ortho_height_m = H,
                                           .width = W,
                                           .height = H,
                                           .near_m = 0.1,
                                           .far_m = 3000}};
    struct sv_sun sun = {2, 0.7};
    sv_light_from_sun(&sun, &frame.light);
    sv_camera_aim(&frame.camera, 0, -SV_PI / 2, 0);
    for (int j = 4; j < FH - 4; j += 5)
        for (int i = 4; i < FW - 4; i += 5) {
            /* One metre a pixel; sample (i, j) at the centre of pixel (20, 15). */
            double x = field->x0 + i * field->dx, y = field->y0 + j * field->dy;
            frame.camera.eye = sv_vec3(x + W / 2.0 - 20.5, y - (H / 2.0 - 15.5), field->z0 + 500);
            draw(f, &frame, 0, false);
            read_layer(f, SV_LAYER_NORMAL, 3, SV_PIXEL_F32, normals);
            struct sv_vec3 n = sv_heightfield_sample_normal(field, i, j);
            const float *got = normals + 3 * (15 * W + 20);
            assert_true(fabs((double)got[0] - n.x) < 0.01 && fabs((double)got[1] - n.y) < 0.01 &&
                        fabs((double)got[2] - n.z) < 0.02);
        }
}

static void terrains_without_normals_are_refused(void **state)
{
    struct fixture *f = *state;
    struct sv_terrain bare = {.field = f->terrain.field, .albedo = f->terrain.albedo};
    struct sv_terrain_draw *none = NULL;
    struct sv_error error;
    assert_int_equal(sv_terrain_draw_create(&bare, NULL, &none, &error), SV_EINVAL);
    assert_string_equal(error.field, "terrain.normal");
    assert_null(none);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(depth_is_that_of_the_surface),
        cmocka_unit_test(no_level_of_detail_has_holes),
        cmocka_unit_test(depth_alone),
        cmocka_unit_test(normals_are_those_of_the_samples),
        cmocka_unit_test(terrains_without_normals_are_refused),
    };
    sv_color_init();
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
