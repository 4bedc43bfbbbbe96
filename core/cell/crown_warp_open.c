/* crown_warp_open.c - what opens behind the nearer leaves of a crown as the eye moves away from V: shown as
 * what is seen beside it, farther away (crown_warp.h). One body for all SIMD levels; only the search for keys
 * is theirs. */
#include <string.h>

#include "core/cell/crown_warp_kernel.h"

const int sv_crown_ways[SV_CROWN_WAYS][2] = {{-1, 0},  {1, 0}, {0, -1}, {0, 1},
                                             {-1, -1}, {1, 1}, {-1, 1}, {1, -1}};

/* Whether V's panel has something nearer where the pixel sees the key's depth. Half a texel off beside a
 * silhouette is enough to be taken for it: one that is nearer by less than this share is the same leaf. */
static bool is_hidden(const struct sv_crown_place *at)
{
    const float same = 0.02f;
    float code = (float)sv_panel_code(at->source->layer, (int)(at->u + 0.5f), (int)(at->v + 0.5f));
    return code > at->code * (1 + same);
}

/* A texel as it is, under what has been gathered. */
static void show_texel(const struct sv_crown_place *at, float light[4])
{
    const struct sv_panel_layer *layer = at->source->layer;
    uint32_t slot = at->texel / SV_PANEL_SLOT_CODES, in_tile = at->texel % SV_PANEL_SLOT_CODES;
    const uint8_t *c = layer->color[slot * SV_PANEL_SLOT_COLORS +
                                    in_tile / SV_PANEL_TILE * SV_PANEL_SLOT_SIDE + in_tile % SV_PANEL_TILE];
    float pass = light[3] * (1.0f / (255 * 255));
    for (int k = 0; k < 3; k++)
        light[k] += pass * (float)(c[k] * c[k]);
    light[3] -= pass * (float)(c[3] * 255);
}

void sv_crown_show_behind(const struct sv_crown_resolve *r, const uint64_t keys[SV_CROWN_WAYS], int i, int j)
{
    size_t p = (size_t)j * (size_t)r->buffer->width + (size_t)i;
    struct sv_crown_place best = {NULL, 0, 0, 0, 0};
    uint64_t least = UINT64_MAX;
    for (int way = 0; way < SV_CROWN_WAYS; way++) {
        if (keys[way] <= r->buffer->epoch || keys[way] >= least)
            continue;
        struct sv_crown_place at = sv_crown_locate(r, keys[way], (float)i, (float)(r->buffer->row_first + j));
        if (at.source && at.source->opens && is_hidden(&at)) {
            best = at;
            least = keys[way];
        }
    }
    if (!best.source)
        return;
    float d = sv_crown_depth(least);
    if (!(r->depth && d < r->depth[p] * r->keep))
        show_texel(&best, r->light[p - r->skip]);
}
