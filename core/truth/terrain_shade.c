#include "core/truth/terrain_shade.h"

#include <math.h>

#include "core/base/color.h"
#include "core/terrain/detail.h"

/* Bilinear taps of a texture whose sample (0, 0) is at position 0; clamped to the border. */
struct taps {
    size_t at[4];
    float fu, fv;
};

static void find_taps(double x, double y, int width, int height, struct taps *taps)
{
    x = sv_clamp(x, 0, width - 1);
    y = sv_clamp(y, 0, height - 1);
    int i = (int)x, j = (int)y;
    int i1 = i + 1 < width ? i + 1 : i, j1 = j + 1 < height ? j + 1 : j;
    size_t w = (size_t)width;
    taps->at[0] = (size_t)j * w + (size_t)i;
    taps->at[1] = (size_t)j * w + (size_t)i1;
    taps->at[2] = (size_t)j1 * w + (size_t)i;
    taps->at[3] = (size_t)j1 * w + (size_t)i1;
    taps->fu = (float)(x - i);
    taps->fv = (float)(y - j);
}

static float blend(const struct taps *t, float a, float b, float c, float d)
{
    float low = a + (b - a) * t->fu, high = c + (d - c) * t->fu;
    return low + (high - low) * t->fv;
}

void sv_terrain_shade(const struct sv_terrain *terrain, double x, double y, double pixel_m,
                      struct sv_vec3 to_viewer, float albedo[3], struct sv_vec3 *normal)
{
    const struct sv_heightfield *f = &terrain->field;
    double gi = (x - f->x0) / f->dx, gj = (y - f->y0) / f->dy;
    struct taps t;
    const struct sv_image *image = &terrain->albedo;
    find_taps(gi / (f->width - 1) * image->width - 0.5, gj / (f->height - 1) * image->height - 0.5,
              image->width, image->height, &t);
    const uint8_t *p = image->data;
    for (int c = 0; c < 3; c++)
        albedo[c] = blend(&t, sv_linear_from_srgb8[p[t.at[0] * 4 + (size_t)c]],
                          sv_linear_from_srgb8[p[t.at[1] * 4 + (size_t)c]],
                          sv_linear_from_srgb8[p[t.at[2] * 4 + (size_t)c]],
                          sv_linear_from_srgb8[p[t.at[3] * 4 + (size_t)c]]);
    find_taps(gi, gj, f->width, f->height, &t);
    p = terrain->normal.data;
    float n[2];
    for (int c = 0; c < 2; c++)
        n[c] = (blend(&t, p[t.at[0] * 2 + (size_t)c], p[t.at[1] * 2 + (size_t)c], p[t.at[2] * 2 + (size_t)c],
                      p[t.at[3] * 2 + (size_t)c]) -
                128.0f) /
               127.0f;
    double z2 = 1 - (double)n[0] * (double)n[0] - (double)n[1] * (double)n[1];
    *normal = sv_normalize(sv_vec3((double)n[0], (double)n[1], sqrt(fmax(z2, 0))));
    double texel_m = (f->width - 1) * f->dx / image->width;
    sv_terrain_detail_apply(x, y, pixel_m, sv_dot(*normal, to_viewer), texel_m, albedo);
}
