#include "tests/experiments/forest_kit.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "core/base/color.h"
#include "core/base/hash.h"
#include "core/base/rng.h"
#include "core/image/encode.h"
#include "core/view/cells_refine.h"

/* The species of deploy/demo/scene.json. */
static const char SCENE[] =
    "{\"name\": \"forest\","
    "\"terrain\": {\"procedural\": {\"size_m\": %d, \"samples\": 513, \"relief_m\": 60, \"seed\": 11}},"
    "\"species\": ["
    "{\"name\": \"beech\", \"procedural\": {\"habit\": \"broadleaf\", \"leaves\": 38952, \"seed\": 7}},"
    "{\"name\": \"oak\", \"procedural\": {\"habit\": \"broadleaf\", \"leaves\": 39204, \"seed\": 23}},"
    "{\"name\": \"spruce\", \"procedural\": {\"habit\": \"conifer\", \"leaves\": 38952, \"seed\": 3}},"
    "{\"name\": \"poplar\", \"procedural\": {\"habit\": \"poplar\", \"leaves\": 39010, \"seed\": 5}},"
    "{\"name\": \"hazel\", \"procedural\": {\"habit\": \"shrub\", \"leaves\": 38700, \"seed\": 2}}],"
    "\"forest\": [{\"scatter\": {\"count\": %u, \"seed\": 1, \"height_m\": [8, 20], \"min_spacing_m\": %g,"
    "\"max_slope_deg\": 60, \"mix\": {\"beech\": 0.2, \"oak\": 0.2, \"spruce\": 0.2, \"poplar\": 0.2, \"hazel\": 0.2}}}],"
    "\"sun\": {\"azimuth_deg\": 135, \"elevation_deg\": 40}}";

static void die(const char *what, const struct sv_error *error)
{
    fprintf(stderr, "%s: %s: %s\n", what, error->field, error->message);
    exit(1);
}

static double clock_ms(clockid_t id)
{
    struct timespec t;
    clock_gettime(id, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

double forest_now_ms(void)
{
    return clock_ms(CLOCK_MONOTONIC);
}

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

double forest_median(double *values, int count)
{
    if (count == 0)
        return NAN;
    qsort(values, (size_t)count, sizeof *values, ascending);
    return count & 1 ? values[count / 2] : 0.5 * (values[count / 2 - 1] + values[count / 2]);
}

static size_t cells_bytes;

void forest_use_cells(size_t bytes)
{
    cells_bytes = bytes;
}

/* Reads the file at path, or parses text. */
static void open_scene(const char *path, const char *text, size_t bytes, bool truth, struct forest *forest)
{
    struct sv_error error = {0};
    struct sv_errors errors = {0};
    memset(forest, 0, sizeof *forest);
    sv_color_init();
    const char *folder = getenv("SILVISTA_CACHE_DIR");
    if (folder && sv_store_open(folder, (uint64_t)8 << 30, &forest->store, &error) != SV_OK)
        forest->store = NULL;
    struct sv_scene_spec spec;
    struct sv_scene_options options = {.store = forest->store};
    if ((text ? sv_scene_spec_parse(text, bytes, path, &spec, &errors) : sv_scene_spec_read(path, &spec, &errors)) ||
        sv_scene_load(&spec, &options, &forest->scene, &errors)) {
        for (size_t k = 0; k < errors.count; k++)
            fprintf(stderr, "%s: %s\n", errors.items[k].field, errors.items[k].message);
        exit(1);
    }
    if (cells_bytes > 0 && sv_cells_memory_make(cells_bytes, &forest->cells, &error))
        die("cells", &error);
    struct sv_renderer_options render = {
        .store = forest->store, .clock = forest_now_ms, .truth = truth, .cells = forest->cells.cache};
    if (sv_renderer_create(forest->scene, &render, &forest->renderer, &error))
        die("renderer", &error);
}

void forest_open(uint32_t count, bool truth, struct forest *forest)
{
    char text[4096];
    /* A million trees stand a metre apart at the mean: closer than the spacing that suits 45,000. */
    double spacing = fmin(2, 0.4 * sqrt((double)FOREST_SIDE_M * FOREST_SIDE_M / fmax(count, 1)));
    int bytes = snprintf(text, sizeof text, SCENE, FOREST_SIDE_M, count, spacing);
    open_scene("forest.json", text, (size_t)bytes, truth, forest);
}

void forest_open_file(const char *path, bool truth, struct forest *forest)
{
    open_scene(path, NULL, 0, truth, forest);
}

void forest_close(struct forest *forest)
{
    sv_renderer_destroy(forest->renderer);
    sv_scene_destroy(forest->scene);
    sv_store_close(forest->store);
    sv_cells_memory_close(&forest->cells);
}

bool forest_is_free(const struct forest *forest, double x, double y, double clear_m)
{
    for (uint32_t k = 0; k < forest->scene->forest.count; k++) {
        const struct sv_tree *tree = &forest->scene->forest.trees[k];
        if (hypot(tree->x - x, tree->y - y) < clear_m)
            return false;
    }
    return true;
}

struct sv_view_request forest_request(const struct forest *forest, enum forest_eye kind, int k)
{
    struct sv_rng rng = sv_rng_seeded(kind == FOREST_WALK ? 171 : 3060, (uint64_t)k);
    const struct sv_heightfield *f = &forest->scene->terrain.field;
    struct sv_view_request r;
    memset(&r, 0, sizeof r);
    r.eye.form = SV_PLACE_XY;
    do {
        /* Eyes in the inner part: some hundred metres of forest in every direction. */
        r.eye.x = f->x0 + sv_rng_range(&rng, 0.2, 0.8) * FOREST_SIDE_M;
        r.eye.y = f->y0 + sv_rng_range(&rng, 0.2, 0.8) * FOREST_SIDE_M;
    } while (kind == FOREST_WALK && !forest_is_free(forest, r.eye.x, r.eye.y, 1));
    r.eye.agl = kind == FOREST_WALK ? 1.7 : sv_rng_range(&rng, 30, 60);
    double cx = f->x0 + 0.5 * FOREST_SIDE_M, cy = f->y0 + 0.5 * FOREST_SIDE_M;
    double spread = sv_rng_range(&rng, -SV_PI / 3, SV_PI / 3);
    /* Roughly over the middle, so that forest fills the picture. */
    r.heading_rad = kind == FOREST_WALK ? sv_rng_range(&rng, 0, 2 * SV_PI) : atan2(cx - r.eye.x, cy - r.eye.y) + spread;
    r.pitch_rad = kind == FOREST_WALK ? sv_radians(3) : sv_radians(sv_rng_range(&rng, -18, -8));
    r.vfov_rad = sv_radians(60);
    r.projection = SV_PROJECTION_PERSPECTIVE;
    r.width = r.height = 512;
    r.format = SV_FORMAT_PNG;
    r.q = 85;
    r.layers = 1u << SV_LAYER_COLOR;
    r.sky = true;
    r.quality = SV_QUALITY_BALANCED;
    r.shadows = true;
    return r;
}

static void resolve(const struct forest *forest, const struct sv_view_request *request, struct sv_resolved_view *view)
{
    struct sv_error error = {0};
    if (sv_view_resolve(forest->scene, request, view, NULL, &error))
        die("resolve", &error);
}

static struct sv_timings timings;

double forest_stage_ms(enum sv_stage stage)
{
    return timings.ms[stage];
}

void forest_draw(const struct forest *forest, const struct sv_view_request *request, struct sv_picture *picture,
                 struct sv_draw_stats *stats, double *ms, double *cpu_ms)
{
    struct sv_error error = {0};
    struct sv_resolved_view view;
    double since = forest_now_ms(), cpu_since = clock_ms(CLOCK_PROCESS_CPUTIME_ID);
    resolve(forest, request, &view);
    for (int k = 0; k < SV_STAGE_COUNT; k++)
        timings.ms[k] = -1;
    if (sv_renderer_draw(forest->renderer, request, &view, picture, &timings, stats, &error))
        die("draw", &error);
    if (ms)
        *ms = forest_now_ms() - since;
    if (cpu_ms)
        *cpu_ms = clock_ms(CLOCK_PROCESS_CPUTIME_ID) - cpu_since;
}

uint32_t forest_refine(const struct forest *forest, const struct sv_view_request *request, int samples,
                       int scale, bool shadows_alone, double *cpu_ms)
{
    struct sv_error error = {0};
    struct sv_resolved_view view;
    struct sv_cells_refine_options options = {
        .samples = samples, .scale = scale, .shadows_alone = shadows_alone, .most = UINT32_MAX};
    struct sv_cells_refine_report report;
    double cpu_since = clock_ms(CLOCK_PROCESS_CPUTIME_ID);
    resolve(forest, request, &view);
    if (sv_renderer_refine_cells(forest->renderer, request, &view, &options, &report, &error))
        die("refine", &error);
    if (cpu_ms)
        *cpu_ms = clock_ms(CLOCK_PROCESS_CPUTIME_ID) - cpu_since;
    return report.refined;
}

/* What the truth depends on: not how we would have drawn the view. */
static uint64_t truth_key(const struct forest *forest, const struct sv_resolved_view *view)
{
    const struct sv_camera *c = &view->camera;
    const struct sv_vec3 vectors[] = {c->eye, c->right, c->up, c->forward};
    const double numbers[] = {c->vfov_rad, c->width, c->height, view->sun.azimuth_rad, view->sun.elevation_rad,
                              view->plan.shadows};
    uint64_t key = sv_hash_u64(SV_HASH_INIT, forest->scene->version);
    key = sv_hash_bytes(key, vectors, sizeof vectors);
    return sv_hash_bytes(key, numbers, sizeof numbers);
}

void forest_truth(const struct forest *forest, const struct sv_view_request *request, struct sv_image *color)
{
    forest_truth_of(forest, request, 64, color);
}

void forest_truth_of(const struct forest *forest, const struct sv_view_request *request, int samples,
                     struct sv_image *color)
{
    struct sv_error error = {0};
    char kind[16];
    snprintf(kind, sizeof kind, "truth%d", samples);
    struct sv_view_request r = *request;
    r.quality = SV_QUALITY_REFERENCE;
    r.trees = SV_TREES_AUTO;
    r.samples = samples;
    struct sv_resolved_view view;
    resolve(forest, &r, &view);
    uint64_t key = truth_key(forest, &view);
    void *data;
    size_t bytes, size = (size_t)r.width * (size_t)r.height * 4;
    if (sv_image_alloc(r.width, r.height, 4, SV_PIXEL_U8, color, &error))
        die("truth", &error);
    if (sv_store_get(forest->store, kind, key, &data, &bytes, &error) == SV_OK) {
        if (bytes == size) {
            memcpy(color->data, data, size);
            free(data);
            return;
        }
        free(data);
    }
    sv_image_free(color);
    struct sv_picture picture;
    forest_draw(forest, &r, &picture, NULL, NULL, NULL);
    *color = picture.layer[SV_LAYER_COLOR];
    sv_store_put(forest->store, kind, key, color->data, size, &error);
}

struct sv_compare_result forest_compare(const struct sv_image *picture, const struct sv_image *truth)
{
    struct sv_error error = {0};
    struct sv_compare_result result;
    if (sv_compare(picture, truth, &SV_COMPARE_OPTIONS_DEFAULT, &result, &error))
        die("compare", &error);
    return result;
}

void forest_save(const struct sv_image *image, const char *path)
{
    static const char *const names[] = {"R", "G", "B", "A"};
    struct sv_encode_layer layer = {image, names};
    struct sv_encode_options options = {.format = SV_FORMAT_PNG, .quality = 90};
    void *bytes;
    size_t size;
    struct sv_error error = {0};
    if (sv_image_encode(&layer, 1, &options, &bytes, &size, &error))
        die(path, &error);
    FILE *file = fopen(path, "wb");
    if (!file || fwrite(bytes, 1, size, file) != size || fclose(file)) {
        perror(path);
        exit(1);
    }
    free(bytes);
}
