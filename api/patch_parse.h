/* patch_parse.h - the body of PATCH /v1/scene, checked in full: one table of keys, from which the reader and
 * the OpenAPI document are derived.
 *
 * {"sun": {"azimuth_deg", "elevation_deg"} or {"time"},
 *  "trees": {"remove": {"ids", "within", "near"}, "add": [tree, ... or {"scatter"} ...]},
 *  "objects": {"remove": {"ids"}, "add": [object, ...]}}
 * Keys, units and ranges are those of the scene file (core/scene/scene_file.h) where it has them; unknown
 * keys are refused; every bad field is named by its key path, with value and range. A geometry is GeoJSON: in
 * degrees as RFC 7946 has it, or, when its numbers can be no degrees or the scene has no place on Earth, in
 * the scene's metres: the rule for files that a scene file names. Every part is optional; all of them missing
 * is an error.
 *
 * Reads no file; models are looked for where the scene file would name them from. */
#ifndef SV_API_PATCH_PARSE_H
#define SV_API_PATCH_PARSE_H

#include <cjson/cJSON.h>
#include <stdbool.h>

#include "core/scene/patch.h"

/* The text is any bytes. scene: names of species, folder of the scene file. *patch is written on success only
 * (sv_scene_patch_finish); else errors has grown, and the status is the first new one's. */
SV_MUST_CHECK enum sv_status sv_api_patch_parse(const char *text, size_t bytes,
                                                const struct sv_scene_spec *scene,
                                                struct sv_scene_patch *patch, struct sv_errors *errors);

/* The schema of the body for the OpenAPI document. */
cJSON *sv_api_patch_schema(bool *good);

#endif
