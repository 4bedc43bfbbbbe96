/* test_warm.c - warming up draws something of every scene, with trees or without, and changes no picture. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "core/view/warm.h"
#include "tests/core/tree/kept_bakes.h"
#include "tests/core/view/scene_kit.h"

static struct sv_picture draw(struct sv_renderer *renderer, const struct sv_scene *scene)
{
    struct sv_view_request request = kit_request();
    struct sv_resolved_view view;
    struct sv_picture picture = {0};
    struct sv_error error;
    const struct sv_heightfield *f = &scene->terrain.field;
    request.eye = (struct sv_place){.form = SV_PLACE_XY,
                                    .x = 0.5 * (f->x0 + sv_heightfield_x1(f)),
                                    .y = 0.5 * (f->y0 + sv_heightfield_y1(f)),
                                    .agl = 3};
    request.layers = (1u << SV_LAYER_COUNT) - 1;
    if (sv_view_resolve(scene, &request, &view, NULL, &error) != SV_OK ||
        sv_renderer_draw(renderer, &request, &view, &picture, NULL, NULL, &error) != SV_OK)
        fail_msg("%s: %s", error.field, error.message);
    return picture;
}

static void check(uint32_t trees)
{
    struct kit_options options = {.width = 65,
                                  .height = 65,
                                  .x0 = 500000,
                                  .y0 = 4000000,
                                  .z0 = 100,
                                  .dx = 5,
                                  .dy = 5,
                                  .relief_m = 20,
                                  .seed = 3,
                                  .species = 1,
                                  .leaves = 400,
                                  .trees = trees,
                                  .spread_m = 60,
                                  .height_min_m = 5,
                                  .height_max_m = 9};
    struct sv_scene *scene = kit_scene(&options);
    struct sv_renderer *renderer;
    struct sv_renderer_options plain = {.store = kept_bakes()};
    struct sv_error error;
    if (sv_renderer_create(scene, &plain, &renderer, &error) != SV_OK)
        fail_msg("%s", error.message);
    struct sv_picture before = draw(renderer, scene);
    for (unsigned layers = 1; layers < 1u << SV_LAYER_COUNT; layers += 7) /* 1, 8, 15 */
        if (sv_view_warm(renderer, scene, layers, &error) != SV_OK)
            fail_msg("%s: %s", error.field, error.message);
    struct sv_picture after = draw(renderer, scene);
    for (int k = 0; k < SV_LAYER_COUNT; k++)
        assert_memory_equal(before.layer[k].data, after.layer[k].data, sv_image_bytes(&before.layer[k]));
    sv_picture_finish(&before);
    sv_picture_finish(&after);
    sv_renderer_destroy(renderer);
    kit_free(scene);
}

static void forest(void **state)
{
    (void)state;
    check(50);
}

static void one_tree(void **state)
{
    (void)state;
    check(1);
}

static void no_tree(void **state)
{
    (void)state;
    check(0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(forest), cmocka_unit_test(one_tree),
                                       cmocka_unit_test(no_tree)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
