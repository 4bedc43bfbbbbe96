/* sprite_resolve.c - canvas to tile and back: depth becomes metres, light that was gathered goes over the
 * canvas' colour. */
#include <math.h>
#include <string.h>

#include "core/base/color.h"
#include "core/tree/sprite_private.h"

const struct sv_sprite_steps sv_sprite_scalar = {sv_sprite_kernel_scalar, sv_sprite_tile_load,
                                                 sv_sprite_tile_store};
const struct sv_sprite_steps sv_sprite_avx2 = {sv_sprite_kernel_avx2, sv_sprite_tile_load_avx2,
                                               sv_sprite_tile_store_avx2};

static float metres(const struct sv_camera *camera, float depth)
{
    if (!(depth > 0))
        return INFINITY;
    return camera->projection == SV_PROJECTION_ORTHOGRAPHIC ? (float)camera->far_m * (1 - depth)
                                                            : (float)camera->near_m / depth;
}

void sv_sprite_load_row(const struct sv_camera *camera, const float *depth, int first, int columns, float *z)
{
    for (int i = first; i < columns; i++)
        z[i] = metres(camera, depth[i]);
}

void sv_sprite_tile_load(const struct sv_canvas *canvas, const struct sv_camera *camera, int columns,
                         int rows, struct sv_sprite_state *state, struct sv_sprite_tile *tile)
{
    sv_sprite_tile_clear(columns, rows, state, tile);
    for (int j = 0; j < rows; j++)
        sv_sprite_load_row(camera, canvas->depth + sv_canvas_at(canvas, state->x0, state->y0 + j), 0, columns,
                           tile->z + j * SV_SPRITE_TILE);
    for (size_t k = 0; k < SV_SPRITE_TILE_PIXELS; k++)
        state->far_z = tile->z[k] > state->far_z ? tile->z[k] : state->far_z;
}

void sv_sprite_tile_clear(int columns, int rows, struct sv_sprite_state *state, struct sv_sprite_tile *tile)
{
    int groups = (columns + SV_SPRITE_LANES - 1) / SV_SPRITE_LANES;
    memset(tile->red, 0, sizeof tile->red);
    memset(tile->green, 0, sizeof tile->green);
    memset(tile->blue, 0, sizeof tile->blue);
    memset(state->open, 0, sizeof state->open);
    for (int k = 0; k < SV_SPRITE_TILE_PIXELS; k++) {
        bool there = k % SV_SPRITE_TILE < columns && k / SV_SPRITE_TILE < rows;
        tile->pass[k] = there;
        tile->z[k] = -1; /* nothing is in front of it */
    }
    memset(state->open, (1 << groups) - 1, (size_t)rows);
    state->open_groups = groups * rows;
    state->far_z = 0;
}

void sv_sprite_store_row(uint8_t *color, const struct sv_sprite_tile *tile, size_t at, int first, int columns)
{
    for (int i = first; i < columns; i++) {
        size_t k = at + (size_t)i;
        uint8_t *p = color + 4 * i;
        float pass = tile->pass[k], each = 1;
        if (pass == 1)
            continue;
        if (!(pass >= SV_SPRITE_PASS_MIN)) {
            each = 1 / (1 - pass);
            pass = 0;
        }
        const float gathered[3] = {each * tile->red[k], each * tile->green[k], each * tile->blue[k]};
        for (int c = 0; c < 3; c++)
            p[c] = sv_srgb8_from_linear(gathered[c] + pass * sv_linear_from_srgb8[p[c]]);
        p[3] = (uint8_t)(255 * (1 - pass) + pass * (float)p[3] + 0.5f);
    }
}

void sv_sprite_tile_store(const struct sv_canvas *canvas, int columns, int rows,
                          const struct sv_sprite_state *state, const struct sv_sprite_tile *tile)
{
    for (int j = 0; j < rows; j++)
        sv_sprite_store_row(canvas->color + 4 * sv_canvas_at(canvas, state->x0, state->y0 + j), tile,
                            (size_t)(j * SV_SPRITE_TILE), 0, columns);
}

void sv_sprite_hard_store(const struct sv_canvas *canvas, const struct sv_camera *camera, int columns,
                          int rows, const struct sv_sprite_state *state, const struct sv_sprite_tile *tile,
                          const struct sv_sprite_hard *hard)
{
    bool orthographic = camera->projection == SV_PROJECTION_ORTHOGRAPHIC;
    for (int j = 0; j < rows; j++)
        for (int i = 0; i < columns; i++) {
            size_t k = (size_t)(j * SV_SPRITE_TILE + i),
                   at = sv_canvas_at(canvas, state->x0 + i, state->y0 + j);
            if (!(hard->z[k] > 0) || (hard->surface && tile->pass[k] > 0.5f && canvas->color[4 * at + 3] >= 128))
                continue;
            /* A mean over pictures: none is nearer than the near plane, the mean but for rounding. */
            canvas->depth[at] = orthographic ? 1 - hard->z[k] / (float)camera->far_m
                                             : fminf((float)camera->near_m / hard->z[k], 1);
            if (canvas->id)
                canvas->id[at] = hard->id[k];
            for (int c = 0; canvas->normal && c < 3; c++)
                canvas->normal[3 * at + (size_t)c] = hard->normal[c][k];
        }
}
