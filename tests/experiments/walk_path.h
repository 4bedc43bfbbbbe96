/* walk_path.h - the ways that an eye goes through the forest of forest_kit.h, frame by frame. */
#ifndef SV_TESTS_WALK_PATH_H
#define SV_TESTS_WALK_PATH_H

#include "tests/experiments/forest_kit.h"

/* FLIGHT: 15 m/s, 40 m over the ground. WALK: 1.4 m/s at 1.7 m. 30 frames a second. JUMP: poses of both kinds
 * at random. TURN, SURVEY: on the spot, by WALK_TURN_DEG a frame, at 1.7 m and, looking down by 40 degrees,
 * so that sides of cells meet the face below amid the picture, at 40 m. */
enum walk_path { PATH_FLIGHT, PATH_WALK, PATH_JUMP, PATH_TURN, PATH_SURVEY, WALK_PATHS };
#define WALK_TURN_DEG 2.0

extern const char *const WALK_PATH_NAMES[WALK_PATHS];

/* Of that name, or WALK_PATHS. */
enum walk_path walk_path_named(const char *name);
bool walk_path_turns(enum walk_path path);
/* The pose of frame k, of width x height; still: of the first one. */
struct sv_view_request walk_path_pose(const struct forest *forest, enum walk_path path, int k, bool still,
                                      int width, int height);

#endif
