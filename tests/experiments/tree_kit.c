/* tree_kit.c - see tree_kit.h. */
#include "tests/experiments/tree_kit.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "core/base/color.h"
#include "core/base/frames.h"
#include "core/base/hash.h"
#include "core/image/encode.h"

enum { ARENA_BYTES = 1 << 20, FOCAL_SIDE = 512 };
static const double HEIGHT_M = 12;
static const uint8_t SKY[3] = {172, 196, 220};

const char *const tree_kit_names[TREE_KIT_TREES] = {"beech",       "oak",      "spruce",   "poplar",
                                                    "hazel",       "ez_oak",   "ez_ash",   "birch",
                                                    "gazebo_pine", "palmetto", "christmas"};
/* deploy/demo/scene.json */
static const struct sv_species_spec SPECIES[TREE_KIT_SPECIES] = {
    {.habit = SV_HABIT_BROADLEAF, .leaves = 38952, .seed = 7},
    {.habit = SV_HABIT_BROADLEAF, .leaves = 39204, .seed = 23},
    {.habit = SV_HABIT_CONIFER, .leaves = 38952, .seed = 3},
    {.habit = SV_HABIT_POPLAR, .leaves = 39010, .seed = 5},
    {.habit = SV_HABIT_SHRUB, .leaves = 38700, .seed = 2}};
static const char *const MODELS[TREE_KIT_MODELS] = {"eztree/ez_oak_medium.glb",
                                                    "eztree/ez_ash_large.glb",
                                                    "quaternius/Birch_1.obj",
                                                    "gazebo/pine_tree/pine_tree.dae",
                                                    "sweethome3d/sabalPalmeto/sabalPalmeto.obj",
                                                    "sweethome3d/christmas_tree/christmas_tree.obj"};

void tree_kit_must(enum sv_status status, const struct sv_error *error)
{
    if (status == SV_OK)
        return;
    fprintf(stderr, "%s: %s\n", error->field, error->message);
    exit(1);
}

void *tree_kit_alloc(size_t bytes)
{
    void *memory = calloc(1, bytes ? bytes : 1);
    if (!memory) {
        fprintf(stderr, "no memory\n");
        exit(1);
    }
    return memory;
}

double tree_kit_now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

int tree_kit_find(const char *name)
{
    for (int k = 0; k < TREE_KIT_TREES; k++)
        if (strcmp(name, tree_kit_names[k]) == 0)
            return k;
    return -1;
}

/* A scene of the tree alone, by hand: all that the truth reads of one. */
static void make_scene(struct tree_kit *kit)
{
    struct sv_error error;
    static const float heights[4];
    const struct sv_crown_bound bound = {kit->mesh.radius, 1, 0};
    tree_kit_must(sv_arena_create(ARENA_BYTES, &kit->arena, &error), &error);
    kit->tree = (struct sv_tree){.height_m = (float)HEIGHT_M};
    tree_kit_must(sv_forest_build(&kit->tree, 1, &bound, kit->arena, &kit->forest, &error), &error);
    snprintf(kit->species.name, sizeof kit->species.name, "%s", kit->name);
    kit->species.mesh = kit->mesh;
    kit->species.key = kit->key;
    kit->species.tree_count = 1;
    kit->scene = (struct sv_scene){.species = &kit->species, .species_count = 1, .forest = kit->forest};
    kit->scene.terrain.field = (struct sv_heightfield){
        .width = 2, .height = 2, .x0 = -5e-4, .y0 = -5e-4, .dx = 1e-3, .dy = 1e-3, .z0 = -1000, .h = heights};
}

bool tree_kit_open(struct tree_kit *kit, int tree, const char *models, struct sv_store *store)
{
    struct sv_error error;
    struct sv_errors notes = {0};
    char path[4096];
    *kit = (struct tree_kit){.name = tree_kit_names[tree]};
    struct sv_species_spec spec = {0};
    if (tree < TREE_KIT_SPECIES) {
        spec = SPECIES[tree];
    } else {
        snprintf(path, sizeof path, "%s/%s", models, MODELS[tree - TREE_KIT_SPECIES]);
        if (access(path, R_OK) != 0) {
            printf("%s: skipped, there is no %s\n", kit->name, path);
            return false;
        }
        spec.model = path;
    }
    tree_kit_must(sv_species_build(&spec, store, &kit->mesh, &kit->key, &notes, &error), &error);
    make_scene(kit);
    return true;
}

void tree_kit_close(struct tree_kit *kit)
{
    sv_truth_destroy(kit->truth);
    sv_arena_destroy(kit->arena);
    sv_tree_mesh_finish(&kit->mesh);
}

struct sv_camera tree_kit_camera(const struct tree_kit *kit, double height_px, double azimuth_deg,
                                 double elevation_deg)
{
    double focal = 0.5 * FOCAL_SIDE / tan(sv_radians(30)), distance = focal * HEIGHT_M / height_px;
    double wide = fmax(1, 2.1 * (double)kit->mesh.radius), azimuth = sv_radians(azimuth_deg),
           elevation = sv_radians(elevation_deg);
    int side = (int)(height_px * wide * 1.12) + 12;
    struct sv_camera camera = {
        .vfov_rad = 2 * atan(0.5 * side / focal),
        .width = side,
        .height = side,
        .near_m = 0.1,
        .eye = sv_madd(sv_vec3(0, 0, HEIGHT_M / 2), sv_direction(azimuth, elevation), distance)};
    sv_camera_aim(&camera, azimuth + SV_PI, -elevation, 0);
    return camera;
}

/* How far the mesh reaches to a side, near a height. */
static double reach(const struct sv_tree_mesh *mesh, const float side[2], double height)
{
    double most = 0;
    for (uint32_t k = 0; k < mesh->vertex_count; k++) {
        const float *p = mesh->vertices[k].position;
        if (fabs((double)p[2] - height) < 0.05)
            most = fmax(most, (double)(p[0] * side[0] + p[1] * side[1]));
    }
    return most;
}

struct sv_camera tree_kit_edge_camera(const struct tree_kit *kit, double height_px, double azimuth_deg,
                                      double at_height, int side)
{
    double focal = 0.5 * FOCAL_SIDE / tan(sv_radians(30)), distance = focal * HEIGHT_M / height_px;
    double azimuth = sv_radians(azimuth_deg);
    struct sv_vec3 right = sv_direction(azimuth - SV_PI / 2, 0);
    double out = 0.93 * reach(&kit->mesh, (const float[2]){(float)right.x, (float)right.y}, at_height);
    struct sv_vec3 at = sv_madd(sv_vec3(0, 0, at_height * HEIGHT_M), right, out * HEIGHT_M);
    struct sv_camera camera = {.vfov_rad = 2 * atan(0.5 * side / focal),
                               .width = side,
                               .height = side,
                               .near_m = 0.1,
                               .eye = sv_madd(at, sv_direction(azimuth, 0), distance)};
    sv_camera_aim(&camera, azimuth + SV_PI, 0, 0);
    return camera;
}

struct sv_light tree_kit_light(double azimuth_deg, double elevation_deg)
{
    struct sv_light light;
    sv_light_from_sun(&(struct sv_sun){sv_radians(azimuth_deg), sv_radians(elevation_deg)}, &light);
    return light;
}

static uint64_t truth_key(const struct tree_kit *kit, const struct sv_camera *c, const struct sv_light *light,
                          int samples)
{
    const double numbers[] = {c->eye.x,     c->eye.y,        c->eye.z,       c->vfov_rad,
                              c->width,     samples,         c->forward.x,   c->forward.y,
                              c->forward.z, light->to_sun.x, light->to_sun.y};
    uint64_t h = sv_hash_u64(SV_HASH_INIT, kit->key);
    for (size_t k = 0; k < sizeof numbers / sizeof *numbers; k++)
        h = sv_hash_double(h, numbers[k]);
    return sv_hash_done(h);
}

struct sv_image tree_kit_truth(const struct tree_kit *kit, const struct sv_camera *camera,
                               const struct sv_light *light, int samples, struct sv_store *store)
{
    struct sv_error error;
    struct sv_truth_picture picture = {0};
    void *kept;
    size_t bytes;
    uint64_t key = truth_key(kit, camera, light, samples);
    tree_kit_must(sv_image_alloc(camera->width, camera->height, 4, SV_PIXEL_U8, &picture.color, &error),
                  &error);
    if (sv_store_get(store, "treetruth1", key, &kept, &bytes, &error) == SV_OK) {
        if (bytes == sv_image_bytes(&picture.color)) {
            memcpy(picture.color.data, kept, bytes);
            free(kept);
            return picture.color;
        }
        free(kept);
    }
    struct tree_kit *owner = (struct tree_kit *)kit;
    if (!kit->truth)
        tree_kit_must(sv_truth_create(&kit->scene, &owner->truth, &error), &error);
    const struct sv_truth_options options = {
        .layers = 1u << SV_LAYER_COLOR, .samples = samples, .trees = true, .row_count = camera->height};
    tree_kit_must(sv_truth_render(kit->truth, camera, light, &options, &picture, &error), &error);
    sv_store_put(store, "treetruth1", key, picture.color.data, sv_image_bytes(&picture.color), &error);
    return picture.color;
}

struct sv_image tree_kit_compose(const struct sv_image *rgba, bool premultiplied)
{
    struct sv_error error;
    struct sv_image out;
    tree_kit_must(sv_image_alloc(rgba->width, rgba->height, 3, SV_PIXEL_U8, &out, &error), &error);
    const uint8_t *from = rgba->data;
    uint8_t *to = out.data;
    for (size_t i = 0; i < (size_t)rgba->width * (size_t)rgba->height; i++, from += 4, to += 3)
        for (int c = 0; c < 3; c++) {
            float a = (float)from[3] / 255, v = sv_linear_from_srgb8[from[c]] * (premultiplied ? 1 : a);
            to[c] = sv_srgb8_from_linear(v + (1 - a) * sv_linear_from_srgb8[SKY[c]]);
        }
    return out;
}

struct tree_kit_sheet tree_kit_sheet(int columns, int rows, int side)
{
    struct sv_error error;
    struct tree_kit_sheet sheet = {.columns = columns, .rows = rows, .side = side};
    tree_kit_must(sv_image_alloc(columns * side, rows * side, 3, SV_PIXEL_U8, &sheet.image, &error), &error);
    uint8_t *p = sheet.image.data;
    for (size_t i = 0; i < (size_t)columns * (size_t)side * (size_t)rows * (size_t)side; i++, p += 3)
        memcpy(p, SKY, 3);
    return sheet;
}

void tree_kit_sheet_put(struct tree_kit_sheet *sheet, int column, int row, const struct sv_image *rgb)
{
    int most = rgb->width > rgb->height ? rgb->width : rgb->height, times = sheet->side / most;
    times = times < 1 ? 1 : times;
    int left = (sheet->side - times * rgb->width) / 2, above = (sheet->side - times * rgb->height) / 2;
    for (int j = 0; j < sheet->side; j++)
        for (int i = 0; i < sheet->side; i++) {
            int x = i - left, y = j - above;
            if (x < 0 || y < 0 || x >= times * rgb->width || y >= times * rgb->height)
                continue;
            uint8_t *to = (uint8_t *)sheet->image.data +
                          3 * ((size_t)(row * sheet->side + j) * (size_t)sheet->image.width +
                               (size_t)(column * sheet->side + i));
            memcpy(to,
                   (const uint8_t *)rgb->data +
                       3 * ((size_t)(y / times) * (size_t)rgb->width + (size_t)(x / times)),
                   3);
        }
}

void tree_kit_sheet_write(const struct tree_kit_sheet *sheet, const char *path)
{
    struct sv_encode_layer layer = {&sheet->image, NULL};
    const struct sv_encode_options options = {.format = SV_FORMAT_PNG, .quality = 90};
    struct sv_error error;
    void *bytes;
    size_t size;
    tree_kit_must(sv_image_encode(&layer, 1, &options, &bytes, &size, &error), &error);
    FILE *f = fopen(path, "wb");
    if (!f || fwrite(bytes, 1, size, f) != size || fclose(f) != 0) {
        fprintf(stderr, "cannot write %s\n", path);
        exit(1);
    }
    free(bytes);
}
