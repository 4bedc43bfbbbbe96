/* fields.h - the one table of what a view request may say: name, type, unit, range, default, help.
 *
 * The KVP reader, the JSON reader, the OpenAPI document, the canonical text and every error message are
 * derived from it. What a single field cannot know (which fields exclude each other, what a format can hold)
 * is in view_rules.h. Angles are degrees here, as on the wire. */
#ifndef SV_API_FIELDS_H
#define SV_API_FIELDS_H

#include <stdbool.h>
#include <stddef.h>

#include "core/base/error.h"

/* Every field, in the order in which documents and canonical texts list them. */
#define SV_FIELD_LIST(X)                               \
    X(SV_FIELD_X, "x")                                 \
    X(SV_FIELD_Y, "y")                                 \
    X(SV_FIELD_LON, "lon")                             \
    X(SV_FIELD_LAT, "lat")                             \
    X(SV_FIELD_CRS, "crs")                             \
    X(SV_FIELD_Z, "z")                                 \
    X(SV_FIELD_AGL, "agl")                             \
    X(SV_FIELD_HEADING, "heading")                     \
    X(SV_FIELD_PITCH, "pitch")                         \
    X(SV_FIELD_ROLL, "roll")                           \
    X(SV_FIELD_NORTH, "north")                         \
    X(SV_FIELD_TARGET_X, "target_x")                   \
    X(SV_FIELD_TARGET_Y, "target_y")                   \
    X(SV_FIELD_TARGET_LON, "target_lon")               \
    X(SV_FIELD_TARGET_LAT, "target_lat")               \
    X(SV_FIELD_TARGET_Z, "target_z")                   \
    X(SV_FIELD_TARGET_AGL, "target_agl")               \
    X(SV_FIELD_RANGE, "range")                         \
    X(SV_FIELD_VFOV, "vfov")                           \
    X(SV_FIELD_PROJECTION, "projection")               \
    X(SV_FIELD_ORTHO_HEIGHT, "ortho_height")           \
    X(SV_FIELD_WIDTH, "width")                         \
    X(SV_FIELD_HEIGHT, "height")                       \
    X(SV_FIELD_FORMAT, "format")                       \
    X(SV_FIELD_Q, "q")                                 \
    X(SV_FIELD_LAYER, "layer")                         \
    X(SV_FIELD_SKY, "sky")                             \
    X(SV_FIELD_QUALITY, "quality")                     \
    X(SV_FIELD_MAX_ERROR, "max_error")                 \
    X(SV_FIELD_BUDGET_MS, "budget_ms")                 \
    X(SV_FIELD_TREES, "trees")                         \
    X(SV_FIELD_RELIEF, "relief")                       \
    X(SV_FIELD_RELIEF_DISTANCE, "relief_distance")     \
    X(SV_FIELD_RELIEF_RESOLUTION, "relief_resolution") \
    X(SV_FIELD_SHADOWS, "shadows")                     \
    X(SV_FIELD_SAMPLES, "samples")                     \
    X(SV_FIELD_SUN_AZIMUTH, "sun_azimuth")             \
    X(SV_FIELD_SUN_ELEVATION, "sun_elevation")         \
    X(SV_FIELD_TIME, "time")                           \
    X(SV_FIELD_AIR, "air")                             \
    X(SV_FIELD_F, "f")

enum sv_field_id {
#define X(id, name) id,
    SV_FIELD_LIST(X)
#undef X
        SV_FIELD_COUNT
};

#define SV_FIELD_TYPE_LIST(X)                                                                            \
    X(SV_FIELD_NUMBER, "a number")                                                                       \
    X(SV_FIELD_INTEGER, "an integer")                                                                    \
    X(SV_FIELD_INTEGER_SET, "an integer") /* one of a few: choices are their texts */                    \
    X(SV_FIELD_CHOICE, "one of")          /* a name */                                                   \
    X(SV_FIELD_CHOICES, "one or more of") /* names with commas between; in JSON an array will do, too */ \
    X(SV_FIELD_SWITCH, "one of")          /* off, on; in JSON false and true will do, too */             \
    X(SV_FIELD_EPSG, "EPSG: with a number")                                                              \
    X(SV_FIELD_MOMENT, "a date and time as in RFC 3339")

enum sv_field_type {
#define X(id, text) id,
    SV_FIELD_TYPE_LIST(X)
#undef X
        SV_FIELD_TYPE_COUNT
};

struct sv_field {
    enum sv_field_type type;
    const char *unit;           /* "" when it has none */
    double min, max;            /* numbers, integers, EPSG codes, moments (s since 1970): the legal range */
    bool above_min;             /* min itself is not legal */
    const char *const *choices; /* names by value, ending in NULL: the index is the enum's value */
    const char *preset;         /* the default as it would be written; NULL: depends, help says on what */
    bool unbuilt;               /* known, checked, and then answered 501: a later version builds it */
    unsigned unbuilt_choices;   /* bit set of the choices that are */
    const char *help;           /* one or two sentences for the OpenAPI document */
};

/* What a field's text or JSON value came to. */
struct sv_field_value {
    bool present;    /* the client named the field */
    bool good;       /* and its value is legal */
    double number;   /* numbers, integers, EPSG codes; moments: s since 1970 */
    unsigned choice; /* the index of a choice, 0/1 of a switch; a set of bits for SV_FIELD_CHOICES */
};

const struct sv_field *sv_api_field(enum sv_field_id id);
const char *sv_api_field_name(enum sv_field_id id);
/* The field of that name (case counts), or SV_FIELD_COUNT. */
enum sv_field_id sv_api_field_find(const char *name);
/* The name of a field that was likely meant, or NULL when none is near. */
const char *sv_api_field_nearest(const char *name);
/* A guess at what was meant, for any list of names: keeps the candidate that is nearer to the name than *best
 * is, and its distance. Start with NULL and SIZE_MAX. A third of the name's letters may be wrong, case apart;
 * names of over 31 bytes are near to nothing. */
void sv_api_name_consider(const char *name, const char *candidate, const char **best, size_t *best_distance);
/* What is legal: "a number from 1 to 150 deg", "one of png, jpeg, ...". Returns out; 256 bytes hold every
 * field's. */
const char *sv_api_field_legal(enum sv_field_id id, char *out, size_t size);

/* Reads a value as KVP has it: n bytes of UTF-8, ending in NUL. On an error value->good stays false and the
 * list gets a sentence with the value, what is legal and the unit. */
void sv_api_field_read(enum sv_field_id id, const char *text, size_t n, struct sv_field_value *value,
                       struct sv_errors *errors);
/* The same for a value that is a number already (JSON); text is how to show it, may be NULL. */
void sv_api_field_read_number(enum sv_field_id id, double number, struct sv_field_value *value,
                              struct sv_errors *errors);
/* The default of a field that has one. */
struct sv_field_value sv_api_field_preset(enum sv_field_id id);

#endif
