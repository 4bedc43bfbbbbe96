/* test_rings.c - resolved views of one outermost cell have one reference point; what a request says of panels
 * is in their plan, and the scene's own otherwise; cells are as large as the quality bears. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/base/vec.h"
#include "core/view/resolve.h"
#include "core/view/rings.h"
#include "tests/core/view/scene_kit.h"

static const struct kit_options HILLS = {
    .width = 65, .height = 65, .x0 = 5e5, .y0 = 4e6, .z0 = 100, .dx = 5, .dy = 5, .relief_m = 20, .seed = 3};

static struct sv_resolved_view resolve(const struct sv_scene *scene, const struct sv_view_request *request)
{
    struct sv_resolved_view view;
    struct sv_error error;
    if (sv_view_resolve(scene, request, &view, NULL, &error) != SV_OK)
        fail_msg("%s: %s", error.field, error.message);
    return view;
}

static void cells_of_views(void **state)
{
    (void)state;
    struct sv_scene *scene = kit_scene(&HILLS);
    scene->relief_distance_m = 100;
    scene->relief_resolution = 512;
    struct sv_view_request request = kit_request();
    struct sv_rng rng = sv_rng_seeded(9, 0);
    for (int n = 0; n < 2000; n++) {
        request.eye = (struct sv_place){.form = SV_PLACE_XY,
                                        .x = sv_rng_range(&rng, 500010, 500300),
                                        .y = sv_rng_range(&rng, 4000010, 4000300),
                                        .agl = sv_rng_range(&rng, 0.5, 200)};
        request.relief_distance_m = n % 2 ? sv_rng_range(&rng, 25, 400) : 0;
        request.relief_resolution = n % 3 ? 0 : 777;
        struct sv_resolved_view view = resolve(scene, &request);
        double d = n % 2 ? request.relief_distance_m : 100;
        assert_true(view.plan.relief_distance_m == d);
        assert_int_equal(view.plan.relief_resolution, n % 3 ? 512 : 777);
        struct sv_view_rings at;
        assert_true(sv_view_rings(&view, &at));
        const struct sv_cell_place *outer = &at.chain[at.rings.count - 1];
        assert_true(view.cell.x == outer->v.x && view.cell.y == outer->v.y && view.cell.z == outer->v.z);
        assert_true(at.rings.distance_m[at.crowns_first] >= 6 || at.crowns_first == at.rings.count - 1);
        assert_true(at.crowns_first == 0 || at.rings.distance_m[at.crowns_first - 1] < 6);
        /* An eye where an inner cell's reference point is, is of the same outermost cell. */
        request.eye = (struct sv_place){.form = SV_PLACE_XY,
                                        .x = at.chain[0].v.x,
                                        .y = at.chain[0].v.y,
                                        .has_z = true,
                                        .z = at.chain[0].v.z};
        if (at.chain[0].v.z <= view.ground_z + 3)
            continue;
        struct sv_resolved_view other = resolve(scene, &request);
        assert_true(other.cell.x == view.cell.x && other.cell.y == view.cell.y &&
                    other.cell.z == view.cell.z);
    }
    kit_free(scene);
}

/* Panels are as fine as the picture needs, and no finer than the scene's. */
static void resolutions(void **state)
{
    (void)state;
    static const struct {
        int scene, height;
        double vfov_deg;
        int want;
    } rows[] = {
        {1024, 4096, 60, 1024}, {1024, 512, 60, 1024}, /* 2 F = 887 */
        {1024, 256, 60, 512},   {1024, 128, 60, 256},  {1024, 16, 60, 256},
        {2048, 512, 60, 1024},  {1024, 511, 90, 512},  {1024, 513, 90, 1024},
        {777, 16, 60, 777},     {200, 16, 60, 200},    {1024, 16, 1, 1024}, /* 2 F = 1833 */
    };
    struct sv_scene *scene = kit_scene(&HILLS);
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        struct sv_view_request request = kit_request();
        request.eye = (struct sv_place){.form = SV_PLACE_XY, .x = 500100, .y = 4000100, .agl = 2};
        request.height = rows[k].height;
        request.vfov_rad = sv_radians(rows[k].vfov_deg);
        scene->relief_resolution = rows[k].scene;
        assert_int_equal(resolve(scene, &request).plan.relief_resolution, rows[k].want);
        request.relief_resolution = 333;
        assert_int_equal(resolve(scene, &request).plan.relief_resolution, 333);
    }
    kit_free(scene);
}

/* Lattices of the qualities nest by powers of 2, so that few share the memory of panels, and no eye is
 * farther from any of its reference points than the prediction was made for: two steps along an axis
 * (lattice.h). */
static void cells_by_quality(void **state)
{
    (void)state;
    static const double steps[SV_QUALITY_COUNT] = {[SV_QUALITY_FAST] = 0.1,
                                                   [SV_QUALITY_BALANCED] = 0.05,
                                                   [SV_QUALITY_HIGH] = 0.025,
                                                   [SV_QUALITY_REFERENCE] = 0.025};
    struct sv_scene *scene = kit_scene(&HILLS);
    struct sv_rng rng = sv_rng_seeded(9, 1);
    scene->relief_distance_m = 100;
    for (int n = 0; n < 4000; n++) {
        struct sv_view_request request = kit_request();
        request.quality = (enum sv_quality)(n % SV_QUALITY_COUNT);
        request.width = 16 + n % 700;
        request.vfov_rad = sv_radians(sv_rng_range(&rng, 5, 120));
        request.eye = (struct sv_place){.form = SV_PLACE_XY,
                                        .x = sv_rng_range(&rng, 500010, 500300),
                                        .y = sv_rng_range(&rng, 4000010, 4000300),
                                        .agl = sv_rng_range(&rng, 0.5, 200)};
        struct sv_resolved_view view = resolve(scene, &request);
        struct sv_view_rings at;
        assert_true(view.plan.relief_pitch == steps[request.quality]);
        assert_true(sv_view_rings(&view, &at) && at.rings.pitch == view.plan.relief_pitch);
        for (int ring = 0; ring < at.rings.count; ring++) {
            double most = 2 * steps[request.quality] * at.rings.distance_m[ring] + 1e-6;
            struct sv_vec3 off = sv_sub(view.camera.eye, at.chain[ring].v);
            assert_true(fabs(off.x) <= most && fabs(off.y) <= most && fabs(off.z) <= most);
        }
    }
    kit_free(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(cells_of_views), cmocka_unit_test(resolutions),
                                       cmocka_unit_test(cells_by_quality)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
