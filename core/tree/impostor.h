/* impostor.h - the 64 directions from which a tree species is baked into pictures, seen from all over the upper
 * hemisphere, and what is known of each picture ("frame") besides its texels. Sprites (sprite.h) are drawn from such
 * pictures, shade.h takes its silhouettes from them.
 *
 * Frames stand on rings of equal elevation instead of the octahedral grid of Brucks (2018): trees are mostly
 * seen from elevations of 0 to 40 degrees, where 8 x 8 octahedral frames leave gaps of 27 and 37 degrees;
 * these rings leave 10 to 18 (own choice; the zenith is a frame of its own, so a map seen straight down is
 * exact).
 *
 * Instead of a depth texture each frame has the plane that fits the depth of what it shows (least squares,
 * with the stem's foot as a heavy point). The quad is drawn in that plane, in space: between frames every
 * point near the plane moves as it should, the foot stays on its place, and a fragment costs nothing for it
 * (own derivation, impostor_frame.c). */
#ifndef SV_TREE_IMPOSTOR_H
#define SV_TREE_IMPOSTOR_H

#include "core/tree/mesh.h"

enum {
    SV_IMPOSTOR_FRAMES = 64,
    SV_IMPOSTOR_GRID = 8,   /* frames a side of the atlas */
    SV_IMPOSTOR_CELL = 128, /* texels a side of a frame */
    SV_IMPOSTOR_SIDE = SV_IMPOSTOR_GRID * SV_IMPOSTOR_CELL,
};

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

/* The frame nearest to the direction (model space, towards the viewer, any length; 0 or NaN: frame 0). Below
 * the horizon the lowest ring serves. */
int sv_impostor_nearest(float x, float y, float z);
/* The frames about that direction and their shares (sum 1): one alone near to it; two, or four, in the zones
 * of width 2 half (of the way from frame to frame, 0 < half <= 1/2) where the nearest one changes, so that a
 * viewer who moves sees one pass into the other. Returns how many: 1 .. 4. 0 or NaN: frame 0. */
int sv_impostor_blend(float x, float y, float z, float half, int frames[4], float weights[4]);
/* Direction of a frame (unit). */
void sv_impostor_direction(int frame, float direction[3]);

/* By what the shader's guess of mean |n.l| must be multiplied, over a frame: frame's own scatter against the
 * level's. l is the unit direction to the sun in (right, up, toward). */
float sv_impostor_gain(const float truth[6], const float guess[6], const float l[3]);

#endif
