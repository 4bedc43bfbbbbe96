/* texels.h - the ray-cast truth of a part of a scene, as a relief panel holds it: some trees, see-through, or
 * the terrain and the objects, opaque; in the light of the whole scene, whose every tree and object casts its
 * shadow on them, seen or not.
 *
 * Rows on demand, so that who refines panels in idle time can stop after each. One thread. */
#ifndef SV_TRUTH_TEXELS_H
#define SV_TRUTH_TEXELS_H

#include "core/truth/truth.h"

struct sv_truth_part;

/* The trees scene.forest.trees[trees[k]], to be looked at alone; borrows truth for life. Some 4 us and 0.5 KB
 * a tree. A part is of the scene as it is now: after a change it is only to be destroyed. SV_ENOMEM,
 * SV_EINTERNAL. */
SV_MUST_CHECK enum sv_status sv_truth_part_create(const struct sv_truth *truth, const uint32_t *trees,
                                                  uint32_t count, struct sv_truth_part **part,
                                                  struct sv_error *error);
void sv_truth_part_destroy(struct sv_truth_part *part); /* NULL is legal */

struct sv_truth_texels_options {
    int samples;  /* a texel: 1, 4, 16, 64, positions of sv_camera_sample_offset */
    bool shadows; /* are cast, */
    bool trees;   /* by trees, too; else by terrain and objects alone */
};

/* Row `row` of the camera's picture (width texels) of trees. light: mean premultiplied colour in linear light
 * and coverage, each sample clipped to 1; inverse_m: mean of 1 / Z (Z along forward, from the camera's near
 * plane on) over the samples that hit, 0 where none does. */
void sv_truth_trees_row(const struct sv_truth_part *part, const struct sv_camera *camera,
                        const struct sv_light *light, const struct sv_truth_texels_options *options, int row,
                        float (*light_out)[4], float *inverse_m);
/* The same of terrain and objects. A texel shows the surface that its middle sees, or nothing: inverse_m is
 * that of the middle, light_out the mean of those samples whose 1 / Z differs from it by at most `apart`,
 * alpha 1. */
void sv_truth_ground_row(const struct sv_truth *truth, const struct sv_camera *camera,
                         const struct sv_light *light, const struct sv_truth_texels_options *options,
                         double apart, int row, float (*light_out)[4], float *inverse_m);

#endif
