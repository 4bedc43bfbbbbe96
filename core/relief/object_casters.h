/* object_casters.h - a relief object as the sun sees it: depth of its six faces in parallel light. Private to
 * object_shadow.c and its test.
 *
 * Nothing but the light moves, so that what casts is laid out once: the cells of each face (at half its
 * resolution: enough for a shadow, at a quarter of the cost) that need be drawn, and quarters of the cells
 * that are torn, all as quadrilaterals over the face, eight together. A change of light projects them (three
 * rows of an affine map) and asks them for pixels as the splat of pictures does (object_splat_kernel.h,
 * sv_relief_quad). Both sides cast: where no face shows what is turned to the light, its back is there (of
 * a knot's sunward texels 1.7 % are lit by mistake with one side, 1.1 % with both). Of a pixel the greatest
 * depth stays. */
#ifndef SV_RELIEF_OBJECT_CASTERS_H
#define SV_RELIEF_OBJECT_CASTERS_H

#include "core/relief/object.h"

/* Corner 0 at (u, v), counted in halves of a texel of the caster; corner 1 du beside it, 2 dv below, 3 both;
 * t: displ of the four. Eights are filled up with t = NaN. */
struct sv_relief_quads {
    int16_t u[8], v[8];
    float t[4][8];
};
/* Those of one face with the same du and dv, and its frame at half the resolution. */
struct sv_relief_quad_run {
    struct sv_relief_frame frame;
    int du, dv;
    size_t first, count; /* eights */
};
enum { SV_RELIEF_QUAD_RUNS = 5 * SV_RELIEF_FACES };
struct sv_relief_casters {
    struct sv_relief_quads *quads;
    size_t count;
    struct sv_relief_quad_run run[SV_RELIEF_QUAD_RUNS];
};

/* SV_ENOMEM. finish: of zeros is legal. */
SV_MUST_CHECK enum sv_status sv_relief_casters_init(const struct sv_relief_object *object,
                                                    struct sv_relief_casters *casters,
                                                    struct sv_error *error);
void sv_relief_casters_finish(struct sv_relief_casters *casters);

/* A depth map and how a run lies in it: x, y, depth by u, v, t, 1. */
struct sv_relief_map {
    float at[3][4];
    float du, dv;
    float *depth; /* width * height, each at least 1; pixel centres at + 0.5 */
    int width, height;
};
/* Draws `count` eights into it; scalar and AVX2 give the same bits. */
void sv_relief_cast_scalar(const struct sv_relief_map *map, const struct sv_relief_quads *quads,
                           size_t count);
void sv_relief_cast_avx2(const struct sv_relief_map *map, const struct sv_relief_quads *quads, size_t count);

#endif
