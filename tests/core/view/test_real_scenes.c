/* test_real_scenes.c - three places on Earth, five poses each: Olinda (DEM, Landsat 3,2,1, scattered trees),
 * SCBI (DEM, an inventory of 53 species on imported models, natural colouring), Zion (a tree at 5 m and
 * ridges 20 km away in one picture).
 *
 * Checked: raster and ray cast agree on what is sky and what is ground (no cracks, no holes) and on the
 * light; slopes that face the sun are brighter than those that do not; in the orthographic view from above,
 * north is up and every probed tree is where the inventory says; stems meet the surface. Skipped where the
 * real inputs are not. SV_TEST_PICTURES=folder keeps the pictures. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <math.h>
#include <unistd.h>
#include <cmocka.h>

#include "core/base/frames.h"
#include "core/scene/id.h"
#include "tests/core/view/scene_kit.h"

static const char *data_folder(void)
{
    const char *folder = getenv("SV_DATA");
    folder = folder ? folder : "../shared/data";
    return access(folder, R_OK) == 0 ? folder : NULL;
}

struct place_scene {
    struct sv_scene *scene;
    struct sv_renderer *renderer;
    struct sv_store *store;
    const char *name;
};

static void log_line(void *context, int level, const char *message)
{
    printf("  %s: %s%s\n", (const char *)context, level ? "warning: " : "", message);
}

/* text with every @ replaced by the absolute data folder. */
static void write_scene(const char *path, const char *text, const char *folder)
{
    char absolute[4096];
    assert_non_null(realpath(folder, absolute));
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    for (const char *c = text; *c; c++)
        if (*c == '@')
            fputs(absolute, file);
        else
            fputc(*c, file);
    fclose(file);
}

static void load(struct place_scene *p, const char *name, const char *text, const char *folder)
{
    char path[] = "/tmp/silvista-real-XXXXXX";
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    close(fd);
    write_scene(path, text, folder);
    struct sv_scene_spec spec;
    struct sv_errors errors;
    struct sv_error error = {0};
    sv_errors_init(&errors);
    sv_geo_init();
    sv_image_init();
    const char *cache = getenv("SILVISTA_CACHE_DIR");
    if (!cache || sv_store_open(cache, (uint64_t)1 << 31, &p->store, &error))
        p->store = NULL;
    p->name = name;
    enum sv_status status = sv_scene_spec_read(path, &spec, &errors);
    if (!status)
        status =
            sv_scene_load(&spec,
                          &(struct sv_scene_options){
                              .store = p->store, .log = log_line, .log_context = (void *)(uintptr_t)name},
                          &p->scene, &errors);
    unlink(path);
    for (size_t k = 0; k < errors.count; k++)
        printf("  %s: %s: %s\n", name, errors.items[k].field, errors.items[k].message);
    assert_int_equal(status, SV_OK);
    sv_errors_finish(&errors);
    if (sv_renderer_create(p->scene, &(struct sv_renderer_options){.store = p->store, .truth = true},
                           &p->renderer, &error))
        fail_msg("%s: %s", error.field, error.message);
}

static void unload(struct place_scene *p)
{
    sv_renderer_destroy(p->renderer);
    sv_scene_destroy(p->scene);
    sv_store_close(p->store);
}

static void draw(const struct place_scene *p, struct sv_view_request request, enum sv_trees trees,
                 unsigned layers, struct sv_picture *picture, struct sv_resolved_view *view)
{
    struct sv_error error = {0};
    request.trees = trees;
    request.layers = layers;
    enum sv_status status = sv_view_resolve(p->scene, &request, view, NULL, &error);
    if (!status)
        status = sv_renderer_draw(p->renderer, &request, view, picture, NULL, NULL, &error);
    if (status)
        fail_msg("%s: %s: %s", p->name, error.field, error.message);
}

struct pose {
    double x, y, agl, heading_deg, pitch_deg, vfov_deg; /* x, y as shares of the terrain's rectangle */
};

static struct sv_view_request pose_request(const struct place_scene *p, const struct pose *pose)
{
    const struct sv_heightfield *f = &p->scene->terrain.field;
    struct sv_view_request r = kit_request();
    r.width = 512;
    r.height = 352;
    r.eye.x = f->x0 + pose->x * (f->width - 1) * f->dx;
    r.eye.y = f->y0 + pose->y * (f->height - 1) * f->dy;
    r.eye.agl = pose->agl;
    r.heading_rad = sv_radians(pose->heading_deg);
    r.pitch_rad = sv_radians(pose->pitch_deg);
    r.vfov_rad = sv_radians(pose->vfov_deg);
    r.has_sun_azimuth = r.has_sun_elevation = true;
    r.sun_azimuth_rad = sv_radians(120);
    r.sun_elevation_rad = sv_radians(32);
    return r;
}

/* Share of pixels where raster and ray cast disagree on sky or not sky, and luminance of ground facing and
 * facing away. */
static void check_pose(const struct place_scene *p, const struct pose *pose, int number)
{
    enum { ALL = 1u << SV_LAYER_COLOR | 1u << SV_LAYER_NORMAL | 1u << SV_LAYER_ID };
    struct sv_view_request request = pose_request(p, pose);
    struct sv_picture raster, cast;
    struct sv_resolved_view view;
    draw(p, request, SV_TREES_AUTO, ALL, &raster, &view);
    draw(p, request, SV_TREES_RAYCAST, ALL, &cast, &view);
    char name[96];
    snprintf(name, sizeof name, "%s-%d", p->name, number);
    kit_keep(&raster.layer[SV_LAYER_COLOR], name);
    snprintf(name, sizeof name, "%s-%d-truth", p->name, number);
    kit_keep(&cast.layer[SV_LAYER_COLOR], name);
    const uint32_t *a = raster.layer[SV_LAYER_ID].data, *b = cast.layer[SV_LAYER_ID].data;
    const uint8_t *c = raster.layer[SV_LAYER_COLOR].data, *q = cast.layer[SV_LAYER_COLOR].data;
    long n = request.width * request.height, both_ground = 0, holes = 0, extra = 0;
    double difference = 0, light[2] = {0}, lit[2] = {0};
    for (long k = 0; k < n; k++) {
        holes += b[k] == SV_ID_TERRAIN && a[k] == SV_ID_SKY;
        extra += b[k] == SV_ID_SKY && a[k] == SV_ID_TERRAIN;
        if (a[k] != SV_ID_TERRAIN || b[k] != SV_ID_TERRAIN)
            continue;
        both_ground++;
        for (int i = 0; i < 3; i++)
            difference += abs((int)c[4 * k + i] - (int)q[4 * k + i]) / 3.0;
        const float *normal = (const float *)cast.layer[SV_LAYER_NORMAL].data + 3 * k;
        struct sv_vec3 sun = sv_direction(view.sun.azimuth_rad, view.sun.elevation_rad);
        double facing = (double)normal[0] * sun.x + (double)normal[1] * sun.y + (double)normal[2] * sun.z;
        int side = facing > sun.z; /* more than flat ground does */
        light[side]++;
        lit[side] += (0.2126 * c[4 * k] + 0.7152 * c[4 * k + 1] + 0.0722 * c[4 * k + 2]);
    }
    printf("%s pose %d: ground in common %.1f %%, sky through ground %ld px, ground over sky %ld px, ground "
           "differs by "
           "%.2f levels, luminance away from / towards the sun %.1f / %.1f\n",
           p->name, number, 100.0 * (double)both_ground / (double)n, holes, extra,
           difference / (double)(both_ground ? both_ground : 1), lit[0] / (light[0] + 1e-9),
           lit[1] / (light[1] + 1e-9));
    /* The skyline may differ by the screen-space error (1 px): a band of one pixel across the picture. */
    assert_true(holes <= request.width);
    assert_true(extra <= request.width);
    if (both_ground > n / 10)
        assert_true(difference / (double)both_ground < 8);
    sv_picture_finish(&raster);
    sv_picture_finish(&cast);
}

/* From straight above: the tree of a known place is found where the picture's geometry says, north up, east
 * right. */
static void check_map(const struct place_scene *p, double x, double y, double height_m)
{
    struct sv_view_request r = kit_request();
    r.width = r.height = 512;
    r.projection = SV_PROJECTION_ORTHOGRAPHIC;
    r.ortho_height_m = height_m;
    r.eye.x = x;
    r.eye.y = y;
    r.eye.agl = 400;
    r.pitch_rad = -SV_PI / 2;
    struct sv_picture picture;
    struct sv_resolved_view view;
    draw(p, r, SV_TREES_AUTO, 1u << SV_LAYER_COLOR | 1u << SV_LAYER_ID, &picture, &view);
    char name[96];
    snprintf(name, sizeof name, "%s-map", p->name);
    kit_keep(&picture.layer[SV_LAYER_COLOR], name);
    const uint32_t *id = picture.layer[SV_LAYER_ID].data;
    long seen = 0, apart = 0;
    for (uint32_t k = 0; k < p->scene->forest.count; k++) {
        const struct sv_tree *t = &p->scene->forest.trees[k];
        double px = 256 + (t->x - x) * 512 / height_m, py = 256 - (t->y - y) * 512 / height_m;
        double sx = 0, sy = 0, reach = t->height_m * 512 / height_m;
        long n = 0;
        if (!(px > reach && py > reach && px < 512 - reach && py < 512 - reach))
            continue;
        for (int j = (int)(py - reach); j <= py + reach; j++)
            for (int i = (int)(px - reach); i <= px + reach; i++)
                if (id[j * 512 + i] == SV_ID_TREE_FIRST + t->number) {
                    sx += i + 0.5;
                    sy += j + 0.5;
                    n++;
                }
        if (n < 4)
            continue;
        seen++;
        apart += hypot(sx / (double)n - px, sy / (double)n - py) > 0.45 * reach + 1.5;
    }
    printf("%s map: %ld trees probed from above, %ld not where they stand\n", p->name, seen, apart);
    assert_true(seen >= 5);
    assert_true(apart <= seen / 20);
    sv_picture_finish(&picture);
}

/* Every stem's base lies on the surface. */
static void check_ground(const struct place_scene *p)
{
    for (uint32_t k = 0; k < p->scene->forest.count; k++) {
        const struct sv_tree *t = &p->scene->forest.trees[k];
        assert_true(fabs(t->z - kit_surface(&p->scene->terrain.field, t->x, t->y)) < 0.02);
    }
}

static const char olinda_text[] =
    "{\"name\":\"olinda\",\"terrain\":{\"dem\":\"@/dem/olinda_srtm_utm25s.tif\","
    "\"imagery\":\"@/ortho/olinda_landsat7_utm25s.tif\",\"imagery_bands\":[3,2,1]},"
    "\"species\":[{\"name\":\"palm\",\"procedural\":{\"habit\":\"palm\",\"leaves\":4000,\"seed\":1}},"
    "{\"name\":\"mango\",\"procedural\":{\"habit\":\"broadleaf\",\"leaves\":9000,\"seed\":2}}],"
    "\"forest\":[{\"scatter\":{\"count\":20000,\"seed\":5,\"mix\":{\"palm\":0.3,\"mango\":0.7},"
    "\"height_m\":[6,18],\"min_spacing_m\":6}}]}";

static const char scbi_text[] =
    "{\"name\":\"scbi\",\"terrain\":{\"dem\":\"@/dem/scbi_10m_utm17n.tif\"},"
    "\"species\":[{\"name\":\"oak\",\"model\":\"@/models/eztree/ez_oak_medium.glb\"},"
    "{\"name\":\"ash\",\"model\":\"@/models/eztree/ez_ash_large.glb\"},"
    "{\"name\":\"aspen\",\"model\":\"@/models/eztree/ez_aspen_large.glb\"},"
    "{\"name\":\"bush\",\"model\":\"@/models/eztree/ez_bush_1.glb\"},"
    "{\"name\":\"willow\",\"model\":\"@/models/eztree/ez_willowbark_custom.glb\"},"
    "{\"name\":\"birch\",\"model\":\"@/models/quaternius/Birch_1.obj\"},"
    "{\"name\":\"pine\",\"model\":\"@/models/gazebo/pine_tree/pine_tree.dae\"}],"
    "\"forest\":[{\"points\":\"@/trees/"
    "scbi_forestgeo_utm17n.csv\",\"x\":\"x\",\"y\":\"y\",\"species\":\"species\","
    "\"height_m\":\"height_m\",\"crs\":\"EPSG:26917\",\"default_species\":\"oak\",\"default_height_m\":21,"
    "\"species_map\":{\"Fraxinus americana\":\"ash\",\"Carya glabra\":\"ash\",\"Carya tomentosa\":\"ash\","
    "\"Liriodendron tulipifera\":\"willow\",\"pist\":\"pine\",\"Pinus virginiana\":\"pine\","
    "\"Cercis canadensis\":\"bush\",\"Carpinus caroliniana\":\"birch\",\"Acer "
    "rubrum\":\"aspen\",\"*\":\"oak\"}}]}";

static const char zion_text[] =
    "{\"name\":\"zion\",\"terrain\":{\"dem\":\"@/dem/zion_srtm3_4326.tif\"},"
    "\"species\":[{\"name\":\"pine\",\"procedural\":{\"habit\":\"conifer\",\"leaves\":12000,\"seed\":4}},"
    "{\"name\":\"juniper\",\"procedural\":{\"habit\":\"shrub\",\"leaves\":6000,\"seed\":9}}],"
    "\"forest\":[{\"scatter\":{\"count\":60000,\"seed\":3,\"mix\":{\"pine\":0.5,\"juniper\":0.5},\"height_"
    "m\":[3,16],"
    "\"min_spacing_m\":5,\"max_slope_deg\":30}}]}";

/* more: what else is looked at in that place, or NULL. */
static void run_place(const char *name, const char *text, const struct pose poses[5], double map_height_m,
                      void (*more)(const struct place_scene *))
{
    const char *folder = data_folder();
    if (!folder) {
        printf("%s: skipped, the real inputs are not here\n", name);
        skip();
    }
    struct place_scene p = {0};
    load(&p, name, text, folder);
    check_ground(&p);
    for (int k = 0; k < 5; k++)
        check_pose(&p, &poses[k], k);
    const struct sv_forest *forest = &p.scene->forest;
    const struct sv_tree *middle = &forest->trees[forest->count / 2];
    check_map(&p, middle->x, middle->y, map_height_m);
    if (more)
        more(&p);
    unload(&p);
}

static void test_olinda(void **state)
{
    (void)state;
    static const struct pose poses[5] = {{0.3, 0.5, 120, 90, -12, 60},
                                         {0.6, 0.7, 40, 200, -8, 60},
                                         {0.5, 0.5, 1.7, 30, 3, 60},
                                         {0.2, 0.2, 900, 45, -25, 60},
                                         {0.75, 0.55, 250, 270, -15, 50}};
    run_place("olinda", olinda_text, poses, 200, NULL);
}

static void test_scbi(void **state)
{
    (void)state;
    static const struct pose poses[5] = {{0.5, 0.02, 60, 0, -14, 60},
                                         {0.5, 0.4, 1.7, 20, 4, 60},
                                         {0.02, 0.5, 90, 90, -16, 60},
                                         {0.98, 0.6, 30, 265, -4, 60},
                                         {0.55, 0.95, 150, 180, -22, 60}};
    run_place("scbi", scbi_text, poses, 120, NULL);
}

/* One picture with a tree at 5 m and ridges 20 km away: depth spans both, and both are there. */
static void near_and_far(const struct place_scene *p)
{
    const struct sv_forest *forest = &p->scene->forest;
    /* The small pine, and the heading, with most to see beyond 18 km: by marching over the ground from 2 m
     * above its foot. */
    double best = 0, heading = 0;
    const struct sv_tree *tree = NULL;
    const struct sv_heightfield *f = &p->scene->terrain.field;
    for (uint32_t k = 0; k < forest->count; k += 40) {
        const struct sv_tree *t = &forest->trees[k];
        for (int turn = 0; turn < 24 && t->species == 0 && t->height_m < 9; turn++) {
            double a = turn * SV_PI / 12, nearer = -INFINITY, all = -INFINITY;
            for (double d = 60; d < 40000; d += 80) {
                double ground = kit_surface(f, t->x + d * sin(a), t->y + d * cos(a));
                if (isnan(ground))
                    break;
                all = fmax(all, (ground - t->z - 2) / d);
                nearer = d < 18000 ? all : nearer;
            }
            if (all - nearer > best) {
                best = all - nearer;
                heading = a;
                tree = t;
            }
        }
    }
    assert_non_null(tree);
    printf("zion: a pine of %.1f m; ground beyond 18 km rises %.2f degrees behind what is nearer, heading "
           "%.0f\n",
           (double)tree->height_m, sv_degrees(atan(best)), sv_degrees(heading));
    struct sv_view_request r = kit_request();
    r.width = 768;
    r.height = 512;
    r.eye.x = tree->x - 5 * sin(heading - 0.25);
    r.eye.y = tree->y - 5 * cos(heading - 0.25);
    r.eye.agl = 1.7;
    r.heading_rad = heading;
    r.pitch_rad = sv_radians(2);
    r.has_sun_azimuth = r.has_sun_elevation = true;
    r.sun_azimuth_rad = sv_radians(150);
    r.sun_elevation_rad = sv_radians(35);
    struct sv_picture picture;
    struct sv_resolved_view view;
    draw(p, r, SV_TREES_AUTO, 1u << SV_LAYER_COLOR | 1u << SV_LAYER_DEPTH | 1u << SV_LAYER_ID, &picture,
         &view);
    kit_keep(&picture.layer[SV_LAYER_COLOR], "zion-near-and-far");
    const float *z = picture.layer[SV_LAYER_DEPTH].data;
    const uint32_t *id = picture.layer[SV_LAYER_ID].data;
    long near = 0, far = 0;
    for (long k = 0; k < (long)r.width * r.height; k++) {
        near += id[k] == SV_ID_TREE_FIRST + tree->number && z[k] > 1 && z[k] < 12;
        far += id[k] == SV_ID_TERRAIN && z[k] > 18000;
    }
    printf("zion: %ld pixels of the tree at 5 m, %ld pixels of ground beyond 18 km\n", near, far);
    assert_true(near > 1000);
    assert_true(far > 150);
    sv_picture_finish(&picture);
}

static void test_zion(void **state)
{
    (void)state;
    static const struct pose poses[5] = {{0.30, 0.35, 60, 40, -5, 60},
                                         {0.45, 0.30, 400, 0, -12, 60},
                                         {0.6, 0.5, 1.7, 300, 2, 60},
                                         {0.2, 0.8, 1500, 130, -18, 70},
                                         {0.8, 0.2, 200, 320, -6, 40}};
    run_place("zion", zion_text, poses, 600, near_and_far);
}

int main(void)
{
    if (!data_folder()) {
        printf("skipped: the real inputs are not here (SV_DATA, or ../shared/data)\n");
        return 77;
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_olinda), cmocka_unit_test(test_scbi),
                                       cmocka_unit_test(test_zion)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
