/* warp_scenes.h - made-up reliefs and cameras for the tests and benchmarks of the warp. */
#ifndef SV_TESTS_RELIEF_WARP_SCENES_H
#define SV_TESTS_RELIEF_WARP_SCENES_H

#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "core/base/simd.h"
#include "core/relief/warp.h"

static inline uint32_t scene_random(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    uint32_t x = (uint32_t)(*state >> 33) ^ (uint32_t)(*state >> 51);
    return x * 0x9E3779B9u ^ (x >> 15);
}

static inline double scene_uniform(uint64_t *state, double lo, double hi)
{
    return lo + (hi - lo) * (scene_random(state) / 4294967296.0);
}

enum scene_shape { SCENE_FLAT, SCENE_SMOOTH, SCENE_STEPPED, SCENE_NOISE };

/* Height (texels) of a shape at (u, v) of a relief with n texels a side; steps are higher than 2. */
static inline double scene_height(enum scene_shape shape, double u, double v, double n)
{
    double x = u / n, y = v / n, h = 0.02 * n * (sin(9 * x + 2 * y) + sin(7 * y - 3 * x));
    if (shape == SCENE_FLAT)
        return 0;
    if (shape == SCENE_STEPPED && hypot(x - 0.4, y - 0.45) < 0.15)
        h += 0.06 * n;
    if (shape == SCENE_STEPPED && fabs(x - 0.7) < 0.06 && fabs(y - 0.6) < 0.25)
        h += 0.09 * n;
    return h;
}

/* Texels of a source on the heap (free with scene_finish); colours vary smoothly, with a grid on them. */
static inline struct sv_warp_source scene_source(enum scene_shape shape, int width, int height, uint64_t seed)
{
    size_t n = (size_t)width * (size_t)height;
    float *t = malloc(n * sizeof *t);
    uint8_t(*color)[4] = malloc(n * sizeof *color);
    double side = width > height ? width : height;
    uint64_t state = seed;
    for (int j = 0; j < height; j++)
        for (int i = 0; i < width; i++) {
            size_t p = (size_t)j * (size_t)width + (size_t)i;
            t[p] = (float)scene_height(shape, i + 0.5, j + 0.5, side);
            if (shape == SCENE_NOISE)
                t[p] = (float)scene_uniform(&state, -2, 2);
            int line = i % 16 == 0 || j % 16 == 0;
            color[p][0] = (uint8_t)(255 * (i + 0.5) / width);
            color[p][1] = (uint8_t)(255 * (j + 0.5) / height);
            color[p][2] = (uint8_t)(line ? 200 : 60);
            color[p][3] = 255;
        }
    return (struct sv_warp_source){
        .width = width, .height = height, .t = t, .color = (const void *)color, .cut = 2};
}

static inline void scene_finish(struct sv_warp_source *source)
{
    free((void *)(uintptr_t)source->t);
    free((void *)(uintptr_t)source->color);
}

/* A frame of width x height texels of 1 m in world place `middle`, front towards (heading, pitch): f. */
static inline struct sv_relief_frame scene_frame(int width, int height, struct sv_vec3 middle,
                                                 struct sv_vec3 front)
{
    struct sv_relief_frame frame;
    struct sv_vec3 up = fabs(front.z) > 0.9 ? sv_vec3(0, 1, 0) : sv_vec3(0, 0, 1);
    frame.f = sv_normalize(front);
    frame.a = sv_normalize(sv_cross(up, frame.f));
    frame.b = sv_cross(frame.a, frame.f);
    frame.origin = sv_madd(sv_madd(middle, frame.a, -0.5 * width), frame.b, -0.5 * height);
    return frame;
}

/* A camera that sees `middle` in its own, from `distance` along a direction tilted by `angle` from front. */
static inline struct sv_camera scene_camera(const struct sv_relief_frame *frame, struct sv_vec3 middle,
                                            double distance, double angle, double turn, double roll,
                                            int width, int height, double texel_px)
{
    struct sv_camera camera = {.projection = SV_PROJECTION_PERSPECTIVE, .width = width, .height = height};
    struct sv_vec3 side =
        sv_add(sv_scale(sv_normalize(frame->a), cos(turn)), sv_scale(sv_normalize(frame->b), sin(turn)));
    struct sv_vec3 to_eye = sv_add(sv_scale(frame->f, cos(angle)), sv_scale(side, sin(angle)));
    struct sv_vec3 look = sv_scale(to_eye, -1);
    camera.eye = sv_madd(middle, to_eye, distance);
    camera.vfov_rad = 2 * atan(0.5 * height / (texel_px * distance));
    camera.near_m = 0.1;
    camera.far_m = 1e5;
    camera.ortho_height_m = height / texel_px;
    sv_camera_aim(&camera, atan2(look.x, look.y), asin(sv_clamp(look.z, -1, 1)), roll);
    return camera;
}

/* Levels that this machine has: scalar, SSE2, AVX2. */
static inline int level_count(void)
{
    return sv_simd_level() == SV_SIMD_AVX2 ? 3 : 2;
}

/* A source in UTM coordinates, seen from twice its width: angle off the front, turn about it, roll. */
static inline struct sv_warp_source posed(enum scene_shape shape, int width, int height, double angle,
                                          double turn, double roll, double texel_px, int picture,
                                          uint64_t seed)
{
    const struct sv_vec3 middle = {.x = 412345.5, .y = 4123456.25, .z = 310};
    struct sv_warp_source s = scene_source(shape, width, height, seed);
    struct sv_relief_frame frame = scene_frame(width, height, middle, sv_vec3(0.3, -1, 0.2));
    struct sv_camera camera =
        scene_camera(&frame, middle, 2.0 * width, angle, turn, roll, picture, picture, texel_px);
    sv_warp_map_from_camera(&frame, &camera, 0, 0, &s.map);
    return s;
}

#endif
