/* resolve.h - a request meets a scene: coordinates, ground heights, look-at and orbit forms, sun, and the plan. No drawing. */
#ifndef SV_VIEW_RESOLVE_H
#define SV_VIEW_RESOLVE_H

#include "core/scene/scene.h"
#include "core/view/camera.h"
#include "core/view/request.h"

/* What will be drawn, how (design.md section 7). Plain values: crosses the process border as it is. */
struct sv_plan {
    bool raycast;            /* by Embree (quality=reference, trees=raycast) */
    bool draw_trees;
    bool shadows;
    int samples;
    double terrain_error_px; /* 0: full detail */
    enum sv_trees trees;     /* the form: auto is polygon near and impostor far */
    double polygon_px;
    uint32_t triangle_budget;
};

struct sv_resolved_view {
    struct sv_camera camera;
    bool has_target;
    struct sv_vec3 target;
    double heading_rad, pitch_rad, roll_rad; /* from grid north */
    double convergence_rad;                  /* heading of true north, clockwise from grid north, at the eye */
    double ground_z;                         /* below the eye, m; NaN outside the terrain */
    bool has_lonlat;
    double lon_deg, lat_deg; /* of the eye */
    struct sv_sun sun;       /* azimuth from grid north */
    bool air;
    struct sv_plan plan;
};

/* SV_EUNDERGROUND (message names the ground's height; *ground_z is written), SV_EOUTSIDE (agl or a target_agl where there is no terrain), SV_EINVAL
 * (crs not known, lon/lat without a CRS, eye equals target), SV_EUNSUPPORTED for a feature of a later version. */
SV_MUST_CHECK enum sv_status sv_view_resolve(const struct sv_scene *scene, const struct sv_view_request *request,
                                             struct sv_resolved_view *view, double *ground_z, struct sv_error *error);

#endif
