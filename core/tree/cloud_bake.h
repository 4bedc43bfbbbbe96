/* cloud_bake.h - draws what lies on a plane of a billboard cloud into a picture of any size: the source of
 * every texture that a plane has (colour, normals, light; texture coordinates for the density texture).
 *
 * A picture covers the plane's rectangle: sample (i, j) is at x = half[0] (2 (i + 0.5) / width - 1) along u,
 * y = half[1] (1 - 2 (j + 0.5) / height) along v. Of pieces that overlap the one in front (along the plane's
 * normal, where the tree has it) is seen. Two ways to read it:
 * - sv_cloud_bake_sample: one sample: which piece, its texture coordinates, colour, normal ... (paper 2's UV
 *   texture is this, drawn at 1024 x 1024);
 * - sv_cloud_bake_texel: means over a block of samples, for prefiltered textures. Draw with texels x s
 * samples a side. The alpha test is mesh.h's on masks of at least 256 texels a side (impostor_raster.h). No
 * GL, any thread, deterministic; sv_color_init has been called. 24 planes of 2048 x 2048 samples take some 2
 * s. */
#ifndef SV_TREE_CLOUD_BAKE_H
#define SV_TREE_CLOUD_BAKE_H

#include "core/tree/cloud.h"
#include "core/tree/impostor_raster.h"

enum { SV_CLOUD_BAKE_SIDE_MAX = 8192 };

struct sv_cloud_bake {
    const struct sv_tree_mesh *mesh;   /* borrowed */
    const struct sv_tree_cloud *cloud; /* borrowed */
    struct sv_raster raster;
    struct sv_tree_mesh placed; /* the plane's triangles, laid on it: z is depth; three vertices each */
    uint32_t *piece;            /* of each placed triangle */
    uint32_t triangle_room;
    int plane; /* what was drawn last; -1: nothing */
};

struct sv_cloud_sample {
    uint32_t piece; /* index in cloud.pieces */
    uint8_t material;
    bool leaf;
    float uv[2];    /* of the mesh's texture */
    float local[2]; /* the same in the piece's box: 0..1 from uv_lo to uv_hi */
    float rgb[3];   /* linear, base colour included */
    float
        normal[3]; /* the mesh's own, unit, in the plane's axes (u, v, normal), turned to its front: z >= 0 */
    float occlusion; /* mesh.h, 0..1 */
    float open[4];   /* mesh.h, slope along the model's axes and mean, / 127 */
    float depth;     /* in front of the plane, model units */
};

/* Means over the samples of a block that show something (all 0 when none does). */
struct sv_cloud_texel {
    float coverage, leaf; /* shares of all samples; leaf: those that show a leaf */
    float rgb[3];         /* linear, straight */
    float normal[3];      /* mean of unit normals, as above: its length falls where normals scatter */
    float occlusion, open[4];
    float translucency;
};

/* For pictures of up to width x height samples (1 .. SV_CLOUD_BAKE_SIDE_MAX). Borrows mesh and cloud, which
 * must belong to each other (sv_tree_cloud_check). SV_EINVAL, SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_cloud_bake_init(const struct sv_tree_mesh *mesh,
                                                const struct sv_tree_cloud *cloud, int width, int height,
                                                struct sv_cloud_bake *bake, struct sv_error *error);
void sv_cloud_bake_finish(struct sv_cloud_bake *bake); /* legal on a zeroed one */
/* Draws a plane; width, height within what init was given. SV_EINVAL, SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_cloud_bake_draw(struct sv_cloud_bake *bake, int plane, int width, int height,
                                                struct sv_error *error);
/* False where nothing is seen (sample is not written). i, j inside the picture. */
bool sv_cloud_bake_sample(const struct sv_cloud_bake *bake, int i, int j, struct sv_cloud_sample *sample);
/* Samples (i s .. i s + s - 1, j s .. j s + s - 1); those outside of the picture count as empty. */
void sv_cloud_bake_texel(const struct sv_cloud_bake *bake, int i, int j, int s, struct sv_cloud_texel *texel);
/* True where sample (i, j) shows something: cheap. */
static inline bool sv_cloud_bake_covered(const struct sv_cloud_bake *bake, int i, int j)
{
    const struct sv_raster *r = &bake->raster;
    return r->triangle[(size_t)j * (size_t)r->width + (size_t)i] != SV_RASTER_NONE;
}
/* The piece that it shows. */
static inline uint32_t sv_cloud_bake_piece(const struct sv_cloud_bake *bake, int i, int j)
{
    const struct sv_raster *r = &bake->raster;
    return bake->piece[r->triangle[(size_t)j * (size_t)r->width + (size_t)i] / 3];
}

#endif
