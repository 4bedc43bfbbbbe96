/* impostor_raster.h - which triangle is seen at each sample of an orthographic picture of a mesh: the
 * z-buffer of the bakes (sprite_bake.c, cloud_bake.c).
 *
 * Keeps only depth and triangle; what a sample looks like is worked out once, for what is seen. The alpha
 * test is that of mesh.h, on masks prepared at no less than 256 texels a side. Private to core/tree. */
#ifndef SV_TREE_IMPOSTOR_RASTER_H
#define SV_TREE_IMPOSTOR_RASTER_H

#include "core/tree/mesh.h"

enum { SV_RASTER_NONE = -1 };

/* A material's texture as the bake reads it: nearest texel, alpha decided. */
struct sv_raster_texture {
    int width, height;
    uint8_t *texels; /* heap; sRGB r, g, b; NULL: no texture */
    uint8_t *mask; /* in the same block: a bit a texel, from the lowest: the alpha test keeps it. (In bytes it
                      would not stay in the first cache.) */
};

static inline bool sv_raster_texture_keeps(const struct sv_raster_texture *t, int i, int j)
{
    size_t at = (size_t)j * (size_t)t->width + (size_t)i;
    return t->mask[at / 8] >> at % 8 & 1;
}

struct sv_raster {
    const struct sv_tree_mesh *mesh;
    struct sv_raster_texture textures[SV_TREE_MATERIALS_MAX];
    int width, height; /* samples */
    size_t sample_room;
    uint32_t vertex_room;
    float *x, *y, *z;  /* of each vertex: samples right, samples down, model units towards the viewer */
    float *depth;      /* width x height, row 0 at the top */
    int32_t *triangle; /* width x height: index of the triangle's first index, or NONE */
    uint8_t *material; /* width x height: valid where triangle is not NONE */
};

/* Where the picture lies: sample (i, j) of the cell is at left + (i + 0.5) step along right, top - (j + 0.5)
 * step along up. */
struct sv_raster_view {
    const float *right, *up, *toward;
    float left, top, step;
};

/* width, height 1 .. 16384. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_raster_init(const struct sv_tree_mesh *mesh, int width, int height,
                                            struct sv_raster *raster, struct sv_error *error);
void sv_raster_finish(struct sv_raster *raster);
/* Takes another mesh of the same materials; x, y, z are the caller's to fill. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_raster_set_mesh(struct sv_raster *raster, const struct sv_tree_mesh *mesh,
                                                struct sv_error *error);
/* Another size of picture. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_raster_resize(struct sv_raster *raster, int width, int height,
                                              struct sv_error *error);
/* Weights of the seen triangle's corners at sample (i, j), which shows one. */
void sv_raster_weights(const struct sv_raster *raster, int i, int j, float weights[3]);
/* For a square raster: sets the square view that just holds the mesh, and transforms the vertices. */
void sv_raster_aim(struct sv_raster *raster, struct sv_raster_view *view);
void sv_raster_draw(struct sv_raster *raster);
/* True where the material's alpha test keeps texture position (u, v). */
bool sv_raster_kept(const struct sv_raster *raster, int material, float u, float v);
/* Colour (linear, base colour included) of the texture at uv. */
void sv_raster_color(const struct sv_raster *raster, int material, float u, float v, float rgb[3]);

#endif
