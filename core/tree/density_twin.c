/* density_twin.c - the fragment shaders of density textures in C, same names, same order of operations. */
#include <math.h>
#include <string.h>

#include "core/base/color.h"
#include "core/tree/density_look.h"
#include "core/tree/density_private.h"

/* A picture as GL samples it: bilinear, one level; edges held, or repeated. */
struct sampler {
    const uint8_t *rgba;
    int side, stride; /* texels; of a row of the whole picture */
    bool srgb, repeat;
};

static int held(int i, const struct sampler *p)
{
    if (p->repeat)
        return (i % p->side + p->side) % p->side;
    return i < 0 ? 0 : i >= p->side ? p->side - 1 : i;
}

static void bilinear(const struct sampler *p, float s, float t, float out[4])
{
    float x = s * (float)p->side - 0.5f, y = t * (float)p->side - 0.5f;
    float fx = x - floorf(x), fy = y - floorf(y);
    memset(out, 0, 4 * sizeof *out);
    for (int k = 0; k < 4; k++) {
        int i = held((int)floorf(x) + (k & 1), p), j = held((int)floorf(y) + (k >> 1), p);
        const uint8_t *texel = p->rgba + 4 * ((size_t)j * (size_t)p->stride + (size_t)i);
        float w = (k & 1 ? fx : 1 - fx) * (k >> 1 ? fy : 1 - fy);
        for (int c = 0; c < 4; c++)
            out[c] +=
                w * (p->srgb && c < 3 ? sv_linear_from_srgb8[texel[c]] : (float)texel[c] * (1.0f / 255.0f));
    }
}

/* GL_LINEAR_MIPMAP_NEAREST. */
static int level_of(float lod, int last)
{
    int level = lod <= 0.5f ? 0 : (int)ceilf(lod + 0.5f) - 1;
    return level < last ? level : last;
}

static struct sampler tile(const uint8_t *atlas, int level, int plane, bool srgb)
{
    int side = SV_DENSITY_TILE >> level, stride = SV_DENSITY_WIDTH >> level;
    size_t at = (size_t)(plane / SV_DENSITY_COLUMNS * side) * (size_t)stride +
                (size_t)(plane % SV_DENSITY_COLUMNS * side);
    return (struct sampler){atlas + 4 * at, side, stride, srgb, false};
}

static float unit(float v)
{
    return v > 0 ? v < 1 ? v : 1 : 0;
}

static void set_light(const struct sv_density *density, int plane, float s, float t,
                      struct sv_density_look *look)
{
    enum { SIDE = SV_DENSITY_LIGHT_SIDE };
    uint8_t rgba[SIDE * SIDE * 4];
    float o[4];
    sv_density_open(density, plane, rgba);
    bilinear(&(struct sampler){rgba, SIDE, SIDE, false, false}, s, t, o);
    for (int c = 0; c < 4; c++)
        look->open[c] = c < 3 ? o[c] * 2 - 1 : o[c];
}

static float translucency_of(const struct sv_density *density, const float rgb[3])
{
    const float *rule = density->translucency;
    return unit(rgb[0] * rule[0] + rgb[1] * rule[1] + rgb[2] * rule[2] + rule[3]);
}

static float sharpened(float coverage, float lod, float sharp)
{
    float steep = exp2f(lod < 0 ? -lod : 0);
    float scaled = coverage * (sharp + (1 - sharp) / steep);
    return unit((scaled - 0.5f) * steep + 0.5f);
}

float sv_density_plain_cover(const struct sv_density_levels *levels, float sharp, int plane, float s, float t,
                             float lod, float rgb[3])
{
    int level = level_of(lod, SV_DENSITY_LEVELS - 1);
    struct sampler albedo = tile(levels->albedo[level], level, plane, true);
    float rgba[4];
    bilinear(&albedo, s, t, rgba);
    for (int c = 0; c < 3; c++)
        rgb[c] = rgba[c] / fmaxf(rgba[3], 1e-4f);
    float coverage = sharpened(rgba[3], lod, sharp);
    return coverage < 1.0f / 128 ? 0 : coverage;
}

void sv_density_plain_normal(const struct sv_density_levels *levels, int plane, float s, float t, float lod,
                             float normal[4])
{
    int level = level_of(lod, SV_DENSITY_LEVELS - 1);
    struct sampler normals = tile(levels->normal[level], level, plane, false);
    bilinear(&normals, s, t, normal);
    for (int c = 0; c < 3; c++)
        normal[c] = normal[c] * 2 - 1;
}

float sv_density_finer(const struct sv_density *density, float lod)
{
    float at = fminf(fmaxf(lod - (float)SV_DENSITY_SCALE_FIRST, 0), SV_DENSITY_SCALES - 1), sum = 0;
    for (int k = 0; k < SV_DENSITY_SCALES; k++)
        sum += density->finer[k] * fmaxf(0, 1 - fabsf(at - (float)k));
    return sum;
}

void sv_density_plain_look(const struct sv_density *density, const struct sv_density_levels *levels,
                           float sharp, int plane, float s, float t, float lod, struct sv_density_look *look)
{
    float g[4];
    *look = (struct sv_density_look){0};
    look->coverage = sv_density_plain_cover(levels, sharp, plane, s, t, lod, look->rgb);
    if (look->coverage == 0) {
        *look = (struct sv_density_look){0};
        return;
    }
    sv_density_plain_normal(levels, plane, s, t, lod, g);
    memcpy(look->normal, g, sizeof look->normal);
    look->occlusion = g[3];
    look->translucency = translucency_of(density, look->rgb);
    set_light(density, plane, s, t, look);
}

/* Step (2) of paper 3.5: eq. 1 of the billboard's own coordinate. */
static float period_of(const struct sv_density *density, float code)
{
    return density->period_min + (density->period_max - density->period_min) * unit((code * 255 - 1) / 253);
}

void sv_density_paper_look(const struct sv_density *density, const uint8_t *texels,
                           uint8_t *const leaf[SV_DENSITY_LEAF_LEVELS], int plane, float s, float t,
                           const float per_px[2], struct sv_density_look *look)
{
    struct sampler density_at = tile(texels, 0, plane, false);
    float code[4], rgba[4] = {density->wood[0], density->wood[1], density->wood[2], 1}, occlusion[4];
    *look = (struct sv_density_look){0};
    bilinear(&density_at, s, t, code);
    float low = fminf(code[0], code[1]);
    bool wood = low > 254.5f / 255;
    if (low < 1.0f / 255)
        return;
    if (!wood) {
        float x = s * SV_DENSITY_UV_SIDE / period_of(density, code[0]),
              y = t * SV_DENSITY_UV_SIDE / period_of(density, code[1]);
        float wide = fmaxf(per_px[0] / period_of(density, code[0]), per_px[1] / period_of(density, code[1]));
        int level = level_of(log2f(wide * SV_DENSITY_LEAF_SIDE), SV_DENSITY_LEAF_LEVELS - 3);
        int side = SV_DENSITY_LEAF_SIDE >> level;
        bilinear(&(struct sampler){leaf[level], side, side, true, true}, x - floorf(x), y - floorf(y), rgba);
    }
    if (rgba[3] < 0.5f)
        return;
    float n[2] = {code[2] * 2 - 1, code[3] * 2 - 1};
    memcpy(look->rgb, rgba, sizeof look->rgb);
    look->coverage = 1;
    look->normal[0] = n[0];
    look->normal[1] = n[1];
    look->normal[2] = sqrtf(fmaxf(0, 1 - n[0] * n[0] - n[1] * n[1]));
    look->translucency = wood ? 0 : translucency_of(density, look->rgb);
    set_light(density, plane, s, t, look);
    uint8_t light[SV_DENSITY_LIGHT_SIDE * SV_DENSITY_LIGHT_SIDE * 4];
    sv_density_occlusion(density, plane, light);
    bilinear(&(struct sampler){light, SV_DENSITY_LIGHT_SIDE, SV_DENSITY_LIGHT_SIDE, false, false}, s, t,
             occlusion);
    look->occlusion = occlusion[0];
}
