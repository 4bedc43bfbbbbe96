/* draw_mixed.c - see draw_mixed.h: the order of the lists, and how leaves' samples go into sprites' tiles. */
#include "core/tree/draw_mixed.h"

#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/tree/leaf_pass.h"
#include "core/tree/sprite_band.h"

/* Samples of a band: 16 bytes each. */
enum { BAND_SAMPLES = 1 << 20 };
/* A sample's alpha: as leaves write it; once it is part of the picture. */
enum { FRESH = 255, TAKEN = 1 };

_Static_assert((int)SV_LEAF_BLOCK == (int)SV_SPRITE_TILE, "leaves mark tiles of sprites");

struct mixed {
    struct sv_leaf_splat *leaves;
    struct sv_sprite_band *sprites;
    struct sv_leaf_pass pass;
    struct sv_canvas band;
    struct sv_leaf_between to_leaves;
    struct sv_sprite_between to_sprites;
    int columns; /* tiles of sprites a row */
};

/* The first sample of a pixel of the band. */
static size_t sample_at(const struct mixed *m, int x, int y)
{
    size_t columns = (size_t)(m->band.width * m->pass.across);
    return (size_t)(y * m->pass.down) * columns + (size_t)(x * m->pass.across);
}

static size_t leaf_tile_at(const struct mixed *m, int x, int y)
{
    return (size_t)(y * m->pass.down / SV_LEAF_TILE) * (size_t)m->pass.tiles_x +
           (size_t)(x * m->pass.across / SV_LEAF_TILE);
}

static void close_pixel(const struct mixed *m, int x, int y)
{
    float *depth = m->leaves->sample_depth + sample_at(m, x, y);
    for (int j = 0; j < m->pass.down; j++)
        for (int i = 0; i < m->pass.across; i++)
            depth[j * m->band.width * m->pass.across + i] = SV_LEAF_CLOSED;
}

/* Samples that leaves begin with: where sprites have closed the view nothing is to be won. */
static void leaves_begun(void *context, int tx, int ty)
{
    const struct mixed *m = context;
    int w = SV_LEAF_TILE / m->pass.across, h = SV_LEAF_TILE / m->pass.down, x0 = tx * w, y0 = ty * h;
    int t = y0 / SV_SPRITE_TILE * m->columns + x0 / SV_SPRITE_TILE;
    const struct sv_sprite_state *state = sv_sprite_band_state(m->sprites, t);
    if (!state || state->open_groups == SV_SPRITE_TILE * (SV_SPRITE_TILE / SV_SPRITE_LANES))
        return;
    for (int y = y0; y < y0 + h && y < m->band.row_count; y++)
        for (int x = x0; x < x0 + w && x < m->band.width; x++)
            if (!(state->open[y % SV_SPRITE_TILE] >> x % SV_SPRITE_TILE / SV_SPRITE_LANES & 1))
                close_pixel(m, x, y);
}

/* Sprites have closed groups of a tile. */
static void sprites_closed(void *context, int t, const struct sv_sprite_state *before,
                           const struct sv_sprite_state *now)
{
    const struct mixed *m = context;
    int x0 = t % m->columns * SV_SPRITE_TILE, y0 = t / m->columns * SV_SPRITE_TILE;
    for (int row = 0; row < SV_SPRITE_TILE && y0 + row < m->band.row_count; row++)
        for (unsigned shut = before->open[row] & ~now->open[row]; shut; shut &= shut - 1) {
            int first = x0 + __builtin_ctz(shut) * SV_SPRITE_LANES;
            for (int x = first; x < first + SV_SPRITE_LANES && x < m->band.width; x++) {
                uint8_t *state = &m->leaves->tile_state[leaf_tile_at(m, x, y0 + row)];
                if (*state == SV_LEAF_TILE_RAW)
                    continue;
                close_pixel(m, x, y0 + row);
                *state = SV_LEAF_TILE_OLD;
            }
        }
}

/* What leaves have won of a pixel since it was last taken. */
struct won {
    int before, now; /* samples */
    float rgb[3], depth;
};

static struct won take_samples(const struct mixed *m, int x, int y)
{
    struct won won = {0};
    size_t first = sample_at(m, x, y), columns = (size_t)(m->band.width * m->pass.across);
    for (int j = 0; j < m->pass.down; j++)
        for (int i = 0; i < m->pass.across; i++) {
            size_t k = first + (size_t)j * columns + (size_t)i;
            uint8_t *color = m->leaves->sample_color + 4 * k;
            float *depth = m->leaves->sample_depth + k;
            won.before += color[3] == TAKEN;
            if (color[3] != FRESH)
                continue;
            won.now++;
            for (int c = 0; c < 3; c++)
                won.rgb[c] += sv_linear_from_srgb8[color[c]];
            won.depth = *depth > won.depth ? *depth : won.depth;
            color[3] = TAKEN;
            *depth = SV_LEAF_CLOSED;
        }
    return won;
}

static void take_pixel(const struct mixed *m, int x, int y, struct sv_sprite_tile *tile,
                       struct sv_sprite_hard *hard)
{
    struct won won = take_samples(m, x, y);
    int samples = m->pass.across * m->pass.down, taken = won.before + won.now;
    size_t k = (size_t)(y % SV_SPRITE_TILE * SV_SPRITE_TILE + x % SV_SPRITE_TILE);
    if (won.now == 0)
        return;
    float pass = tile->pass[k], each = pass / (float)(samples - won.before);
    tile->red[k] += each * won.rgb[0];
    tile->green[k] += each * won.rgb[1];
    tile->blue[k] += each * won.rgb[2];
    tile->pass[k] = each * (float)(samples - taken);
    if (!hard && 2 * won.before < samples && 2 * taken >= samples)
        m->band.depth[(size_t)y * (size_t)m->band.width + (size_t)x] = won.depth;
    if (hard && pass > 0.5f) {
        const struct sv_camera *camera = &m->pass.view->camera;
        hard->z[k] = camera->projection == SV_PROJECTION_ORTHOGRAPHIC ? (float)camera->far_m * (1 - won.depth)
                                                                      : (float)camera->near_m / won.depth;
    }
}

static void take_tile(void *context, int t, const struct sv_sprite_state *state, struct sv_sprite_tile *tile,
                      struct sv_sprite_hard *hard)
{
    const struct mixed *m = context;
    int x0 = t % m->columns * SV_SPRITE_TILE, y0 = state->y0 - m->band.row_first;
    int w = SV_LEAF_TILE / m->pass.across, h = SV_LEAF_TILE / m->pass.down;
    for (int top = y0; top < y0 + SV_SPRITE_TILE && top < m->band.row_count; top += h)
        for (int left = x0; left < x0 + SV_SPRITE_TILE && left < m->band.width; left += w) {
            size_t leaf_tile = leaf_tile_at(m, left, top);
            if (!m->leaves->tile_fresh[leaf_tile])
                continue;
            m->leaves->tile_fresh[leaf_tile] = 0;
            m->leaves->tile_state[leaf_tile] = SV_LEAF_TILE_OLD;
            for (int y = top; y < top + h && y < m->band.row_count; y++)
                for (int x = left; x < left + w && x < m->band.width; x++)
                    take_pixel(m, x, y, tile, hard);
        }
}

/* Entries first .. of the leaves' list that come before the sprite `next` (NULL: all); returns the first
 * after. */
static uint32_t draw_leaves(struct mixed *m, const struct sv_mixed_draw *draw, uint32_t first,
                            const struct sv_cull_entry *next, enum sv_status *status, struct sv_error *error)
{
    struct sv_leaf_splat_trees list = draw->near;
    uint32_t last = first;
    while (last < draw->near.count && (!next || draw->near.entries[last].key <= next->key))
        last++;
    list.entries += first;
    list.weight = list.weight ? list.weight + first : NULL;
    list.fraction = list.fraction ? list.fraction + first : NULL;
    list.count = last - first;
    m->pass.trees = &list;
    *status = sv_leaf_band_draw(m->leaves, &m->pass, error);
    return last;
}

/* Entries first .. of the sprites' list that come before the leaves of `next` (NULL: all). */
static uint32_t draw_sprites(struct mixed *m, const struct sv_mixed_draw *draw, uint32_t first,
                             const struct sv_cull_entry *next, enum sv_status *status, struct sv_error *error)
{
    struct sv_sprite_list list = draw->far;
    uint32_t last = first;
    while (last < draw->far.count && (!next || draw->far.entries[last].key < next->key))
        last++;
    list.entries += first;
    list.shares = list.shares ? list.shares + first : NULL;
    list.count = last - first;
    *status = sv_sprite_band_draw(m->sprites, draw->near.trees, &list, draw->near.lights, error);
    return last;
}

static enum sv_status draw_band(struct mixed *m, const struct sv_mixed_draw *draw, struct sv_error *error)
{
    const struct sv_sprite_view view = {&draw->view.camera, &draw->view.light, draw->view.shift_x_px,
                                        draw->view.shift_y_px};
    uint32_t i = 0, j = 0;
    size_t rows = (size_t)(m->band.row_count + SV_SPRITE_TILE - 1) / SV_SPRITE_TILE;
    memset(m->to_leaves.fresh, 0, (size_t)m->columns * rows);
    enum sv_status status = sv_leaf_band_begin(m->leaves, &m->pass, error);
    if (!status)
        status = sv_sprite_band_begin(m->sprites, &view, &m->band, &m->to_sprites, error);
    while (!status && (i < draw->near.count || j < draw->far.count)) {
        i = draw_leaves(m, draw, i, j < draw->far.count ? &draw->far.entries[j] : NULL, &status, error);
        if (!status)
            j = draw_sprites(m, draw, j, i < draw->near.count ? &draw->near.entries[i] : NULL, &status,
                             error);
    }
    if (!status)
        sv_sprite_band_end(m->sprites);
    return status;
}

/* A multiple of a tile. */
static int rows_of_band(const struct sv_canvas *canvas, int samples)
{
    int rows = BAND_SAMPLES / samples / canvas->width / SV_SPRITE_TILE * SV_SPRITE_TILE;
    int most = sv_sprite_band_rows(canvas->width);
    rows = rows < most ? rows : most;
    return rows > SV_SPRITE_TILE ? rows : SV_SPRITE_TILE;
}

enum sv_status sv_mixed_draw(const struct sv_mixed_draw *draw, struct sv_error *error)
{
    const struct sv_canvas *canvas = draw->canvas;
    struct mixed m = {.leaves = draw->leaves,
                      .sprites = sv_sprite_draw_band(draw->sprites),
                      .columns = (canvas->width + SV_SPRITE_TILE - 1) / SV_SPRITE_TILE};
    enum sv_status status = sv_leaf_pass_init(draw->leaves, &draw->view, draw->near.samples, &m.pass, error);
    if (status)
        return status;
    int rows = rows_of_band(canvas, draw->near.samples), end = canvas->row_first + canvas->row_count;
    uint8_t *fresh = malloc((size_t)m.columns * (size_t)rows / SV_SPRITE_TILE);
    if (!fresh)
        return sv_fail(error, SV_ENOMEM, "trees", "no memory for bands of %d rows", rows);
    m.to_leaves = (struct sv_leaf_between){&m, leaves_begun, fresh, m.columns};
    m.to_sprites = (struct sv_sprite_between){&m, fresh, take_tile, sprites_closed};
    m.pass.between = &m.to_leaves;
    m.pass.sampled = true;
    m.pass.canvas = &m.band;
    for (int row = canvas->row_first; row < end && !status; row += rows) {
        m.band = sv_canvas_band(canvas, row, end - row < rows ? end - row : rows);
        status = draw_band(&m, draw, error);
    }
    free(fresh);
    return status;
}
