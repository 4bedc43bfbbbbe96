/* walk_path.c - see walk_path.h. */
#include "tests/experiments/walk_path.h"

#include <math.h>
#include <string.h>

#define FRAMES_PER_S 30.0

const char *const WALK_PATH_NAMES[WALK_PATHS] = {"flight", "walk", "jump", "turn", "survey"};

static const struct {
    enum forest_eye eye;
    double agl_m, pitch_deg, speed_m_s, turn_deg;
} paths[WALK_PATHS] = {[PATH_FLIGHT] = {FOREST_OVERVIEW, 40, -12, 15, 0},
                       [PATH_WALK] = {FOREST_WALK, 1.7, 3, 1.4, 0},
                       [PATH_TURN] = {FOREST_WALK, 1.7, 3, 0, WALK_TURN_DEG},
                       [PATH_SURVEY] = {FOREST_OVERVIEW, 40, -40, 0, WALK_TURN_DEG}};

enum walk_path walk_path_named(const char *name)
{
    enum walk_path path = PATH_FLIGHT;
    while (path < WALK_PATHS && strcmp(name, WALK_PATH_NAMES[path]) != 0)
        path++;
    return path;
}

bool walk_path_turns(enum walk_path path)
{
    return paths[path].turn_deg > 0;
}

struct sv_view_request walk_path_pose(const struct forest *forest, enum walk_path path, int k, bool still,
                                      int width, int height)
{
    struct sv_view_request r;
    if (path == PATH_JUMP) {
        r = forest_request(forest, k & 1 ? FOREST_WALK : FOREST_OVERVIEW, k / 2);
    } else {
        double step = still ? 0 : k;
        r = forest_request(forest, paths[path].eye, 0);
        r.eye.x += step * paths[path].speed_m_s / FRAMES_PER_S * sin(r.heading_rad);
        r.eye.y += step * paths[path].speed_m_s / FRAMES_PER_S * cos(r.heading_rad);
        r.eye.agl = paths[path].agl_m;
        r.heading_rad = fmod(r.heading_rad + step * sv_radians(paths[path].turn_deg), 2 * SV_PI);
        r.pitch_rad = sv_radians(paths[path].pitch_deg);
    }
    r.width = width;
    r.height = height;
    return r;
}
