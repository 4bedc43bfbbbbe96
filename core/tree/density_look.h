/* density_look.h - what drawing makes of a density texture when it is loaded, and the CPU twins of its
 * fragment shaders (tree_density.frag, tree_density_paper.frag), which a test holds them to.
 *
 * Pictures have a layer a plane; those of light are SV_DENSITY_LIGHT_SIDE a side. No GL, any thread. */
#ifndef SV_TREE_DENSITY_LOOK_H
#define SV_TREE_DENSITY_LOOK_H

#include "core/tree/density.h"

enum {
    SV_DENSITY_LIGHT_SIDE = 16,
    SV_DENSITY_LEAF_SIDE = 64,
    SV_DENSITY_LEAF_LEVELS = 7,
    SV_DENSITY_OUTLINE = 8
};

/* Light of plane k, side x side x 4, row 0 at the top: openness (slope along the model's axes as 127.5 +
 * 127.5 s, and mean), and occlusion in all channels. */
void sv_density_open(const struct sv_density *density, int plane, uint8_t *rgba);
void sv_density_occlusion(const struct sv_density *density, int plane, uint8_t *rgba);

/* Lines about what a plane shows: it lies where a s + b t <= outline[k], (a, b) = (cos, sin) of k 45 degrees,
 * (s, t) 0..1 over its rectangle, t down. -INFINITY: it shows nothing. texels: sv_density_texels. */
void sv_density_outline(const struct sv_density *density, const uint8_t *texels, int plane,
                        float outline[SV_DENSITY_OUTLINE]);

/* The picture of the species' leaf (density.leaf): all levels, level k LEAF_SIDE >> k a side, each a heap
 * block of the one that levels[0] begins; sRGB, straight alpha, which at every level passes the test "alpha
 * >= 1/2" for the share that the leaf's own test keeps. A species without leaves has a clear one. SV_ENOMEM.
 */
SV_MUST_CHECK enum sv_status sv_density_leaf_picture(const struct sv_density *density,
                                                     const struct sv_tree_mesh *mesh,
                                                     uint8_t *levels[SV_DENSITY_LEAF_LEVELS],
                                                     struct sv_error *error);

/* By what the coverage of level 0 must be multiplied, so that bilinear coverage of at least 1/2 takes up as
 * much of the planes as there is covered. */
float sv_density_sharp_scale(const struct sv_density *density, const uint8_t *texels);

/* Coverage that a pixel must have by level, so that what depth and ids are drawn of takes up as much of the
 * planes as is covered: a crown has them however far it is. */
void sv_density_bars(const struct sv_density *density, const struct sv_density_levels *levels,
                     float bars[SV_DENSITY_LEVELS]);

/* What a fragment finds before it is lit; all 0 where it is discarded. */
struct sv_density_look {
    float coverage, rgb[3], normal[3], occlusion, open[4],
        translucency; /* normal: plane's axes, mean, not unit */
};

/* Twin of tree_density.frag at (s, t) of a plane's rectangle, lod the level that the shader works out (log2
 * of texels a pixel, sv_density_finer added); sharp: sv_density_sharp_scale. */
void sv_density_plain_look(const struct sv_density *density, const struct sv_density_levels *levels,
                           float sharp, int plane, float s, float t, float lod, struct sv_density_look *look);
/* Its coverage and colour alone; and normal and occlusion. */
float sv_density_plain_cover(const struct sv_density_levels *levels, float sharp, int plane, float s, float t,
                             float lod, float rgb[3]);
void sv_density_plain_normal(const struct sv_density_levels *levels, int plane, float s, float t, float lod,
                             float normal[4]);
/* Twin of tree_density_paper.frag; texels: sv_density_texels; per_px: pixels of the UV texture a pixel of the
 * picture, along s and t. */
void sv_density_paper_look(const struct sv_density *density, const uint8_t *texels,
                           uint8_t *const leaf[SV_DENSITY_LEAF_LEVELS], int plane, float s, float t,
                           const float per_px[2], struct sv_density_look *look);

#endif
