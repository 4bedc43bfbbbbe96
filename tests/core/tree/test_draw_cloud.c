/* test_draw_cloud.c - billboard clouds by GL: against the tree's own polygons, supersampled; the shader of
 * indirect textures against its CPU twin; layers, light, order, and what drawing leaves behind. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/color.h"
#include "core/gl/functions.h"
#include "core/scene/id.h"
#include "core/tree/draw_cloud.h"
#include "core/tree/draw_cloud_form.h"
#include "core/tree/draw_mesh.h"
#include "core/tree/grow.h"
#include "core/tree/indirect.h"
#include "draw_fixture.h"

static struct sv_gl_context *context;
static struct sv_tree_mesh mesh;     /* a small broadleaf: 6,000 leaves */
static struct sv_cloud_draw *clouds; /* of it */
static const struct sv_tree_lights NO_LIGHTS;

static struct sv_cloud_draw *make_draw(const struct sv_tree_mesh *of, int planes)
{
    struct sv_error error;
    struct sv_cloud_draw *draw;
    struct sv_cloud_options options = SV_CLOUD_OPTIONS_DEFAULT;
    const struct sv_tree_draw_species species = {of, 1, 1};
    options.planes = planes;
    fixture_ok(sv_cloud_draw_create(&species, 1, NULL, &options, &draw, &error), &error);
    return draw;
}

static int setup(void **state)
{
    (void)state;
    struct sv_error error;
    sv_color_init();
    fixture_ok(sv_gl_context_create(&context, &error), &error);
    fixture_ok(sv_tree_grow(SV_HABIT_BROADLEAF, 6000, 3, &mesh, &error), &error);
    clouds = make_draw(&mesh, 24);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    sv_cloud_draw_destroy(clouds);
    sv_tree_mesh_finish(&mesh);
    sv_gl_context_destroy(context);
    return 0;
}

struct job {
    struct sv_cloud_draw *clouds; /* NULL: polygons */
    struct sv_mesh_draw *meshes;
    enum sv_cloud_form form;
    const struct sv_tree *trees;
    uint32_t count; /* nearest first */
    struct sv_tree_lights lights;
    bool color_only;
};

static void read_layer(struct sv_gl_target *target, enum sv_layer layer, int w, int h, int channels,
                       enum sv_pixel_type type, void **out)
{
    struct sv_error error;
    struct sv_image image;
    fixture_ok(sv_image_alloc(w, h, channels, type, &image, &error), &error);
    fixture_ok(sv_gl_target_read(target, layer, &image, &error), &error);
    *out = image.data;
}

static void draw_job(const struct job *job, const struct sv_camera *camera, const struct sv_light *light,
                     struct fixture_view *view)
{
    struct sv_error error;
    struct sv_gl_target *target;
    struct sv_gl_frame frame = {.camera = *camera, .light = *light};
    struct sv_cull_entry entries[64];
    void *data[4];
    int w = camera->width, h = camera->height;
    for (uint32_t k = 0; k < job->count; k++)
        entries[k] = (struct sv_cull_entry){k, k};
    fixture_ok(sv_gl_target_create(w, h, 15, &target, &error), &error);
    sv_gl_target_begin(target);
    fixture_ok(sv_gl_frame_begin(&frame, &error), &error);
    if (job->clouds)
        fixture_ok(sv_cloud_draw_trees(job->clouds, job->form, &frame, job->trees, entries, job->count,
                                       job->color_only, job->lights, &error),
                   &error);
    else
        fixture_ok(
            sv_mesh_draw_trees(job->meshes, &frame, job->trees, entries, job->count, job->lights, &error),
            &error);
    read_layer(target, SV_LAYER_COLOR, w, h, 4, SV_PIXEL_U8, &data[0]);
    read_layer(target, SV_LAYER_DEPTH, w, h, 1, SV_PIXEL_F32, &data[1]);
    read_layer(target, SV_LAYER_NORMAL, w, h, 3, SV_PIXEL_F32, &data[2]);
    read_layer(target, SV_LAYER_ID, w, h, 1, SV_PIXEL_U32, &data[3]);
    *view = (struct fixture_view){
        .width = w, .height = h, .color = data[0], .depth = data[1], .normal = data[2], .id = data[3]};
    sv_gl_target_destroy(target);
}

/* One tree of 10 m at the origin, `px` tall in a square picture around it. */
static struct sv_camera look_at_tree(double px, double azimuth_deg, double elevation_deg)
{
    int side = (int)(1.5 * px) + 4;
    double focal = side / 2.0 / tan(sv_radians(30)), distance = 10 * focal / px;
    double a = sv_radians(azimuth_deg), e = sv_radians(elevation_deg);
    struct sv_vec3 eye =
        sv_vec3(sin(a) * cos(e) * distance, cos(a) * cos(e) * distance, 5 + sin(e) * distance);
    return fixture_camera(eye, azimuth_deg + 180, -elevation_deg, side, side);
}

/* Every form against polygons drawn with 64 samples a pixel: coverage and mean colour over the tree. */
static void forms_look_like_polygons(void **state)
{
    (void)state;
    static const double sizes[] = {240, 120, 60, 30}, views[][2] = {{20, 0}, {200, 25}, {110, 60}};
    const struct sv_tree tree = {.height_m = 10, .rotation_rad = 0.7f, .number = 5};
    struct sv_error error;
    struct sv_mesh_draw *meshes;
    const struct sv_tree_draw_species species = {&mesh, 1, 1};
    fixture_ok(sv_mesh_draw_create(&species, 1, SV_ID_TREE_FIRST, &meshes, &error), &error);
    struct sv_light light = fixture_light(135, 40);
    for (size_t s = 0; s < sizeof sizes / sizeof sizes[0]; s++)
        for (size_t v = 0; v < 3; v++) {
            struct fixture_view truth, view;
            struct sv_camera camera = look_at_tree(sizes[s], views[v][0], views[v][1]), fine = camera;
            int k = sizes[s] > 100 ? 4 : 8;
            fine.width *= k;
            fine.height *= k;
            draw_job(&(struct job){.meshes = meshes, .trees = &tree, .count = 1}, &fine, &light, &truth);
            fixture_shrink(&truth, k);
            struct fixture_look own = fixture_look_at(&truth);
            for (int form = 0; form < SV_CLOUD_FORM_COUNT; form++) {
                draw_job(
                    &(struct job){
                        .clouds = clouds, .form = (enum sv_cloud_form)form, .trees = &tree, .count = 1},
                    &camera, &light, &view);
                struct fixture_look look = fixture_look_at(&view);
                int off = 0, most = 0;
                for (int c = 0; c < 3; c++) {
                    off = (int)sv_srgb8_from_linear((float)look.rgb[c]) -
                          (int)sv_srgb8_from_linear((float)own.rgb[c]);
                    most = abs(off) > abs(most) ? off : most;
                }
                print_message("%-10s %3.0f px from %3.0f, %2.0f: coverage %.3f of the polygons', mean colour "
                              "off by %d\n",
                              sv_cloud_form_name((enum sv_cloud_form)form), sizes[s], views[v][0],
                              views[v][1], look.coverage / own.coverage, most);
                /* The cloud's own share is 0.89 .. 1.08 (test_cloud); the rest is the textures'. Paper 2's own form
                 * tears its leaves and lets holes show (its section 4); it is kept as printed and only told. */
                bool as_printed = form == SV_CLOUD_FORM_DENSITY_PAPER;
                assert_true(look.coverage > (as_printed ? 0.5 : 0.86) * own.coverage &&
                            look.coverage < (as_printed ? 1.5 : 1.12) * own.coverage);
                assert_true(as_printed || abs(most) <= 5);
                fixture_view_finish(&view);
            }
            fixture_view_finish(&truth);
        }
    sv_mesh_draw_destroy(meshes);
}

static void layers_are_written(void **state)
{
    (void)state;
    struct sv_light light = fixture_light(135, 40);
    struct sv_camera camera = look_at_tree(200, 30, 10);
    /* The nearer of two trees of one place but for 4 m towards the viewer. */
    struct sv_tree trees[2] = {{.x = 2 * camera.eye.x / hypot(camera.eye.x, camera.eye.y) * 2,
                                .y = 2 * camera.eye.y / hypot(camera.eye.x, camera.eye.y) * 2,
                                .height_m = 10,
                                .number = 7},
                               {.height_m = 10, .rotation_rad = 2, .number = 9}};
    for (int form = 0; form < SV_CLOUD_FORM_COUNT; form++) {
        struct fixture_view view;
        draw_job(
            &(struct job){.clouds = clouds, .form = (enum sv_cloud_form)form, .trees = trees, .count = 2},
            &camera, &light, &view);
        int near = 0, far = 0, covered = 0, hard = 0;
        for (int k = 0; k < view.width * view.height; k++) {
            const float *n = view.normal + 3 * k;
            near += view.id[k] == SV_ID_TREE_FIRST + 7;
            far += view.id[k] == SV_ID_TREE_FIRST + 9;
            covered += view.color[4 * k + 3] >= 128;
            hard += view.id[k] != 0;
            assert_true(view.id[k] == 0 || view.id[k] == SV_ID_TREE_FIRST + 7 ||
                        view.id[k] == SV_ID_TREE_FIRST + 9);
            assert_int_equal(view.id[k] != 0, view.depth[k] > 0);
            double length = (double)(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
            assert_true(fabs(length - (view.id[k] != 0)) < 0.02);
            if (view.id[k]) { /* depth is near / forward distance: the trees' middles are at distance and - 4
                               */
                double distance = camera.near_m / (double)view.depth[k];
                double middle = sv_length(sv_sub(camera.eye, sv_vec3(0, 0, 5)));
                assert_true(distance > middle - 11 && distance < middle + 7);
            }
        }
        assert_true(near > 3 * far && far > 50);
        assert_true(hard > 0.8 * covered && hard < 1.25 * covered);
        fixture_view_finish(&view);
    }
}

/* Colour alone is the colour; drawing twice is drawing once; blending and masks are as they were. */
static void drawing_leaves_nothing_behind(void **state)
{
    (void)state;
    struct sv_light light = fixture_light(200, 30);
    struct sv_camera camera = look_at_tree(90, 80, 5);
    const struct sv_tree tree = {.height_m = 10, .number = 1};
    for (int form = 0; form < SV_CLOUD_FORM_COUNT; form++) {
        struct fixture_view a, b;
        struct job job = {.clouds = clouds, .form = (enum sv_cloud_form)form, .trees = &tree, .count = 1};
        draw_job(&job, &camera, &light, &a);
        job.color_only = true;
        draw_job(&job, &camera, &light, &b);
        assert_memory_equal(a.color, b.color, 4 * (size_t)(a.width * a.height));
        for (int k = 0; k < b.width * b.height && !sv_cloud_forms[form].tested; k++)
            assert_true(b.id[k] == 0 && b.depth[k] == 0);
        GLint blend = 1, mask[4] = {0}, depth = 0;
        gl.GetIntegerv(GL_BLEND, &blend);
        gl.GetIntegerv(GL_COLOR_WRITEMASK, mask);
        gl.GetIntegerv(GL_DEPTH_WRITEMASK, &depth);
        assert_true(!blend && mask[0] && mask[3] && depth);
        fixture_view_finish(&a);
        fixture_view_finish(&b);
        assert_true(sv_cloud_draw_bytes(clouds, 0, (enum sv_cloud_form)form) > 1000000);
    }
}

/* What a form is said to take before it is built. Billboards by hand, a plane: DXT5 of 1024 x 1024 down to 4 x 4 and
 * two blocks more, normals of 256 x 256 with mips, light of 64 x 64; density: colour and normals of 128 x 128 with
 * mips, two pictures of light of 16 x 16. Built, planes come on top (and kinds of leaves fall short of the most, by
 * less than those take). */
static void bytes_are_known_before(void **state)
{
    (void)state;
    const struct sv_cloud_options options = SV_CLOUD_OPTIONS_DEFAULT;
    size_t planes = (size_t)options.planes;
    const size_t by_hand[SV_CLOUD_FORM_COUNT] = {
        [SV_CLOUD_FORM_BILLBOARD] = planes * ((1024 * 1024 * 4 - 16) / 3 + 2 * 16 + (256 * 256 * 4 - 1) / 3 * 4 + 64 * 64 * 4),
        [SV_CLOUD_FORM_DENSITY] = planes * (2 * ((128 * 128 * 4 - 1) / 3 * 4) + 2 * 16 * 16 * 4)};
    for (int k = 0; k < SV_CLOUD_FORM_COUNT; k++) {
        enum sv_cloud_form form = (enum sv_cloud_form)k;
        struct sv_error error;
        fixture_ok(sv_cloud_draw_build(clouds, 0, form, &error), &error);
        size_t built = sv_cloud_draw_bytes(clouds, 0, form), told = sv_cloud_form_bytes(&mesh, form, &options);
        if (by_hand[k])
            assert_int_equal(told, by_hand[k]);
        assert_true(told < built && built - told < 1500000);
    }
}

/* No sunlight arrives: the picture of a sun of no strength. All arrives: brighter than none, and no darker
 * than half. */
static void light_that_arrives_is_seen(void **state)
{
    (void)state;
    struct sv_light light = fixture_light(135, 40), dark = light;
    struct sv_camera camera = look_at_tree(120, 135, 5);
    const struct sv_tree tree = {.height_m = 10, .number = 1};
    struct sv_tree_light share;
    const struct sv_tree_light_axes axes = {{1, 0, 0, 0.5f}, {0, 0, 3, 0}};
    for (int c = 0; c < 3; c++)
        dark.sun_rgb[c] = 0;
    for (int form = 0; form < SV_CLOUD_FORM_COUNT; form++) {
        struct fixture_view none, night, view;
        double bright[3];
        struct job job = {.clouds = clouds, .form = (enum sv_cloud_form)form, .trees = &tree, .count = 1};
        draw_job(&job, &camera, &dark, &night);
        job.lights = (struct sv_tree_lights){&share, &axes};
        for (int k = 0; k < 3; k++) {
            memset(&share, k * 127, sizeof share);
            draw_job(&job, &camera, &light, k ? &view : &none);
            bright[k] = fixture_look_at(k ? &view : &none).rgb[1];
            if (k)
                fixture_view_finish(&view);
        }
        for (int k = 0; k < 4 * night.width * night.height; k++)
            assert_true(abs((int)night.color[k] - (int)none.color[k]) <= 1);
        assert_true(bright[1] > 1.1 * bright[0] && bright[2] > 1.1 * bright[1]);
        fixture_view_finish(&none);
        fixture_view_finish(&night);
    }
}

/* A cloud of one plane seen square on, orthographic: what the shader finds is what sv_indirect_leaf_at finds.
 */
static void the_indirect_shader_is_its_twin(void **state)
{
    (void)state;
    struct sv_error error;
    struct sv_tree_mesh few;
    struct sv_indirect indirect;
    fixture_ok(sv_tree_grow(SV_HABIT_BROADLEAF, 150, 3, &few, &error), &error);
    struct sv_cloud_draw *one = make_draw(&few, 1);
    fixture_ok(sv_cloud_draw_build(one, 0, SV_CLOUD_FORM_INDIRECT, &error), &error);
    const struct sv_tree_cloud *cloud = sv_cloud_draw_cloud(one, 0);
    fixture_ok(sv_indirect_bake(&few, cloud, &SV_INDIRECT_OPTIONS_DEFAULT, &indirect, &error), &error);
    const struct sv_cloud_plane *p = &cloud->planes[0];
    const struct sv_tree tree = {.height_m = 1, .number = 1};
    struct sv_camera camera = {
        .projection = SV_PROJECTION_ORTHOGRAPHIC, .width = 400, .height = 400, .far_m = 10};
    double side = 2.1 * (double)fmaxf(p->half[0], p->half[1]);
    camera.ortho_height_m = side;
    double heading = atan2(-(double)p->normal[0], -(double)p->normal[1]), pitch = asin(-(double)p->normal[2]);
    camera.eye = sv_vec3((double)(p->centre[0] + 3 * p->normal[0]), (double)(p->centre[1] + 3 * p->normal[1]),
                         (double)(p->centre[2] + 3 * p->normal[2]));
    sv_camera_aim(&camera, heading, pitch, 0);
    struct fixture_view view;
    struct sv_light light = fixture_light(135, 40);
    draw_job(&(struct job){.clouds = one, .form = SV_CLOUD_FORM_INDIRECT, .trees = &tree, .count = 1},
             &camera, &light, &view);
    int told = 0, wrong = 0, present = 0;
    for (int j = 0; j < 400; j++)
        for (int i = 0; i < 400; i++) {
            double x = side * ((i + 0.5) / 400 - 0.5), y = side * (0.5 - (j + 0.5) / 400);
            struct sv_vec3 d = sv_add(sv_scale(camera.right, x), sv_scale(camera.up, y));
            float at[2] = {(float)(d.x * (double)p->u[0] + d.y * (double)p->u[1] + d.z * (double)p->u[2]),
                           (float)(d.x * (double)p->v[0] + d.y * (double)p->v[1] + d.z * (double)p->v[2])};
            float uv[2];
            bool inside = fabsf(at[0]) < p->half[0] && fabsf(at[1]) < p->half[1];
            int kind = inside ? sv_indirect_leaf_at(&indirect, 0, p->half, at[0], at[1], uv) : 0;
            bool covered = false;
            if (kind) { /* level 0 of the leaf's texture, nearest texel; unclear near the cutoff */
                int layer = (int)floorf(indirect.kinds[kind].layer), n = SV_INDIRECT_LEAF_SIDE;
                int s = (int)((uv[0] - floorf(uv[0])) * (float)n),
                    t = (int)((uv[1] - floorf(uv[1])) * (float)n);
                int a = indirect.leaves[4 * (((size_t)layer * (size_t)n + (size_t)(t % n)) * (size_t)n +
                                             (size_t)(s % n)) +
                                        3];
                if (a > 8 && a < 247)
                    continue;
                covered = a > 127;
            }
            bool shown = view.color[4 * (j * 400 + i) + 3] >= 128;
            told++;
            present += covered;
            wrong += shown != covered;
        }
    print_message("indirect twin: %d pixels, %d covered, %d differ\n", told, present, wrong);
    /* Where a leaf's texture is minified its edge is soft over a pixel: along outlines alone. */
    assert_true(present > 2000 && wrong < 0.05 * present);
    fixture_view_finish(&view);
    sv_indirect_finish(&indirect);
    sv_cloud_draw_destroy(one);
    sv_tree_mesh_finish(&few);
}

static void nothing_is_nothing(void **state)
{
    (void)state;
    struct sv_error error;
    struct sv_cloud_draw *draw;
    struct sv_tree_mesh dead;
    struct sv_cloud_options options = SV_CLOUD_OPTIONS_DEFAULT;
    fixture_ok(sv_cloud_draw_create(NULL, 0, NULL, &options, &draw, &error), &error);
    fixture_ok(
        sv_cloud_draw_trees(draw, SV_CLOUD_FORM_BILLBOARD, NULL, NULL, NULL, 0, false, NO_LIGHTS, &error),
        &error);
    sv_cloud_draw_destroy(draw);
    sv_cloud_draw_destroy(NULL);
    assert_null(sv_cloud_form_name(SV_CLOUD_FORM_COUNT));
    /* A dead tree is all wood, and is there. */
    fixture_ok(sv_tree_grow(SV_HABIT_BROADLEAF, 0, 3, &dead, &error), &error);
    draw = make_draw(&dead, 24);
    struct sv_camera camera = look_at_tree(200, 30, 10);
    struct sv_light light = fixture_light(135, 40);
    const struct sv_tree tree = {.height_m = 10, .number = 1};
    for (int form = 0; form < SV_CLOUD_FORM_COUNT; form++) {
        struct fixture_view view;
        draw_job(&(struct job){.clouds = draw, .form = (enum sv_cloud_form)form, .trees = &tree, .count = 1},
                 &camera, &light, &view);
        struct fixture_look look = fixture_look_at(&view);
        print_message("dead tree as %s: %.0f px covered, %d px tall\n", sv_cloud_form_name((enum sv_cloud_form)form),
                      look.coverage, look.bottom - look.top);
        assert_true(look.coverage > 500 && look.bottom - look.top > 170);
        fixture_view_finish(&view);
    }
    sv_cloud_draw_destroy(draw);
    sv_tree_mesh_finish(&dead);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(forms_look_like_polygons),        cmocka_unit_test(layers_are_written),
        cmocka_unit_test(drawing_leaves_nothing_behind),   cmocka_unit_test(bytes_are_known_before), cmocka_unit_test(light_that_arrives_is_seen),
        cmocka_unit_test(the_indirect_shader_is_its_twin), cmocka_unit_test(nothing_is_nothing),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
