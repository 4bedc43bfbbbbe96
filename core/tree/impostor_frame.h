/* impostor_frame.h - one frame of a mesh, drawn and summed up texel by texel: what the impostors are boiled
 * down from. Private to core/tree. */
#ifndef SV_TREE_IMPOSTOR_FRAME_H
#define SV_TREE_IMPOSTOR_FRAME_H

#include "core/tree/impostor.h"
#include "core/tree/impostor_raster.h"
#include "core/tree/least_squares.h"

/* Sums over the samples of a texel that show something; sums of neighbours are the coarser texel's. */
struct sv_frame_texel {
    float count; /* of such samples */
    float rgb[3], normal[3], occlusion, depth, translucency;
    float open[4]; /* openness to the sun, slope in model space, and mean */
};

struct sv_frame_bake {
    int cell, sub; /* texels a side, samples a side of a texel */
    struct sv_raster raster;
    struct sv_raster_view view;
    struct sv_frame_texel *texels; /* heap, cell x cell, row 0 at the top */
    /* Of the frame that was drawn last: */
    struct sv_impostor_frame frame;
    int box[4]; /* texels that show something: first and last + 1 column, then row; empty: first > last */
    double plane[3];          /* depth towards the viewer = plane[0] + plane[1] x + plane[2] y, model units */
    double square[6], weight; /* brightness x products of the normal's components */
};

/* Ready to draw frames of cell x cell texels of sub x sub samples. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_frame_bake_init(const struct sv_tree_mesh *mesh, int cell, int sub,
                                                struct sv_frame_bake *bake, struct sv_error *error);
void sv_frame_bake_finish(struct sv_frame_bake *bake); /* legal on a zeroed one */
/* Draws a frame: texels, frame, box and plane. */
void sv_frame_bake_draw(struct sv_frame_bake *bake, int index);

#endif
