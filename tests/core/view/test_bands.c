/* test_bands.c - a band of rows of a view is its part of the whole picture, byte for byte, in every way of
 * drawing that is split: directly, ray cast, in all layers, sampled once and often, both projections. (From
 * relief cells: test_cells_pictures.c.) */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "core/view/cells.h"
#include "tests/core/view/cells_kit.h"

enum { SIDE = 96, TREES = 300 };
/* Also in the middle of blocks of 4 and of tiles of 16 and 64. */
static const int cuts[] = {0, 1, 30, 47, 64, 95, SIDE};

struct stage {
    struct cells_kit kit;
    struct sv_renderer *renderer;
};

static int setup(void **state)
{
    static struct stage stage;
    struct sv_error error;
    struct kit_options wood = cells_kit_wood(TREES);
    cells_kit_open(&wood, CELLS_KIT_HUT, &stage.kit);
    struct sv_renderer_options options = {0};
    if (sv_renderer_create(stage.kit.scene, &options, &stage.renderer, &error))
        return -1;
    *state = &stage;
    return 0;
}

static int teardown(void **state)
{
    struct stage *stage = *state;
    sv_renderer_destroy(stage->renderer);
    cells_kit_close(&stage->kit);
    return 0;
}

static struct sv_view_request request_of(const struct stage *stage, double agl, double pitch_deg)
{
    const struct sv_heightfield *f = &stage->kit.scene->terrain.field;
    struct sv_view_request r = kit_request();
    r.eye = (struct sv_place){.form = SV_PLACE_XY,
                              .x = f->x0 + 0.45 * (f->width - 1) * f->dx,
                              .y = f->y0 + 0.4 * (f->height - 1) * f->dy,
                              .agl = agl};
    r.pitch_rad = sv_radians(pitch_deg);
    r.width = r.height = SIDE;
    r.relief = SV_RELIEF_OFF;
    return r;
}

static struct sv_picture draw(const struct stage *stage, const struct sv_view_request *request, int first,
                              int rows)
{
    struct sv_error error = {0};
    struct sv_resolved_view view;
    struct sv_picture picture;
    struct sv_draw_took took;
    struct sv_renderer_band band = {.row_first = first, .row_count = rows};
    if (sv_view_resolve(stage->kit.scene, request, &view, NULL, &error))
        fail_msg("%s: %s", error.field, error.message);
    assert_true(sv_bands_can(&view));
    if (sv_renderer_draw_band(stage->renderer, request, &view, &band, &picture, NULL, NULL, &took, &error))
        fail_msg("%s: %s", error.field, error.message);
    return picture;
}

static void check(const struct stage *stage, const struct sv_view_request *request)
{
    struct sv_picture whole = draw(stage, request, 0, SIDE);
    for (size_t b = 0; b + 1 < sizeof cuts / sizeof *cuts; b++) {
        struct sv_picture band = draw(stage, request, cuts[b], cuts[b + 1] - cuts[b]);
        for (int k = 0; k < SV_LAYER_COUNT; k++) {
            const struct sv_image *all = &whole.layer[k], *part = &band.layer[k];
            assert_int_equal(!all->data, !part->data);
            if (!all->data)
                continue;
            assert_int_equal(part->height, cuts[b + 1] - cuts[b]);
            size_t row = sv_image_bytes(all) / SIDE;
            assert_memory_equal(part->data, (const uint8_t *)all->data + (size_t)cuts[b] * row,
                                sv_image_bytes(part));
        }
        sv_picture_finish(&band);
    }
    sv_picture_finish(&whole);
}

static const unsigned all_layers = (1u << SV_LAYER_COUNT) - 1;

static void directly(void **state)
{
    for (int k = 0; k < 2; k++) { /* above the trees, and among them */
        struct sv_view_request r = request_of(*state, k ? 1.7 : 25, k ? 4 : -15);
        check(*state, &r);
        r.sky = false;
        r.shadows = false;
        r.roll_rad = 0.3;
        check(*state, &r);
    }
}

static void in_all_layers(void **state)
{
    struct sv_view_request r = request_of(*state, 8, -8);
    r.layers = all_layers;
    check(*state, &r);
}

static void of_many_samples(void **state)
{
    struct sv_view_request r = request_of(*state, 8, -8);
    r.samples = 4;
    check(*state, &r);
}

static void other_forms_and_projections(void **state)
{
    struct sv_view_request r = request_of(*state, 12, -60);
    r.trees = SV_TREES_COARSE;
    check(*state, &r);
    r.trees = SV_TREES_NONE;
    check(*state, &r);
    r.trees = SV_TREES_AUTO;
    r.projection = SV_PROJECTION_ORTHOGRAPHIC;
    r.ortho_height_m = 40;
    check(*state, &r);
}

static void ray_cast(void **state)
{
    struct sv_view_request r = request_of(*state, 8, -8);
    r.trees = SV_TREES_RAYCAST;
    r.layers = all_layers;
    check(*state, &r);
}

/* What sees the whole picture, or is there to be measured, stays whole. */
static void not_all_ways(void **state)
{
    struct stage *stage = *state;
    static const enum sv_trees by_gl[] = {SV_TREES_POLYGON, SV_TREES_BILLBOARD, SV_TREES_INDIRECT,
                                          SV_TREES_DENSITY, SV_TREES_DENSITY_PAPER};
    struct sv_error error;
    struct sv_resolved_view view;
    struct sv_view_request r = request_of(stage, 8, -8);
    for (size_t k = 0; k < sizeof by_gl / sizeof *by_gl; k++) {
        r.trees = by_gl[k];
        assert_int_equal(sv_view_resolve(stage->kit.scene, &r, &view, NULL, &error), SV_OK);
        assert_false(sv_bands_can(&view));
    }
    r.trees = SV_TREES_AUTO;
    r.relief = SV_RELIEF_PAPER;
    assert_int_equal(sv_view_resolve(stage->kit.scene, &r, &view, NULL, &error), SV_OK);
    assert_false(sv_bands_can(&view));
}

/* Points that a row's pixels see are inside of the planes of its band, and those of rows beside it outside.
 */
static void planes_are_the_rows(void **state)
{
    (void)state;
    for (int k = 0; k < 2; k++) {
        struct sv_camera camera = {.projection = k ? SV_PROJECTION_ORTHOGRAPHIC : SV_PROJECTION_PERSPECTIVE,
                                   .vfov_rad = 1,
                                   .ortho_height_m = 50,
                                   .width = 40,
                                   .height = 30,
                                   .near_m = 0.1,
                                   .far_m = 1000};
        double planes[5][4];
        sv_camera_aim(&camera, 0.7, -0.4, 0.2);
        sv_camera_band_planes(&camera, 7, 19, planes);
        for (int row = 0; row < camera.height; row++) {
            struct sv_vec3 origin, direction;
            bool inside = true;
            sv_camera_ray(&camera, 20.5, row + 0.5, &origin, &direction);
            struct sv_vec3 p = sv_madd(origin, direction, 100);
            for (int n = 0; n < 5; n++)
                inside = inside &&
                         planes[n][0] * p.x + planes[n][1] * p.y + planes[n][2] * p.z + planes[n][3] >= 0;
            bool far_off = row < 6 || row > 19; /* rows 6 and 19: within half a pixel */
            assert_true(inside == (row >= 7 && row < 19) || !far_off);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(directly),
        cmocka_unit_test(in_all_layers),
        cmocka_unit_test(of_many_samples),
        cmocka_unit_test(other_forms_and_projections),
        cmocka_unit_test(ray_cast),
        cmocka_unit_test(not_all_ways),
        cmocka_unit_test(planes_are_the_rows),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
