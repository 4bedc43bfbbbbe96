/* density_private.h - what the files of density.h share: a plane's UV texture and the texels' means. */
#ifndef SV_TREE_DENSITY_PRIVATE_H
#define SV_TREE_DENSITY_PRIVATE_H

#include "core/tree/cloud_bake.h"
#include "core/tree/density.h"

/* The UV texture has a border that shows nothing, so that windows may reach over the edge. */
enum {
    SV_DENSITY_BORDER = 8,
    SV_DENSITY_UV_STRIDE = SV_DENSITY_UV_SIDE + 2 * SV_DENSITY_BORDER,
    SV_DENSITY_TEXELS = SV_DENSITY_TILE * SV_DENSITY_TILE,
};

/* Means over a texel's 8 x 8 pixels that show something. */
struct sv_density_cell {
    float coverage, leaf; /* shares of all pixels: that show something; a leaf */
    float normal[3];      /* plane's axes, turned to its front */
    float rgb[3];         /* linear */
    float translucency;
};

struct sv_density_uv {
    uint8_t *u, *v, *leaf; /* UV_STRIDE squared: texture coordinates of 0..255, and 1 where a leaf is seen */
};

struct sv_density_work {
    const struct sv_tree_mesh *mesh;
    const struct sv_tree_cloud *cloud;
    struct sv_cloud_bake bake;
    struct sv_density_uv uv;       /* of the plane at hand */
    struct sv_density_cell *cells; /* TEXELS a plane, all planes */
    struct sv_density *out;
    uint8_t *rgba; /* WIDTH x HEIGHT x 4 */
};

/* density_sample.c: draws a plane and fills uv, its cells and its sv_density_plane. */
SV_MUST_CHECK enum sv_status sv_density_sample_plane(struct sv_density_work *work, int plane,
                                                     struct sv_error *error);
void sv_density_choose_leaf(struct sv_density_work *work);

/* density_paper.c: periods of the plane at hand, TEXELS of each; then all planes' texels. */
struct sv_density_periods {
    float *x, *y; /* px; 0: no leaf */
};
void sv_density_paper_range(struct sv_density_work *work); /* of periods; after the leaf is chosen */
void sv_density_paper_analyse(const struct sv_density_work *work, struct sv_density_periods *periods,
                              int plane);
void sv_density_paper_texels(struct sv_density_work *work, const struct sv_density_periods *periods);

/* density_plain.c */
void sv_density_plain_texels(struct sv_density_work *work);

/* density_tune.c: sets out->finer, once the file is written; uses up rgba and the bake. */
SV_MUST_CHECK enum sv_status sv_density_tune(struct sv_density_work *work, struct sv_error *error);

/* Texel t of a plane's tile in a picture of the atlas. */
static inline uint8_t *sv_density_texel(uint8_t *rgba, int plane, int t)
{
    int x = plane % SV_DENSITY_COLUMNS * SV_DENSITY_TILE + t % SV_DENSITY_TILE;
    int y = plane / SV_DENSITY_COLUMNS * SV_DENSITY_TILE + t / SV_DENSITY_TILE;
    return rgba + 4 * ((size_t)y * SV_DENSITY_WIDTH + (size_t)x);
}

static inline uint8_t sv_density_unit(float v) /* 0..1 to 8 bits; NaN: 0 */
{
    return (uint8_t)((v > 0 ? v < 1 ? v : 1 : 0) * 255.0f + 0.5f);
}

#endif
