/* sprite_atlas.c - the atlas as bytes, and its coarse coverage. */
#include "core/tree/sprite_atlas.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void sv_sprite_atlas_finish(struct sv_sprite_atlas *atlas)
{
    free(atlas->texels);
    free(atlas->smooth);
    *atlas = (struct sv_sprite_atlas){.texels = NULL};
}

size_t sv_sprite_atlas_bytes(const struct sv_sprite_atlas *atlas)
{
    return sizeof *atlas + atlas->texel_count * sizeof *atlas->texels +
           atlas->smooth_count * sizeof *atlas->smooth;
}

struct blob_header {
    char magic[8];
    uint32_t frames, cell;
    uint64_t texel_count, smooth_count;
};
static const char MAGIC[8] = {'S', 'V', 'S', 'P', 'R', 'I', 'T', '1'};

enum sv_status sv_sprite_atlas_save(const struct sv_sprite_atlas *atlas, void **data, size_t *bytes,
                                    struct sv_error *error)
{
    struct blob_header header = {.frames = SV_IMPOSTOR_FRAMES,
                                 .cell = SV_SPRITE_CELL,
                                 .texel_count = atlas->texel_count,
                                 .smooth_count = atlas->smooth_count};
    memcpy(header.magic, MAGIC, sizeof MAGIC);
    const struct {
        const void *from;
        size_t bytes;
    } parts[] = {{&header, sizeof header},
                 {atlas->frames, sizeof atlas->frames},
                 {atlas->texels, atlas->texel_count * sizeof *atlas->texels},
                 {atlas->smooth, atlas->smooth_count * sizeof *atlas->smooth}};
    size_t total = 0;
    for (int k = 0; k < 4; k++)
        total += parts[k].bytes;
    unsigned char *made = malloc(total), *p = made;
    if (!made)
        return sv_fail(error, SV_ENOMEM, "sprite", "no memory for %zu bytes", total);
    for (int k = 0; k < 4; k++) {
        if (parts[k].bytes > 0)
            memcpy(p, parts[k].from, parts[k].bytes);
        p += parts[k].bytes;
    }
    *data = made;
    *bytes = total;
    return SV_OK;
}

static bool bounded(const float *f, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (!(fabsf(f[i]) <= 1e6f))
            return false;
    return true;
}

/* True when every level lies within the arrays and is half as large as the one before. */
static bool frame_sound(const struct sv_sprite_frame *f, uint64_t texel_count, uint64_t smooth_count)
{
    const struct sv_sprite_level *l = f->level;
    if (!bounded(f->of.right, sizeof f->of / sizeof(float)) || !(f->of.texels > 0) ||
        !bounded(&f->depth_first, 2) || !bounded(f->guess[0], SV_SPRITE_LEVELS * 6))
        return false;
    if (f->left < 0 || f->top < 0 || l->width < 0 || l->height < 0 || f->left % 2 || f->top % 2 ||
        f->left > SV_SPRITE_CELL || f->top > SV_SPRITE_CELL || l->width > SV_SPRITE_CELL - f->left ||
        l->height > SV_SPRITE_CELL - f->top || (l->width > 0) != (l->height > 0))
        return false;
    for (int k = 0; k < SV_SPRITE_LEVELS; k++) {
        uint64_t w = (uint64_t)l[k].width, h = (uint64_t)l[k].height;
        if (k > 0 && (l[k].width != (l[k - 1].width + 1) / 2 || l[k].height != (l[k - 1].height + 1) / 2))
            return false;
        if (w == 0)
            continue;
        if (l[k].texel_first + (w + 2) * (h + 2) > texel_count ||
            l[k].smooth_first + (uint64_t)sv_sprite_smooth_size(l[k].width, k) *
                                    (uint64_t)sv_sprite_smooth_size(l[k].height, k) >
                smooth_count)
            return false;
    }
    return true;
}

static bool atlas_sound(const struct sv_sprite_atlas *atlas, const struct blob_header *header)
{
    for (int k = 0; k < SV_IMPOSTOR_FRAMES; k++)
        if (!frame_sound(&atlas->frames[k], header->texel_count, header->smooth_count))
            return false;
    return true;
}

enum sv_status sv_sprite_atlas_load(const void *data, size_t bytes, struct sv_sprite_atlas *atlas,
                                    struct sv_error *error)
{
    const unsigned char *p = data;
    struct blob_header header;
    struct sv_sprite_atlas made = {.texels = NULL};
    size_t fixed = sizeof header + sizeof made.frames;
    if (bytes < fixed)
        return sv_fail(error, SV_EFORMAT, "sprite", "the block has %zu bytes, fewer than %zu", bytes, fixed);
    memcpy(&header, p, sizeof header);
    memcpy(made.frames, p + sizeof header, sizeof made.frames);
    if (memcmp(header.magic, MAGIC, sizeof MAGIC) || header.frames != SV_IMPOSTOR_FRAMES ||
        header.cell != SV_SPRITE_CELL || header.texel_count > UINT32_MAX ||
        header.smooth_count > UINT32_MAX || (header.texel_count + header.smooth_count) * 8 != bytes - fixed ||
        !atlas_sound(&made, &header))
        return sv_fail(error, SV_EFORMAT, "sprite", "the block is not an atlas of this version");
    made.texel_count = (size_t)header.texel_count;
    made.smooth_count = (size_t)header.smooth_count;
    made.texels = malloc(made.texel_count * sizeof *made.texels + 1);
    made.smooth = malloc(made.smooth_count * sizeof *made.smooth + 1);
    if (!made.texels || !made.smooth) {
        sv_sprite_atlas_finish(&made);
        return sv_fail(error, SV_ENOMEM, "sprite", "no memory for %zu bytes", bytes);
    }
    memcpy(made.texels, p + fixed, made.texel_count * sizeof *made.texels);
    memcpy(made.smooth, p + fixed + made.texel_count * sizeof *made.texels,
           made.smooth_count * sizeof *made.smooth);
    *atlas = made;
    return SV_OK;
}

void sv_sprite_atlas_outline(const struct sv_sprite_atlas *atlas, struct sv_impostor_frame *frames,
                             uint8_t *coverage)
{
    memset(coverage, 0, (size_t)SV_IMPOSTOR_SIDE * SV_IMPOSTOR_SIDE);
    _Static_assert(SV_SPRITE_CELL == 2 * SV_IMPOSTOR_CELL, "level 1 has the outline's texels");
    for (int k = 0; k < SV_IMPOSTOR_FRAMES; k++) {
        const struct sv_sprite_frame *f = &atlas->frames[k];
        const struct sv_sprite_level *l = &f->level[1];
        frames[k] = f->of;
        frames[k].texels = f->of.texels * 0.5f;
        int column = k % SV_IMPOSTOR_GRID * SV_IMPOSTOR_CELL + f->left / 2;
        int row = k / SV_IMPOSTOR_GRID * SV_IMPOSTOR_CELL + f->top / 2;
        for (int j = 0; j < l->height; j++)
            for (int i = 0; i < l->width; i++)
                coverage[(size_t)(row + j) * SV_IMPOSTOR_SIDE + (size_t)(column + i)] =
                    atlas->texels[l->texel_first + (size_t)(j + 1) * (size_t)(l->width + 2) + (size_t)i + 1]
                        .coverage;
    }
}
