/* sprite_band.c - see sprite_band.h. Trees are taken in batches, nearest first; of each, what cannot show
 * (its box lies in tiles that are closed, or behind all that is opaque there) is dropped before it is set up;
 * the rest is sorted into tiles, and each tile draws its own in order. */
#include "core/tree/sprite_band.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/simd.h"

enum { BATCH = 1024, TILES = 1024 };

struct sv_sprite_band {
    const struct sv_sprite_species *known; /* a species each */
    int species_count;
    const struct sv_sprite_steps *steps;
    /* The band at hand: columns x rows tiles, the first at picture row row_first. */
    const struct sv_sprite_between *between; /* NULL: nothing */
    struct sv_camera camera;
    struct sv_canvas canvas;
    struct sv_sprite_frame_view seen;
    struct sv_sprite_light light;
    bool hard_wanted;
    int columns, rows, row_first, row_end;
    int open_tiles; /* that are not loaded, or let light through */
    /* Work space, kept from band to band. */
    struct sv_sprite_tree *trees;   /* BATCH */
    struct sv_sprite *sprites;      /* BATCH * FRAMES_MAX */
    struct sv_sprite_state *states; /* a tile each */
    struct sv_sprite_tile *tiles;
    struct sv_sprite_hard *hard; /* made when first asked for */
    bool *loaded;
    uint32_t *starts; /* a tile each, and one more */
    uint32_t *order;
    size_t tile_room, hard_room, order_room;
};

static void free_tiles(struct sv_sprite_band *band)
{
    free(band->states);
    free(band->tiles);
    free(band->loaded);
    free(band->starts);
    band->states = NULL;
    band->tiles = NULL;
    band->loaded = NULL;
    band->starts = NULL;
    band->tile_room = 0;
}

struct sv_sprite_band *sv_sprite_band_create(const struct sv_sprite_species *known, int species_count)
{
    struct sv_sprite_band *band = calloc(1, sizeof *band);
    if (!band)
        return NULL;
    band->known = known;
    band->species_count = species_count;
    band->steps = sv_simd_level() >= SV_SIMD_AVX2 ? &sv_sprite_avx2 : &sv_sprite_scalar;
    band->trees = malloc(BATCH * sizeof *band->trees);
    band->sprites = malloc((size_t)BATCH * SV_SPRITE_FRAMES_MAX * sizeof *band->sprites);
    if (band->trees && band->sprites)
        return band;
    sv_sprite_band_destroy(band);
    return NULL;
}

void sv_sprite_band_destroy(struct sv_sprite_band *band)
{
    if (!band)
        return;
    free_tiles(band);
    free(band->hard);
    free(band->order);
    free(band->trees);
    free(band->sprites);
    free(band);
}

void sv_sprite_band_use(struct sv_sprite_band *band, const struct sv_sprite_steps *steps)
{
    band->steps = steps;
}

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

static void load_tile(struct sv_sprite_band *s, int t)
{
    struct sv_sprite_state *state = &s->states[t];
    state->x0 = t % s->columns * SV_SPRITE_TILE;
    state->y0 = s->row_first + t / s->columns * SV_SPRITE_TILE;
    s->steps->load(&s->canvas, &s->camera, smaller(SV_SPRITE_TILE, s->canvas.width - state->x0),
                   smaller(SV_SPRITE_TILE, s->row_end - state->y0), state, &s->tiles[t]);
    if (s->hard_wanted) {
        memset(s->hard[t].z, 0, sizeof s->hard[t].z);
        s->hard[t].surface = s->canvas.surface;
        s->hard[t].depth_only = !s->canvas.id && !s->canvas.normal;
    }
    s->loaded[t] = true;
}

static void tile_range(const struct sv_sprite_band *s, const struct sv_sprite_tree *tree, int range[4])
{
    range[0] = tree->x0 / SV_SPRITE_TILE;
    range[1] = (tree->x1 - 1) / SV_SPRITE_TILE;
    range[2] = tree->y0 > s->row_first ? (tree->y0 - s->row_first) / SV_SPRITE_TILE : 0;
    range[3] = (smaller(tree->y1, s->row_end) - 1 - s->row_first) / SV_SPRITE_TILE;
}

/* Which groups of a loaded tile still let light through, after others drew into it. */
static void look_again(struct sv_sprite_state *state, const struct sv_sprite_tile *tile)
{
    for (int row = 0; row < SV_SPRITE_TILE; row++)
        for (unsigned open = state->open[row]; open; open &= open - 1) {
            int g = __builtin_ctz(open), k = row * SV_SPRITE_TILE + g * SV_SPRITE_LANES;
            bool any = false;
            for (int lane = 0; lane < SV_SPRITE_LANES; lane++)
                any |= tile->pass[k + lane] >= SV_SPRITE_PASS_MIN;
            state->open[row] = (uint8_t)(state->open[row] & ~((unsigned)!any << g));
            state->open_groups -= !any;
        }
}

/* The tile was `before`: others are told what has closed. */
static void tell_closed(struct sv_sprite_band *s, int t, const struct sv_sprite_state *before)
{
    const struct sv_sprite_state *state = &s->states[t];
    if (state->open_groups == before->open_groups)
        return;
    s->open_tiles -= state->open_groups == 0;
    if (s->between)
        s->between->closed(s->between->context, t, before, state);
}

/* What others drew goes into the tile. */
static void take(struct sv_sprite_band *s, int t)
{
    struct sv_sprite_state before = s->states[t];
    s->between->fresh[t] = 0;
    s->between->take(s->between->context, t, &before, &s->tiles[t], s->hard_wanted ? &s->hard[t] : NULL);
    look_again(&s->states[t], &s->tiles[t]);
    tell_closed(s, t, &before);
}

/* True when the tile may still show something at that depth; loads it, and has it take what is in front. */
static bool can_show(struct sv_sprite_band *s, int t, float near_z)
{
    if (!s->loaded[t])
        load_tile(s, t);
    const struct sv_sprite_state *state = &s->states[t];
    if (!(near_z <= state->far_z))
        return false;
    if (s->between && s->between->fresh[t])
        take(s, t);
    return state->open_groups > 0;
}

static bool box_can_show(struct sv_sprite_band *s, const struct sv_sprite_tree *tree)
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
static uint32_t set_up_batch(struct sv_sprite_band *s, const struct sv_tree *trees,
                             const struct sv_sprite_list *list, uint32_t first, uint32_t count,
                             struct sv_tree_lights lights)
{
    uint32_t made = 0, pictures = 0;
    for (uint32_t k = first; k < first + count; k++) {
        uint32_t at = list->farthest_first ? list->count - 1 - k : k, index = list->entries[at].tree;
        const struct sv_tree *tree = &trees[index];
        float share = list->shares ? list->shares[at] : 1;
        if (tree->species >= s->species_count || !s->known[tree->species].atlas ||
            !(share >= 0.5f / SV_SPRITE_SHARE))
            continue;
        const struct sv_sprite_species *species = &s->known[tree->species];
        struct sv_sprite_tree *out = &s->trees[made];
        if (!sv_sprite_bound(&s->seen, species, tree, out) || !box_can_show(s, out))
            continue;
        out->first = pictures;
        out->share = (uint32_t)(fminf(share, 1) * SV_SPRITE_SHARE + 0.5f);
        int n = sv_sprite_set_up(&s->seen, species, tree, lights.of_tree ? &lights.of_tree[index] : NULL,
                                 lights.of_tree ? &lights.of_species[tree->species] : NULL, out,
                                 s->sprites + pictures);
        pictures += (uint32_t)n;
        made += n > 0;
    }
    return made;
}

/* starts[t] .. starts[t + 1]: the tile's part of order. */
static enum sv_status sort_into_tiles(struct sv_sprite_band *s, uint32_t count, struct sv_error *error)
{
    size_t tiles = (size_t)s->columns * (size_t)s->rows, total = 0;
    memset(s->starts, 0, (tiles + 1) * sizeof *s->starts);
    for (uint32_t pass = 0; pass < 2; pass++) {
        for (uint32_t k = 0; k < count; k++) {
            const struct sv_sprite_tree *tree = &s->trees[k];
            int range[4];
            tile_range(s, tree, range);
            for (int j = range[2]; j <= range[3]; j++)
                for (int i = range[0]; i <= range[1]; i++) {
                    int t = j * s->columns + i;
                    if (!can_show(s, t, tree->near_z))
                        continue;
                    if (pass)
                        s->order[s->starts[t]++] = k;
                    else
                        s->starts[t + 1]++;
                }
        }
        if (pass)
            break;
        for (size_t t = 0; t < tiles; t++)
            s->starts[t + 1] += s->starts[t];
        total = s->starts[tiles];
        if (total > s->order_room) {
            uint32_t *order = realloc(s->order, 2 * total * sizeof *order);
            if (!order)
                return sv_fail(error, SV_ENOMEM, "trees", "no memory to sort %zu trees into tiles", total);
            s->order = order;
            s->order_room = 2 * total;
        }
    }
    /* Filling moved each start to its tile's end. */
    memmove(s->starts + 1, s->starts, tiles * sizeof *s->starts);
    s->starts[0] = 0;
    return SV_OK;
}

static void draw_tiles(struct sv_sprite_band *s)
{
    for (int t = 0; t < s->columns * s->rows; t++) {
        uint32_t first = s->starts[t], end = s->starts[t + 1];
        if (first == end)
            continue;
        struct sv_sprite_state before = s->states[t];
        s->steps->draw(&s->light, s->trees, s->sprites, s->order + first, end - first, &s->states[t],
                       &s->tiles[t], s->hard_wanted ? &s->hard[t] : NULL);
        tell_closed(s, t, &before);
    }
}

static void store_tiles(struct sv_sprite_band *s)
{
    for (int t = 0; t < s->columns * s->rows; t++) {
        const struct sv_sprite_state *state = &s->states[t];
        if (s->between && s->between->fresh[t])
            (void)can_show(s, t, 0);
        if (!s->loaded[t])
            continue;
        int columns = smaller(SV_SPRITE_TILE, s->canvas.width - state->x0);
        int rows = smaller(SV_SPRITE_TILE, s->row_end - state->y0);
        if (s->hard_wanted) /* before the colour: it asks for what was there */
            sv_sprite_hard_store(&s->canvas, &s->camera, columns, rows, state, &s->tiles[t], &s->hard[t]);
        s->steps->store(&s->canvas, columns, rows, state, &s->tiles[t]);
    }
}

static enum sv_status want_tiles(struct sv_sprite_band *s, size_t count, bool hard, struct sv_error *error)
{
    if (s->tile_room < count) {
        free_tiles(s);
        s->states = malloc(count * sizeof *s->states);
        s->tiles = malloc(count * sizeof *s->tiles);
        s->loaded = malloc(count * sizeof *s->loaded);
        s->starts = malloc((count + 1) * sizeof *s->starts);
        if (!s->states || !s->tiles || !s->loaded || !s->starts) {
            free_tiles(s);
            return sv_fail(error, SV_ENOMEM, "trees", "no memory for %zu tiles", count);
        }
        s->tile_room = count;
    }
    if (hard && s->hard_room < count) {
        free(s->hard);
        s->hard_room = 0;
        s->hard = malloc(count * sizeof *s->hard);
        if (!s->hard)
            return sv_fail(error, SV_ENOMEM, "trees", "no memory for %zu tiles", count);
        s->hard_room = count;
    }
    return SV_OK;
}

int sv_sprite_band_rows(int width)
{
    int columns = (width + SV_SPRITE_TILE - 1) / SV_SPRITE_TILE;
    return (TILES / columns > 1 ? TILES / columns : 1) * SV_SPRITE_TILE;
}

enum sv_status sv_sprite_band_begin(struct sv_sprite_band *band, const struct sv_sprite_view *view,
                                    const struct sv_canvas *canvas, const struct sv_sprite_between *between,
                                    struct sv_error *error)
{
    band->between = between;
    band->camera = *view->camera;
    band->canvas = *canvas;
    band->seen = view_of(view);
    band->light = light_of(view);
    band->hard_wanted = canvas->id || canvas->normal || canvas->surface;
    band->columns = (canvas->width + SV_SPRITE_TILE - 1) / SV_SPRITE_TILE;
    band->rows = (canvas->row_count + SV_SPRITE_TILE - 1) / SV_SPRITE_TILE;
    band->row_first = canvas->row_first;
    band->row_end = canvas->row_first + canvas->row_count;
    band->seen.row_first = band->row_first;
    band->seen.row_last = band->row_end;
    band->open_tiles = band->columns * band->rows;
    enum sv_status status = want_tiles(band, (size_t)band->open_tiles, band->hard_wanted, error);
    if (!status)
        memset(band->loaded, 0, (size_t)band->open_tiles * sizeof *band->loaded);
    return status;
}

enum sv_status sv_sprite_band_draw(struct sv_sprite_band *band, const struct sv_tree *trees,
                                   const struct sv_sprite_list *list, struct sv_tree_lights lights,
                                   struct sv_error *error)
{
    enum sv_status status = SV_OK;
    if (!lights.of_tree || !lights.of_species)
        lights = (struct sv_tree_lights){NULL, NULL};
    for (uint32_t k = 0; !status && k < list->count && band->open_tiles > 0; k += BATCH) {
        uint32_t count = list->count - k < BATCH ? list->count - k : BATCH;
        uint32_t made = set_up_batch(band, trees, list, k, count, lights);
        if (made == 0)
            continue;
        status = sort_into_tiles(band, made, error);
        if (!status)
            draw_tiles(band);
    }
    return status;
}

const struct sv_sprite_state *sv_sprite_band_state(const struct sv_sprite_band *band, int t)
{
    return band->loaded[t] ? &band->states[t] : NULL;
}

void sv_sprite_band_end(struct sv_sprite_band *band)
{
    store_tiles(band);
    band->between = NULL;
}
