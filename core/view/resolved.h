/* resolved.h - a view that has met its scene: camera, sun and plan as plain values. Made by resolve.h on a
 * worker; crosses the process border as it is, so the daemon includes this and nothing heavier. */
#ifndef SV_VIEW_RESOLVED_H
#define SV_VIEW_RESOLVED_H

#include <stdbool.h>
#include <stdint.h>

#include "core/base/vec.h"
#include "core/scene/light.h"
#include "core/view/camera.h"
#include "core/view/request.h"

/* What will be drawn, how (design.md section 7). */
struct sv_plan {
    bool raycast; /* by Embree (quality=reference, trees=raycast) */
    bool draw_trees;
    bool shadows;
    int samples;
    double terrain_error_px; /* 0: full detail */
    double relief_texel_px;  /* objects whose relief texels are at most this large are reliefs; 0: none */
    int leaf_samples;        /* a pixel, of near trees in pictures of one sample */
    int near_samples;        /* the same before panels; 1: softened (soften.h) */
    enum sv_trees trees;     /* the form */
    double tree_error_px;    /* auto: trees are sprites where those are off by at most this */
    enum sv_relief_mode relief; /* whether from relief panels: as asked */
    double relief_distance_m;   /* of the outermost ring of panels */
    int relief_resolution;      /* texels of a panel over 90 degrees */
    double relief_pitch;        /* lattice step of cells over their distance */
};

struct sv_resolved_view {
    struct sv_camera camera;
    bool has_target;
    struct sv_vec3 target;
    double heading_rad, pitch_rad, roll_rad; /* from grid north */
    double convergence_rad; /* heading of true north, clockwise from grid north, at the eye */
    double ground_z;        /* below the eye, m; NaN outside the terrain */
    bool has_lonlat;
    double lon_deg, lat_deg; /* of the eye */
    struct sv_sun sun;       /* azimuth from grid north */
    bool air;
    struct sv_plan plan;
    struct sv_vec3 cell; /* reference point of the outermost cell: one for all views of it; without cells the eye */
};

#endif
