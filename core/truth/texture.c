#include "core/truth/texture.h"

#include <math.h>

#include "core/base/color.h"

struct taps {
    const uint8_t *p[4]; /* 00, 10, 01, 11 */
    float fu, fv;
};

static int wrap(int i, int n)
{
    i %= n;
    return i < 0 ? i + n : i;
}

static void find_taps(const struct sv_image *image, float u, float v, struct taps *taps)
{
    /* Into [0, 1) first: a texture coordinate of 1e6 still has its fraction, and the cast below stays legal.
     */
    float x = (u - floorf(u)) * (float)image->width - 0.5f, y = (v - floorf(v)) * (float)image->height - 0.5f;
    if (!(x >= -1 && x <= (float)image->width) || !(y >= -1 && y <= (float)image->height))
        x = y = 0; /* NaN and infinity in a model */
    float bx = floorf(x), by = floorf(y);
    int x0 = wrap((int)bx, image->width), x1 = wrap((int)bx + 1, image->width);
    int y0 = wrap((int)by, image->height), y1 = wrap((int)by + 1, image->height);
    const uint8_t *data = image->data;
    size_t w = (size_t)image->width;
    taps->p[0] = data + ((size_t)y0 * w + (size_t)x0) * 4;
    taps->p[1] = data + ((size_t)y0 * w + (size_t)x1) * 4;
    taps->p[2] = data + ((size_t)y1 * w + (size_t)x0) * 4;
    taps->p[3] = data + ((size_t)y1 * w + (size_t)x1) * 4;
    taps->fu = x - bx;
    taps->fv = y - by;
}

static float mix4(float a, float b, float c, float d, float fu, float fv)
{
    float top = a + (b - a) * fu, bottom = c + (d - c) * fu;
    return top + (bottom - top) * fv;
}

float sv_texture_alpha(const struct sv_image *image, float u, float v)
{
    struct taps t;
    find_taps(image, u, v, &t);
    return mix4(t.p[0][3], t.p[1][3], t.p[2][3], t.p[3][3], t.fu, t.fv) * (1.0f / 255.0f);
}

void sv_texture_rgba(const struct sv_image *image, float u, float v, float rgba[4])
{
    struct taps t;
    find_taps(image, u, v, &t);
    for (int c = 0; c < 3; c++)
        rgba[c] = mix4(sv_linear_from_srgb8[t.p[0][c]], sv_linear_from_srgb8[t.p[1][c]],
                       sv_linear_from_srgb8[t.p[2][c]], sv_linear_from_srgb8[t.p[3][c]], t.fu, t.fv);
    rgba[3] = mix4(t.p[0][3], t.p[1][3], t.p[2][3], t.p[3][3], t.fu, t.fv) * (1.0f / 255.0f);
}
