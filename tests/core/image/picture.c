/* picture.c - value noise and two ridges; nothing but integers hashed to floats, so equal on every machine.
 */
#include "tests/core/image/picture.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/rng.h"

static float hash_unit(int x, int y, uint64_t seed)
{
    uint64_t h = sv_mix64((uint64_t)(uint32_t)x * UINT64_C(0x9E3779B97F4A7C15) + (uint32_t)y + (seed << 40));
    return (float)(h >> 40) * 0x1p-24f;
}

/* Smooth value noise of the given period, 0..1. */
static float noise(float x, float y, float period, uint64_t seed)
{
    float fx = x / period, fy = y / period;
    int ix = (int)floorf(fx), iy = (int)floorf(fy);
    float u = fx - (float)ix, v = fy - (float)iy;
    u = u * u * (3 - 2 * u), v = v * v * (3 - 2 * v);
    float a = hash_unit(ix, iy, seed), b = hash_unit(ix + 1, iy, seed);
    float c = hash_unit(ix, iy + 1, seed), d = hash_unit(ix + 1, iy + 1, seed);
    return (a + (b - a) * u) * (1 - v) + (c + (d - c) * u) * v;
}

static void make(int width, int height, int channels, enum sv_pixel_type type, struct sv_image *image)
{
    struct sv_error error;
    if (sv_image_alloc(width, height, channels, type, image, &error) != SV_OK) {
        fprintf(stderr, "picture: %s\n", error.message);
        abort();
    }
}

static float ridge(float x, float size, uint64_t seed)
{
    return noise(x, 0, size / 3, seed) * 0.12f + noise(x, 0, size / 17, seed + 1) * 0.03f;
}

static float pixel(float x, float y, float w, float h, unsigned char rgba[4], uint32_t *id)
{
    float t = y / h, far_ridge = 0.28f + ridge(x, w, 1), near_ridge = 0.42f + ridge(x, w, 5);
    float r, g, b, depth;
    if (t < far_ridge) {
        r = 120 + 110 * t, g = 165 + 70 * t, b = 225 + 20 * t, depth = INFINITY, *id = 0;
    } else if (t < near_ridge) {
        float n = noise(x, y, 3, 11) * 26 + noise(x, y, 19, 12) * 22;
        r = 75 + n, g = 98 + n, b = 105 + n, depth = 9000 - 6000 * (t - far_ridge), *id = 1;
    } else {
        float n = noise(x, y, 2, 21) * 55 + noise(x, y, 9, 22) * 60 + hash_unit((int)x, (int)y, 23) * 24;
        r = 18 + n * 0.75f, g = 38 + n, b = 10 + n * 0.45f;
        float crown = noise(x, y, 13, 24);
        depth = 40 / (t - near_ridge + 0.01f) + 3 * crown;
        *id = UINT32_C(0x01000000) + (uint32_t)(x / 13) + 977 * (uint32_t)(y / 13);
    }
    rgba[0] = (unsigned char)r, rgba[1] = (unsigned char)g, rgba[2] = (unsigned char)b;
    rgba[3] = isinf(depth) ? 0 : t < near_ridge ? 255 : (unsigned char)(255 - 60 * noise(x, y, 5, 31));
    return depth;
}

void picture_make(int width, int height, struct sv_image *rgba, struct sv_image *depth, struct sv_image *id)
{
    if (rgba)
        make(width, height, 4, SV_PIXEL_U8, rgba);
    if (depth)
        make(width, height, 1, SV_PIXEL_F32, depth);
    if (id)
        make(width, height, 1, SV_PIXEL_U32, id);
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            size_t i = (size_t)y * (size_t)width + (size_t)x;
            unsigned char p[4];
            uint32_t label = 0;
            float d = pixel((float)x, (float)y, (float)width, (float)height, p, &label);
            if (rgba)
                memcpy((unsigned char *)rgba->data + 4 * i, p, 4);
            if (depth)
                ((float *)depth->data)[i] = d;
            if (id)
                ((uint32_t *)id->data)[i] = label;
        }
}
