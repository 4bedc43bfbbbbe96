/* test_patch.c - a patched scene against one that was loaded from a scene file with the change: the same
 * trees, hierarchy, objects and sun, and byte for byte the same pictures in every kind of form, shadows
 * included; what was added and removed again leaves no trace; ids stay with their trees. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "api/patch_parse.h"
#include "core/scene/id.h"
#include "tests/core/tree/kept_bakes.h"
#include "tests/core/view/patch_kit.h"
#include "tests/core/view/scene_kit.h"

enum { SIDE = 96 };

static struct sv_renderer *renderer_of(const struct sv_scene *scene)
{
    struct sv_renderer *r = NULL;
    struct sv_error error;
    struct sv_renderer_options options = {.store = kept_bakes(), .truth = true};
    if (sv_renderer_create(scene, &options, &r, &error) != SV_OK ||
        sv_renderer_warm_shadows(r, &error) != SV_OK)
        fail_msg("%s: %s", error.field, error.message);
    return r;
}

/* ---- pictures ---- */

static const struct {
    double x, y, agl, heading_deg, pitch_deg;
    enum sv_trees trees;
    unsigned layers;
} VIEWS[] = {
    {110, 20, 30, 0, -20, SV_TREES_AUTO, 1u << SV_LAYER_COLOR},
    {20, 20, 1.7, 45, 0, SV_TREES_AUTO, 1u << SV_LAYER_COLOR | 1u << SV_LAYER_ID},
    {110, 200, 45, 180, -35, SV_TREES_RAYCAST, 1u << SV_LAYER_COLOR | 1u << SV_LAYER_ID},
    {200, 110, 20, 270, -20, SV_TREES_POLYGON, 1u << SV_LAYER_COLOR},
    {110, 110, 25, 90, -30, SV_TREES_NONE, 1u << SV_LAYER_COLOR},
};
enum { VIEW_COUNT = sizeof VIEWS / sizeof VIEWS[0] };

static void draw(const struct sv_scene *scene, struct sv_renderer *r, int k, struct sv_picture *picture)
{
    struct sv_view_request q = kit_request();
    struct sv_resolved_view view;
    struct sv_error error;
    q.eye.x = VIEWS[k].x;
    q.eye.y = VIEWS[k].y;
    q.eye.agl = VIEWS[k].agl;
    q.heading_rad = sv_radians(VIEWS[k].heading_deg);
    q.pitch_rad = sv_radians(VIEWS[k].pitch_deg);
    q.trees = VIEWS[k].trees;
    q.layers = VIEWS[k].layers;
    q.width = q.height = SIDE;
    q.shadows = true;
    if (sv_view_resolve(scene, &q, &view, NULL, &error) != SV_OK ||
        sv_renderer_draw(r, &q, &view, picture, NULL, NULL, &error) != SV_OK)
        fail_msg("view %d: %s: %s", k, error.field, error.message);
}

static uint32_t differing(const struct sv_picture *a, const struct sv_picture *b)
{
    uint32_t pixels = 0;
    for (int l = 0; l < SV_LAYER_COUNT; l++) {
        const uint32_t *p = a->layer[l].data, *q = b->layer[l].data; /* colour and id: four bytes a pixel */
        for (int i = 0; p && i < SIDE * SIDE; i++)
            pixels += p[i] != q[i];
    }
    return pixels;
}

struct album {
    struct sv_picture pictures[VIEW_COUNT];
};

static struct album *take(const struct sv_scene *scene, struct sv_renderer *r, const char *name)
{
    struct album *a = calloc(1, sizeof *a);
    for (int k = 0; k < VIEW_COUNT; k++) {
        char file[64];
        draw(scene, r, k, &a->pictures[k]);
        snprintf(file, sizeof file, "patch-%s-%d", name, k);
        kit_keep(&a->pictures[k].layer[SV_LAYER_COLOR], file);
    }
    return a;
}

static void drop(struct album *a)
{
    for (int k = 0; k < VIEW_COUNT; k++)
        sv_picture_finish(&a->pictures[k]);
    free(a);
}

/* A ray that meets the edge of two triangles meets both at one distance. Which of them Embree tells of
 * depends on whether hits are filtered (truth.h): on what is gone they are. Edges are as wide as floats are
 * coarse, some 1e-5 m at these distances, of leaves of 0.1 m and more: 1e-4 of the rays. */
enum { TIES = SIDE * SIDE / 5000 };

static void same_pictures(const struct album *a, const struct album *b)
{
    for (int k = 0; k < VIEW_COUNT; k++)
        if (differing(&a->pictures[k], &b->pictures[k]) > (VIEWS[k].trees == SV_TREES_RAYCAST ? TIES : 0))
            fail_msg("view %d: %u pixels differ", k, differing(&a->pictures[k], &b->pictures[k]));
}

/* At least one view with trees shows it. */
static void other_pictures(const struct album *a, const struct album *b)
{
    uint32_t pixels = 0;
    for (int k = 0; k < VIEW_COUNT; k++)
        pixels += differing(&a->pictures[k], &b->pictures[k]);
    assert_true(pixels > 0);
}

static void same_scene(const struct sv_scene *a, const struct sv_scene *b)
{
    const struct sv_forest *f = &a->forest, *g = &b->forest;
    assert_int_equal(f->count, g->count);
    assert_int_equal(f->node_count, g->node_count);
    assert_memory_equal(&f->origin, &g->origin, sizeof f->origin);
    if (f->count) {
        assert_memory_equal(f->trees, g->trees, f->count * sizeof *f->trees);
        assert_memory_equal(f->nodes, g->nodes, f->node_count * sizeof *f->nodes);
    }
    for (int k = 0; k < a->species_count; k++)
        assert_int_equal(a->species[k].tree_count, b->species[k].tree_count);
    assert_int_equal(a->object_count, b->object_count);
    for (int k = 0; k < a->object_count; k++) {
        const struct sv_scene_object *o = &a->objects[k], *q = &b->objects[k];
        assert_string_equal(a->models[o->model].file, b->models[q->model].file);
        assert_true(o->x == q->x && o->y == q->y && o->z == q->z && o->heading_rad == q->heading_rad);
        assert_true(o->number == q->number && o->height_m == q->height_m);
    }
    assert_true(a->sun.azimuth_rad == b->sun.azimuth_rad && a->sun.elevation_rad == b->sun.elevation_rad);
}

/* One context at a time: pictures of the patched scene, then those of the loaded one. */
static void compare(struct sv_scene *patched, struct sv_renderer *r, struct sv_scene *loaded,
                    const char *name)
{
    struct album *a = take(patched, r, name);
    sv_renderer_destroy(r);
    same_scene(patched, loaded);
    struct sv_renderer *other = renderer_of(loaded);
    struct album *b = take(loaded, other, "loaded");
    same_pictures(a, b);
    sv_renderer_destroy(other);
    drop(a);
    drop(b);
    sv_scene_destroy(patched);
    sv_scene_destroy(loaded);
}

/* ---- tests ---- */

/* One patch after the other: by list (the first bush of the scene, too), by scatter, an object, the sun. */
static void test_changes(void **state)
{
    (void)state;
    const char *scatter = "\"scatter\":{\"count\":300,\"seed\":9,\"mix\":{\"bush\":1,\"oak\":2},\"height_m\":"
                          "[2,9],\"min_spacing_m\":1,"
                          "\"within\":";
    const char *area = "{\"type\":\"Polygon\",\"coordinates\":[[[60,60],[150,70],[140,160],[60,60]]]}";
    const char *object = "\"x\":80.5,\"y\":95,\"height_m\":9,\"heading_deg\":25,\"relief_resolution\":32}";
    char forest[768], objects[256];
    struct sv_scene *scene = patch_kit_load(PATCH_KIT_TREES, "", "", 135);
    struct sv_renderer *r = renderer_of(scene);
    struct sv_scene_change c = patch_kit_patch(scene, r,
                                     "{\"trees\":{\"add\":[{\"x\":100.5,\"y\":90.25,\"species\":\"bush\","
                                     "\"height_m\":4},{\"x\":125,\"y\":125,"
                                     "\"species\":\"fir\",\"height_m\":17.5,\"rotation_deg\":40}]}}");
    assert_true(c.trees_added == 2 && c.first_tree == PATCH_KIT_TREES && c.box_count == 2);
    c = patch_kit_patch(scene, r, "{\"trees\":{\"add\":[{%s%s}}]}}", scatter, area);
    assert_int_equal(c.trees_added + c.not_placed, 300);
    assert_true(c.trees_added > 100 && c.box_count > 10 && c.box_count <= SV_CHANGE_BOXES_MAX);
    patch_kit_write("tower.obj", "%s", PATCH_KIT_HUT);
    patch_kit_patch(scene, r, "{\"objects\":{\"add\":[{\"model\":\"tower.obj\",%s]}}", object);
    c = patch_kit_patch(scene, r, "{\"sun\":{\"azimuth_deg\":250.5}}");
    assert_true(c.sun && c.box_count == 0);
    patch_kit_write("more.csv", "x,y,species,height_m,rotation_deg\n100.5,90.25,bush,4,\n125,125,fir,17.5,40\n");
    patch_kit_write("area.geojson", "%s", area);
    snprintf(forest, sizeof forest,
             ",{\"points\":\"more.csv\",\"species\":\"species\",\"height_m\":\"height_m\",\"rotation_deg\":"
             "\"rotation_deg\"},{%s\"area.geojson\"}}",
             scatter);
    snprintf(objects, sizeof objects, ",{\"model\":\"tower.obj\",%s", object);
    compare(scene, r, patch_kit_load(PATCH_KIT_TREES, forest, objects, 250.5), "changes");
}

/* The last 9 trees of the file go: 3 by id, the others by areas about each. */
static void test_removed(void **state)
{
    (void)state;
    struct sv_scene *scene = patch_kit_load(PATCH_KIT_TREES, "", "", 135);
    struct sv_renderer *r = renderer_of(scene);
    for (uint32_t number = PATCH_KIT_TREES - 9; number < PATCH_KIT_TREES; number++) {
        uint32_t k = 0;
        while (scene->forest.trees[k].number != number)
            k++;
        double x = scene->forest.trees[k].x, y = scene->forest.trees[k].y, d = 1e-6;
        struct sv_scene_change c =
            number % 3 == 0
                ? patch_kit_patch(scene, r, "{\"trees\":{\"remove\":{\"ids\":[%u]}}}", SV_ID_TREE_FIRST + number)
            : number % 3 == 1
                ? patch_kit_patch(scene, r,
                        "{\"trees\":{\"remove\":{\"near\":{\"x\":%.17g,\"y\":%.17g,\"radius_m\":%g}}}}", x, y,
                        d)
                : patch_kit_patch(scene, r,
                        "{\"trees\":{\"remove\":{\"within\":{\"type\":\"Polygon\",\"coordinates\":[[[%.17g,%."
                        "17g],"
                        "[%.17g,%.17g],[%.17g,%.17g],[%.17g,%.17g]]]}}}}",
                        x - d, y - d, x + d, y - d, x, y + d, x - d, y - d);
        assert_int_equal(c.trees_removed, 1);
    }
    compare(scene, r, patch_kit_load(PATCH_KIT_TREES - 9, "", "", 135), "removed");
}

/* To no tree at all, and from none to one: no number is given twice. */
static void none_and_one(struct sv_scene *scene, struct sv_renderer *r)
{
    patch_kit_patch(scene, r, "{\"trees\":{\"remove\":{\"near\":{\"x\":110,\"y\":110,\"radius_m\":1000}}}}");
    assert_int_equal(scene->forest.count, 0);
    drop(take(scene, r, "none"));
    struct sv_scene_change c =
        patch_kit_patch(scene, r, "{\"trees\":{\"add\":[{\"x\":111,\"y\":70,\"species\":\"oak\",\"height_m\":12}]}}");
    assert_int_equal(c.first_tree, PATCH_KIT_TREES + 2);
    struct album *a = take(scene, r, "one");
    sv_renderer_destroy(r);
    r = renderer_of(scene);
    struct album *b = take(scene, r, "one-anew");
    same_pictures(a, b);
    drop(a);
    drop(b);
    sv_renderer_destroy(r);
    sv_scene_destroy(scene);
}

/* Everything at once, and the whole of it taken back: version, trees and pictures are those of before. */
static void test_there_and_back(void **state)
{
    (void)state;
    struct sv_scene *scene = patch_kit_load(PATCH_KIT_TREES, "", "", 135);
    struct sv_renderer *r = renderer_of(scene);
    uint64_t version = scene->version;
    struct album *before = take(scene, r, "before");
    struct sv_scene_change c = patch_kit_patch(scene, r,
                                     "{\"sun\":{\"elevation_deg\":55},\"trees\":{\"add\":[{\"x\":5,\"y\":215,"
                                     "\"species\":\"bush\",\"height_m\":30},"
                                     "{\"x\":111,\"y\":70,\"species\":\"oak\",\"height_m\":12}]},"
                                     "\"objects\":{\"add\":[{\"model\":\"hut.obj\",\"x\":70,\"y\":70,"
                                     "\"height_m\":5,\"relief_resolution\":32}]}}");
    assert_true(scene->version != version);
    struct album *between = take(scene, r, "between");
    other_pictures(before, between);
    patch_kit_patch(scene, r,
          "{\"sun\":{\"elevation_deg\":28},\"trees\":{\"remove\":{\"ids\":[%u,%u]}},\"objects\":{\"remove\":{"
          "\"ids\":["
          "%u]}}}",
          SV_ID_TREE_FIRST + c.first_tree, SV_ID_TREE_FIRST + c.first_tree + 1,
          SV_ID_OBJECT_FIRST + c.first_object);
    assert_int_equal(scene->version, version);
    struct album *after = take(scene, r, "after");
    same_pictures(before, after);
    drop(before);
    drop(between);
    drop(after);
    none_and_one(scene, r);
}

static void expect(struct sv_scene *scene, const char *text, const char *const fields[], size_t count)
{
    struct sv_scene_patch patch;
    struct sv_scene_delta delta;
    struct sv_errors errors;
    uint64_t version = scene->version;
    const struct sv_tree *trees = scene->forest.trees;
    sv_errors_init(&errors);
    enum sv_status status = sv_api_patch_parse(text, strlen(text), &scene->spec, &patch, &errors);
    if (status == SV_OK) {
        status = sv_scene_patch_apply(scene, &patch, &(struct sv_scene_patch_options){0}, &delta, &errors);
        sv_scene_patch_finish(&patch);
    }
    assert_int_not_equal(status, SV_OK);
    assert_int_equal(errors.total, count);
    for (size_t k = 0; k < count; k++)
        assert_string_equal(errors.items[k].field, fields[k]);
    assert_true(scene->version == version && scene->forest.trees == trees);
    sv_errors_finish(&errors);
}

/* What only the scene knows is told all at once, and changes nothing. */
static void test_refused(void **state)
{
    (void)state;
    struct sv_scene *scene = patch_kit_load(8, "", "", 135);
    expect(
        scene,
        "{\"sun\":{\"time\":\"2026-06-21T10:00:00Z\"},\"trees\":{\"remove\":{\"ids\":[2147483655,2147483656,"
        "4294967295]},\"add\":[{\"x\":1,\"y\":1,\"species\":\"oak\",\"height_m\":3},{\"x\":-1,\"y\":1,"
        "\"species\":"
        "\"oak\",\"height_m\":3},{\"lon\":8,\"lat\":47,\"species\":\"oak\",\"height_m\":3}]},\"objects\":{"
        "\"remove\":{\"ids\":[1073741825]},\"add\":[{\"model\":\"hut.obj\",\"x\":900,\"y\":1,\"height_m\":2}]"
        "}}",
        (const char *const[]){"sun.time", "objects.remove.ids[0]", "objects.add[0]", "trees.remove.ids[1]",
                              "trees.remove.ids[2]", "trees.add[1]", "trees.add[2]"},
        7);
    sv_scene_destroy(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_changes), cmocka_unit_test(test_removed),
                                       cmocka_unit_test(test_there_and_back), cmocka_unit_test(test_refused)};
    return cmocka_run_group_tests(tests, patch_kit_setup, patch_kit_teardown);
}
