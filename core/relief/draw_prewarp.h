/* draw_prewarp.h - the second half of paper 1's way: the relief's plane, drawn by GL with the warped texture.
 *
 * The window of the plane is one quad. What is seen through a point of it lies on the same ray, tau times as
 * far: with displ d of the sample, tau = 1 + d / (c.f) for a perspective camera (prewarp.h), and d /
 * (forward.f) metres farther for an orthographic one. So the true depth goes to gl_FragDepth, as the camera
 * sees the texel, and reliefs compose with each other and with polygons by the ordinary depth test. The
 * texture must have been warped for the eye (or the direction) of the very camera that draws it.
 *
 * Where at least half of the bilinear weight is on samples that hold something, the nearest of them says
 * which surface is seen (cut), and colour, depth and normal are bilinear over the samples of that one.
 * Colours are those that are seen (light is in them) and go to the target as they are. Current GL context
 * needed. */
#ifndef SV_RELIEF_DRAW_PREWARP_H
#define SV_RELIEF_DRAW_PREWARP_H

#include "core/gl/frame.h"
#include "core/relief/prewarp.h"

struct sv_prewarp_draw;

SV_MUST_CHECK enum sv_status sv_prewarp_draw_create(struct sv_prewarp_draw **draw, struct sv_error *error);
void sv_prewarp_draw_destroy(struct sv_prewarp_draw *draw); /* NULL is legal */

/* Puts a warped texture into the one set of texture objects, which is kept while sizes stay. relief: whose
 * normals are drawn, or NULL: the plane's. Borrows nothing. SV_ENOMEM, SV_ELIMIT (more samples a side than GL
 * takes), SV_EINTERNAL. */
SV_MUST_CHECK enum sv_status sv_prewarp_draw_upload(struct sv_prewarp_draw *draw,
                                                    const struct sv_warped *warped,
                                                    const struct sv_relief *relief, struct sv_error *error);

struct sv_prewarp_plane {
    const struct sv_relief_frame *frame; /* of the relief, world */
    float cut;                           /* of the relief */
    uint32_t id;
};

/* Draws what was uploaded last into the bound target, depth-tested. Both sides of the plane are seen.
 * SV_EINVAL when the camera's eye (orthographic: its axis) lies in the plane, or nothing was uploaded. */
SV_MUST_CHECK enum sv_status sv_prewarp_draw_plane(struct sv_prewarp_draw *draw,
                                                   const struct sv_gl_frame *frame,
                                                   const struct sv_prewarp_plane *plane,
                                                   struct sv_error *error);

#endif
