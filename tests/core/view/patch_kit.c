/* patch_kit.c - see patch_kit.h. */
#include "tests/core/view/patch_kit.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "api/patch_parse.h"
#include "core/base/rng.h"
#include "tests/core/tree/kept_bakes.h"

static char folder[] = "/tmp/sv-patch-XXXXXX";

void patch_kit_write(const char *name, const char *format, ...)
{
    char path[128];
    va_list args;
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "we");
    assert_non_null(file);
    va_start(args, format);
    vfprintf(file, format, args);
    va_end(args);
    fclose(file);
}

/* The first `count` of the trees that all scenes here are made of; tree k is the same in all of them. */
static void write_trees(uint32_t count)
{
    static char text[PATCH_KIT_TREES * 96];
    struct sv_rng rng = sv_rng_seeded(5, 0);
    size_t used = (size_t)snprintf(text, sizeof text, "x,y,species,height_m\n");
    for (uint32_t k = 0; k < count; k++) {
        double x = sv_rng_range(&rng, 30, 190), y = sv_rng_range(&rng, 30, 190),
               h = sv_rng_range(&rng, 3, 14);
        used += (size_t)snprintf(text + used, sizeof text - used, "%.17g,%.17g,%s,%.17g\n", x, y,
                                 k % 3 ? "oak" : "fir", h);
    }
    patch_kit_write("trees.csv", "%s", text);
}

/* Oak and fir are of one shape, so that there is less to bake. */
const char PATCH_KIT_HUT[] = "o hut\nv -0.5 0 -0.4\nv 0.5 0 -0.4\nv 0.5 0 0.4\nv -0.5 0 0.4\nv 0 1 0\n"
                             "f 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\nf 4 3 2 1\n";

/* forest, objects: more entries of the lists, with a comma before; sun: azimuth. */
struct sv_scene *patch_kit_load(uint32_t trees, const char *forest, const char *objects, double azimuth_deg)
{
    char path[128];
    struct sv_scene_spec spec;
    struct sv_errors errors;
    struct sv_scene *scene = NULL;
    struct sv_scene_options options = {.store = kept_bakes(), .arena_bytes = (size_t)1 << 30};
    write_trees(trees);
    patch_kit_write("hut.obj", "%s", PATCH_KIT_HUT);
    patch_kit_write(
        "scene.json",
        "{\"name\":\"p\",\"terrain\":{\"procedural\":{\"size_m\":220,\"samples\":65,\"relief_m\":25,\"seed\":"
        "2}},"
        "\"species\":[{\"name\":\"oak\",\"procedural\":{\"habit\":\"broadleaf\",\"leaves\":400}},"
        "{\"name\":\"fir\",\"procedural\":{\"habit\":\"broadleaf\",\"leaves\":400}},"
        "{\"name\":\"bush\",\"procedural\":{\"habit\":\"shrub\",\"leaves\":300}}],"
        "\"forest\":[{\"points\":\"trees.csv\",\"species\":\"species\",\"height_m\":\"height_m\"}%s],"
        "\"objects\":[{\"model\":\"hut.obj\",\"x\":110,\"y\":118,\"height_m\":7,\"relief_resolution\":32}%s],"
        "\"sun\":{\"azimuth_deg\":%.17g,\"elevation_deg\":28}}",
        forest, objects, azimuth_deg);
    snprintf(path, sizeof path, "%s/scene.json", folder);
    sv_errors_init(&errors);
    if (sv_scene_spec_read(path, &spec, &errors) != SV_OK ||
        sv_scene_load(&spec, &options, &scene, &errors) != SV_OK)
        fail_msg("%s: %s", errors.items[0].field, errors.items[0].message);
    sv_errors_finish(&errors);
    return scene;
}

struct sv_scene_change patch_kit_patch(struct sv_scene *scene, struct sv_renderer *r, const char *format, ...)
{
    static char text[65536];
    struct sv_scene_patch patch;
    struct sv_scene_patch_options options = {.store = kept_bakes()};
    struct sv_scene_delta delta;
    struct sv_errors errors;
    struct sv_error error;
    va_list args;
    va_start(args, format);
    int bytes = vsnprintf(text, sizeof text, format, args);
    va_end(args);
    sv_errors_init(&errors);
    if (sv_api_patch_parse(text, (size_t)bytes, &scene->spec, &patch, &errors) != SV_OK ||
        sv_scene_patch_apply(scene, &patch, &options, &delta, &errors) != SV_OK)
        fail_msg("%s: %s", errors.items[0].field, errors.items[0].message);
    if (r && sv_renderer_change(r, &delta, kept_bakes(), &error) != SV_OK)
        fail_msg("%s: %s", error.field, error.message);
    struct sv_scene_change change = delta.change;
    sv_scene_delta_finish(&delta);
    sv_scene_patch_finish(&patch);
    sv_errors_finish(&errors);
    return change;
}

int patch_kit_setup(void **state)
{
    (void)state;
    sv_geo_init();
    return mkdtemp(folder) ? 0 : 1;
}

int patch_kit_teardown(void **state)
{
    (void)state;
    char command[160];
    snprintf(command, sizeof command, "rm -rf %s", folder);
    return system(command);
}
