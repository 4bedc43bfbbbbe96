/* impostor_bake.c - the impostor of the GL quads: 64 frames (impostor_frame.h) in three atlases. */
#include "core/tree/impostor.h"

#include <math.h>
#include <stdlib.h>

#include "core/base/color.h"
#include "core/tree/impostor_frame.h"

enum { SUB = 3 };

static uint8_t unit_code(float v)
{
    return (uint8_t)(fminf(fmaxf(v, 0), 1) * 255.0f + 0.5f);
}

static void put_texel(struct sv_impostor *out, const struct sv_frame_texel *t, size_t at)
{
    uint8_t *albedo = out->albedo + at, *normal = out->normal + at, *open = out->open + at;
    const float all = (float)(SUB * SUB);
    float each = 1.0f / t->count;
    for (int c = 0; c < 3; c++) {
        albedo[c] = sv_srgb8_from_linear(t->rgb[c] / all);
        normal[c] = unit_code(0.5f + 0.5f * t->normal[c] * each);
        open[c] = unit_code(0.5f + 0.5f * t->open[c] * each);
    }
    albedo[3] = unit_code(t->count / all);
    normal[3] = unit_code(t->occlusion * each);
    open[3] = unit_code(t->open[3] * each);
}

static void bake_frame(struct sv_frame_bake *bake, int index, struct sv_impostor *out)
{
    int column = index % SV_IMPOSTOR_GRID * SV_IMPOSTOR_CELL,
        row = index / SV_IMPOSTOR_GRID * SV_IMPOSTOR_CELL;
    sv_frame_bake_draw(bake, index);
    out->frames[index] = bake->frame;
    const struct sv_frame_texel *t = bake->texels;
    for (int j = 0; j < SV_IMPOSTOR_CELL; j++)
        for (int i = 0; i < SV_IMPOSTOR_CELL; i++, t++)
            if (t->count > 0)
                put_texel(out, t, 4 * ((size_t)(row + j) * SV_IMPOSTOR_SIDE + (size_t)(column + i)));
}

enum sv_status sv_impostor_bake(const struct sv_tree_mesh *mesh, struct sv_impostor *impostor,
                                struct sv_error *error)
{
    size_t texels = (size_t)SV_IMPOSTOR_SIDE * SV_IMPOSTOR_SIDE;
    struct sv_impostor made = {
        .albedo = calloc(texels, 4), .normal = calloc(texels, 4), .open = calloc(texels, 4)};
    struct sv_frame_bake bake;
    enum sv_status status = SV_OK;
    if (!made.albedo || !made.normal || !made.open)
        status = sv_fail(error, SV_ENOMEM, "impostor", "no memory for an atlas");
    if (!status)
        status = sv_frame_bake_init(mesh, SV_IMPOSTOR_CELL, SUB, &bake, error);
    if (status) {
        sv_impostor_finish(&made);
        return status;
    }
    for (int k = 0; k < SV_IMPOSTOR_FRAMES; k++)
        bake_frame(&bake, k, &made);
    sv_frame_bake_translucency(&bake, made.translucency);
    sv_frame_bake_finish(&bake);
    *impostor = made;
    return SV_OK;
}
