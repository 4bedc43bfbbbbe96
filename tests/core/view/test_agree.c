/* test_agree.c - OSMesa's polygons and Embree's are two independent drawings of one scene: neither is trusted
 * alone.
 *
 * Seven scenes of up to 50 trees that fill at least a fifth of the picture, no shadows: 16 samples at the same
 * positions, the same alpha rule: mean absolute error under 2 of 255 levels over the pixels where either
 * shows a tree, and the ids of one-sample pictures equal in 97 % of those. SV_TEST_FULL=1 draws 20
 * scenes, with trees of 38,952 leaves, at 256 x 256. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <math.h>
#include <cmocka.h>

#include "core/base/rng.h"
#include "core/scene/id.h"
#include "tests/core/tree/kept_bakes.h"
#include "tests/core/view/scene_kit.h"

enum { SCENES = 20, SCENES_PLAIN = 7 };

struct agreement {
    double mean_error, id_equal, filled;
};

static bool is_tree(uint32_t id)
{
    return id >= SV_ID_TREE_FIRST;
}

static void draw(struct sv_renderer *renderer, const struct sv_scene *scene, struct sv_view_request request,
                 enum sv_trees trees, int samples, enum sv_layer layer, struct sv_image *out)
{
    struct sv_error error = {0};
    struct sv_resolved_view view;
    struct sv_picture picture;
    request.trees = trees;
    request.samples = samples;
    request.layers = 1u << layer;
    enum sv_status status = sv_view_resolve(scene, &request, &view, NULL, &error);
    view.plan.terrain_error_px = 0;
    if (!status)
        status = sv_renderer_draw(renderer, &request, &view, &picture, NULL, NULL, &error);
    if (status)
        fail_msg("%s: %s", error.field, error.message);
    *out = picture.layer[layer];
    picture.layer[layer] = (struct sv_image){0};
    sv_picture_finish(&picture);
}

static struct agreement agree(int number, int side, uint32_t leaves)
{
    struct sv_rng rng = sv_rng_seeded((uint64_t)number, 4);
    uint32_t trees = number == 0 ? 1 : (uint32_t)sv_rng_range(&rng, 2, 51);
    struct kit_options options = {.width = 33,
                                  .height = 33,
                                  .x0 = 500000,
                                  .y0 = 5.2e6,
                                  .z0 = 300,
                                  .dx = 8,
                                  .dy = 8,
                                  .relief_m = 20,
                                  .seed = (uint64_t)number + 1,
                                  .species = 5,
                                  .leaves = leaves,
                                  .trees = trees,
                                  .spread_m = 4 + 0.8 * trees,
                                  .height_min_m = 6,
                                  .height_max_m = 18};
    struct sv_scene *scene = kit_scene(&options);
    struct sv_renderer *renderer;
    struct sv_error error = {0};
    if (sv_renderer_create(scene, &(struct sv_renderer_options){.store = kept_bakes(), .truth = true},
                           &renderer, &error))
        fail_msg("%s: %s", error.field, error.message);
    struct sv_view_request request = kit_request();
    request.width = request.height = side;
    request.eye.form = SV_PLACE_NONE;
    request.target = (struct sv_place){.form = SV_PLACE_XY, .x = 500128, .y = 5200128, .agl = 6};
    request.heading_rad = sv_rng_range(&rng, 0, 2 * SV_PI);
    request.pitch_rad = sv_radians(sv_rng_range(&rng, -50, -2));
    request.range_m = options.spread_m + 14;
    request.has_sun_azimuth = request.has_sun_elevation = true;
    request.sun_azimuth_rad = sv_rng_range(&rng, 0, 2 * SV_PI);
    request.sun_elevation_rad = sv_radians(sv_rng_range(&rng, 8, 80));
    if (number % 5 == 4) {
        request.projection = SV_PROJECTION_ORTHOGRAPHIC;
        request.ortho_height_m = options.spread_m * 1.5 + 9;
    }
    struct sv_image color[2], id[2];
    for (int way = 0; way < 2; way++) {
        enum sv_trees form = way ? SV_TREES_RAYCAST : SV_TREES_POLYGON;
        draw(renderer, scene, request, form, 16, SV_LAYER_COLOR, &color[way]);
        draw(renderer, scene, request, form, 1, SV_LAYER_ID, &id[way]);
        char name[64];
        snprintf(name, sizeof name, "agree-%02d-%s", number, way ? "embree" : "osmesa");
        kit_keep(&color[way], name);
    }
    const uint32_t *a = id[0].data, *b = id[1].data;
    const uint8_t *p = color[0].data, *q = color[1].data;
    long either = 0, equal = 0, sum = 0;
    for (int k = 0; k < side * side; k++) {
        if (!is_tree(a[k]) && !is_tree(b[k]))
            continue;
        either++;
        equal += a[k] == b[k];
        for (int c = 0; c < 3; c++)
            sum += labs((long)p[k * 4 + c] - (long)q[k * 4 + c]);
    }
    for (int way = 0; way < 2; way++) {
        sv_image_free(&color[way]);
        sv_image_free(&id[way]);
    }
    sv_renderer_destroy(renderer);
    kit_free(scene);
    printf("scene %2d: %2u trees fill %4.1f %%, mean absolute error %.3f of 255, ids equal %.2f %%\n", number,
           trees, 100.0 * (double)either / (side * side), (double)sum / (3.0 * (double)either),
           100.0 * (double)equal / (double)either);
    return (struct agreement){(double)sum / (3.0 * (double)either), (double)equal / (double)either,
                              (double)either / (side * side)};
}

static void test_polygons_agree(void **state)
{
    (void)state;
    const char *full = getenv("SV_TEST_FULL");
    bool whole = full && strcmp(full, "1") == 0;
    for (int k = 0; k < (whole ? SCENES : SCENES_PLAIN); k++) {
        struct agreement g = agree(k, whole ? 256 : 96, whole ? 38952 : 1500);
        assert_true(g.filled >= 0.20);
        assert_true(g.mean_error < 2.0);
        assert_true(g.id_equal >= 0.97);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_polygons_agree)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
