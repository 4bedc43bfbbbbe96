/* draw.c - see draw.h: culls, chooses each tree's form, hands the lists to the forms. */
#include "core/tree/draw.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/scene/id.h"
#include "core/tree/draw_cloud.h"
#include "core/tree/draw_cull.h"
#include "core/tree/draw_mesh.h"
#include "core/tree/draw_mesh_upload.h"
#include "core/tree/draw_mixed.h"
#include "core/tree/ladder.h"
#include "core/tree/leaf_splat.h"
#include "core/tree/sprite.h"

/* From this share of the size where leaves begin on, trees fade: a share of the leaves is there, and the sprite of the
 * others (sprite.h), so that a crown covers in both what it does in either. */
static const double FADE_FROM = 0.8;

struct sv_tree_draw {
    const struct sv_forest *forest;
    struct sv_tree_draw_species *given;
    struct sv_cull_species *species;
    int species_count;
    struct sv_store *store;
    struct sv_mesh_draw *meshes;  /* made when first drawn */
    struct sv_cloud_draw *clouds; /* made when first drawn */
    struct sv_sprite_draw *sprites;
    struct sv_leaf_splat *leaves;
    struct sv_ladder *ladders;
    double *near_px; /* of each species, for the view at hand */
    struct sv_cull_list list;
    /* Of the list: what each form draws, nearest first, and by how much of it. */
    struct choice {
        struct sv_cull_entry *entries;
        float *weights;
        uint32_t count;
    } near, far;
    uint32_t room;
};

const char *sv_tree_form_name(enum sv_tree_form form)
{
    static const char *const names[] = {
#define X(name, text) [name] = text,
        SV_TREE_FORM_LIST(X)
#undef X
    };
    return (unsigned)form < SV_TREE_FORM_COUNT ? names[form] : "unknown form";
}

bool sv_tree_form_on_canvas(enum sv_tree_form form)
{
    return form == SV_TREE_FORM_AUTO || form == SV_TREE_FORM_COARSE || form == SV_TREE_FORM_LEAF;
}

static enum sv_status check_forest(const struct sv_tree_draw_species *species, int species_count,
                                   const struct sv_forest *forest, struct sv_error *error)
{
    for (uint32_t k = 0; k < forest->count; k++) {
        const struct sv_tree *tree = &forest->trees[k];
        if (tree->species >= species_count || species[tree->species].tree_count == 0)
            return sv_fail(error, SV_EINVAL, "forest",
                           "tree %u is of species %u, which is not among the %d to draw", tree->number,
                           tree->species, species_count);
    }
    return SV_OK;
}

static enum sv_status obtain_ladder(struct sv_tree_draw *draw, int k, struct sv_error *error)
{
    enum sv_status status = sv_leaf_splat_prepare(draw->leaves, k, error);
    return status ? status
                  : sv_ladder_obtain(draw->sprites, draw->leaves, k, &draw->given[k], draw->store,
                                     &draw->ladders[k], error);
}

static enum sv_status create_forms(struct sv_tree_draw *draw, struct sv_error *error)
{
    enum sv_status status =
        sv_sprite_draw_create(draw->given, draw->species_count, draw->store, &draw->sprites, error);
    if (!status)
        status = sv_leaf_splat_create(draw->given, draw->species_count, &draw->leaves, error);
    for (int k = 0; k < draw->species_count && !status; k++)
        if (draw->given[k].tree_count > 0)
            status = obtain_ladder(draw, k, error);
    return status;
}

enum sv_status sv_tree_draw_create(const struct sv_tree_draw_species *species, int species_count,
                                   const struct sv_forest *forest, struct sv_store *store,
                                   struct sv_tree_draw **out, struct sv_error *error)
{
    enum sv_status status = check_forest(species, species_count, forest, error);
    if (status)
        return status;
    struct sv_tree_draw *draw = calloc(1, sizeof *draw);
    if (draw) {
        draw->species = calloc((size_t)species_count + 1, sizeof *draw->species);
        draw->given = calloc((size_t)species_count + 1, sizeof *draw->given);
        draw->ladders = calloc((size_t)species_count + 1, sizeof *draw->ladders);
        draw->near_px = calloc((size_t)species_count + 1, sizeof *draw->near_px);
    }
    if (!draw || !draw->species || !draw->given || !draw->ladders || !draw->near_px) {
        sv_tree_draw_destroy(draw);
        return sv_fail(error, SV_ENOMEM, "species", "no memory to draw %d species", species_count);
    }
    sv_color_init();
    draw->forest = forest;
    draw->species_count = species_count;
    draw->store = store;
    for (int k = 0; k < species_count; k++) {
        draw->given[k] = species[k];
        if (species[k].tree_count > 0)
            draw->species[k] = (struct sv_cull_species){species[k].mesh->radius};
    }
    status = create_forms(draw, error);
    if (status) {
        sv_tree_draw_destroy(draw);
        return status;
    }
    *out = draw;
    return SV_OK;
}

/* Everything that `auto` needs of a species that has got its first tree. */
static enum sv_status add_species(struct sv_tree_draw *draw, int k, struct sv_error *error)
{
    draw->species[k] = (struct sv_cull_species){draw->given[k].mesh->radius};
    enum sv_status status = sv_sprite_draw_add(draw->sprites, k, &draw->given[k], draw->store, error);
    if (status)
        return status;
    sv_leaf_splat_add(draw->leaves, k, draw->given[k].mesh);
    return obtain_ladder(draw, k, error);
}

enum sv_status sv_tree_draw_change(struct sv_tree_draw *draw, const struct sv_tree_draw_species *species,
                                   struct sv_error *error)
{
    enum sv_status status = check_forest(species, draw->species_count, draw->forest, error);
    bool came = false;
    for (int k = 0; k < draw->species_count && !status; k++) {
        bool built = sv_sprite_draw_shade_species(draw->sprites, k).frames, needed = species[k].tree_count > 0;
        came = came || (needed && draw->given[k].tree_count == 0);
        draw->given[k] = species[k];
        if (needed && !built)
            status = add_species(draw, k, error);
    }
    if (came) { /* these know which species have trees */
        sv_mesh_draw_destroy(draw->meshes);
        sv_cloud_draw_destroy(draw->clouds);
        draw->meshes = NULL;
        draw->clouds = NULL;
    }
    return status;
}

void sv_tree_draw_destroy(struct sv_tree_draw *draw)
{
    if (!draw)
        return;
    sv_mesh_draw_destroy(draw->meshes);
    sv_cloud_draw_destroy(draw->clouds);
    sv_sprite_draw_destroy(draw->sprites);
    sv_leaf_splat_destroy(draw->leaves);
    sv_cull_list_finish(&draw->list);
    free(draw->near.entries);
    free(draw->near.weights);
    free(draw->far.entries);
    free(draw->far.weights);
    free(draw->species);
    free(draw->given);
    free(draw->ladders);
    free(draw->near_px);
    free(draw);
}

struct sv_shade_species sv_tree_draw_shade_species(const struct sv_tree_draw *draw, int species)
{
    return sv_sprite_draw_shade_species(draw->sprites, species);
}

enum sv_status sv_tree_draw_shade_create(const struct sv_tree_draw *draw, struct sv_tree_shade **shade,
                                         struct sv_error *error)
{
    struct sv_shade_species *species = calloc((size_t)draw->species_count + 1, sizeof *species);
    if (!species)
        return sv_fail(error, SV_ENOMEM, "species", "no memory to shade %d species", draw->species_count);
    for (int k = 0; k < draw->species_count; k++)
        species[k] = sv_sprite_draw_shade_species(draw->sprites, k);
    enum sv_status status = sv_tree_shade_create(species, draw->species_count, draw->forest, shade, error);
    free(species);
    return status;
}

static enum sv_status make_room(struct sv_tree_draw *draw, uint32_t count, struct sv_error *error)
{
    if (draw->room >= count)
        return SV_OK;
    struct choice *both[2] = {&draw->near, &draw->far};
    draw->room = 0;
    for (int k = 0; k < 2; k++) {
        free(both[k]->entries);
        free(both[k]->weights);
        both[k]->entries = malloc(count * sizeof *both[k]->entries);
        both[k]->weights = malloc(count * sizeof *both[k]->weights);
        if (!both[k]->entries || !both[k]->weights)
            return sv_fail(error, SV_ENOMEM, "forest", "no memory to choose the forms of %u trees", count);
    }
    draw->room = count;
    return SV_OK;
}

static void put(struct choice *choice, struct sv_cull_entry entry, double weight)
{
    if (!(weight > 0))
        return;
    choice->entries[choice->count] = entry;
    choice->weights[choice->count++] = (float)fmin(weight, 1);
}

/* Splits the list into leaf splats and sprites. */
static void choose(struct sv_tree_draw *draw, const struct sv_camera *camera,
                   const struct sv_tree_draw_options *options)
{
    draw->near.count = draw->far.count = 0;
    for (int k = 0; k < draw->species_count; k++)
        draw->near_px[k] = options->form == SV_TREE_FORM_AUTO
                               ? options->near_scale * sv_tree_draw_near_px(draw, k, options->error_px)
                           : options->form == SV_TREE_FORM_LEAF ? 0
                                                                : INFINITY;
    for (uint32_t k = 0; k < draw->list.count; k++) {
        struct sv_cull_entry entry = draw->list.entries[k];
        const struct sv_tree *tree = &draw->forest->trees[entry.tree];
        double near_px = draw->near_px[tree->species], from = FADE_FROM * near_px;
        double h = sv_cull_height_px(camera, tree), come = h >= near_px ? 1 : h > from ? (h - from) / (near_px - from) : 0;
        put(&draw->near, entry, come);
        put(&draw->far, entry, 1 - come);
    }
}

/* Entries first .. last - 1 of the far list. */
static enum sv_status draw_sprites(struct sv_tree_draw *draw, const struct sv_gl_frame *frame,
                                   const struct sv_canvas *canvas, uint32_t first, uint32_t last,
                                   struct sv_tree_lights lights, struct sv_error *error)
{
    struct sv_sprite_view view = {&frame->camera, &frame->light, frame->shift_x_px, frame->shift_y_px};
    struct sv_sprite_list list = {draw->far.entries + first, draw->far.weights + first, last - first, false};
    return list.count == 0 ? SV_OK
                           : sv_sprite_draw_trees(draw->sprites, &view, canvas, draw->forest->trees, &list, lights,
                                                  error);
}

/* Entries first .. last - 1 of the near list. */
static struct sv_leaf_splat_trees leaf_list(const struct sv_tree_draw *draw, const struct sv_tree_draw_options *options,
                                            uint32_t first, uint32_t last, struct sv_tree_lights lights)
{
    bool one = options->canvas->id || options->canvas->normal;
    return (struct sv_leaf_splat_trees){.trees = draw->forest->trees,
                                        .entries = draw->near.entries + first,
                                        .count = last - first,
                                        .weight = draw->near.weights + first,
                                        .samples = one ? 1 : options->leaf_samples,
                                        .lights = lights,
                                        .id_first = SV_ID_TREE_FIRST};
}

static enum sv_status draw_leaves(struct sv_tree_draw *draw, const struct sv_gl_frame *frame,
                                  const struct sv_tree_draw_options *options, uint32_t first, uint32_t last,
                                  struct sv_tree_lights lights, struct sv_error *error)
{
    struct sv_leaf_view view = {frame->camera, frame->light, frame->shift_x_px, frame->shift_y_px};
    struct sv_leaf_splat_trees list = leaf_list(draw, options, first, last, lights);
    return list.count == 0 ? SV_OK : sv_leaf_splat_draw(draw->leaves, &view, options->canvas, &list, NULL, error);
}

/* One form alone, or with planes of ids and normals, which leaves of one sample write as GL would and sprites read: runs
 * of either form, farthest first, for leaves are blended over what is behind them. A tree in both forms: the sprite first,
 * so that gaps between its leaves show it. */
static enum sv_status draw_by_distance(struct sv_tree_draw *draw, const struct sv_gl_frame *frame,
                                       const struct sv_tree_draw_options *options, struct sv_tree_lights lights,
                                       struct sv_error *error)
{
    const struct sv_cull_entry *near = draw->near.entries, *far = draw->far.entries;
    uint32_t i = draw->near.count, j = draw->far.count;
    enum sv_status status = SV_OK;
    while ((i > 0 || j > 0) && !status) {
        uint32_t last = j;
        while (j > 0 && (i == 0 || far[j - 1].key >= near[i - 1].key))
            j--;
        status = draw_sprites(draw, frame, options->canvas, j, last, lights, error);
        if (status)
            break;
        last = i;
        while (i > 0 && (j == 0 || near[i - 1].key > far[j - 1].key))
            i--;
        status = draw_leaves(draw, frame, options, i, last, lights, error);
    }
    return status;
}

/* Both forms, nearest first: what is hidden costs little. */
static enum sv_status draw_mixed(struct sv_tree_draw *draw, const struct sv_gl_frame *frame,
                                 const struct sv_tree_draw_options *options, struct sv_tree_lights lights,
                                 struct sv_error *error)
{
    struct sv_mixed_draw mixed = {
        .leaves = draw->leaves,
        .sprites = draw->sprites,
        .view = {frame->camera, frame->light, frame->shift_x_px, frame->shift_y_px},
        .canvas = options->canvas,
        .near = leaf_list(draw, options, 0, draw->near.count, lights),
        .far = {draw->far.entries, draw->far.weights, draw->far.count, false}};
    return sv_mixed_draw(&mixed, error);
}

static enum sv_status draw_canvas(struct sv_tree_draw *draw, const struct sv_gl_frame *frame,
                                  const struct sv_tree_draw_options *options, struct sv_tree_lights lights,
                                  struct sv_tree_draw_stats *stats, struct sv_error *error)
{
    if (!options->canvas)
        return sv_fail(error, SV_EINVAL, "canvas", "form %s is drawn into a canvas, and there is none",
                       sv_tree_form_name(options->form));
    enum sv_status status = make_room(draw, draw->list.count, error);
    if (status)
        return status;
    choose(draw, &frame->camera, options);
    bool mixed = draw->near.count > 0 && draw->far.count > 0 && !options->canvas->id && !options->canvas->normal;
    status = (mixed ? draw_mixed : draw_by_distance)(draw, frame, options, lights, error);
    stats->trees[SV_TREE_FORM_LEAF] = draw->near.count;
    stats->trees[SV_TREE_FORM_COARSE] = draw->far.count;
    return status;
}

static enum sv_status draw_polygons(struct sv_tree_draw *draw, const struct sv_gl_frame *frame,
                                    struct sv_tree_lights lights, struct sv_error *error)
{
    enum sv_status status = SV_OK;
    if (!draw->meshes)
        status = sv_mesh_draw_create(draw->given, draw->species_count, SV_ID_TREE_FIRST, &draw->meshes, error);
    return status ? status
                  : sv_mesh_draw_trees(draw->meshes, frame, draw->forest->trees, draw->list.entries,
                                       draw->list.count, lights, error);
}

static enum sv_cloud_form cloud_form(enum sv_tree_form form)
{
    static const enum sv_cloud_form forms[SV_TREE_FORM_COUNT] = {
        [SV_TREE_FORM_BILLBOARD] = SV_CLOUD_FORM_BILLBOARD,
        [SV_TREE_FORM_INDIRECT] = SV_CLOUD_FORM_INDIRECT,
        [SV_TREE_FORM_DENSITY] = SV_CLOUD_FORM_DENSITY,
        [SV_TREE_FORM_DENSITY_PAPER] = SV_CLOUD_FORM_DENSITY_PAPER,
    };
    return forms[form];
}

static enum sv_status draw_cloud(struct sv_tree_draw *draw, const struct sv_gl_frame *frame,
                                 const struct sv_tree_draw_options *options, struct sv_tree_lights lights,
                                 struct sv_error *error)
{
    enum sv_status status = SV_OK;
    if (!draw->clouds)
        status = sv_cloud_draw_create(draw->given, draw->species_count, draw->store, &SV_CLOUD_OPTIONS_DEFAULT,
                                      &draw->clouds, error);
    return status ? status
                  : sv_cloud_draw_trees(draw->clouds, cloud_form(options->form), frame, draw->forest->trees,
                                        draw->list.entries, draw->list.count, options->color_only, lights,
                                        error);
}

enum sv_status sv_tree_draw_count(struct sv_tree_draw *draw, const struct sv_camera *camera,
                                  const double planes[5][4], const struct sv_tree_shell *shell, uint32_t *count,
                                  struct sv_error *error)
{
    enum sv_status status =
        sv_cull_forest(draw->forest, draw->species, camera, planes, shell, &draw->list, error);
    if (!status)
        *count = draw->list.count;
    return status;
}

enum sv_status sv_tree_draw_forest(struct sv_tree_draw *draw, const struct sv_gl_frame *frame,
                                   const struct sv_tree_draw_options *options,
                                   struct sv_tree_draw_stats *stats, struct sv_error *error)
{
    if (!(options->error_px > 0))
        return sv_fail(error, SV_EINVAL, "error_px", "%g is not an error in px above 0", options->error_px);
    struct sv_tree_draw_stats own = {{0}, 0};
    struct sv_tree_lights lights = {NULL, NULL};
    if (options->shade)
        lights = sv_tree_shade_lights(options->shade);
    enum sv_status status = sv_cull_forest(draw->forest, draw->species, &frame->camera, frame->planes,
                                           options->shell, &draw->list, error);
    if (status)
        return status;
    own.culled_trees = draw->list.culled;
    if (sv_tree_form_on_canvas(options->form)) {
        status = draw_canvas(draw, frame, options, lights, &own, error);
    } else {
        own.trees[options->form] = draw->list.count;
        status = options->form == SV_TREE_FORM_POLYGON
                     ? draw_polygons(draw, frame, lights, error)
                     : draw_cloud(draw, frame, options, lights, error);
    }
    if (!status && stats)
        *stats = own;
    return status;
}

double sv_tree_draw_near_px(const struct sv_tree_draw *draw, int species, double error_px)
{
    if (species < 0 || species >= draw->species_count || draw->given[species].tree_count == 0)
        return INFINITY;
    return sv_ladder_near_px(&draw->ladders[species], error_px);
}

static bool is_cloud(enum sv_tree_form form)
{
    return form != SV_TREE_FORM_POLYGON && !sv_tree_form_on_canvas(form);
}

static bool grows(const struct sv_tree_draw *draw, int species)
{
    return species >= 0 && species < draw->species_count && draw->given[species].tree_count > 0;
}

static size_t cloud_bytes(const struct sv_tree_draw *draw, int species, enum sv_cloud_form form)
{
    size_t bytes = draw->clouds ? sv_cloud_draw_bytes(draw->clouds, species, form) : 0;
    return bytes > 0 ? bytes
                     : sv_cloud_form_bytes(draw->given[species].mesh, form, &SV_CLOUD_OPTIONS_DEFAULT);
}

size_t sv_tree_draw_bytes(const struct sv_tree_draw *draw, int species, enum sv_tree_form form)
{
    if (!grows(draw, species))
        return 0;
    switch (form) {
    case SV_TREE_FORM_POLYGON:
        return sv_mesh_upload_bytes(draw->given[species].mesh);
    case SV_TREE_FORM_BILLBOARD:
    case SV_TREE_FORM_INDIRECT:
    case SV_TREE_FORM_DENSITY:
    case SV_TREE_FORM_DENSITY_PAPER:
        return cloud_bytes(draw, species, cloud_form(form));
    case SV_TREE_FORM_COARSE:
        return sv_sprite_draw_bytes(draw->sprites, species);
    case SV_TREE_FORM_LEAF:
        return sv_leaf_splat_bytes(draw->leaves, species);
    case SV_TREE_FORM_AUTO:
    case SV_TREE_FORM_COUNT:
        break;
    }
    return 0;
}

bool sv_tree_draw_built(const struct sv_tree_draw *draw, int species, enum sv_tree_form form)
{
    if (!grows(draw, species) || !is_cloud(form))
        return true;
    if (draw->clouds && sv_cloud_draw_bytes(draw->clouds, species, cloud_form(form)) > 0)
        return true;
    return sv_cloud_form_kept(&draw->given[species], cloud_form(form), &SV_CLOUD_OPTIONS_DEFAULT,
                              draw->store);
}

enum sv_status sv_tree_draw_build(const struct sv_tree_draw *draw, enum sv_tree_form form,
                                  struct sv_error *error)
{
    enum sv_status status = SV_OK;
    for (int k = 0; draw->store && k < draw->species_count && !status; k++)
        if (!sv_tree_draw_built(draw, k, form))
            status = sv_cloud_form_prepare(&draw->given[k], cloud_form(form), &SV_CLOUD_OPTIONS_DEFAULT,
                                           draw->store, error);
    return status;
}

enum sv_status sv_tree_draw_prepare(const struct sv_tree_draw_species *species, struct sv_store *store,
                                    struct sv_error *error)
{
    struct sv_sprite_draw *sprites = NULL;
    struct sv_leaf_splat *leaves = NULL;
    struct sv_ladder ladder;
    sv_color_init();
    enum sv_status status = sv_sprite_draw_create(species, 1, store, &sprites, error);
    if (!status)
        status = sv_leaf_splat_create(species, 1, &leaves, error);
    if (!status)
        status = sv_ladder_obtain(sprites, leaves, 0, species, store, &ladder, error);
    sv_leaf_splat_destroy(leaves);
    sv_sprite_draw_destroy(sprites);
    return status;
}
