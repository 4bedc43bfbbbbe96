/* warm.h - pays once, before workers are forked, what each of them would pay at its first views: llvmpipe
 * compiles a shader when it is first drawn with, for each combination of attached layers, and what is
 * compiled before a fork is there after it. */
#ifndef SV_VIEW_WARM_H
#define SV_VIEW_WARM_H

#include "core/view/renderer.h"

/* Draws a small picture of these layers (a bit set, not 0) with shadows and one without, and drops them:
 * terrain at every distance, sky, trees in each form. Views of the same set of layers then cost the same from
 * the first one on, whatever their camera, sun, air and sky. A set takes 0.6 (depth, normals or ids alone)
 * to 1.2 s (colour) of CPU time. Errors as sv_renderer_draw. */
SV_MUST_CHECK enum sv_status sv_view_warm(struct sv_renderer *renderer, const struct sv_scene *scene,
                                          unsigned layers, struct sv_error *error);

#endif
