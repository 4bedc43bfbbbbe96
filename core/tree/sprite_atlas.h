/* sprite_atlas.h - a tree species baked into 64 pictures for drawing on the CPU (sprite.h).
 *
 * The directions, axes and planes of the frames are those of impostor.h; the texels are finer and laid out
 * for loads of 8 at a time: two 32-bit words a texel, colour and coverage in one, normal and prominence in
 * the other. What is smooth over a crown (sky occlusion, openness to the sun, depth off the frame's plane,
 * translucency) has texels two or four times as large. Each level of each frame is an array of its own, cut
 * to what is covered, with a border one texel wide that covers nothing; no level mixes two frames.
 *
 * All levels are made from the bake's sums, not from one another: coverage and every mean are rounded once.
 * Where nothing is covered, all but coverage continues what is near, so that filtering takes in no rubbish.
 */
#ifndef SV_TREE_SPRITE_ATLAS_H
#define SV_TREE_SPRITE_ATLAS_H

#include "core/tree/impostor.h"

enum {
    SV_SPRITE_PROMINENCE = 40, /* steps an rms */
    SV_SPRITE_CELL = 256,      /* texels of level 0 a side of a frame's square cell */
    SV_SPRITE_LEVELS = 9,      /* the last one has one texel a frame */
    SV_SPRITE_BLOCKS = 16,
};

/* Kind of the blob in the store; the digit is raised whenever the bake or the layout changes. */
#define SV_SPRITE_KIND "spr1"

struct sv_sprite_texel {
    uint8_t rgb[3];     /* mean albedo of what covers (straight): 255 times the root of the linear value */
    uint8_t coverage;   /* 255 times the share */
    uint8_t normal[3];  /* mean unit normal, turned to the viewer: 127.5 + 127.5 (right, up, toward) */
    uint8_t prominence; /* 128 + PROMINENCE times how far it stands out of the crown about it, in rms of its
                           frame */
};

struct sv_sprite_smooth {
    uint8_t occlusion;
    uint8_t
        open[4]; /* mean openness to the sun (mesh.h): slope along the model's axes, 127.5 + 127.5 s; mean */
    uint8_t depth; /* towards the viewer, off the frame's plane: first + step * code */
    uint8_t translucency;
    uint8_t unused;
};

/* Texel (i, j) of a level, i in -1 .. width, j in -1 .. height (border), is texel texel_first + (j + 1)
 * (width + 2) + i + 1. What is smooth there is at smooth_first + (j' + 1) sv_sprite_smooth_size(width, level)
 * + i' + 1 with i' = floor(i / 2^sv_sprite_shift(level)), j' likewise. */
static inline int sv_sprite_shift(int level)
{
    return level < 2 ? 2 : 1;
}
/* Smooth texels, border counted, along a side of `size` texels. */
static inline int sv_sprite_smooth_size(int size, int level)
{
    int shift = sv_sprite_shift(level);
    return ((size + (1 << shift) - 1) >> shift) + 2;
}
struct sv_sprite_level {
    uint32_t texel_first, smooth_first;
    int32_t width, height;
    /* What may be covered: the level with half of its border, width + 1 by height + 1 texels, is divided in
     * 16 x 16 blocks; bit 16 (j mod 2) + i of word j / 2: block (i, j) has a texel that covers, or lies
     * beside one. */
    uint32_t blocks[SV_SPRITE_BLOCKS / 2];
};

struct sv_sprite_frame {
    struct sv_impostor_frame of;                    /* texels: of level 0, a model unit */
    int32_t left, top;                              /* of the cut, in texels of level 0, even */
    float depth_first, depth_step;                  /* model units */
    float guess[SV_SPRITE_LEVELS][6];               /* impostor.h, sv_impostor_gain */
    struct sv_sprite_level level[SV_SPRITE_LEVELS]; /* width 0: the frame shows nothing */
};

struct sv_sprite_atlas {
    struct sv_sprite_frame frames[SV_IMPOSTOR_FRAMES];
    struct sv_sprite_texel *texels;  /* heap */
    struct sv_sprite_smooth *smooth; /* heap */
    size_t texel_count, smooth_count;
};

/* Bakes a measured mesh (mesh.h). SV_ENOMEM. A mesh without triangles gives frames that show nothing. Any
 * process, any thread. Some seconds. */
SV_MUST_CHECK enum sv_status sv_sprite_atlas_bake(const struct sv_tree_mesh *mesh,
                                                  struct sv_sprite_atlas *atlas, struct sv_error *error);
void sv_sprite_atlas_finish(struct sv_sprite_atlas *atlas); /* legal on a zeroed one */

/* One block of bytes (heap, caller frees) and back; load takes any bytes: SV_EFORMAT. */
SV_MUST_CHECK enum sv_status sv_sprite_atlas_save(const struct sv_sprite_atlas *atlas, void **data,
                                                  size_t *bytes, struct sv_error *error);
SV_MUST_CHECK enum sv_status sv_sprite_atlas_load(const void *data, size_t bytes,
                                                  struct sv_sprite_atlas *atlas, struct sv_error *error);

/* Bytes in memory. */
size_t sv_sprite_atlas_bytes(const struct sv_sprite_atlas *atlas);
/* What shade.h is made from: coverage of all frames at SV_IMPOSTOR_CELL texels a side, and the frames.
 * coverage: SV_IMPOSTOR_SIDE squared; frames: SV_IMPOSTOR_FRAMES; caller's. */
void sv_sprite_atlas_outline(const struct sv_sprite_atlas *atlas, struct sv_impostor_frame *frames,
                             uint8_t *coverage);

#endif
