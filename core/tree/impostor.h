/* impostor.h - a tree species baked into 64 small pictures, seen from all over the upper hemisphere.
 *
 * Made once from the mesh by a rasteriser of our own (impostor_bake.c: orthographic, 3 x 3 samples a texel,
 * no GL, so that a bake is the same on every machine and may run in any process). Sprites (sprite.h) are
 * baked from the same frames, larger, and are what is drawn; tests of shade.h read this one. Each picture
 * ("frame") keeps, prefiltered: premultiplied albedo and coverage; the mean of the unit normals turned to the
 * viewer (its length falls where normals scatter: the light needs that), and sky occlusion.
 *
 * Frames stand on rings of equal elevation instead of the octahedral grid of Brucks (2018): trees are mostly
 * seen from elevations of 0 to 40 degrees, where 8 x 8 octahedral frames leave gaps of 27 and 37 degrees;
 * these rings leave 10 to 18 (own choice; the zenith is a frame of its own, so a map seen straight down is
 * exact).
 *
 * Instead of a depth texture each frame has the plane that fits the depth of what it shows (least squares,
 * with the stem's foot as a heavy point). The quad is drawn in that plane, in space: between frames every
 * point near the plane moves as it should, the foot stays on its place, and a fragment costs nothing for it
 * (own derivation, bake.c). */
#ifndef SV_TREE_IMPOSTOR_H
#define SV_TREE_IMPOSTOR_H

#include "core/tree/mesh.h"

enum {
    SV_IMPOSTOR_FRAMES = 64,
    SV_IMPOSTOR_GRID = 8,   /* frames a side of the atlas */
    SV_IMPOSTOR_CELL = 128, /* texels a side of a frame */
    SV_IMPOSTOR_SIDE = SV_IMPOSTOR_GRID * SV_IMPOSTOR_CELL,
    SV_IMPOSTOR_LEVELS = 8, /* mip levels: the last one has one texel a frame */
};

/* Kind of the blob in the store; the digit is raised whenever the bake or the layout changes. */
#define SV_IMPOSTOR_KIND "imp2"

/* Cell coordinates: s right, t down, [0, 1] over the frame's square cell. */
struct sv_impostor_frame {
    float right[3], up[3], toward[3]; /* unit, model space; toward the viewer */
    float origin[3], along_s[3],
        along_t[3];   /* the quad's point (s, t) is origin + s along_s + t along_t, model space */
    float scatter[6]; /* mean |n.l| of what it shows, for a unit l: l' S l, S symmetric: xx, yy, zz, xy, xz,
                         yz (right, up, toward) */
    float s_min, t_min, s_max, t_max; /* what is covered; min > max for a frame that shows nothing */
    float texels;                     /* of level 0, a model unit (tree height) */
};

struct sv_impostor {
    struct sv_impostor_frame frames[SV_IMPOSTOR_FRAMES];
    float translucency[4]; /* of what shows colour c (linear, not premultiplied): c . [0..2] + [3], to be held
                              in 0..1 */
    uint8_t *albedo; /* heap, SIDE x SIDE x 4: premultiplied linear colour in sRGB code, and coverage; row 0
                        at the top */
    uint8_t *normal; /* heap, SIDE x SIDE x 4: mean normal in (right, up, toward) as 127.5 + 127.5 m, and
                        occlusion */
    uint8_t *open; /* heap, SIDE x SIDE x 4: mean openness to the sun (mesh.h, open): slope along the model's
                      axes as 127.5 + 127.5 s, and mean */
};

/* The frame nearest to the direction (model space, towards the viewer, any length; 0 or NaN: frame 0). Below
 * the horizon the lowest ring serves. */
int sv_impostor_nearest(float x, float y, float z);
/* The frames about that direction and their shares (sum 1): one alone near to it; two, or four, in the zones
 * of width 2 half (of the way from frame to frame, 0 < half <= 1/2) where the nearest one changes, so that a
 * viewer who moves sees one pass into the other. Returns how many: 1 .. 4. 0 or NaN: frame 0. */
int sv_impostor_blend(float x, float y, float z, float half, int frames[4], float weights[4]);
/* Direction of a frame (unit). */
void sv_impostor_direction(int frame, float direction[3]);

/* Bakes a measured mesh (mesh.h). SV_ENOMEM. A mesh without triangles gives an empty impostor. Any process,
 * any thread; needs sv_color_init. */
SV_MUST_CHECK enum sv_status sv_impostor_bake(const struct sv_tree_mesh *mesh, struct sv_impostor *impostor,
                                              struct sv_error *error);
void sv_impostor_finish(struct sv_impostor *impostor); /* legal on a zeroed one */

/* One block of bytes (heap, caller frees) and back; load takes any bytes: SV_EFORMAT. */
SV_MUST_CHECK enum sv_status sv_impostor_save(const struct sv_impostor *impostor, void **data, size_t *bytes,
                                              struct sv_error *error);
SV_MUST_CHECK enum sv_status sv_impostor_load(const void *data, size_t bytes, struct sv_impostor *impostor,
                                              struct sv_error *error);

/* All mip levels of both textures, heap, level after level, level k SIDE >> k a side. Coverage and
 * premultiplied colour are averaged in linear light, normals and occlusion by coverage; where nothing is
 * covered normals continue what is near, so that filtering takes in no rubbish. No level mixes two frames. */
struct sv_impostor_levels {
    uint8_t *albedo[SV_IMPOSTOR_LEVELS], *normal[SV_IMPOSTOR_LEVELS], *open[SV_IMPOSTOR_LEVELS];
    float (*scatter)[SV_IMPOSTOR_FRAMES]
                    [6]; /* heap, a row a level: what the shader's guess from mean normals comes to */
};
/* By what the shader's guess of mean |n.l| must be multiplied, over a frame: frame's own scatter against the
 * level's. l is the unit direction to the sun in (right, up, toward). */
float sv_impostor_gain(const float truth[6], const float guess[6], const float l[3]);
SV_MUST_CHECK enum sv_status sv_impostor_levels_init(const struct sv_impostor *impostor,
                                                     struct sv_impostor_levels *levels,
                                                     struct sv_error *error);
void sv_impostor_levels_finish(struct sv_impostor_levels *levels);

#endif
