/* ground_rows.h - the job of ground.c as its row kernels take it. Private to core/terrain. */
#ifndef SV_TERRAIN_GROUND_ROWS_H
#define SV_TERRAIN_GROUND_ROWS_H

#include <stdbool.h>
#include <stdint.h>

#include "core/scene/light.h"
#include "core/terrain/detail.h"
#include "core/terrain/shadow_page.h"

enum { SV_GROUND_LEVELS = 16, SV_GROUND_CODES = 4096 };
/* Of the texel that SV_SHADOW_PAGE_TEXEL_PX tells, where pages are refined: these are read at several places
 * a pixel. On a walk among 5,000 trees at 1.7 m, against 64 samples of the truth
 * (tests/experiments/walkthrough --refine 16 --shadows): the ground is off by 1.31 levels with 0.5 and four
 * places, 1.39 with 0.72 and two, 1.58 with 1 and one; with texels of 16 mm at the finest 1.46, 1.49
 * and 1.58. As built, 4.18. */
#define SV_GROUND_REFINED_SHARE 0.5f
enum { SV_GROUND_PAGE_LEVELS = SV_SHADOW_PAGE_FINER + SV_SHADOW_PAGE_LEVELS };

/* An image and its mip levels. */
struct sv_ground_map {
    const uint8_t *base; /* level 0 */
    const uint8_t *rest; /* the others, one after the other */
    int levels;
    int32_t width[SV_GROUND_LEVELS], height[SV_GROUND_LEVELS];
    int32_t first[SV_GROUND_LEVELS]; /* texel of rest with which a level begins */
};

struct sv_ground_job {
    /* picture and camera */
    int width;
    const float *depth;
    const uint8_t *hidden; /* or NULL */
    uint8_t *rgba;
    bool orthographic, sky;
    float near_m, far_m, pixel; /* pixel: its size at depth 1 (orthographic: anywhere), m */
    float centre_x,
        centre_y; /* picture position of the axis, px, less what the sample is off the pixel's centre */
    float right[3], up[3], forward[3];
    /* light */
    float to_sun[3], sun[3], sky_light[3], bounce[3], zenith[3], horizon[3], air[3];
    float air_per_m; /* 0: off */
    /* ground: texture coordinates (0 .. 1 over a level's texels) of local x, y: scale, offset */
    const struct sv_ground_map *albedo, *normal;
    float albedo_uv[4], normal_uv[4];
    float albedo_lod, normal_lod; /* log2 of a texel, m */
    float texel_m;                /* of the albedo, as the detail has it */
    const uint8_t *codes; /* SV_GROUND_CODES: sRGB of (k / (SV_GROUND_CODES - 1)), and three bytes to spare */
    const float *linear;  /* SV_GROUND_CODES: what sRGB k / (SV_GROUND_CODES - 1) is in linear light */
    /* detail */
    const uint8_t *tile;
    int32_t tile_first[SV_TERRAIN_DETAIL_LEVELS]; /* byte with which a level begins */
    float tile_eye[SV_DETAIL_COUNT][2];
    float tile_turn[SV_DETAIL_COUNT][2]; /* cosine, sine, both divided by the period */
    float tile_share[SV_DETAIL_COUNT], tile_lod[SV_DETAIL_COUNT], tile_fade[SV_DETAIL_COUNT][2];
    /* shadows; NULL: none */
    struct sv_shadow_pages *pages;
    const uint8_t *light;
    bool refined; /* pages of a source are in use, */
    bool noting;  /* and all that are wanted are noted */
    int finest;
    /* of levels from -FINER on: the eye, texels, from its page's corner */
    float page_x[SV_GROUND_PAGE_LEVELS], page_y[SV_GROUND_PAGE_LEVELS];
    int32_t page_i[SV_GROUND_PAGE_LEVELS], page_j[SV_GROUND_PAGE_LEVELS];
};

typedef void sv_ground_row(const struct sv_ground_job *job, int y);
sv_ground_row sv_ground_row_plain, sv_ground_row_avx2;

/* sv_ground_shade by one of the kernels. */
struct sv_ground;
struct sv_ground_view;
void sv_ground_shade_by(const struct sv_ground *ground, const struct sv_ground_view *view, sv_ground_row *row,
                        uint8_t *rgba);

#endif
