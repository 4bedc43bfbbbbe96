/* density.c - see density.h: building, mip levels. */
#include "core/tree/density.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/image/dds_file.h"
#include "core/image/dxt.h"
#include "core/tree/density_private.h"

float sv_density_quadratic_at(const struct sv_density_quadratic *q, float x, float y)
{
    const float *c = q->c;
    return c[0] + c[1] * x + c[2] * y + c[3] * x * x + c[4] * x * y + c[5] * y * y;
}

void sv_density_finish(struct sv_density *density)
{
    free(density->file);
    *density = (struct sv_density){0};
}

/* ---- building ---- */

static void work_finish(struct sv_density_work *work)
{
    sv_cloud_bake_finish(&work->bake);
    free(work->uv.u);
    free(work->uv.v);
    free(work->uv.leaf);
    free(work->cells);
    free(work->rgba);
}

static enum sv_status work_init(struct sv_density_work *work, struct sv_error *error)
{
    size_t pixels = (size_t)SV_DENSITY_UV_STRIDE * SV_DENSITY_UV_STRIDE;
    work->uv = (struct sv_density_uv){calloc(pixels, 1), calloc(pixels, 1), calloc(pixels, 1)};
    work->cells = calloc((size_t)work->cloud->plane_count * SV_DENSITY_TEXELS + 1, sizeof *work->cells);
    work->rgba = calloc((size_t)SV_DENSITY_WIDTH * SV_DENSITY_HEIGHT, 4);
    work->out->file = malloc(SV_DENSITY_FILE_BYTES);
    if (!work->uv.u || !work->uv.v || !work->uv.leaf || !work->cells || !work->rgba || !work->out->file)
        return sv_fail(error, SV_ENOMEM, "density", "no memory to build a density texture");
    return sv_cloud_bake_init(work->mesh, work->cloud, SV_DENSITY_UV_SIDE, SV_DENSITY_UV_SIDE, &work->bake,
                              error);
}

static enum sv_status write_file(struct sv_density_work *work, struct sv_error *error)
{
    uint8_t *blocks = malloc(sv_dxt5_bytes(SV_DENSITY_WIDTH, SV_DENSITY_HEIGHT));
    if (!blocks)
        return sv_fail(error, SV_ENOMEM, "density", "no memory to pack a density texture");
    sv_dxt5_encode(work->rgba, SV_DENSITY_WIDTH, SV_DENSITY_HEIGHT, blocks);
    enum sv_status status =
        sv_dds_file_write(blocks, SV_DENSITY_WIDTH, SV_DENSITY_HEIGHT, work->out->file, error);
    free(blocks);
    return status;
}

static enum sv_status build_planes(struct sv_density_work *work, struct sv_error *error)
{
    struct sv_density *out = work->out;
    size_t count = (size_t)out->plane_count * SV_DENSITY_TEXELS;
    struct sv_density_periods periods = {NULL, NULL};
    enum sv_status status = SV_OK;
    if (out->kind == SV_DENSITY_PAPER) {
        periods.x = malloc((count + 1) * sizeof(float));
        periods.y = malloc((count + 1) * sizeof(float));
        if (!periods.x || !periods.y)
            status = sv_fail(error, SV_ENOMEM, "density", "no memory for periods");
    }
    sv_density_choose_leaf(work);
    if (out->kind == SV_DENSITY_PAPER)
        sv_density_paper_range(work);
    for (int k = 0; !status && k < out->plane_count; k++) {
        status = sv_density_sample_plane(work, k, error);
        if (!status && out->kind == SV_DENSITY_PAPER)
            sv_density_paper_analyse(work, &periods, k);
    }
    if (!status) {
        sv_density_plain_texels(work); /* colours of tones, translucency: of both kinds */
        if (out->kind == SV_DENSITY_PAPER)
            sv_density_paper_texels(work, &periods);
        status = write_file(work, error);
    }
    if (!status && out->kind == SV_DENSITY_PLAIN)
        status = sv_density_tune(work, error);
    free(periods.x);
    free(periods.y);
    return status;
}

enum sv_status sv_density_build(const struct sv_tree_mesh *mesh, const struct sv_tree_cloud *cloud,
                                enum sv_density_kind kind, struct sv_density *density, struct sv_error *error)
{
    if (cloud->plane_count > SV_DENSITY_PLANES_MAX)
        return sv_fail(error, SV_ELIMIT, "planes", "%d planes: a density texture has tiles for %d",
                       cloud->plane_count, SV_DENSITY_PLANES_MAX);
    struct sv_density made = {
        .kind = kind, .plane_count = cloud->plane_count, .period_min = 1, .period_max = 1};
    struct sv_density_work work = {.mesh = mesh, .cloud = cloud, .out = &made};
    enum sv_status status = work_init(&work, error);
    if (!status)
        status = build_planes(&work, error);
    work_finish(&work);
    if (status)
        sv_density_finish(&made);
    else
        *density = made;
    return status;
}

void sv_density_texels(const struct sv_density *density, uint8_t *rgba)
{
    sv_dxt5_decode(density->file + SV_DDS_FILE_HEADER, SV_DENSITY_WIDTH, SV_DENSITY_HEIGHT, rgba);
}

/* ---- mip levels ---- */

enum { ATLAS_TEXELS = SV_DENSITY_WIDTH * SV_DENSITY_HEIGHT };

/* A texel of the file as level 0 has it. */
static void unpack(const struct sv_density *density, const struct sv_density_plane *plane,
                   const uint8_t from[4], uint8_t albedo[4], uint8_t normal[4])
{
    float x = (float)from[0] * (2.0f / 255.0f) - 1, y = (float)from[1] * (2.0f / 255.0f) - 1;
    float rgb[3], tone = (float)from[2] * (1.0f / 255.0f), cover = (float)from[3] * (1.0f / 255.0f);
    float z = sqrtf(fmaxf(0, 1 - x * x - y * y)), long2 = x * x + y * y + z * z;
    float unit = plane->length / sqrtf(long2 > 1 ? long2 : 1);
    sv_density_color(density, tone, rgb);
    for (int c = 0; c < 3; c++)
        albedo[c] = sv_srgb8_from_linear(cover * rgb[c]);
    albedo[3] = from[3];
    normal[0] = sv_density_unit(0.5f + 0.5f * unit * x);
    normal[1] = sv_density_unit(0.5f + 0.5f * unit * y);
    normal[2] = sv_density_unit(0.5f + 0.5f * unit * z);
}

/* Occlusion beside the normals, at the texels' own places. */
static void put_occlusion(const struct sv_density *density, int level, uint8_t *normal)
{
    int side = SV_DENSITY_TILE >> level, width = SV_DENSITY_WIDTH >> level,
        height = SV_DENSITY_HEIGHT >> level;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            const struct sv_density_plane *p = &density->planes[y / side * SV_DENSITY_COLUMNS + x / side];
            float px = (2 * (float)(x % side) + 1) / (float)side - 1,
                  py = 1 - (2 * (float)(y % side) + 1) / (float)side;
            normal[4 * ((size_t)y * (size_t)width + (size_t)x) + 3] =
                sv_density_unit(sv_density_quadratic_at(&p->occlusion, px, py));
        }
}

static void first_level(const struct sv_density *density, const uint8_t *rgba,
                        struct sv_density_levels *levels)
{
    for (size_t i = 0; i < ATLAS_TEXELS; i++) {
        int x = (int)(i % SV_DENSITY_WIDTH), y = (int)(i / SV_DENSITY_WIDTH);
        int plane = y / SV_DENSITY_TILE * SV_DENSITY_COLUMNS + x / SV_DENSITY_TILE;
        unpack(density, &density->planes[plane], rgba + 4 * i, levels->albedo[0] + 4 * i,
               levels->normal[0] + 4 * i);
    }
}

/* Texel (x, y) of a level from the four of the level below. */
static void shrink(struct sv_density_levels *levels, int level, int x, int y)
{
    int fine = SV_DENSITY_WIDTH >> (level - 1), side = SV_DENSITY_WIDTH >> level;
    float color[4] = {0}, normal[3] = {0}, plain[3] = {0};
    for (int k = 0; k < 4; k++) {
        size_t at = 4 * ((size_t)(2 * y + (k >> 1)) * (size_t)fine + (size_t)(2 * x + (k & 1)));
        const uint8_t *a = levels->albedo[level - 1] + at, *n = levels->normal[level - 1] + at;
        for (int c = 0; c < 3; c++)
            color[c] += sv_linear_from_srgb8[a[c]];
        color[3] += (float)a[3];
        for (int c = 0; c < 3; c++) {
            normal[c] += (float)a[3] * (float)n[c];
            plain[c] += (float)n[c];
        }
    }
    size_t at = 4 * ((size_t)y * (size_t)side + (size_t)x);
    for (int c = 0; c < 3; c++)
        levels->albedo[level][at + (size_t)c] = sv_srgb8_from_linear(0.25f * color[c]);
    levels->albedo[level][at + 3] = (uint8_t)(0.25f * color[3] + 0.5f);
    for (int c = 0; c < 3; c++)
        levels->normal[level][at + (size_t)c] =
            (uint8_t)((color[3] > 0 ? normal[c] / color[3] : 0.25f * plain[c]) + 0.5f);
}

/* Mean over `width` texels about texel k of `side`, `stride` apart; the edges mirror, so that nothing is
 * lost.
 */
static void mean_along(const uint8_t *row, size_t stride, int side, int k, float width, float out[4])
{
    float half = 0.5f * (width - 1);
    int reach = (int)ceilf(half);
    memset(out, 0, 4 * sizeof *out);
    for (int i = -reach; i <= reach; i++) {
        int at = k + i < 0 ? -1 - k - i : k + i >= side ? 2 * side - 1 - k - i : k + i;
        float w = fminf(1, half + 1 - (float)abs(i)) / width;
        const uint8_t *p = row + (size_t)at * stride;
        for (int c = 0; c < 3; c++)
            out[c] += w * sv_linear_from_srgb8[p[c]];
        out[3] += w * (float)p[3];
    }
}

/* A slender plane's part of a level of colour (density.h). */
static void widen(const struct sv_density_plane *plane, int index, int level, uint8_t *albedo)
{
    int side = SV_DENSITY_TILE >> level;
    bool tall = plane->slender < 1;
    float width = fminf(sqrtf(tall ? 1 / plane->slender : plane->slender), (float)side);
    size_t row = 4 * ((size_t)SV_DENSITY_WIDTH >> level), stride = tall ? 4 : row, other = tall ? row : 4;
    uint8_t *corner = albedo + (size_t)(index / SV_DENSITY_COLUMNS * side) * row +
                      4 * (size_t)(index % SV_DENSITY_COLUMNS * side),
            line[SV_DENSITY_TILE][4];
    for (int j = 0; j < side && width > 1; j++) {
        uint8_t *at = corner + (size_t)j * other;
        for (int k = 0; k < side; k++) {
            float mean[4];
            mean_along(at, stride, side, k, width, mean);
            for (int c = 0; c < 3; c++)
                line[k][c] = sv_srgb8_from_linear(mean[c]);
            line[k][3] = (uint8_t)(mean[3] + 0.5f);
        }
        for (int k = 0; k < side; k++)
            memcpy(at + (size_t)k * stride, line[k], 4);
    }
}

void sv_density_levels_finish(struct sv_density_levels *levels)
{
    free(levels->albedo[0]); /* one block each */
    free(levels->normal[0]);
    *levels = (struct sv_density_levels){0};
}

enum sv_status sv_density_levels_init(const struct sv_density *density, struct sv_density_levels *levels,
                                      struct sv_error *error)
{
    size_t total = 0;
    for (int k = 0; k < SV_DENSITY_LEVELS; k++)
        total += 4 * ((size_t)ATLAS_TEXELS >> (2 * k));
    struct sv_density_levels made = {{malloc(total)}, {malloc(total)}};
    uint8_t *rgba = malloc((size_t)ATLAS_TEXELS * 4);
    if (!made.albedo[0] || !made.normal[0] || !rgba) {
        free(rgba);
        sv_density_levels_finish(&made);
        return sv_fail(error, SV_ENOMEM, "density", "no memory for %zu bytes of mip levels", 2 * total);
    }
    sv_density_texels(density, rgba);
    first_level(density, rgba, &made);
    for (int k = 1; k < SV_DENSITY_LEVELS; k++) {
        made.albedo[k] = made.albedo[k - 1] + 4 * ((size_t)ATLAS_TEXELS >> (2 * (k - 1)));
        made.normal[k] = made.normal[k - 1] + 4 * ((size_t)ATLAS_TEXELS >> (2 * (k - 1)));
        for (int y = 0; y < SV_DENSITY_HEIGHT >> k; y++)
            for (int x = 0; x < SV_DENSITY_WIDTH >> k; x++)
                shrink(&made, k, x, y);
    }
    for (int k = 0; k < SV_DENSITY_LEVELS; k++)
        put_occlusion(density, k, made.normal[k]);
    for (int k = 1; k < SV_DENSITY_LEVELS; k++)
        for (int p = 0; p < density->plane_count; p++)
            widen(&density->planes[p], p, k, made.albedo[k]);
    free(rgba);
    *levels = made;
    return SV_OK;
}
