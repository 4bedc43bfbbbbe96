/* cloud_light.h - what laying leaves on planes does to their light, and the remedy.
 *
 * A leaf of a tree is seen by how much it faces the viewer and by how little stands before it; on planes it
 * is seen by how much the plane does, and one looks deeper into a crown between two dozen of them. So from
 * above, where a tree shows what is turned to the sun, its cloud shows dark leaves: 8 levels of 255 at 25
 * degrees, 16 at 60. Three numbers a tree and view put the means right: a factor on sunlight, one on the
 * sky's light, and what is added to the normal's height. They are tabled by the elevation of the view, and
 * sunlight by that of the sun and the angle between them in plan besides: ratios of what leaves show of the
 * mesh and of the cloud, both rasterised from around (own derivation). Used by draw_cloud.c for all forms. No
 * GL; deterministic. */
#ifndef SV_TREE_CLOUD_LIGHT_H
#define SV_TREE_CLOUD_LIGHT_H

#include "core/tree/cloud.h"

/* Kind of the table in the store (its bytes as they are). */
#define SV_CLOUD_LIGHT_KIND "cloudl2"

enum { SV_CLOUD_LIGHT_VIEWS = 5, SV_CLOUD_LIGHT_SUNS = 4, SV_CLOUD_LIGHT_TURNS = 5 };

struct sv_cloud_light {
    /* Views from -30, 0, 30, 60, 90 degrees over the horizon, suns at 0 (5), 30, 60, 90, turns of 0 .. 180.
     */
    float sun[SV_CLOUD_LIGHT_VIEWS][SV_CLOUD_LIGHT_SUNS][SV_CLOUD_LIGHT_TURNS];
    float sky[SV_CLOUD_LIGHT_VIEWS], lift[SV_CLOUD_LIGHT_VIEWS];
    float translucency; /* mean of the leaves' (of the wood's, 0, when there are none) */
};

struct sv_cloud_shift {
    float sun, sky, lift;
};

/* 0.4 s for 39,000 leaves. SV_ENOMEM. */
SV_MUST_CHECK enum sv_status sv_cloud_light_measure(const struct sv_tree_mesh *mesh,
                                                    const struct sv_tree_cloud *cloud,
                                                    struct sv_cloud_light *light, struct sv_error *error);
/* False for bytes that are no such table. */
bool sv_cloud_light_sound(const struct sv_cloud_light *light);
/* to_viewer, to_sun: model space, any length; {1, 1, 0} for one of length 0 or NaN. Continuous in both. */
struct sv_cloud_shift sv_cloud_light_shift(const struct sv_cloud_light *light, const float to_viewer[3],
                                           const float to_sun[3]);

#endif
