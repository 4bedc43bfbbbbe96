#include "tests/core/view/scene_kit.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/rng.h"
#include "core/terrain/coloring.h"
#include "core/tree/grow.h"
#include "tests/core/tree/kept_bakes.h"

static void must(enum sv_status status, const struct sv_error *error, const char *what)
{
    if (status == SV_OK)
        return;
    fprintf(stderr, "%s: %s: %s: %s\n", what, sv_status_text(status), error->field, error->message);
    abort();
}

/* Smooth value noise of three octaves: hills that no library made. */
static double noise(uint64_t seed, double x, double y)
{
    double sum = 0, scale = 1;
    for (int octave = 0; octave < 4; octave++, scale *= 0.45, x *= 2.1, y *= 2.1) {
        double fx = floor(x), fy = floor(y), u = x - fx, v = y - fy, c[4];
        u = u * u * (3 - 2 * u);
        v = v * v * (3 - 2 * v);
        for (int k = 0; k < 4; k++) {
            uint64_t cell = (uint64_t)((int64_t)fx + (k & 1)) * 0x9E3779B97F4A7C15u ^
                            (uint64_t)((int64_t)fy + (k >> 1)) * 0xC2B2AE3D27D4EB4Fu;
            c[k] = (double)(sv_mix64(cell ^ seed ^ (uint64_t)octave << 56) >> 11) * 0x1p-53;
        }
        sum += scale * ((c[0] * (1 - u) + c[1] * u) * (1 - v) + (c[2] * (1 - u) + c[3] * u) * v);
    }
    return sum / 1.75;
}

static void make_field(struct sv_scene *scene, const struct kit_options *o)
{
    struct sv_heightfield *f = &scene->terrain.field;
    float *h = sv_arena_alloc(scene->arena, (size_t)o->width * (size_t)o->height, sizeof *h);
    f->h_min = INFINITY;
    f->h_max = -INFINITY;
    for (int j = 0; j < o->height; j++)
        for (int i = 0; i < o->width; i++) {
            double n = noise(o->seed, i * 6.0 / o->width, j * 6.0 / o->height);
            float v = (float)((n - 0.5) * o->relief_m);
            h[(size_t)j * (size_t)o->width + (size_t)i] = v;
            f->h_min = fminf(f->h_min, v);
            f->h_max = fmaxf(f->h_max, v);
        }
    f->width = o->width;
    f->height = o->height;
    f->x0 = o->x0;
    f->y0 = o->y0;
    f->z0 = o->z0;
    f->dx = o->dx;
    f->dy = o->dy;
    f->h = h;
    struct sv_error error = {0};
    must(sv_terrain_color(&scene->terrain, NULL, 47, scene->arena, &error), &error, "sv_terrain_color");
}

/* The habit's tree, grown once for all scenes of as many leaves. */
static const struct sv_tree_mesh *grown(enum sv_habit habit, uint32_t leaves)
{
    static struct sv_tree_mesh kept[SV_HABIT_COUNT];
    static uint32_t kept_leaves[SV_HABIT_COUNT];
    struct sv_error error = {0};
    if (!kept[habit].vertices || kept_leaves[habit] != leaves) {
        sv_tree_mesh_finish(&kept[habit]);
        must(sv_tree_grow(habit, leaves, (uint64_t)habit + 1, &kept[habit], &error), &error, "sv_tree_grow");
        kept_leaves[habit] = leaves;
    }
    return &kept[habit];
}

static void make_trees(struct sv_scene *scene, const struct kit_options *o)
{
    struct sv_error error = {0};
    struct sv_species *species = sv_arena_alloc(scene->arena, (size_t)o->species + 1, sizeof *species);
    struct sv_crown_bound bounds[SV_HABIT_COUNT];
    for (int k = 0; k < o->species; k++) {
        const struct sv_tree_mesh *mesh = grown((enum sv_habit)(k % SV_HABIT_COUNT), o->leaves);
        must(sv_tree_mesh_to_arena(mesh, scene->arena, &species[k].mesh, &error), &error, "to_arena");
        snprintf(species[k].name, sizeof species[k].name, "%s",
                 sv_habit_name((enum sv_habit)(k % SV_HABIT_COUNT)));
        species[k].key = kept_bakes_key(&species[k].mesh);
        bounds[k % SV_HABIT_COUNT] = (struct sv_crown_bound){species[k].mesh.radius, 1, 0};
    }
    scene->species = species;
    scene->species_count = o->species;
    struct sv_tree *trees = sv_arena_alloc(scene->arena, o->trees, sizeof *trees); /* the forest keeps them */
    struct sv_rng rng = sv_rng_seeded(o->seed, 99);
    const struct sv_heightfield *f = &scene->terrain.field;
    double cx = f->x0 + (f->width - 1) * f->dx / 2, cy = f->y0 + (f->height - 1) * f->dy / 2;
    for (uint32_t k = 0; k < o->trees; k++) {
        double a = sv_rng_range(&rng, 0, 2 * SV_PI), r = o->spread_m * sqrt(sv_rng_unit(&rng));
        struct sv_tree *t = &trees[k];
        t->x = cx + r * cos(a);
        t->y = cy + r * sin(a);
        t->z = kit_surface(f, t->x, t->y);
        t->height_m = (float)sv_rng_range(&rng, o->height_min_m, o->height_max_m);
        t->rotation_rad = (float)sv_rng_range(&rng, 0, 6.28);
        t->species = (uint16_t)(k % (uint32_t)o->species);
        t->number = k;
        species[t->species].tree_count++;
    }
    must(sv_forest_build(trees, o->trees, bounds, scene->arena, &scene->forest, &error), &error,
         "sv_forest_build");
}

struct sv_scene *kit_scene(const struct kit_options *o)
{
    struct sv_error error = {0};
    struct sv_scene *scene = calloc(1, sizeof *scene);
    must(sv_arena_create((size_t)1 << 32, &scene->arena, &error), &error, "arena");
    must(sv_crs_create_local(&scene->crs, &error), &error, "crs");
    snprintf(scene->name, sizeof scene->name, "kit");
    scene->sun = (struct sv_sun){sv_radians(135), sv_radians(40)};
    make_field(scene, o);
    if (o->trees)
        make_trees(scene, o);
    return scene;
}

void kit_free(struct sv_scene *scene)
{
    sv_crs_destroy(scene->crs);
    sv_arena_destroy(scene->arena);
    free(scene);
}

struct sv_view_request kit_request(void)
{
    struct sv_view_request r;
    memset(&r, 0, sizeof r);
    r.eye.form = SV_PLACE_XY;
    r.eye.agl = 1.7;
    r.vfov_rad = sv_radians(60);
    r.projection = SV_PROJECTION_PERSPECTIVE;
    r.width = r.height = 256;
    r.format = SV_FORMAT_PNG;
    r.q = 85;
    r.layers = 1u << SV_LAYER_COLOR;
    r.sky = true;
    r.quality = SV_QUALITY_BALANCED;
    r.trees = SV_TREES_AUTO;
    r.relief = SV_RELIEF_AUTO;
    return r;
}

double kit_surface(const struct sv_heightfield *f, double x, double y)
{
    double gi = (x - f->x0) / f->dx, gj = (y - f->y0) / f->dy;
    if (!(gi >= 0 && gj >= 0 && gi <= f->width - 1 && gj <= f->height - 1))
        return NAN;
    int i = gi < f->width - 1 ? (int)gi : f->width - 2, j = gj < f->height - 1 ? (int)gj : f->height - 2;
    double u = gi - i, v = gj - j;
    const float *p = f->h + (size_t)j * (size_t)f->width + (size_t)i;
    double a = (double)p[0], b = (double)p[1], c = (double)p[f->width], d = (double)p[f->width + 1];
    double z;
    if (((i + j) & 1) == 0)
        z = u >= v ? a * (1 - u) + b * (u - v) + d * v : a * (1 - v) + c * (v - u) + d * u;
    else
        z = u + v <= 1 ? a * (1 - u - v) + b * u + c * v : d * (u + v - 1) + b * (1 - v) + c * (1 - u);
    return f->z0 + z;
}

void kit_keep(const struct sv_image *image, const char *name)
{
    const char *folder = getenv("SV_TEST_PICTURES");
    if (!folder)
        return;
    static const char *const names[] = {"R", "G", "B", "A"};
    struct sv_encode_layer layer = {image, names};
    struct sv_encode_options options = {.format = SV_FORMAT_PNG, .quality = 90};
    void *bytes;
    size_t size;
    struct sv_error error = {0};
    must(sv_image_encode(&layer, 1, &options, &bytes, &size, &error), &error, "sv_image_encode");
    char path[512];
    snprintf(path, sizeof path, "%s/%s.png", folder, name);
    FILE *file = fopen(path, "wb");
    if (file) {
        fwrite(bytes, 1, size, file);
        fclose(file);
    }
    free(bytes);
}
