/* impostor_raster.h - which triangle is seen at each sample of an orthographic picture of a mesh: the bake's
 * z-buffer.
 *
 * Keeps only depth and triangle; what a sample looks like is worked out once, for what is seen
 * (impostor_bake.c). The alpha test is that of mesh.h, on masks prepared at no less than 256 texels a side.
 * Private to core/tree. */
#ifndef SV_TREE_IMPOSTOR_RASTER_H
#define SV_TREE_IMPOSTOR_RASTER_H

#include "core/tree/mesh.h"

enum { SV_RASTER_NONE = -1 };

/* A material's texture as the bake reads it: nearest texel, alpha decided. */
struct sv_raster_texture {
    int width, height;
    uint8_t *texels; /* heap; sRGB r, g, b; NULL: no texture */
    uint8_t *mask;   /* in the same block: 1 where the alpha test keeps it */
};

struct sv_raster {
    const struct sv_tree_mesh *mesh;
    int side; /* samples */
    struct sv_raster_texture textures[SV_TREE_MATERIALS_MAX];
    float *x, *y, *z;  /* of each vertex: samples right, samples down, model units towards the viewer */
    float *depth;      /* side x side, row 0 at the top */
    int32_t *triangle; /* side x side: index of the triangle's first index, or NONE */
    uint8_t *material; /* side x side: valid where triangle is not NONE */
};

/* Where the picture lies: sample (i, j) of the cell is at left + (i + 0.5) step along right, top - (j + 0.5)
 * step along up. */
struct sv_raster_view {
    const float *right, *up, *toward;
    float left, top, step;
};

/* side: 1 .. 4096 samples. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_raster_init(const struct sv_tree_mesh *mesh, int side,
                                            struct sv_raster *raster, struct sv_error *error);
void sv_raster_finish(struct sv_raster *raster);
/* Sets the square view that just holds the mesh, and transforms the vertices. */
void sv_raster_aim(struct sv_raster *raster, struct sv_raster_view *view);
void sv_raster_draw(struct sv_raster *raster);
/* Colour (linear, base colour included) of the texture at uv. */
void sv_raster_color(const struct sv_raster *raster, int material, float u, float v, float rgb[3]);

#endif
