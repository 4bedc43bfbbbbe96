/* test_draw_object.c - objects in a picture: polygons by OSMesa, reliefs by the warp, and both against the
 * ray-cast truth, which shares no line with either; which form is chosen; shadows; many objects. UTM
 * coordinates throughout. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <math.h>
#include <time.h>
#include <cmocka.h>

#include "core/base/rng.h"
#include "core/relief/draw_object.h"
#include "core/scene/id.h"
#include "core/tree/import.h"
#include "tests/core/relief/object_fixture.h"

enum { SIDE = 160 };

struct stage {
    struct sv_scene *scene;
    struct sv_renderer *renderer;
};

static struct stage make_stage(const struct sv_tree_mesh *const *meshes, int mesh_count,
                               const struct object_place *places, int count, double relief_m)
{
    struct stage s;
    struct sv_error error = {0};
    struct kit_options kit = {.width = 65,
                              .height = 65,
                              .x0 = 500000,
                              .y0 = 5.2e6,
                              .z0 = 300,
                              .dx = 4,
                              .dy = 4,
                              .relief_m = relief_m,
                              .seed = 3};
    s.scene = kit_scene(&kit);
    object_add(s.scene, meshes, mesh_count, places, count);
    if (sv_renderer_create(s.scene, &(struct sv_renderer_options){.truth = true}, &s.renderer, &error))
        fail_msg("%s: %s", error.field, error.message);
    return s;
}

static void end_stage(struct stage *s)
{
    sv_renderer_destroy(s->renderer);
    kit_free(s->scene);
}

static const struct object_place HUT = {0, 500128, 5200128, 0.4, 6, 256};
static struct stage hut; /* on flat ground; most tests share it: a renderer takes seconds to make */

/* An orbit's pose around the field's middle. */
static struct sv_view_request orbit(double heading_deg, double pitch_deg, double range_m)
{
    struct sv_view_request request = kit_request();
    request.width = request.height = SIDE;
    request.eye.form = SV_PLACE_NONE;
    request.target = (struct sv_place){.form = SV_PLACE_XY, .x = 500128, .y = 5200128, .agl = 2.5};
    request.heading_rad = sv_radians(heading_deg);
    request.pitch_rad = sv_radians(pitch_deg);
    request.range_m = range_m;
    request.vfov_rad = sv_radians(40);
    request.shadows = true;
    request.has_sun_azimuth = request.has_sun_elevation = true;
    request.sun_azimuth_rad = sv_radians(140);
    request.sun_elevation_rad = sv_radians(40);
    return request;
}

static bool is_object(uint32_t id)
{
    return id >= SV_ID_OBJECT_FIRST && id < SV_ID_TREE_FIRST;
}

struct agreement {
    double mean_error, id_equal, either;
};

/* One form against another, over the pixels where either shows the object. samples: of both. */
static struct agreement agree(const struct stage *s, int object, struct sv_view_request request,
                              enum object_form a, enum object_form b, int samples, const char *name)
{
    struct sv_image color[2], id[2];
    const enum object_form form[2] = {a, b};
    static const char *const names[] = {"polygon", "relief", "truth"};
    for (int k = 0; k < 2; k++) {
        char file[96];
        object_draw(s->renderer, s->scene, request, form[k], samples, SV_LAYER_COLOR, &color[k], NULL);
        object_draw(s->renderer, s->scene, request, form[k], 1, SV_LAYER_ID, &id[k], NULL);
        snprintf(file, sizeof file, "%s-%s", name, names[form[k]]);
        kit_keep(&color[k], file);
    }
    const uint32_t *p = id[0].data, *q = id[1].data;
    const uint8_t *u = color[0].data, *v = color[1].data;
    const uint32_t wanted = SV_ID_OBJECT_FIRST + (uint32_t)object;
    long either = 0, equal = 0, sum = 0;
    for (int i = 0; i < request.width * request.height; i++) {
        if (p[i] != wanted && q[i] != wanted)
            continue;
        either++;
        equal += p[i] == q[i];
        for (int c = 0; c < 3; c++)
            sum += labs((long)u[4 * i + c] - (long)v[4 * i + c]);
    }
    for (int k = 0; k < 2; k++) {
        sv_image_free(&color[k]);
        sv_image_free(&id[k]);
    }
    return (struct agreement){either ? (double)sum / (3.0 * (double)either) : 0,
                              either ? (double)equal / (double)either : 0,
                              (double)either / (request.width * request.height)};
}

static void polygons_agree_with_truth(void **state)
{
    (void)state;
    const struct stage s = hut;
    struct sv_rng rng = sv_rng_seeded(5, 5);
    for (int k = 0; k < 6; k++) {
        struct sv_view_request request =
            orbit(sv_rng_range(&rng, 0, 360), sv_rng_range(&rng, -60, -4), sv_rng_range(&rng, 14, 30));
        char name[32];
        snprintf(name, sizeof name, "object-%02d", k);
        request.sun_azimuth_rad = sv_rng_range(&rng, 0, 2 * SV_PI);
        request.sun_elevation_rad = sv_radians(sv_rng_range(&rng, 15, 80));
        if (k % 3 == 2) {
            request.projection = SV_PROJECTION_ORTHOGRAPHIC;
            request.ortho_height_m = 16;
        }
        request.shadows = k % 2 == 0;
        struct agreement g = agree(&s, 0, request, OBJECT_POLYGON, OBJECT_TRUTH, 16, name);
        printf("view %d%s: %.1f %% of the picture, mean error %.2f of 255, ids equal %.2f %%\n", k,
               request.shadows ? ", shadows" : "", 100 * g.either, g.mean_error, 100 * g.id_equal);
        assert_true(g.either > 0.05);
        assert_true(g.id_equal >= 0.97);
        assert_true(g.mean_error <
                    (request.shadows ? 4.0 : 1.5)); /* shadow maps have texels, rays have none */
    }
}

/* Where the rule of texel size lets reliefs be drawn, they must not show against polygons. */
static void reliefs_agree_with_truth(void **state)
{
    (void)state;
    const struct stage s = hut;
    struct sv_rng rng = sv_rng_seeded(6, 5);
    double sum = 0, ids = 0;
    enum { VIEWS = 6 };
    for (int k = 0; k < VIEWS; k++) {
        struct sv_view_request request =
            orbit(sv_rng_range(&rng, 0, 360), sv_rng_range(&rng, -60, -3), sv_rng_range(&rng, 24, 40));
        char name[32];
        snprintf(name, sizeof name, "object-relief-%02d", k);
        struct agreement g = agree(&s, 0, request, OBJECT_RELIEF, OBJECT_TRUTH, 4, name);
        struct agreement p = agree(&s, 0, request, OBJECT_POLYGON, OBJECT_TRUTH, 4, name);
        printf("view %2d: relief %.2f of 255, ids %.2f %%; polygons %.2f, %.2f %%\n", k, g.mean_error,
               100 * g.id_equal, p.mean_error, 100 * p.id_equal);
        sum += g.mean_error / VIEWS;
        ids += g.id_equal / VIEWS;
    }
    printf("mean of %d views: %.2f of 255, ids %.2f %%\n", (int)VIEWS, sum, 100 * ids);
    assert_true(ids >= 0.96);
    assert_true(sum < 8);
}

/* 36 steps around: no step may lose the object, or show it much unlike its polygons. */
static void orbit_in_relief(void **state)
{
    (void)state;
    const struct stage s = hut;
    double worst = 0, worst_id = 1;
    for (int k = 0; k < 36; k++) {
        struct agreement g = agree(&s, 0, orbit(10 * k, -20, 30), OBJECT_RELIEF, OBJECT_POLYGON, 1, "orbit");
        worst = fmax(worst, g.mean_error);
        worst_id = fmin(worst_id, g.id_equal);
    }
    printf("orbit: worst mean error against polygons %.2f of 255, worst share of equal ids %.2f %%\n", worst,
           100 * worst_id);
    assert_true(worst_id >= 0.93);
    assert_true(worst < 16);
}

static struct sv_draw_stats count_forms(const struct stage *s, struct sv_view_request request,
                                        double *texel_px)
{
    struct sv_resolved_view view;
    struct sv_picture picture;
    struct sv_draw_stats stats = {0};
    struct sv_error error;
    if (sv_view_resolve(s->scene, &request, &view, NULL, &error) ||
        sv_renderer_draw(s->renderer, &request, &view, &picture, NULL, &stats, &error))
        fail_msg("%s: %s", error.field, error.message);
    sv_picture_finish(&picture);
    *texel_px = view.plan.relief_texel_px;
    return stats;
}

/* relief when its texel is at most relief_texel_px in the picture: by distance, as quality says. The box's
 * longest side, 9 m of 6 m height, has 256 texels: a texel is 9/256 m and at distance d from its nearest
 * corner 9/256 F / d px. */
static void form_by_size(void **state)
{
    (void)state;
    const struct stage s = hut;
    static const struct {
        enum sv_quality quality;
        enum sv_relief_mode relief;
        double range_m, limit_px;
        bool relief_form;
    } cases[] = {{SV_QUALITY_BALANCED, SV_RELIEF_AUTO, 60, 1, true},
                 {SV_QUALITY_BALANCED, SV_RELIEF_AUTO, 9, 1, false},
                 {SV_QUALITY_FAST, SV_RELIEF_AUTO, 9, 2, true},
                 {SV_QUALITY_HIGH, SV_RELIEF_AUTO, 12, 0.5, false},
                 {SV_QUALITY_HIGH, SV_RELIEF_AUTO, 60, 0.5, true},
                 {SV_QUALITY_BALANCED, SV_RELIEF_OFF, 60, 0, false}};
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        struct sv_view_request request = orbit(30, -15, cases[k].range_m);
        request.quality = cases[k].quality;
        request.relief = cases[k].relief;
        double limit, f = SIDE / 2 / tan(sv_radians(20));
        struct sv_draw_stats stats = count_forms(&s, request, &limit);
        printf("range %2.0f m: a texel at the middle is %.2f px, limit %.1f: %s\n", cases[k].range_m,
               9.0 / 256 * f / cases[k].range_m, limit, stats.relief_objects ? "relief" : "polygons");
        assert_true(limit == cases[k].limit_px);
        assert_int_equal(stats.relief_objects, cases[k].relief_form);
        assert_int_equal(stats.polygon_objects, !cases[k].relief_form);
    }
    struct sv_view_request away = orbit(30, -15, 30);
    away.eye = (struct sv_place){.form = SV_PLACE_XY, .x = 500128, .y = 5200120, .agl = 30};
    away.target = (struct sv_place){.form = SV_PLACE_XY, .x = 500128, .y = 5200020, .agl = 30};
    double limit;
    struct sv_draw_stats stats = count_forms(&s, away, &limit);
    assert_int_equal(stats.relief_objects + stats.polygon_objects, 0); /* behind the eye */
}

static double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

/* 1,000 objects of one model in eight headings. Times are told, not judged. */
static void a_thousand(void **state)
{
    (void)state;
    enum { COUNT = 1000 };
    static struct object_place places[COUNT];
    struct sv_tree_mesh mesh;
    struct sv_rng rng = sv_rng_seeded(7, 5);
    object_hut(&mesh);
    for (int k = 0; k < COUNT; k++)
        places[k] = (struct object_place){0,
                                          500000 + sv_rng_range(&rng, 1, 255),
                                          5200000 + sv_rng_range(&rng, 1, 255),
                                          (k % 8) * SV_PI / 4,
                                          sv_rng_range(&rng, 1, 4),
                                          64};
    const struct sv_tree_mesh *const meshes[] = {&mesh};
    struct stage s = make_stage(meshes, 1, places, COUNT, 10);
    struct sv_view_request request = orbit(20, -25, 180);
    request.vfov_rad = sv_radians(60);
    double limit, times[3];
    struct sv_draw_stats stats = {0};
    for (int k = 0; k < 3; k++) {
        double since = now_ms();
        stats = count_forms(&s, request, &limit);
        times[k] = now_ms() - since;
    }
    printf("%u polygons, %u reliefs: first picture %.1f ms, then %.1f ms\n", stats.polygon_objects,
           stats.relief_objects, times[0], fmin(times[1], times[2]));
    assert_true(stats.relief_objects > 500);
    struct sv_image id[2];
    object_draw(s.renderer, s.scene, request, OBJECT_RELIEF, 1, SV_LAYER_ID, &id[0], NULL);
    object_draw(s.renderer, s.scene, request, OBJECT_TRUTH, 1, SV_LAYER_ID, &id[1], NULL);
    const uint32_t *p = id[0].data, *q = id[1].data;
    long either = 0, equal = 0;
    for (int i = 0; i < SIDE * SIDE; i++)
        if (is_object(p[i]) || is_object(q[i]))
            either++, equal += p[i] == q[i];
    printf("ids of %ld pixels: %.2f %% equal to the truth's\n", either,
           100.0 * (double)equal / (double)either);
    assert_true((double)equal > 0.75 * (double)either); /* huts of a few pixels: most of these are border */
    sv_image_free(&id[0]);
    sv_image_free(&id[1]);
    end_stage(&s);
    sv_tree_mesh_finish(&mesh);
}

/* The ground's shadow: where the truth says that the hut keeps the sun away, the picture is dark. */
static void shadow_on_the_ground(void **state)
{
    (void)state;
    const struct stage s = hut;
    struct sv_view_request request = orbit(0, -89.9, 40);
    struct sv_image lit[2], dark[2], id;
    for (int k = 0; k < 2; k++) {
        enum object_form form = k ? OBJECT_TRUTH : OBJECT_POLYGON;
        request.shadows = false;
        object_draw(s.renderer, s.scene, request, form, 4, SV_LAYER_COLOR, &lit[k], NULL);
        request.shadows = true;
        object_draw(s.renderer, s.scene, request, form, 4, SV_LAYER_COLOR, &dark[k], NULL);
    }
    object_draw(s.renderer, s.scene, request, OBJECT_TRUTH, 1, SV_LAYER_ID, &id, NULL);
    long shaded = 0, same = 0, all = 0;
    for (int i = 0; i < SIDE * SIDE; i++) {
        if (((const uint32_t *)id.data)[i] != SV_ID_TERRAIN)
            continue;
        bool is_dark[2];
        for (int k = 0; k < 2; k++) {
            const uint8_t *a = (const uint8_t *)lit[k].data + 4 * i,
                          *b = (const uint8_t *)dark[k].data + 4 * i;
            is_dark[k] = 4 * (b[0] + b[1] + b[2]) < 3 * (a[0] + a[1] + a[2]);
        }
        all++;
        shaded += is_dark[0] || is_dark[1];
        same += is_dark[0] && is_dark[1];
    }
    printf("%ld px of ground, %ld in shadow by either, %.1f %% by both\n", all, shaded,
           100.0 * (double)same / (double)shaded);
    assert_true(shaded > 300);
    assert_true((double)same > 0.88 * (double)shaded); /* a border of one pixel around 500 is a tenth */
    for (int k = 0; k < 2; k++) {
        sv_image_free(&lit[k]);
        sv_image_free(&dark[k]);
    }
    sv_image_free(&id);
}

/* A small hut behind a large one, seen from the sun's left: in its shadow in both forms, as rays say. */
static void shadow_on_another(void **state)
{
    (void)state;
    struct sv_tree_mesh mesh;
    const struct sv_tree_mesh *const meshes[] = {&mesh};
    object_hut(&mesh);
    /* sun at azimuth 180, elevation 30: the shadow of 12 m reaches 20 m to the north */
    const struct object_place places[] = {{0, 500128, 5200120, 0, 12, 128},
                                          {0, 500128, 5200134.5, 0, 2.5, 128}};
    struct stage s = make_stage(meshes, 1, places, 2, 0);
    struct sv_view_request request = orbit(250, -20, 12);
    request.target.y = 5200134.5;
    request.target.agl = 1;
    request.sun_azimuth_rad = SV_PI;
    request.sun_elevation_rad = sv_radians(30);
    for (int form = OBJECT_POLYGON; form <= OBJECT_RELIEF; form++) {
        struct agreement shaded = agree(&s, 1, request, (enum object_form)form, OBJECT_TRUTH, 4, "shaded");
        printf("in another's shadow, form %d: %.1f %% of the picture, mean error %.2f of 255\n", form,
               100 * shaded.either, shaded.mean_error);
        assert_true(shaded.either > 0.02 && shaded.mean_error < 6);
    }
    end_stage(&s);
    sv_tree_mesh_finish(&mesh);
}

/* A small hut under the eaves of a tower of a hut, the sun straight above: in the dark in both forms. */
static void shadow_from_straight_above(void **state)
{
    (void)state;
    struct sv_tree_mesh mesh;
    const struct sv_tree_mesh *const meshes[] = {&mesh};
    object_hut(&mesh);
    /* walls at 30 m from the middle, eaves at 35 m, 27 m above the ground */
    const struct object_place places[] = {{0, 500128, 5200120, 0, 60, 128},
                                          {0, 500128, 5200152.5, 0, 2.5, 128}};
    struct stage s = make_stage(meshes, 1, places, 2, 0);
    struct sv_view_request request = orbit(200, -20, 12);
    request.target.y = 5200152.5;
    request.target.agl = 1;
    request.sun_elevation_rad = SV_PI / 2;
    for (int form = OBJECT_POLYGON; form <= OBJECT_RELIEF; form++) {
        struct agreement shaded = agree(&s, 1, request, (enum object_form)form, OBJECT_TRUTH, 4, "eaves");
        printf("under eaves, form %d: %.1f %% of the picture, mean error %.2f of 255\n", form,
               100 * shaded.either, shaded.mean_error);
        assert_true(shaded.either > 0.02 && shaded.mean_error < 6);
    }
    end_stage(&s);
    sv_tree_mesh_finish(&mesh);
}

/* Every model that is here, in all forms, near and far. */
static void real_models(void **state)
{
    (void)state;
    static const char *const files[] = {"german_house/germanvillagehouse1.ac", "church/big-church.ac",
                                        "rock1/rock1.obj", "spot/spot_textured.obj", "bunny/bunny.ply"};
    const char *data = getenv("SV_DATA");
    enum { FILES = sizeof files / sizeof files[0] };
    struct sv_tree_mesh meshes[FILES];
    const struct sv_tree_mesh *list[FILES];
    const char *names[FILES];
    struct object_place places[FILES];
    int drawn = 0;
    for (size_t k = 0; k < FILES; k++) {
        char path[512];
        struct sv_error error;
        snprintf(path, sizeof path, "%s/objects/%s", data ? data : "../shared/data", files[k]);
        enum sv_status status = sv_object_import(path, &meshes[drawn], NULL, &error);
        if (status == SV_ENOENT)
            continue;
        if (status)
            fail_msg("%s: %s", error.field, error.message);
        places[drawn] = (struct object_place){drawn, 500030 + 48 * drawn, 5200128, 0.4, 6, 128};
        names[drawn] = files[k];
        list[drawn] = &meshes[drawn];
        drawn++;
    }
    struct stage s = {0};
    if (drawn)
        s = make_stage(list, drawn, places, drawn, 0);
    for (int k = 0; k < drawn; k++) {
        struct sv_view_request request = orbit(10, -20, 45);
        request.target.x = places[k].x;
        struct agreement p = agree(&s, k, request, OBJECT_POLYGON, OBJECT_TRUTH, 16, "real-polygon");
        struct agreement r = agree(&s, k, request, OBJECT_RELIEF, OBJECT_TRUTH, 16, "real-relief");
        printf("%s: polygons %.2f of 255, ids %.2f %%; relief %.2f, %.2f %%\n", names[k], p.mean_error,
               100 * p.id_equal, r.mean_error, 100 * r.id_equal);
        assert_true(p.id_equal >= 0.95 && p.mean_error < 8);
        assert_true(r.id_equal >= 0.90 && r.mean_error < 16);
        sv_tree_mesh_finish(&meshes[k]);
    }
    if (drawn)
        end_stage(&s);
    if (!drawn) {
        printf("skipped: no real models here\n");
        skip();
    }
}

static int set_up(void **state)
{
    (void)state;
    struct sv_tree_mesh mesh;
    const struct sv_tree_mesh *const meshes[] = {&mesh};
    object_hut(&mesh);
    hut = make_stage(meshes, 1, &HUT, 1, 0);
    sv_tree_mesh_finish(&mesh);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    end_stage(&hut);
    return 0;
}

int main(void)
{
    const struct CMUnitTest on_stage[] = {cmocka_unit_test(polygons_agree_with_truth),
                                          cmocka_unit_test(reliefs_agree_with_truth),
                                          cmocka_unit_test(orbit_in_relief), cmocka_unit_test(form_by_size),
                                          cmocka_unit_test(shadow_on_the_ground)};
    /* These make renderers of their own: there is one GL context at a time. */
    const struct CMUnitTest others[] = {cmocka_unit_test(a_thousand), cmocka_unit_test(real_models),
                                        cmocka_unit_test(shadow_on_another),
                                        cmocka_unit_test(shadow_from_straight_above)};
    int failed = cmocka_run_group_tests(on_stage, set_up, tear_down);
    return failed + cmocka_run_group_tests(others, NULL, NULL);
}
