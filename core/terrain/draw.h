/* draw.h - the terrain drawn by OSMesa with view-dependent level of detail: a 4-8 mesh refined top-down by
 * screen-space error (Lindstrom and Pascucci 2002), without cracks by construction (lod.h). Geometry errors
 * are true bounds: the largest vertical distance between the triangle drawn and the full-detail surface below
 * it (computed once, kept on disk).
 *
 * Drawn are depth, ids and normals; what colour the ground has is decided for the pixels that see it
 * (ground.h). Depth test on, nothing blended; triangles come from near to far. Where the field ends there is
 * nothing. */
#ifndef SV_TERRAIN_DRAW_H
#define SV_TERRAIN_DRAW_H

#include "core/base/store.h"
#include "core/gl/frame.h"
#include "core/terrain/terrain.h"

struct sv_terrain_draw;

struct sv_terrain_draw_stats {
    uint32_t triangles;
    double max_error_px; /* largest projected error left in what was drawn */
};

/* Builds errors (from the store when there) and the texture of normals; needs a current context (context.h).
 * Borrows terrain for life. store may be NULL. Memory: lod.h, plus 2.7 bytes a sample. SV_EINVAL when the
 * terrain has no normals (coloring.h). */
SV_MUST_CHECK enum sv_status sv_terrain_draw_create(const struct sv_terrain *terrain, struct sv_store *store,
                                                    struct sv_terrain_draw **draw, struct sv_error *error);
void sv_terrain_draw_destroy(struct sv_terrain_draw *draw);
/* Draws into the bound target, for the frame whose sv_gl_frame_begin was called last. error_px: allowed
 * screen-space error; 0 draws full detail. depth_only: neither ids nor normals. Colour is left as it is.
 * stats may be NULL. Errors as sv_terrain_lod_refine. */
SV_MUST_CHECK enum sv_status sv_terrain_draw(struct sv_terrain_draw *draw, const struct sv_gl_frame *frame,
                                             double error_px, bool depth_only,
                                             struct sv_terrain_draw_stats *stats, struct sv_error *error);

#endif
