/* resolve.h - a request meets a scene: coordinates, ground heights, look-at and orbit forms, sun, and the
 * plan. No drawing. */
#ifndef SV_VIEW_RESOLVE_H
#define SV_VIEW_RESOLVE_H

#include "core/scene/scene.h"
#include "core/view/request.h"
#include "core/view/resolved.h"

/* SV_EUNDERGROUND (message names the ground's height; *ground_z is written), SV_EOUTSIDE (agl or a target_agl
 * where there is no terrain), SV_EINVAL (crs not known, lon/lat without a CRS, eye equals target),
 * SV_EUNSUPPORTED for a feature of a later version. */
SV_MUST_CHECK enum sv_status sv_view_resolve(const struct sv_scene *scene,
                                             const struct sv_view_request *request,
                                             struct sv_resolved_view *view, double *ground_z,
                                             struct sv_error *error);

#endif
