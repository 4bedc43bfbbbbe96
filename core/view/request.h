/* request.h - what a client asked for: one view, checked for form and range, but not yet resolved against a
 * scene.
 *
 * Plain values only: the daemon links this without anything heavy. Made by api/view_parse.c from the one
 * table of fields; resolved by core/view/resolve.h on a worker, which knows the terrain. Angles are radians,
 * lengths metres (lon/lat stay degrees: they are geodetic coordinates, not angles to compute with). */
#ifndef SV_VIEW_REQUEST_H
#define SV_VIEW_REQUEST_H

#include <stdbool.h>
#include <stdint.h>

#include "core/image/encode.h"

enum { SV_VIEW_SIDE_MIN = 16, SV_VIEW_SIDE_MAX = 4096 };

#define SV_QUALITY_LIST(X)             \
    X(SV_QUALITY_FAST, "fast")         \
    X(SV_QUALITY_BALANCED, "balanced") \
    X(SV_QUALITY_HIGH, "high")         \
    X(SV_QUALITY_REFERENCE, "reference")

#define SV_TREES_LIST(X)                       \
    X(SV_TREES_AUTO, "auto")                   \
    X(SV_TREES_RAYCAST, "raycast")             \
    X(SV_TREES_POLYGON, "polygon")             \
    X(SV_TREES_BILLBOARD, "billboard")         \
    X(SV_TREES_INDIRECT, "indirect")           \
    X(SV_TREES_DENSITY, "density")             \
    X(SV_TREES_DENSITY_PAPER, "density_paper") \
    X(SV_TREES_COARSE, "coarse")               \
    X(SV_TREES_NONE, "none")

#define SV_RELIEF_LIST(X)     \
    X(SV_RELIEF_AUTO, "auto") \
    X(SV_RELIEF_OFF, "off")   \
    X(SV_RELIEF_ON, "on")     \
    X(SV_RELIEF_PAPER, "paper")

#define SV_LAYER_LIST(X)         \
    X(SV_LAYER_COLOR, "color")   \
    X(SV_LAYER_DEPTH, "depth")   \
    X(SV_LAYER_NORMAL, "normal") \
    X(SV_LAYER_ID, "id")

#define SV_PROJECTION_LIST(X)                   \
    X(SV_PROJECTION_PERSPECTIVE, "perspective") \
    X(SV_PROJECTION_ORTHOGRAPHIC, "orthographic")

#define X(name, text) name,
enum sv_quality { SV_QUALITY_LIST(X) SV_QUALITY_COUNT };
enum sv_trees { SV_TREES_LIST(X) SV_TREES_COUNT };
enum sv_relief_mode { SV_RELIEF_LIST(X) SV_RELIEF_COUNT };
enum sv_layer { SV_LAYER_LIST(X) SV_LAYER_COUNT };
enum sv_projection { SV_PROJECTION_LIST(X) SV_PROJECTION_COUNT };
#undef X

/* A place as a client may give it. */
enum sv_place_form { SV_PLACE_NONE, SV_PLACE_XY, SV_PLACE_LONLAT };

struct sv_place {
    enum sv_place_form form;
    double x, y; /* in request.crs (or the scene's), easting first; or lon, lat in degrees (WGS 84) */
    bool has_z;  /* z is absolute; else agl counts from the ground */
    double z, agl;
};

struct sv_view_request {
    struct sv_place eye;    /* SV_PLACE_NONE only in the orbit form (target and range) */
    struct sv_place target; /* SV_PLACE_NONE: heading and pitch are used */
    double range_m;         /* orbit form; 0 otherwise */
    int crs_epsg;           /* of x, y; 0: the scene's own */
    double heading_rad, pitch_rad, roll_rad;
    bool north_true;
    double vfov_rad;
    enum sv_projection projection;
    double ortho_height_m; /* 0 for perspective */
    int width, height;     /* px */
    enum sv_format format;
    int q;           /* 1..100 */
    unsigned layers; /* bit set of 1u << enum sv_layer; never 0 */
    bool sky;
    enum sv_quality quality;
    double max_error_px; /* 0: not given */
    double budget_ms;    /* 0: not given */
    enum sv_trees trees;
    enum sv_relief_mode relief;
    double relief_distance_m; /* 0: not given */
    int relief_resolution;    /* 0: not given */
    bool shadows;
    int samples; /* 1, 4, 16, 64; 0: not given */
    bool has_sun_azimuth, has_sun_elevation, has_time;
    double sun_azimuth_rad, sun_elevation_rad, time_unix_s;
    bool air;      /* aerial perspective */
    bool describe; /* f=json: do not draw */
};

/* Names for the enums above; never NULL for legal values. */
const char *sv_quality_name(enum sv_quality v);
const char *sv_trees_name(enum sv_trees v);
const char *sv_relief_name(enum sv_relief_mode v);
const char *sv_layer_name(enum sv_layer v);
const char *sv_projection_name(enum sv_projection v);
const char *sv_format_name(enum sv_format v);
const char *sv_format_media(enum sv_format v);

#endif
