/* test_depth.c - layer=depth against a brute-force march of the same triangulated surface (diagonal:
 * alternating, see heightfield.h), by OSMesa and by Embree, at far UTM coordinates and at the origin; and the
 * bound that the level of detail states.
 *
 * Allowed: 0.1 % or 5 cm, whichever is larger, away from silhouettes by 2 px. A silhouette is where the
 * truth's own inverse depth, linear on any plane, bends sharply within the 5 x 5 pixels around. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <math.h>
#include <cmocka.h>

#include "core/base/rng.h"
#include "tests/core/view/scene_kit.h"

enum { W = 64, H = 48, POSES = 100 };

static const struct kit_options utm = {.width = 129,
                                       .height = 97,
                                       .x0 = 499123.5,
                                       .y0 = 5204567.25,
                                       .z0 = 1234.5,
                                       .dx = 4.0,
                                       .dy = 5.0,
                                       .relief_m = 160,
                                       .seed = 42};

static double march(const struct sv_heightfield *f, const struct sv_camera *camera, int i, int j)
{
    struct sv_vec3 o, d;
    sv_camera_ray(camera, i + 0.5, j + 0.5, &o, &d);
    o = sv_add(o, camera->eye);
    double step = 0.1 * fmin(f->dx, f->dy) / fmax(hypot(d.x, d.y), 0.2), end = 1200;
    double before = NAN, t = camera->near_m;
    for (; t < end; t += step) {
        struct sv_vec3 p = sv_madd(o, d, t);
        double gap = p.z - kit_surface(f, p.x, p.y);
        if (before * gap <= 0)
            break;
        before = gap;
    }
    if (!(t < end))
        return INFINITY;
    double a = t - step, b = t;
    for (int k = 0; k < 60; k++) {
        double m = (a + b) / 2;
        struct sv_vec3 p = sv_madd(o, d, m);
        if ((p.z - kit_surface(f, p.x, p.y)) * before > 0)
            a = m;
        else
            b = m;
    }
    return (a + b) / 2;
}

static bool near_silhouette(const double *z, int i, int j)
{
    for (int y = j - 2; y <= j + 2; y++)
        for (int x = i - 2; x <= i + 2; x++) {
            if (x < 1 || y < 1 || x >= W - 1 || y >= H - 1)
                return true;
            double c = 1 / z[y * W + x], l = 1 / z[y * W + x - 1], r = 1 / z[y * W + x + 1],
                   u = 1 / z[(y - 1) * W + x], d = 1 / z[(y + 1) * W + x];
            if (fabs(l - 2 * c + r) > 0.08 * c || fabs(u - 2 * c + d) > 0.08 * c ||
                (c == 0 && l + r + u + d > 0))
                return true;
        }
    return false;
}

struct tally {
    long compared, silhouette, wrong, sky_wrong;
    double worst; /* error in units of what is allowed */
};

static void compare(const double *truth, const float *drawn, struct tally *tally)
{
    for (int j = 0; j < H; j++)
        for (int i = 0; i < W; i++) {
            double z = truth[j * W + i], g = (double)drawn[j * W + i];
            if (near_silhouette(truth, i, j)) {
                tally->silhouette++;
                continue;
            }
            tally->compared++;
            if (isinf(z) || isinf(g)) {
                tally->sky_wrong += isinf(z) != isinf(g);
                continue;
            }
            double error = fabs(g - z) / fmax(0.001 * z, 0.05);
            tally->worst = fmax(tally->worst, error);
            tally->wrong += !(error <= 1);
        }
}

static struct sv_view_request random_pose(const struct sv_heightfield *f, struct sv_rng *rng)
{
    struct sv_view_request r = kit_request();
    r.eye.x = f->x0 + (f->width - 1) * f->dx * sv_rng_range(rng, 0.02, 0.98);
    r.eye.y = f->y0 + (f->height - 1) * f->dy * sv_rng_range(rng, 0.02, 0.98);
    r.eye.agl = exp(sv_rng_range(rng, log(1.5), log(200)));
    r.heading_rad = sv_rng_range(rng, 0, 2 * SV_PI);
    r.pitch_rad = sv_radians(sv_rng_range(rng, -60, 10));
    r.roll_rad = sv_radians(sv_rng_range(rng, -20, 20));
    r.vfov_rad = sv_radians(sv_rng_range(rng, 25, 100));
    r.width = W;
    r.height = H;
    r.layers = 1u << SV_LAYER_DEPTH;
    r.trees = SV_TREES_NONE;
    return r;
}

static void run(double x0, double y0, double z0, const char *name)
{
    struct kit_options options = utm;
    options.x0 = x0;
    options.y0 = y0;
    options.z0 = z0;
    struct sv_scene *scene = kit_scene(&options);
    struct sv_renderer *renderer;
    struct sv_error error = {0};
    assert_int_equal(
        sv_renderer_create(scene, &(struct sv_renderer_options){.truth = true}, &renderer, &error), SV_OK);
    struct sv_rng rng = sv_rng_seeded(7, 0);
    struct tally raster = {0}, raycast = {0};
    static double truth[W * H];
    for (int k = 0; k < POSES; k++) {
        struct sv_view_request request = random_pose(&scene->terrain.field, &rng);
        struct sv_resolved_view view;
        assert_int_equal(sv_view_resolve(scene, &request, &view, NULL, &error), SV_OK);
        for (int p = 0; p < W * H; p++)
            truth[p] = march(&scene->terrain.field, &view.camera, p % W, p / W);
        for (int way = 0; way < 2; way++) {
            struct sv_picture picture;
            view.plan.terrain_error_px = 0;
            view.plan.raycast = way == 1;
            assert_int_equal(sv_renderer_draw(renderer, &request, &view, &picture, NULL, NULL, &error),
                             SV_OK);
            compare(truth, picture.layer[SV_LAYER_DEPTH].data, way ? &raycast : &raster);
            sv_picture_finish(&picture);
        }
    }
    const struct tally *all[] = {&raster, &raycast};
    static const char *const ways[] = {"OSMesa", "Embree"};
    for (int way = 0; way < 2; way++) {
        const struct tally *t = all[way];
        printf("%s, %s: %ld pixels compared, %ld near silhouettes, %ld beyond 0.1 %% or 5 cm, worst %.4f of "
               "allowed, "
               "%ld sky for ground\n",
               name, ways[way], t->compared, t->silhouette, t->wrong, t->worst, t->sky_wrong);
        assert_int_equal(t->wrong, 0);
        assert_int_equal(t->sky_wrong, 0);
        assert_true(t->compared > POSES * W * H / 2);
    }
    sv_renderer_destroy(renderer);
    kit_free(scene);
}

static void test_depth_utm(void **state)
{
    (void)state;
    run(utm.x0, utm.y0, utm.z0, "UTM coordinates");
}

static void test_depth_origin(void **state)
{
    (void)state;
    run(0, 0, 0, "moved to the origin");
}

/* With level of detail on: where drawn and true depth are of the same spot of ground (no silhouette), the
 * drawn point lies off the true surface by a height that, seen from the eye, is less than the stated pixels.
 */
static void test_detail_error(void **state)
{
    (void)state;
    struct sv_scene *scene = kit_scene(&utm);
    struct sv_renderer *renderer;
    struct sv_error error = {0};
    assert_int_equal(sv_renderer_create(scene, &(struct sv_renderer_options){0}, &renderer, &error), SV_OK);
    const struct sv_heightfield *f = &scene->terrain.field;
    struct sv_rng rng = sv_rng_seeded(8, 0);
    static const double allowed[] = {0.5, 1, 2, 8};
    long checked = 0, fewer = 0;
    for (int k = 0; k < POSES; k++) {
        struct sv_view_request request = random_pose(f, &rng);
        struct sv_resolved_view view;
        assert_int_equal(sv_view_resolve(scene, &request, &view, NULL, &error), SV_OK);
        view.plan.terrain_error_px = allowed[k % 4];
        struct sv_picture picture;
        struct sv_draw_stats stats = {0};
        assert_int_equal(sv_renderer_draw(renderer, &request, &view, &picture, NULL, &stats, &error), SV_OK);
        assert_true(stats.terrain_error_px <= allowed[k % 4]);
        fewer += stats.terrain_triangles < 2u * 128 * 96;
        const float *z = picture.layer[SV_LAYER_DEPTH].data;
        double focal = sv_camera_focal_px(&view.camera);
        for (int p = 0; p < W * H; p++) {
            if (isinf(z[p]))
                continue;
            struct sv_vec3 o, d;
            sv_camera_ray(&view.camera, p % W + 0.5, p / W + 0.5, &o, &d);
            struct sv_vec3 at = sv_madd(sv_add(o, view.camera.eye), d, (double)z[p]);
            double ground = kit_surface(f, at.x, at.y);
            if (isnan(ground))
                continue; /* on the rim, by a rounding */
            double px = fabs(at.z - ground) * focal / sv_length(sv_sub(at, view.camera.eye));
            /* depth itself may be off by 5e-7 of itself (float) */
            if (px > allowed[k % 4] + 1e-3)
                fail_msg("pose %d pixel %d: %.4f px off, allowed %.2f", k, p, px, allowed[k % 4]);
            checked++;
        }
        sv_picture_finish(&picture);
    }
    printf("level of detail: %ld points on the drawn surface checked; %ld of %d poses drew fewer triangles "
           "than all\n",
           checked, fewer, POSES);
    assert_true(checked > POSES * W * H / 4);
    assert_true(fewer > POSES / 2);
    sv_renderer_destroy(renderer);
    kit_free(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_depth_utm),
        cmocka_unit_test(test_depth_origin),
        cmocka_unit_test(test_detail_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
