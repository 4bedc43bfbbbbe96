/* density_look.c - see density_look.h. */
#include "core/tree/density_look.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/tree/billboard.h"
#include "core/tree/density_private.h"

static void light_place(int i, int j, float at[2])
{
    at[0] = 2 * ((float)i + 0.5f) / SV_DENSITY_LIGHT_SIDE - 1;
    at[1] = 1 - 2 * ((float)j + 0.5f) / SV_DENSITY_LIGHT_SIDE;
}

void sv_density_open(const struct sv_density *density, int plane, uint8_t *rgba)
{
    const struct sv_density_plane *p = &density->planes[plane];
    for (int n = 0; n < SV_DENSITY_LIGHT_SIDE * SV_DENSITY_LIGHT_SIDE; n++) {
        float at[2];
        light_place(n % SV_DENSITY_LIGHT_SIDE, n / SV_DENSITY_LIGHT_SIDE, at);
        for (int c = 0; c < 4; c++) {
            float v = sv_density_quadratic_at(&p->open[c], at[0], at[1]);
            rgba[4 * n + c] = sv_density_unit(c < 3 ? 0.5f + 0.5f * v : v);
        }
    }
}

void sv_density_occlusion(const struct sv_density *density, int plane, uint8_t *rgba)
{
    for (int n = 0; n < SV_DENSITY_LIGHT_SIDE * SV_DENSITY_LIGHT_SIDE; n++) {
        float at[2];
        light_place(n % SV_DENSITY_LIGHT_SIDE, n / SV_DENSITY_LIGHT_SIDE, at);
        memset(rgba + 4 * n,
               sv_density_unit(sv_density_quadratic_at(&density->planes[plane].occlusion, at[0], at[1])), 4);
    }
}

static bool shows(const struct sv_density *density, const uint8_t *texel)
{
    return density->kind == SV_DENSITY_PAPER ? texel[0] > 0 || texel[1] > 0 : texel[3] > 0;
}

void sv_density_outline(const struct sv_density *density, const uint8_t *texels, int plane,
                        float outline[SV_DENSITY_OUTLINE])
{
    static const float h = 0.70710678f;
    static const float a[SV_DENSITY_OUTLINE] = {1,  0.70710678f,  0, -0.70710678f,
                                                -1, -0.70710678f, 0, 0.70710678f};
    for (int k = 0; k < SV_DENSITY_OUTLINE; k++)
        outline[k] = -INFINITY;
    for (int t = 0; t < SV_DENSITY_TEXELS; t++) {
        if (!shows(density, sv_density_texel((uint8_t *)texels, plane, t)))
            continue;
        float x = (float)(t % SV_DENSITY_TILE) + 0.5f, y = (float)(t / SV_DENSITY_TILE) + 0.5f;
        for (int k = 0; k < SV_DENSITY_OUTLINE; k++) /* the texel, and as far as filtering spreads it */
            outline[k] =
                fmaxf(outline[k], (a[k] * x + a[(k + 6) % 8] * y + (k & 1 ? 2 * h : 1)) / SV_DENSITY_TILE);
    }
}

/* ---- the leaf ---- */

/* Bilinear, repeating: the rule of mesh.h. */
static void leaf_texel(const struct sv_tree_material *m, float u, float v, float rgba[4])
{
    memcpy(rgba, m->base_color, 4 * sizeof *rgba);
    const struct sv_image *image = &m->albedo;
    if (!image->data)
        return;
    float x = u * (float)image->width - 0.5f, y = v * (float)image->height - 0.5f, sum[4] = {0};
    float fx = x - floorf(x), fy = y - floorf(y);
    for (int k = 0; k < 4; k++) {
        int i = (int)floorf(x) + (k & 1), j = (int)floorf(y) + (k >> 1);
        i = (i % image->width + image->width) % image->width;
        j = (j % image->height + image->height) % image->height;
        const uint8_t *p = (const uint8_t *)image->data + 4 * ((size_t)j * (size_t)image->width + (size_t)i);
        float w = (k & 1 ? fx : 1 - fx) * (k >> 1 ? fy : 1 - fy);
        for (int c = 0; c < 3; c++)
            sum[c] += w * sv_linear_from_srgb8[p[c]];
        sum[3] += w * (float)p[3] * (1.0f / 255.0f);
    }
    for (int c = 0; c < 4; c++)
        rgba[c] *= sum[c];
}

/* Straight colour and kept share of a box of the leaf, by SUB x SUB samples. */
static void leaf_box(const struct sv_density_leaf *leaf, const struct sv_tree_material *m, int side, int i,
                     int j, float rgba[4])
{
    enum { SUB = 4 };
    float kept = 0, sum[3] = {0}, all[3] = {0};
    for (int n = 0; n < SUB * SUB; n++) {
        float s = ((float)i + ((float)(n % SUB) + 0.5f) / SUB) / (float)side;
        float t = ((float)j + ((float)(n / SUB) + 0.5f) / SUB) / (float)side, c[4];
        leaf_texel(m, leaf->uv_lo[0] + s * (leaf->uv_hi[0] - leaf->uv_lo[0]),
                   leaf->uv_lo[1] + t * (leaf->uv_hi[1] - leaf->uv_lo[1]), c);
        bool in = !m->masked || c[3] >= m->alpha_cutoff;
        kept += in;
        for (int a = 0; a < 3; a++) {
            sum[a] += in ? c[a] : 0;
            all[a] += c[a];
        }
    }
    for (int a = 0; a < 3; a++)
        rgba[a] = kept > 0 ? sum[a] / kept : all[a] / (SUB * SUB);
    rgba[3] = kept / (SUB * SUB);
}

static enum sv_status leaf_level(const struct sv_density_leaf *leaf, const struct sv_tree_material *m,
                                 int side, uint8_t *out, struct sv_error *error)
{
    size_t texels = (size_t)side * (size_t)side;
    float *cover = malloc(texels * sizeof *cover), scale = 1;
    if (!cover)
        return sv_fail(error, SV_ENOMEM, "density", "no memory for a leaf's picture");
    double target = 0;
    for (size_t k = 0; k < texels; k++) {
        float rgba[4];
        leaf_box(leaf, m, side, (int)(k % (size_t)side), (int)(k / (size_t)side), rgba);
        for (int c = 0; c < 3; c++)
            out[4 * k + (size_t)c] = sv_srgb8_from_linear(rgba[c]);
        cover[k] = rgba[3];
        target += (double)rgba[3] / (double)texels;
    }
    if (target > 0 && target < 1 && side >= 4)
        scale = 0.5f / sv_coverage_bar(cover, side, target);
    for (size_t k = 0; k < texels; k++)
        out[4 * k + 3] = sv_density_unit(cover[k] * scale);
    free(cover);
    return SV_OK;
}

enum sv_status sv_density_leaf_picture(const struct sv_density *density, const struct sv_tree_mesh *mesh,
                                       uint8_t *levels[SV_DENSITY_LEAF_LEVELS], struct sv_error *error)
{
    size_t texels = 0;
    for (int k = 0; k < SV_DENSITY_LEAF_LEVELS; k++)
        texels += (size_t)(SV_DENSITY_LEAF_SIDE >> k) * (size_t)(SV_DENSITY_LEAF_SIDE >> k);
    uint8_t *block = calloc(texels, 4), *at = block;
    enum sv_status status = SV_OK;
    if (!block)
        return sv_fail(error, SV_ENOMEM, "density", "no memory for a leaf's picture");
    int material = density->leaf.material;
    for (int k = 0; k < SV_DENSITY_LEAF_LEVELS; k++) {
        int side = SV_DENSITY_LEAF_SIDE >> k;
        levels[k] = at;
        if (!status && material >= 0 && material < mesh->material_count)
            status = leaf_level(&density->leaf, &mesh->materials[material], side, at, error);
        at += 4 * (size_t)side * (size_t)side;
    }
    if (status)
        free(block);
    return status;
}

/* ---- bars of coverage ---- */

/* The mean of planes' bars, by what they cover; 0.5 where nothing is. */
static float mean_bar(const uint8_t *rgba, int side, int planes, float *cover)
{
    double sum = 0, weight = 0;
    for (int plane = 0; plane < planes; plane++) {
        double covered = 0;
        size_t corner = (size_t)(plane / SV_DENSITY_COLUMNS * side) * (size_t)(side * SV_DENSITY_COLUMNS) +
                        (size_t)(plane % SV_DENSITY_COLUMNS * side);
        for (int t = 0; t < side * side; t++) {
            size_t at =
                corner + (size_t)(t / side) * (size_t)(side * SV_DENSITY_COLUMNS) + (size_t)(t % side);
            cover[t] = (float)rgba[4 * at + 3] * (1.0f / 255.0f);
            covered += (double)cover[t];
        }
        if (!(covered > 0))
            continue;
        sum += covered * (double)sv_coverage_bar(cover, side, covered / (side * side));
        weight += covered;
    }
    return weight > 0 ? (float)(sum / weight) : 0.5f;
}

float sv_density_sharp_scale(const struct sv_density *density, const uint8_t *texels)
{
    float *cover = malloc(SV_DENSITY_TEXELS * sizeof *cover);
    float bar = cover ? mean_bar(texels, SV_DENSITY_TILE, density->plane_count, cover) : 0.5f;
    free(cover);
    return 0.5f / bar;
}

void sv_density_bars(const struct sv_density *density, const struct sv_density_levels *levels,
                     float bars[SV_DENSITY_LEVELS])
{
    float *cover = malloc(SV_DENSITY_TEXELS * sizeof *cover);
    for (int k = 0; k < SV_DENSITY_LEVELS; k++)
        bars[k] =
            cover ? mean_bar(levels->albedo[k], SV_DENSITY_TILE >> k, density->plane_count, cover) : 0.5f;
    free(cover);
}
