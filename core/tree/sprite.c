/* sprite.c - see sprite.h: species, and the way of a picture. Trees are taken in batches, nearest first; of
 * each, what cannot show (its box lies in tiles that are closed, or behind all that is opaque there) is
 * dropped before it is set up; the rest is sorted into tiles, and each tile draws its own in order. Pictures
 * with many rows are drawn in slices of whole tiles, so that gathered light stays within SLICE_TILES tiles of
 * memory. */
#include "core/tree/sprite.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/base/simd.h"
#include "core/tree/sprite_private.h"

enum { BATCH = 1024, SLICE_TILES = 1024 };

struct species {
    struct sv_sprite_atlas *atlas; /* heap, owner's; NULL: not built */
    struct sv_impostor_frame *outline;
    uint8_t *coverage; /* heap, owner's: what shade.h is made from */
    const struct sv_tree_mesh *mesh;
    int owner;
};

struct sv_sprite_draw {
    int species_count;
    struct species *species;
    struct sv_sprite_species *known; /* a species each */
    const struct sv_sprite_steps *steps;
    /* Work space, kept from view to view. */
    struct sv_sprite_tree *trees;   /* BATCH */
    struct sv_sprite *sprites;      /* BATCH * FRAMES_MAX */
    struct sv_sprite_state *states; /* a tile of a slice each */
    struct sv_sprite_tile *tiles;
    struct sv_sprite_hard *hard; /* made when first asked for */
    bool *loaded;
    uint32_t *starts; /* a tile each, and one more */
    uint32_t *order;
    size_t tile_room, hard_room, order_room;
};

/* ---- species ---- */

static enum sv_status obtain(const struct sv_tree_draw_species *species, struct sv_store *store,
                             struct sv_sprite_atlas *atlas, struct sv_error *error)
{
    void *data;
    size_t bytes;
    struct sv_error ignored;
    if (store && sv_store_get(store, SV_SPRITE_KIND, species->key, &data, &bytes, &ignored) == SV_OK) {
        enum sv_status status = sv_sprite_atlas_load(data, bytes, atlas, &ignored);
        free(data);
        if (status == SV_OK || status == SV_ENOMEM)
            return status == SV_OK ? SV_OK : sv_fail(error, status, ignored.field, "%s", ignored.message);
    }
    enum sv_status status = sv_sprite_atlas_bake(species->mesh, atlas, error);
    if (status == SV_OK && store && sv_sprite_atlas_save(atlas, &data, &bytes, &ignored) == SV_OK) {
        sv_store_put(store, SV_SPRITE_KIND, species->key, data, bytes, &ignored);
        free(data);
    }
    return status;
}

enum sv_status sv_sprite_prepare(const struct sv_tree_draw_species *species, struct sv_store *store,
                                 struct sv_error *error)
{
    struct sv_sprite_atlas atlas = {.texels = NULL};
    enum sv_status status = obtain(species, store, &atlas, error);
    sv_sprite_atlas_finish(&atlas);
    return status;
}

static enum sv_status build_species(const struct sv_tree_draw_species *species, struct sv_store *store,
                                    struct species *s, struct sv_error *error)
{
    s->atlas = calloc(1, sizeof *s->atlas);
    s->outline = malloc(SV_IMPOSTOR_FRAMES * sizeof *s->outline);
    s->coverage = malloc((size_t)SV_IMPOSTOR_SIDE * SV_IMPOSTOR_SIDE);
    if (!s->atlas || !s->outline || !s->coverage)
        return sv_fail(error, SV_ENOMEM, "sprite", "no memory for an atlas");
    enum sv_status status = obtain(species, store, s->atlas, error);
    if (!status)
        sv_sprite_atlas_outline(s->atlas, s->outline, s->coverage);
    return status;
}

/* Radius of the ball about the tree's middle that holds its cylinder, and a little for what widen() adds. */
static float reach_of(const struct sv_tree_mesh *mesh)
{
    float r = 1.05f * mesh->radius;
    return 1.05f * sqrtf(r * r + 0.3f);
}

enum sv_status sv_sprite_draw_add(struct sv_sprite_draw *draw, int k, const struct sv_tree_draw_species *species,
                                  struct sv_store *store, struct sv_error *error)
{
    struct species *s = &draw->species[k];
    enum sv_status status = SV_OK;
    if (draw->known[k].atlas)
        return SV_OK;
    s->mesh = species->mesh;
    s->owner = k;
    for (int i = draw->species_count - 1; i >= 0; i--)
        if (i != k && draw->species[i].mesh == s->mesh)
            s->owner = draw->species[i].owner;
    if (s->owner == k)
        status = build_species(species, store, s, error);
    draw->known[k] = (struct sv_sprite_species){draw->species[s->owner].atlas, reach_of(s->mesh)};
    return status;
}

enum sv_status sv_sprite_draw_create(const struct sv_tree_draw_species *species, int species_count,
                                     struct sv_store *store, struct sv_sprite_draw **out,
                                     struct sv_error *error)
{
    struct sv_sprite_draw *draw = calloc(1, sizeof *draw);
    size_t count = (size_t)species_count + 1;
    if (draw) {
        draw->species = calloc(count, sizeof *draw->species);
        draw->known = calloc(count, sizeof *draw->known);
        draw->trees = malloc(BATCH * sizeof *draw->trees);
        draw->sprites = malloc((size_t)BATCH * SV_SPRITE_FRAMES_MAX * sizeof *draw->sprites);
    }
    if (!draw || !draw->species || !draw->known || !draw->trees || !draw->sprites) {
        sv_sprite_draw_destroy(draw);
        return sv_fail(error, SV_ENOMEM, "species", "no memory to draw %d species", species_count);
    }
    sv_color_init();
    draw->species_count = species_count;
    draw->steps = sv_simd_level() >= SV_SIMD_AVX2 ? &sv_sprite_avx2 : &sv_sprite_scalar;
    enum sv_status status = SV_OK;
    for (int k = 0; !status && k < species_count; k++)
        if (species[k].tree_count > 0)
            status = sv_sprite_draw_add(draw, k, &species[k], store, error);
    if (status) {
        sv_sprite_draw_destroy(draw);
        return status;
    }
    *out = draw;
    return SV_OK;
}

static void free_tiles(struct sv_sprite_draw *draw)
{
    free(draw->states);
    free(draw->tiles);
    free(draw->loaded);
    free(draw->starts);
    draw->states = NULL;
    draw->tiles = NULL;
    draw->loaded = NULL;
    draw->starts = NULL;
    draw->tile_room = 0;
}

void sv_sprite_draw_use(struct sv_sprite_draw *draw, const struct sv_sprite_steps *steps)
{
    draw->steps = steps;
}

void sv_sprite_draw_destroy(struct sv_sprite_draw *draw)
{
    if (!draw)
        return;
    for (int k = 0; k < draw->species_count; k++) {
        if (draw->species[k].atlas)
            sv_sprite_atlas_finish(draw->species[k].atlas);
        free(draw->species[k].atlas);
        free(draw->species[k].outline);
        free(draw->species[k].coverage);
    }
    free_tiles(draw);
    free(draw->hard);
    free(draw->order);
    free(draw->species);
    free(draw->known);
    free(draw->trees);
    free(draw->sprites);
    free(draw);
}

struct sv_shade_species sv_sprite_draw_shade_species(const struct sv_sprite_draw *draw, int species)
{
    const struct species *s = &draw->species[species];
    if (!s->mesh)
        return (struct sv_shade_species){NULL, NULL, 0};
    const struct species *owner = &draw->species[s->owner];
    return (struct sv_shade_species){owner->outline, owner->coverage, s->mesh->radius};
}

size_t sv_sprite_draw_bytes(const struct sv_sprite_draw *draw, int species)
{
    const struct species *s = &draw->species[species];
    return s->mesh ? sv_sprite_atlas_bytes(draw->species[s->owner].atlas) : 0;
}

/* ---- a view ---- */

/* A slice of the picture while it is drawn: columns x rows tiles, the first at picture row row_first. */
struct slice {
    struct sv_sprite_draw *draw;
    const struct sv_sprite_view *view;
    const struct sv_canvas *canvas;
    struct sv_sprite_frame_view seen;
    struct sv_sprite_light light;
    bool hard;
    int columns, rows, row_first, row_end;
    int open_tiles; /* that are not loaded, or let light through */
};

static struct sv_sprite_frame_view view_of(const struct sv_sprite_view *view)
{
    const struct sv_camera *c = view->camera;
    const struct sv_vec3 sun = view->light->to_sun;
    return (struct sv_sprite_frame_view){
        .eye = c->eye,
        .right = {(float)c->right.x, (float)c->right.y, (float)c->right.z},
        .up = {(float)c->up.x, (float)c->up.y, (float)c->up.z},
        .forward = {(float)c->forward.x, (float)c->forward.y, (float)c->forward.z},
        .to_sun = {(float)sun.x, (float)sun.y, (float)sun.z},
        .focal_px = (float)sv_camera_focal_px(c),
        .near_m = c->projection == SV_PROJECTION_ORTHOGRAPHIC ? 0 : (float)c->near_m,
        .center_x = (float)(0.5 * c->width - 0.5 - view->shift_x_px),
        .center_y = (float)(0.5 * c->height - 0.5 - view->shift_y_px),
        .orthographic = c->projection == SV_PROJECTION_ORTHOGRAPHIC,
        .width = c->width,
        .height = c->height,
        .air_length_m = view->light->air ? view->light->air_length_m : 0};
}

static struct sv_sprite_light light_of(const struct sv_sprite_view *view)
{
    const struct sv_light *light = view->light;
    bool orthographic = view->camera->projection == SV_PROJECTION_ORTHOGRAPHIC;
    struct sv_sprite_light out = {.near_z = orthographic ? FLT_MIN : (float)view->camera->near_m};
    for (int c = 0; c < 3; c++) {
        out.sun_rgb[c] = light->sun_rgb[c] * SV_LIGHT_EXPOSURE;
        out.sky_rgb[c] = light->sky_rgb[c] * SV_LIGHT_EXPOSURE;
        out.ground_rgb[c] = light->ground_rgb[c] * SV_LIGHT_EXPOSURE;
        out.air_rgb[c] = light->air_rgb[c];
    }
    return out;
}

static int smaller(int a, int b)
{
    return a < b ? a : b;
}

static void load_tile(struct slice *s, int t)
{
    struct sv_sprite_draw *draw = s->draw;
    struct sv_sprite_state *state = &draw->states[t];
    state->x0 = t % s->columns * SV_SPRITE_TILE;
    state->y0 = s->row_first + t / s->columns * SV_SPRITE_TILE;
    draw->steps->load(s->canvas, s->view->camera, smaller(SV_SPRITE_TILE, s->canvas->width - state->x0),
                      smaller(SV_SPRITE_TILE, s->row_end - state->y0), state, &draw->tiles[t]);
    if (s->hard) {
        memset(draw->hard[t].z, 0, sizeof draw->hard[t].z);
        draw->hard[t].surface = s->canvas->surface;
    }
    draw->loaded[t] = true;
}

static void tile_range(const struct slice *s, const struct sv_sprite_tree *tree, int range[4])
{
    range[0] = tree->x0 / SV_SPRITE_TILE;
    range[1] = (tree->x1 - 1) / SV_SPRITE_TILE;
    range[2] = tree->y0 > s->row_first ? (tree->y0 - s->row_first) / SV_SPRITE_TILE : 0;
    range[3] = (smaller(tree->y1, s->row_end) - 1 - s->row_first) / SV_SPRITE_TILE;
}

/* True when the tile may still show something at that depth; loads it. */
static bool can_show(struct slice *s, int t, float near_z)
{
    if (!s->draw->loaded[t])
        load_tile(s, t);
    const struct sv_sprite_state *state = &s->draw->states[t];
    return state->open_groups > 0 && near_z <= state->far_z;
}

static bool box_can_show(struct slice *s, const struct sv_sprite_tree *tree)
{
    int range[4];
    tile_range(s, tree, range);
    for (int j = range[2]; j <= range[3]; j++)
        for (int i = range[0]; i <= range[1]; i++)
            if (can_show(s, j * s->columns + i, tree->near_z))
                return true;
    return false;
}

/* What of a batch can show, ready to draw. */
static uint32_t set_up_batch(struct slice *s, const struct sv_tree *trees, const struct sv_sprite_list *list,
                             uint32_t first, uint32_t count, struct sv_tree_lights lights)
{
    struct sv_sprite_draw *draw = s->draw;
    uint32_t made = 0, pictures = 0;
    for (uint32_t k = first; k < first + count; k++) {
        uint32_t at = list->farthest_first ? list->count - 1 - k : k, index = list->entries[at].tree;
        const struct sv_tree *tree = &trees[index];
        float share = list->shares ? list->shares[at] : 1;
        if (tree->species >= draw->species_count || !draw->known[tree->species].atlas ||
            !(share >= 0.5f / SV_SPRITE_SHARE))
            continue;
        const struct sv_sprite_species *species = &draw->known[tree->species];
        struct sv_sprite_tree *out = &draw->trees[made];
        if (!sv_sprite_bound(&s->seen, species, tree, out) || !box_can_show(s, out))
            continue;
        out->first = pictures;
        out->share = (uint32_t)(fminf(share, 1) * SV_SPRITE_SHARE + 0.5f);
        int n = sv_sprite_set_up(
            &s->seen, species, tree, lights.of_tree ? &lights.of_tree[index] : NULL,
            lights.of_tree ? &lights.of_species[tree->species] : NULL, out, draw->sprites + pictures);
        pictures += (uint32_t)n;
        made += n > 0;
    }
    return made;
}

/* starts[t] .. starts[t + 1]: the tile's part of order. */
static enum sv_status sort_into_tiles(struct slice *s, uint32_t count, struct sv_error *error)
{
    struct sv_sprite_draw *draw = s->draw;
    size_t tiles = (size_t)s->columns * (size_t)s->rows, total = 0;
    memset(draw->starts, 0, (tiles + 1) * sizeof *draw->starts);
    for (uint32_t pass = 0; pass < 2; pass++) {
        for (uint32_t k = 0; k < count; k++) {
            const struct sv_sprite_tree *tree = &draw->trees[k];
            int range[4];
            tile_range(s, tree, range);
            for (int j = range[2]; j <= range[3]; j++)
                for (int i = range[0]; i <= range[1]; i++) {
                    int t = j * s->columns + i;
                    if (!can_show(s, t, tree->near_z))
                        continue;
                    if (pass)
                        draw->order[draw->starts[t]++] = k;
                    else
                        draw->starts[t + 1]++;
                }
        }
        if (pass)
            break;
        for (size_t t = 0; t < tiles; t++)
            draw->starts[t + 1] += draw->starts[t];
        total = draw->starts[tiles];
        if (total > draw->order_room) {
            uint32_t *order = realloc(draw->order, 2 * total * sizeof *order);
            if (!order)
                return sv_fail(error, SV_ENOMEM, "trees", "no memory to sort %zu trees into tiles", total);
            draw->order = order;
            draw->order_room = 2 * total;
        }
    }
    /* Filling moved each start to its tile's end. */
    memmove(draw->starts + 1, draw->starts, tiles * sizeof *draw->starts);
    draw->starts[0] = 0;
    return SV_OK;
}

static void draw_tiles(struct slice *s)
{
    struct sv_sprite_draw *draw = s->draw;
    for (int t = 0; t < s->columns * s->rows; t++) {
        uint32_t first = draw->starts[t], end = draw->starts[t + 1];
        if (first == end)
            continue;
        draw->steps->draw(&s->light, draw->trees, draw->sprites, draw->order + first, end - first,
                          &draw->states[t], &draw->tiles[t], s->hard ? &draw->hard[t] : NULL);
        s->open_tiles -= draw->states[t].open_groups == 0;
    }
}

static void store_tiles(struct slice *s)
{
    struct sv_sprite_draw *draw = s->draw;
    for (int t = 0; t < s->columns * s->rows; t++) {
        const struct sv_sprite_state *state = &draw->states[t];
        if (!draw->loaded[t])
            continue;
        int columns = smaller(SV_SPRITE_TILE, s->canvas->width - state->x0);
        int rows = smaller(SV_SPRITE_TILE, s->row_end - state->y0);
        if (s->hard) /* before the colour: it asks for what was there */
            sv_sprite_hard_store(s->canvas, s->view->camera, columns, rows, state, &draw->tiles[t],
                                 &draw->hard[t]);
        draw->steps->store(s->canvas, columns, rows, state, &draw->tiles[t]);
    }
}

static enum sv_status want_tiles(struct sv_sprite_draw *draw, size_t count, bool hard, struct sv_error *error)
{
    if (draw->tile_room < count) {
        free_tiles(draw);
        draw->states = malloc(count * sizeof *draw->states);
        draw->tiles = malloc(count * sizeof *draw->tiles);
        draw->loaded = malloc(count * sizeof *draw->loaded);
        draw->starts = malloc((count + 1) * sizeof *draw->starts);
        if (!draw->states || !draw->tiles || !draw->loaded || !draw->starts) {
            free_tiles(draw);
            return sv_fail(error, SV_ENOMEM, "trees", "no memory for %zu tiles", count);
        }
        draw->tile_room = count;
    }
    if (hard && draw->hard_room < count) {
        free(draw->hard);
        draw->hard_room = 0;
        draw->hard = malloc(count * sizeof *draw->hard);
        if (!draw->hard)
            return sv_fail(error, SV_ENOMEM, "trees", "no memory for %zu tiles", count);
        draw->hard_room = count;
    }
    return SV_OK;
}

static enum sv_status draw_slice(struct slice *s, const struct sv_tree *trees,
                                 const struct sv_sprite_list *list, struct sv_tree_lights lights,
                                 struct sv_error *error)
{
    struct sv_sprite_draw *draw = s->draw;
    enum sv_status status = SV_OK;
    s->rows = (s->row_end - s->row_first + SV_SPRITE_TILE - 1) / SV_SPRITE_TILE;
    s->open_tiles = s->columns * s->rows;
    s->seen.row_first = s->row_first;
    s->seen.row_last = s->row_end;
    memset(draw->loaded, 0, (size_t)s->open_tiles * sizeof *draw->loaded);
    for (uint32_t k = 0; !status && k < list->count && s->open_tiles > 0; k += BATCH) {
        uint32_t count = list->count - k < BATCH ? list->count - k : BATCH;
        uint32_t made = set_up_batch(s, trees, list, k, count, lights);
        if (made == 0)
            continue;
        status = sort_into_tiles(s, made, error);
        if (!status)
            draw_tiles(s);
    }
    if (!status)
        store_tiles(s);
    return status;
}

static bool fits(const struct sv_canvas *canvas, const struct sv_camera *camera)
{
    return canvas->width == camera->width && canvas->height == camera->height && canvas->width > 0 &&
           canvas->row_first >= 0 && canvas->row_count >= 0 && canvas->color && canvas->depth &&
           canvas->row_first <= canvas->height - canvas->row_count;
}

enum sv_status sv_sprite_draw_trees(struct sv_sprite_draw *draw, const struct sv_sprite_view *view,
                                    const struct sv_canvas *canvas, const struct sv_tree *trees,
                                    const struct sv_sprite_list *list, struct sv_tree_lights lights,
                                    struct sv_error *error)
{
    if (!fits(canvas, view->camera))
        return sv_fail(error, SV_EINVAL, "canvas", "%d x %d, rows %d + %d, is not the camera's %d x %d",
                       canvas->width, canvas->height, canvas->row_first, canvas->row_count,
                       view->camera->width, view->camera->height);
    if (list->count == 0 || canvas->row_count == 0)
        return SV_OK;
    if (!lights.of_tree || !lights.of_species)
        lights = (struct sv_tree_lights){NULL, NULL};
    struct slice s = {.draw = draw,
                      .view = view,
                      .canvas = canvas,
                      .seen = view_of(view),
                      .light = light_of(view),
                      .hard = canvas->id || canvas->normal || canvas->surface,
                      .columns = (canvas->width + SV_SPRITE_TILE - 1) / SV_SPRITE_TILE};
    int end = canvas->row_first + canvas->row_count;
    int rows = SLICE_TILES / s.columns > 1 ? SLICE_TILES / s.columns : 1; /* of tiles */
    rows = smaller(rows, (canvas->row_count + SV_SPRITE_TILE - 1) / SV_SPRITE_TILE);
    enum sv_status status = want_tiles(draw, (size_t)s.columns * (size_t)rows, s.hard, error);
    for (int row = canvas->row_first; !status && row < end; row += rows * SV_SPRITE_TILE) {
        s.row_first = row;
        s.row_end = smaller(end, row + rows * SV_SPRITE_TILE);
        status = draw_slice(&s, trees, list, lights, error);
    }
    return status;
}
