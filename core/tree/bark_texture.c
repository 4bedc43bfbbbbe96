/* bark_texture.c - bark drawn procedurally, one tile for each habit that repeats in both directions.
 *
 * Rows run along the stem (v), columns around it (u). Each bark is a few layers of periodic value noise: a
 * relief (furrows, rings, scales) that darkens its own valleys, and patches of colour (lichen, lenticels).
 * Colours are sRGB codes. Own drawing. */
#include "core/tree/grow_math.h"
#include "core/tree/grow_parts.h"

enum { SIDE = 256 };

struct bark_style {
    double ridge[3], valley[3], patch[3]; /* colours */
    int across, along;                    /* cells of the main relief around and along */
    double crease;                        /* 0: soft noise; 1: sharp furrows */
    double rings;                         /* weight of rings across the stem */
    int ring_count;
    double patches; /* weight of the patches' colour */
};

static const struct bark_style STYLES[SV_HABIT_COUNT] = {
    /* beech: smooth grey with fine lines across and lichen */
    [SV_HABIT_BROADLEAF] = {{122, 116, 104}, {84, 78, 68}, {136, 140, 116}, 5, 14, 0.25, 0.25, 10, 0.35},
    /* spruce: red-brown scales */
    [SV_HABIT_CONIFER] = {{108, 88, 72}, {56, 43, 34}, {122, 112, 98}, 9, 9, 0.75, 0.0, 1, 0.25},
    /* poplar: grey-brown, furrowed lengthwise */
    [SV_HABIT_POPLAR] = {{118, 108, 92}, {58, 50, 40}, {104, 106, 84}, 10, 3, 0.85, 0.0, 1, 0.20},
    /* bush: brown, smooth, dotted */
    [SV_HABIT_SHRUB] = {{104, 88, 70}, {72, 58, 44}, {126, 112, 92}, 6, 5, 0.3, 0.1, 6, 0.30},
    /* palm: rings of leaf scars */
    [SV_HABIT_PALM] = {{124, 110, 92}, {66, 55, 43}, {100, 94, 82}, 7, 6, 0.5, 0.75, 4, 0.25},
};

static double fractal(double u, double v, int across, int along, uint64_t seed)
{
    double sum = 0, weight = 0.5;
    for (int k = 0; k < 4; k++, weight *= 0.55) {
        int scale = 1 << k;
        sum += weight * sv_grow_noise(u * across * scale, v * along * scale, across * scale, along * scale,
                                      seed + (uint64_t)k);
    }
    return sum; /* about -0.8 .. 0.8 */
}

static void draw_texel(const struct bark_style *style, double u, double v, uint64_t seed, uint8_t texel[4])
{
    double bend = 0.05 * sv_grow_noise(u * 4, v * 4, 4, 4, seed + 50);
    double soft = 0.5 + 0.6 * fractal(u + bend, v, style->across, style->along, seed);
    double crest = 1 - 2.6 * fabs(fractal(u + bend, v, style->across, style->along, seed + 10));
    double relief = soft + style->crease * ((crest < 0 ? 0 : 1 - crest) - soft);
    double wave = v * style->ring_count + 0.25 * sv_grow_noise(u * 6, v * 6, 6, 6, seed + 20);
    double phase = wave - floor(wave), ring = phase < 0.25 ? phase / 0.25 : 1 - 0.35 * (phase - 0.25);
    relief = sv_clamp(relief + style->rings * (ring - 0.5), 0, 1);
    double patch = sv_clamp(2.2 * fractal(u, v, 3, 3, seed + 30) - 0.1, 0, 1) * style->patches;
    double grain = 1 + 0.09 * sv_grow_noise(u * 96, v * 96, 96, 96, seed + 40);
    for (int c = 0; c < 3; c++) {
        double wood = style->valley[c] + relief * (style->ridge[c] - style->valley[c]);
        double shade = (wood + patch * (style->patch[c] - wood)) * grain;
        texel[c] = (uint8_t)sv_clamp(shade + 0.5, 0, 255);
    }
    texel[3] = 255;
}

enum sv_status sv_bark_texture(enum sv_habit habit, uint64_t seed, struct sv_image *image,
                               struct sv_error *error)
{
    struct sv_image out;
    enum sv_status status = sv_image_alloc(SIDE, SIDE, 4, SV_PIXEL_U8, &out, error);
    if (status != SV_OK)
        return status;
    for (int j = 0; j < SIDE; j++)
        for (int i = 0; i < SIDE; i++)
            draw_texel(&STYLES[habit], (i + 0.5) / SIDE, (j + 0.5) / SIDE, sv_mix64(seed + 5),
                       (uint8_t *)out.data + 4 * ((size_t)j * SIDE + (size_t)i));
    *image = out;
    return SV_OK;
}
