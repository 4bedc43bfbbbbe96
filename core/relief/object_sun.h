/* object_sun.h - a mesh as the sun sees it: its silhouette, and how far along the light it begins (a shadow
 * map).
 *
 * The mesh is drawn by the CPU, one sample a texel, alpha masks cut out, onto a plane square to the light, in
 * model units (height 1) but in world axes: turned by the heading, so that objects of one model and heading
 * share one map whatever their height and place. The silhouette (core/relief/silhouette.h) serves whoever
 * receives the shadow: the ground's windows, other objects; the mesh's own polygons look themselves up in
 * first[]. No GL, no clock; any thread. */
#ifndef SV_RELIEF_OBJECT_SUN_H
#define SV_RELIEF_OBJECT_SUN_H

#include "core/base/error.h"
#include "core/relief/silhouette.h"
#include "core/tree/mesh.h"

enum { SV_OBJECT_SUN_SIDE_MIN = 16, SV_OBJECT_SUN_SIDE_MAX = 1024 };

struct sv_object_sun {
    struct sv_silhouette
        silhouette; /* lengths in heights; coverage 0 or 255; row 0 and all borders are empty */
    double texel;   /* side of a texel, heights: texels are square */
    void *block;
};

/* side: texels along the longer side of the outline, SV_OBJECT_SUN_SIDE_MIN .. MAX. travel: direction in
 * which light travels, world axes, any length over 0. first[] is INFINITY where coverage is 0. SV_EINVAL
 * names what is out of range (a
 * vertex that is not finite or beyond 1e9 heights is), SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_object_sun_create(const struct sv_tree_mesh *mesh, double heading_rad,
                                                  struct sv_vec3 travel, int side, struct sv_object_sun *sun,
                                                  struct sv_error *error);
void sv_object_sun_finish(struct sv_object_sun *sun); /* legal on a zeroed one */
/* Share of sunlight that the mesh leaves at a place p (heights from its foot, world axes): bilinear in four
 * comparisons of depth, as the shader has it (sun_seen in object_mesh.frag). bias: heights along the light
 * that a caster must lie in front. */
float sv_object_sun_seen(const struct sv_object_sun *sun, struct sv_vec3 p, double bias);

#endif
