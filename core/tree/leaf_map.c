/* leaf_map.c - textures of leaf forms: where the mask is whole, and smaller levels of colour. */
#include "core/tree/leaf_form.h"

#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"

static int wrapped(int i, int n)
{
    return i < n ? i : i - n;
}

/* Alphas over (under) this much more (less) than the cutoff are in (out) whatever rounding does to their
 * mean. */
static const float SURE = 1e-4f;

static enum sv_status make_classes(const struct sv_tree_material *material, struct sv_leaf_map *map,
                                   struct sv_error *error)
{
    int w = map->width, h = map->height;
    map->classes = calloc((size_t)w * (size_t)h / 16 + 2, sizeof *map->classes);
    if (!map->classes)
        return sv_fail(error, SV_ENOMEM, "species", "no memory for a mask of %d x %d", w, h);
    for (int j = 0; j < h; j++)
        for (int i = 0; i < w; i++) {
            int in = 0, out = 0;
            for (int k = 0; k < 4; k++) {
                int x = wrapped(i + (k & 1), w), y = wrapped(j + (k >> 1), h);
                float a = (float)map->rgba[(size_t)y * (size_t)w + (size_t)x][3] * (1.0f / 255.0f) *
                          material->base_color[3];
                in += a >= material->alpha_cutoff + SURE;
                out += a <= material->alpha_cutoff - SURE;
            }
            uint32_t value = in == 4 ? SV_LEAF_IN : out == 4 ? SV_LEAF_OUT : SV_LEAF_MIXED;
            size_t at = (size_t)j * (size_t)w + (size_t)i;
            map->classes[at >> 4] |= value << 2 * (at & 15);
        }
    return SV_OK;
}

/* Means of 2 x 2 texels (2 x 1, 1 x 2 where a side is 1; an odd last row or column is left out), weighted by
 * alpha. */
static void halve(const uint8_t (*from)[4], int w, int h, uint8_t (*to)[4])
{
    int tw = w > 1 ? w / 2 : 1, th = h > 1 ? h / 2 : 1;
    for (int j = 0; j < th; j++)
        for (int i = 0; i < tw; i++) {
            float sum[3] = {0}, weight = 0, alpha = 0;
            for (int k = 0; k < 4; k++) {
                int x = w > 1 ? 2 * i + (k & 1) : 0, y = h > 1 ? 2 * j + (k >> 1) : 0;
                const uint8_t *p = from[(size_t)y * (size_t)w + (size_t)x];
                float a = (float)p[3] + 1e-3f; /* nothing opaque: the plain mean */
                weight += a;
                alpha += (float)p[3];
                for (int c = 0; c < 3; c++)
                    sum[c] += a * sv_linear_from_srgb8[p[c]];
            }
            uint8_t *p = to[(size_t)j * (size_t)tw + (size_t)i];
            for (int c = 0; c < 3; c++)
                p[c] = sv_srgb8_from_linear(sum[c] / weight);
            p[3] = (uint8_t)(alpha * 0.25f + 0.5f);
        }
}

static enum sv_status make_levels(struct sv_leaf_map *map, size_t *bytes, struct sv_error *error)
{
    size_t room = 0;
    int w = map->width, h = map->height, n = 1;
    map->widths[0] = w;
    map->heights[0] = h;
    for (; n < SV_LEAF_LEVELS && (w > 1 || h > 1); n++) {
        w = w > 1 ? w / 2 : 1;
        h = h > 1 ? h / 2 : 1;
        map->widths[n] = w;
        map->heights[n] = h;
        map->offset[n] = (uint32_t)room;
        room += (size_t)w * (size_t)h;
    }
    map->level_count = n;
    map->levels = malloc((room + 1) * sizeof *map->levels);
    if (!map->levels)
        return sv_fail(error, SV_ENOMEM, "species", "no memory for %zu texels", room);
    *bytes += room * sizeof *map->levels;
    const uint8_t(*from)[4] = map->rgba;
    for (int k = 1; k < n; k++) {
        halve(from, map->widths[k - 1], map->heights[k - 1], map->levels + map->offset[k]);
        from = (const uint8_t(*)[4])(map->levels + map->offset[k]);
    }
    return SV_OK;
}

enum sv_status sv_leaf_maps_init(struct sv_leaf_form *form, struct sv_error *error)
{
    enum sv_status status = SV_OK;
    sv_color_init();
    for (int m = 0; m < form->mesh->material_count && !status; m++) {
        const struct sv_tree_material *material = &form->mesh->materials[m];
        struct sv_leaf_map *map = &form->maps[m];
        if (!material->albedo.data || material->index_count == 0)
            continue;
        map->rgba = material->albedo.data;
        map->width = material->albedo.width;
        map->height = material->albedo.height;
        status = make_levels(map, &form->bytes, error);
        if (!status && material->masked) {
            status = make_classes(material, map, error);
            form->bytes += (size_t)map->width * (size_t)map->height / 4;
        }
    }
    return status;
}
