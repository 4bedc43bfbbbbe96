/* The matrices of f=json are the ones that pictures are drawn with (core/view/camera.c), and the document is
 * whole. */
#include "api/describe.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "api/json.h"
#include "core/base/rng.h"
#include "tests/api/cmocka_all.h"

static struct sv_camera random_camera(struct sv_rng *rng)
{
    struct sv_camera c = {
        .eye = sv_vec3(sv_rng_range(rng, -1e3, 1e3), sv_rng_range(rng, -1e3, 1e3), sv_rng_range(rng, 0, 1e3)),
        .projection = sv_rng_next(rng) % 2 ? SV_PROJECTION_ORTHOGRAPHIC : SV_PROJECTION_PERSPECTIVE,
        .vfov_rad = sv_rng_range(rng, 0.1, 2.5),
        .ortho_height_m = sv_rng_range(rng, 1, 5000),
        .width = 16 + (int)(sv_rng_next(rng) % 1000),
        .height = 16 + (int)(sv_rng_next(rng) % 1000),
        .near_m = 0.1,
        .far_m = sv_rng_range(rng, 100, 1e5)};
    sv_camera_aim(&c, sv_rng_range(rng, -7, 7), sv_rng_range(rng, -1.5, 1.5), sv_rng_range(rng, -3, 3));
    return c;
}

/* World points go to the same pixel and depth by the matrices as by sv_camera_project and the header's
 * formulas. */
static void matrices_agree(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(41, 0);
    int compared = 0;
    for (int n = 0; n < 20000; n++) {
        struct sv_camera c = random_camera(&rng);
        struct sv_mat4 view, projection;
        sv_api_camera_from_world(&c, &view);
        sv_api_clip_from_camera(&c, &projection);
        struct sv_mat4 m = sv_mat4_mul(&projection, &view);
        struct sv_vec3 p = sv_vec3(sv_rng_range(&rng, -2e3, 2e3), sv_rng_range(&rng, -2e3, 2e3),
                                   sv_rng_range(&rng, -1e2, 1e3));
        double px, py, depth_m, clip[4];
        if (!sv_camera_project(&c, p, &px, &py, &depth_m))
            continue;
        for (int k = 0; k < 4; k++)
            clip[k] = m.m[k][0] * p.x + m.m[k][1] * p.y + m.m[k][2] * p.z + m.m[k][3];
        double x = (clip[0] / clip[3] + 1) / 2 * c.width, y = (1 - clip[1] / clip[3]) / 2 * c.height;
        double depth = clip[2] / clip[3];
        double want = c.projection == SV_PROJECTION_ORTHOGRAPHIC ? 1 - depth_m / c.far_m : c.near_m / depth_m;
        /* Products of values up to 3e3 in double; px can be far outside the picture near Z = near. */
        double tolerance = 1e-8 * (1 + fabs(px) + fabs(py));
        if (fabs(x - px) > tolerance || fabs(y - py) > tolerance ||
            fabs(depth - want) > 1e-9 * (1 + 1 / depth_m))
            fail_msg("n %d: (%g, %g, %g), expected (%g, %g, %g)", n, x, y, depth, px, py, want);
        compared++;
    }
    assert_true(compared > 5000);
}

/* Row k of camera_from_world is the axis it is named after; the axes are right-handed (x right, y up, z
 * backward). */
static void axes(void **state)
{
    (void)state;
    struct sv_camera c = {.eye = sv_vec3(10, 20, 30)};
    struct sv_mat4 m;
    sv_camera_aim(&c, 0, 0, 0); /* to the north */
    sv_api_camera_from_world(&c, &m);
    const double want[4][4] = {{1, 0, 0, -10}, {0, 0, 1, -30}, {0, -1, 0, 20}, {0, 0, 0, 1}};
    for (int k = 0; k < 16; k++)
        assert_true(fabs(m.m[k / 4][k % 4] - want[k / 4][k % 4]) < 1e-12);
}

static void document(void **state)
{
    (void)state;
    struct sv_resolved_view v;
    struct sv_view_request request = {
        .format = SV_FORMAT_EXR, .layers = 5, .width = 640, .height = 480, .sky = true};
    memset(&v, 0, sizeof v);
    v.camera = (struct sv_camera){.eye = {500120, 5200340, 800},
                                  .vfov_rad = sv_radians(60),
                                  .width = 640,
                                  .height = 480,
                                  .near_m = 0.1};
    sv_camera_aim(&v.camera, sv_radians(45), 0, 0);
    v.cell = v.camera.eye;
    v.heading_rad = sv_radians(45);
    v.ground_z = NAN;
    v.sun = (struct sv_sun){sv_radians(135), sv_radians(40)};
    v.plan = (struct sv_plan){.draw_trees = true, .samples = 1, .terrain_error_px = 1};
    struct sv_api_description d = {.request = &request,
                                   .resolved = &v,
                                   .canonical = "x=500120",
                                   .etag = "W/\"1\"",
                                   .scene_version = 255,
                                   .relief_distance_m = 100};
    size_t bytes;
    char *text = sv_api_describe(&d, &bytes);
    cJSON *root = NULL;
    assert_non_null(text);
    assert_int_equal(bytes, strlen(text));
    assert_int_equal(sv_api_json_parse(text, bytes, &root, NULL), SV_OK);
    const cJSON *camera = cJSON_GetObjectItem(root, "camera"),
                *predicted = cJSON_GetObjectItem(root, "predicted");
    assert_true(cJSON_GetNumberValue(cJSON_GetObjectItem(camera, "heading")) == 45);
    assert_true(cJSON_GetNumberValue(cJSON_GetArrayItem(cJSON_GetObjectItem(camera, "eye"), 1)) == 5200340);
    assert_true(cJSON_IsNull(cJSON_GetObjectItem(predicted, "ms")));
    assert_true(cJSON_IsNull(cJSON_GetObjectItem(predicted, "error_px")));
    assert_true(cJSON_IsNull(cJSON_GetObjectItem(root, "ground_z")));
    assert_true(cJSON_GetNumberValue(cJSON_GetObjectItem(cJSON_GetObjectItem(root, "sun"), "azimuth")) ==
                135);
    const cJSON *picture = cJSON_GetObjectItem(root, "picture");
    assert_int_equal(cJSON_GetArraySize(cJSON_GetObjectItem(picture, "layers")), 2);
    assert_string_equal(cJSON_GetStringValue(cJSON_GetObjectItem(picture, "media_type")), "image/x-exr");
    assert_string_equal(cJSON_GetStringValue(cJSON_GetObjectItem(root, "scene_version")), "00000000000000ff");
    assert_string_equal(cJSON_GetStringValue(cJSON_GetObjectItem(root, "route")), "100/5001,52003,8");
    assert_string_equal(cJSON_GetStringValue(cJSON_GetObjectItem(root, "request")), "x=500120");
    const cJSON *matrices = cJSON_GetObjectItem(root, "matrices");
    static const char *const names[] = {"camera_from_world", "clip_from_camera", "clip_from_world"};
    for (int k = 0; k < 3; k++) {
        const cJSON *m = cJSON_GetObjectItem(matrices, names[k]);
        assert_int_equal(cJSON_GetArraySize(m), 4);
        for (int r = 0; r < 4; r++)
            assert_int_equal(cJSON_GetArraySize(cJSON_GetArrayItem(m, r)), 4);
    }
    cJSON_Delete(root);
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(matrices_agree), cmocka_unit_test(axes),
                                       cmocka_unit_test(document)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
