#include "core/tree/ladder.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/frames.h"
#include "core/scene/id.h"

enum { TRUTH_SAMPLES = 16, LARGE_SAMPLES = 8, FORM_SAMPLES = 4, MARGIN_PX = 4 };
static const float FIRST_SIZE_PX = 12;
/* From this size on most leaves are larger than a pixel: fewer samples tell as much. */
static const float LARGE_PX = 192;
/* Trees are measured from so many heights away: nearer, perspective would hide parallax errors behind size. */
static const double DISTANCE_HEIGHTS = 6, HEIGHT_M = 10;
/* Elevations and azimuths of the views: level, from over the crowns, from a hill; none on a frame of the sprites. */
static const double VIEWS_DEG[SV_LADDER_VIEWS][2] = {{2, 13}, {9, 131}, {22, 247}, {38, 300}};
static const double SUN_DEG[2] = {40, 100};
static const uint8_t BACKGROUND[4] = {120, 136, 120, 255};

float sv_ladder_size_px(int rung)
{
    return FIRST_SIZE_PX * (float)(1 << rung);
}

/* One tree, one view, pictures of one size. */
struct bench {
    struct sv_sprite_draw *sprites;
    struct sv_leaf_splat *leaves;
    struct sv_tree tree;
    struct sv_camera camera;
    struct sv_light light;
    int samples; /* of the truth */
    size_t pixels;
    float *depth;
    uint8_t *truth, *form;
};

static void bench_finish(struct bench *b)
{
    free(b->depth);
    free(b->truth);
    free(b->form);
}

static enum sv_status bench_init(struct bench *b, const struct sv_tree_mesh *mesh, int species, float size_px,
                                 const double view_deg[2], struct sv_error *error)
{
    double reach = fmax(1, 2.2 * (double)mesh->radius), side = ceil((double)size_px * reach) + 2 * MARGIN_PX;
    struct sv_camera *c = &b->camera;
    b->samples = size_px > LARGE_PX ? LARGE_SAMPLES : TRUTH_SAMPLES;
    b->tree = (struct sv_tree){.height_m = (float)HEIGHT_M, .species = (uint16_t)species};
    c->projection = SV_PROJECTION_PERSPECTIVE;
    c->width = c->height = (int)fmin(side, SV_VIEW_SIDE_MAX);
    c->near_m = 0.1;
    double focal_px = (double)size_px * DISTANCE_HEIGHTS, heading = sv_radians(view_deg[1]);
    c->vfov_rad = 2 * atan(0.5 * c->height / focal_px);
    struct sv_vec3 middle = sv_vec3(0, 0, 0.5 * HEIGHT_M), look = sv_direction(heading, -sv_radians(view_deg[0]));
    c->eye = sv_madd(middle, look, -DISTANCE_HEIGHTS * HEIGHT_M);
    sv_camera_aim(c, heading, -sv_radians(view_deg[0]), 0);
    sv_light_from_sun(&(struct sv_sun){sv_radians(SUN_DEG[1]), sv_radians(SUN_DEG[0])}, &b->light);
    b->pixels = (size_t)c->width * (size_t)c->height;
    b->depth = malloc(b->pixels * sizeof *b->depth);
    b->truth = malloc(b->pixels * 4);
    b->form = malloc(b->pixels * 4);
    if (b->depth && b->truth && b->form)
        return SV_OK;
    return sv_fail(error, SV_ENOMEM, "ladder", "no memory for pictures of %d px", c->width);
}

static struct sv_canvas clean_canvas(struct bench *b)
{
    memset(b->depth, 0, b->pixels * sizeof *b->depth);
    for (size_t k = 0; k < b->pixels; k++)
        memcpy(b->form + 4 * k, BACKGROUND, 4);
    return (struct sv_canvas){.width = b->camera.width,
                              .height = b->camera.height,
                              .row_count = b->camera.height,
                              .depth = b->depth,
                              .color = b->form};
}

static enum sv_status draw_leaves(struct bench *b, const float *fraction, int samples, struct sv_error *error)
{
    struct sv_canvas canvas = clean_canvas(b);
    struct sv_cull_entry entry = {0, 0};
    struct sv_leaf_view view = {b->camera, b->light, 0, 0};
    struct sv_leaf_splat_trees trees = {.trees = &b->tree,
                                        .entries = &entry,
                                        .count = 1,
                                        .fraction = fraction,
                                        .samples = samples,
                                        .level_0 = fraction != NULL,
                                        .lights = {NULL, NULL},
                                        .id_first = SV_ID_TREE_FIRST};
    return sv_leaf_splat_draw(b->leaves, &view, &canvas, &trees, NULL, error);
}

static enum sv_status draw_sprite(struct bench *b, struct sv_error *error)
{
    struct sv_canvas canvas = clean_canvas(b);
    struct sv_cull_entry entry = {0, 0};
    struct sv_sprite_view view = {&b->camera, &b->light, 0, 0};
    struct sv_sprite_list list = {&entry, NULL, 1, false};
    struct sv_tree_lights lights = {NULL, NULL};
    return sv_sprite_draw_trees(b->sprites, &view, &canvas, &b->tree, &list, lights, error);
}

static enum sv_status draw_truth(struct bench *b, struct sv_error *error)
{
    const float whole = 1;
    enum sv_status status = draw_leaves(b, &whole, b->samples, error);
    memcpy(b->truth, b->form, 4 * b->pixels);
    return status;
}

/* Sum of absolute differences between the form and the truth. */
static double difference(const struct bench *b)
{
    double sum = 0;
    for (size_t i = 0; i < b->pixels; i++)
        for (size_t c = 0; c < 3; c++)
            sum += abs(b->form[4 * i + c] - b->truth[4 * i + c]);
    return sum;
}

/* The same between the truth and itself one px to the right and one px lower, their mean: what stands near the
 * picture's edge is background. */
static double difference_shifted(const struct bench *b)
{
    size_t width = (size_t)b->camera.width, height = (size_t)b->camera.height;
    double sum = 0;
    for (size_t j = 0; j + 1 < height; j++)
        for (size_t i = 0; i + 1 < width; i++) {
            const uint8_t *p = b->truth + 4 * (j * width + i);
            for (size_t c = 0; c < 3; c++)
                sum += 0.5 * (abs(p[c] - p[4 + c]) + abs(p[c] - p[4 * width + c]));
        }
    return sum;
}

/* Adds one view's differences. */
static enum sv_status measure_view(struct bench *b, double form[SV_LADDER_FORMS], double *shifted,
                                   struct sv_error *error)
{
    enum sv_status status = draw_truth(b, error);
    if (!status)
        status = draw_sprite(b, error);
    form[SV_LADDER_SPRITE] += difference(b);
    if (!status)
        status = draw_leaves(b, NULL, FORM_SAMPLES, error);
    form[SV_LADDER_LEAF] += difference(b);
    *shifted += difference_shifted(b);
    return status;
}

enum sv_status sv_ladder_measure(struct sv_sprite_draw *sprites, struct sv_leaf_splat *leaves, int species,
                                 const struct sv_tree_mesh *mesh, struct sv_ladder *ladder, struct sv_error *error)
{
    struct sv_ladder made;
    for (int k = 0; k < SV_LADDER_SIZES; k++) {
        double form[SV_LADDER_FORMS] = {0}, shifted = 0;
        for (int v = 0; v < SV_LADDER_VIEWS; v++) {
            struct bench b = {.sprites = sprites, .leaves = leaves};
            enum sv_status status = bench_init(&b, mesh, species, sv_ladder_size_px(k), VIEWS_DEG[v], error);
            if (!status)
                status = measure_view(&b, form, &shifted, error);
            bench_finish(&b);
            if (status)
                return status;
        }
        for (int f = 0; f < SV_LADDER_FORMS; f++) /* an empty tree is drawn right by every form */
            made.error_px[k][f] = shifted > 0 ? (float)(form[f] / shifted) : 0;
    }
    *ladder = made;
    return SV_OK;
}

static bool is_ladder(const void *data, size_t bytes, struct sv_ladder *ladder)
{
    if (bytes != sizeof *ladder)
        return false;
    memcpy(ladder, data, sizeof *ladder);
    for (int k = 0; k < SV_LADDER_SIZES; k++)
        for (int f = 0; f < SV_LADDER_FORMS; f++)
            if (!(ladder->error_px[k][f] >= 0 && isfinite(ladder->error_px[k][f])))
                return false;
    return true;
}

enum sv_status sv_ladder_obtain(struct sv_sprite_draw *sprites, struct sv_leaf_splat *leaves, int species,
                                const struct sv_tree_draw_species *given, struct sv_store *store,
                                struct sv_ladder *ladder, struct sv_error *error)
{
    void *data;
    size_t bytes;
    struct sv_error ignored;
    if (store && sv_store_get(store, SV_LADDER_KIND, given->key, &data, &bytes, &ignored) == SV_OK) {
        struct sv_ladder kept;
        bool well = is_ladder(data, bytes, &kept);
        free(data);
        if (well) {
            *ladder = kept;
            return SV_OK;
        }
    }
    enum sv_status status = sv_ladder_measure(sprites, leaves, species, given->mesh, ladder, error);
    if (status == SV_OK && store)
        sv_store_put(store, SV_LADDER_KIND, given->key, ladder, sizeof *ladder, &ignored);
    return status;
}

double sv_ladder_error_px(const struct sv_ladder *ladder, enum sv_ladder_form form, double size_px)
{
    double rung = size_px > 0 ? log2(size_px / (double)FIRST_SIZE_PX) : 0;
    int last = SV_LADDER_SIZES - 1;
    if (!(rung > 0))
        return (double)ladder->error_px[0][form];
    if (rung >= last) {
        double grown = form == SV_LADDER_SPRITE ? sqrt(size_px / (double)sv_ladder_size_px(last)) : 1;
        return (double)ladder->error_px[last][form] * grown;
    }
    int k = (int)rung;
    double t = rung - k;
    return (1 - t) * (double)ladder->error_px[k][form] + t * (double)ladder->error_px[k + 1][form];
}

/* Sprites serve at this size. */
static bool is_far(const struct sv_ladder *ladder, double size_px, double error_px)
{
    double sprite = sv_ladder_error_px(ladder, SV_LADDER_SPRITE, size_px);
    return sprite <= error_px || sprite <= sv_ladder_error_px(ladder, SV_LADDER_LEAF, size_px);
}

double sv_ladder_near_px(const struct sv_ladder *ladder, double error_px)
{
    /* From above, so that what is nearer than a tree of leaves is one too. Steps of a 16th of a rung. */
    const double step = 1.0443, first = (double)FIRST_SIZE_PX; /* 2^(1/16) */
    double size = SV_LADDER_MAGNIFIED_PX;
    while (size > first && !is_far(ladder, size / step, error_px))
        size /= step;
    return size;
}
