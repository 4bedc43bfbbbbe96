/* fields.c - see fields.h: the table, and what can be read off one row of it. */
#include "api/fields.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/number.h"
#include "api/utf8.h"
#include "core/base/rfc3339.h"
#include "core/view/request.h"

/* Names by enum value, from the lists that define the enums. */
#define X(id, text) [id] = text,
static const char *const projections[] = {SV_PROJECTION_LIST(X) NULL};
static const char *const layers[] = {SV_LAYER_LIST(X) NULL};
static const char *const qualities[] = {SV_QUALITY_LIST(X) NULL};
static const char *const trees[] = {SV_TREES_LIST(X) NULL};
static const char *const reliefs[] = {SV_RELIEF_LIST(X) NULL};
#undef X
#define X(id, text, media) [id] = text,
static const char *const formats[] = {SV_FORMAT_LIST(X) NULL};
#undef X
static const char *const off_on[] = {"off", "on", NULL};
static const char *const norths[] = {"grid", "true", NULL};
static const char *const answers[] = {"image", "json", NULL};
static const char *const sample_counts[] = {"1", "4", "16", "64", NULL};

/* Metres from a scene's origin that a coordinate may have: zone-prefixed eastings reach 6.1e7. */
#define COORDINATE_M .type = SV_FIELD_NUMBER, .unit = "m", .min = -1e9, .max = 1e9
/* Wider than any terrain (heights are legal within 12 km), up to a high orbit of the eye. */
#define HEIGHT_M .type = SV_FIELD_NUMBER, .unit = "m", .min = -12000, .max = 1e6
#define LONGITUDE .type = SV_FIELD_NUMBER, .unit = "deg", .min = -180, .max = 180
#define LATITUDE .type = SV_FIELD_NUMBER, .unit = "deg", .min = -90, .max = 90
#define TURN .type = SV_FIELD_NUMBER, .unit = "deg", .min = -360, .max = 360

static const struct sv_field table[SV_FIELD_COUNT] = {
    [SV_FIELD_X] = {COORDINATE_M, .help = "The eye's easting in the scene's CRS, or in the one that crs "
                                          "names. With y; excludes lon, lat."},
    [SV_FIELD_Y] = {COORDINATE_M, .help = "The eye's northing, likewise."},
    [SV_FIELD_LON] = {LONGITUDE, .help = "The eye's longitude (WGS 84). With lat; excludes x, y."},
    [SV_FIELD_LAT] = {LATITUDE, .help = "The eye's latitude, likewise."},
    [SV_FIELD_CRS] = {.type = SV_FIELD_EPSG,
                      .unit = "",
                      .min = 1,
                      .max = 999999,
                      .help =
                          "The coordinate system that x, y and target_x, target_y are in, always easting or "
                          "longitude first; the scene's own without it."},
    [SV_FIELD_Z] = {HEIGHT_M, .help = "The eye's height in the terrain's vertical datum. Excludes agl."},
    [SV_FIELD_AGL] = {HEIGHT_M, .preset = "1.7",
                      .help = "The eye's height above the ground below it. Excludes z."},
    [SV_FIELD_HEADING] = {TURN, .preset = "0", .help = "Where the eye looks, clockwise from north."},
    [SV_FIELD_PITCH] = {.type = SV_FIELD_NUMBER,
                        .unit = "deg",
                        .min = -90,
                        .max = 90,
                        .preset = "0",
                        .help = "Where the eye looks: 0 is the horizon, positive is up."},
    [SV_FIELD_ROLL] = {TURN, .preset = "0",
                       .help = "Positive lowers the right side of the picture's camera."},
    [SV_FIELD_NORTH] =
        {.type = SV_FIELD_CHOICE,
         .unit = "",
         .choices = norths,
         .preset = "grid",
         .help = "The north that heading and sun_azimuth count from: the scene CRS's grid, or true "
                 "north. The answer's camera tells the convergence."},
    [SV_FIELD_TARGET_X] =
        {COORDINATE_M,
         .help = "Easting of the place to look at. With an eye it replaces heading and pitch; without "
                 "one (orbit form) it needs range, and takes heading and pitch."},
    [SV_FIELD_TARGET_Y] = {COORDINATE_M, .help = "Northing of the place to look at."},
    [SV_FIELD_TARGET_LON] = {LONGITUDE,
                             .help = "Longitude of the place to look at; excludes target_x, target_y."},
    [SV_FIELD_TARGET_LAT] = {LATITUDE, .help = "Latitude of the place to look at."},
    [SV_FIELD_TARGET_Z] = {HEIGHT_M, .help = "Height of the place to look at; excludes target_agl."},
    [SV_FIELD_TARGET_AGL] = {HEIGHT_M, .preset = "1.7",
                             .help = "Height of the place to look at above the ground there."},
    [SV_FIELD_RANGE] = {.type = SV_FIELD_NUMBER,
                        .unit = "m",
                        .min = 0.01,
                        .max = 1e6,
                        .help = "Orbit form: how far the eye is from the target, against heading and pitch."},
    [SV_FIELD_VFOV] =
        {.type = SV_FIELD_NUMBER,
         .unit = "deg",
         .min = 1,
         .max = 150,
         .preset = "60",
         .help = "Vertical field of view of a perspective picture; ignored with projection=orthographic, "
                 "whose size is ortho_height."},
    [SV_FIELD_PROJECTION] = {.type = SV_FIELD_CHOICE,
                             .unit = "",
                             .choices = projections,
                             .preset = "perspective",
                             .help = "orthographic needs ortho_height."},
    [SV_FIELD_ORTHO_HEIGHT] = {.type = SV_FIELD_NUMBER,
                               .unit = "m",
                               .min = 0.01,
                               .max = 1e6,
                               .help = "The height of an orthographic picture in metres."},
    [SV_FIELD_WIDTH] = {.type = SV_FIELD_INTEGER,
                        .unit = "px",
                        .min = SV_VIEW_SIDE_MIN,
                        .max = SV_VIEW_SIDE_MAX,
                        .preset = "512",
                        .help = "The picture's width; the service may limit width x height further."},
    [SV_FIELD_HEIGHT] = {.type = SV_FIELD_INTEGER,
                         .unit = "px",
                         .min = SV_VIEW_SIDE_MIN,
                         .max = SV_VIEW_SIDE_MAX,
                         .preset = "512",
                         .help = "The picture's height."},
    [SV_FIELD_FORMAT] =
        {.type = SV_FIELD_CHOICE,
         .unit = "",
         .choices = formats,
         .help = "The picture's format. Without it the Accept header decides among those that can hold "
                 "what is asked for; failing that jpeg, png for sky=off, exr for other layers."},
    [SV_FIELD_Q] = {.type = SV_FIELD_INTEGER,
                    .unit = "",
                    .min = 1,
                    .max = 100,
                    .preset = "85",
                    .help = "Quality of jpeg and webp; ignored with png, tiff and exr, which lose nothing."},
    [SV_FIELD_LAYER] =
        {.type = SV_FIELD_CHOICES,
         .unit = "",
         .choices = layers,
         .preset = "color",
         .help = "color (any format); depth: metres along the view axis, float, sky +infinity (exr, tiff); "
                 "normal: world frame, float (exr, tiff) or mapped to 8 bits (png); id: what the pixel "
                 "shows, 32 bits, legend in /v1/scene (exr, tiff). Several need exr."},
    [SV_FIELD_SKY] = {.type = SV_FIELD_SWITCH,
                      .unit = "",
                      .choices = off_on,
                      .preset = "on",
                      .help = "off: transparent where the sky is (png, webp, tiff, exr)."},
    [SV_FIELD_QUALITY] = {.type = SV_FIELD_CHOICE,
                          .unit = "",
                          .choices = qualities,
                          .preset = "balanced",
                          .help = "reference is the ground truth: exact polygons, ray cast, supersampled."},
    [SV_FIELD_MAX_ERROR] =
        {.type = SV_FIELD_NUMBER,
         .unit = "px",
         .min = 0,
         .max = 1000,
         .above_min = true,
         .unbuilt = true,
         .help = "What is cheapest within this screen-space error. Excludes quality, budget_ms."},
    [SV_FIELD_BUDGET_MS] =
        {.type = SV_FIELD_NUMBER,
         .unit = "ms",
         .min = 0,
         .max = 600000,
         .above_min = true,
         .unbuilt = true,
         .help = "What is closest to the truth within this time. Excludes quality, max_error."},
    [SV_FIELD_TREES] = {.type = SV_FIELD_CHOICE,
                        .unit = "",
                        .choices = trees,
                        .preset = "auto",
                        .help = "Forces one representation of trees, for measuring; none leaves them out."},
    [SV_FIELD_RELIEF] = {.type = SV_FIELD_CHOICE,
                         .unit = "",
                         .choices = reliefs,
                         .preset = "auto",
                         .help = "How far scenery is drawn: on from relief panels of the eye's cells, which are "
                                 "built where they are missing; off directly; auto from panels that are there, or "
                                 "that pay; paper as Koiso and Nishita do it, for comparison."},
    [SV_FIELD_RELIEF_DISTANCE] = {.type = SV_FIELD_NUMBER,
                                  .unit = "m",
                                  .min = 25,
                                  .max = 400,
                                  .help = "Overrides the scene's relief distance, for measuring."},
    [SV_FIELD_RELIEF_RESOLUTION] = {.type = SV_FIELD_INTEGER,
                                    .unit = "texels",
                                    .min = 256,
                                    .max = 2048,
                                    .help =
                                        "Overrides the relief resolution (texels over 90 degrees), which is the scene's, halved "
                                        "while that is enough for the picture."},
    [SV_FIELD_SHADOWS] =
        {.type = SV_FIELD_SWITCH,
         .unit = "",
         .choices = off_on,
         .preset = "on",
         .help = "Shadows of the terrain, of trees and of objects; off costs nothing for them."},
    [SV_FIELD_SAMPLES] =
        {.type = SV_FIELD_INTEGER_SET,
         .unit = "",
         .choices = sample_counts,
         .help = "Samples a pixel; 1, for quality=reference 16. Samples times pixels has a limit."},
    [SV_FIELD_SUN_AZIMUTH] = {TURN,
                              .help = "The sun's azimuth, clockwise from north; the scene's without it."},
    [SV_FIELD_SUN_ELEVATION] = {.type = SV_FIELD_NUMBER,
                                .unit = "deg",
                                .min = -90,
                                .max = 90,
                                .help = "The sun's elevation above the horizon; the scene's without it."},
    [SV_FIELD_TIME] =
        {.type = SV_FIELD_MOMENT,
         .unit = "",
         .min = -2208988800.0, /* 1900-01-01: where the sun's formula is good to 0.01 deg */
         .max = 4133980799.0,  /* 2100-12-31T23:59:59Z */
         .help = "Puts the sun where it stands at this moment over the scene. Excludes sun_azimuth, "
                 "sun_elevation. In a query write + as %2B."},
    [SV_FIELD_AIR] = {.type = SV_FIELD_SWITCH,
                      .unit = "",
                      .choices = off_on,
                      .preset = "off",
                      .help = "Aerial perspective: what is far fades into the air."},
    [SV_FIELD_F] =
        {.type = SV_FIELD_CHOICE,
         .unit = "",
         .choices = answers,
         .preset = "image",
         .help = "json answers what the picture would be (camera, matrices, plan) without drawing it."},
};

const struct sv_field *sv_api_field(enum sv_field_id id)
{
    return &table[id];
}

const char *sv_api_field_name(enum sv_field_id id)
{
    static const char *const names[] = {
#define X(id_, name) [id_] = name,
        SV_FIELD_LIST(X)
#undef X
    };
    return names[id];
}

enum sv_field_id sv_api_field_find(const char *name)
{
    for (int id = 0; id < SV_FIELD_COUNT; id++)
        if (strcmp(sv_api_field_name((enum sv_field_id)id), name) == 0)
            return (enum sv_field_id)id;
    return SV_FIELD_COUNT;
}

static char lower(char c)
{
    return c >= 'A' && c <= 'Z' ? (char)(c - 'A' + 'a') : c;
}

/* Levenshtein's distance, case apart; words of up to 31 characters, SIZE_MAX for longer ones. */
static size_t distance(const char *a, const char *b)
{
    size_t row[32], na = strlen(a), nb = strlen(b);
    if (na > 31 || nb > 31)
        return SIZE_MAX;
    for (size_t j = 0; j <= nb; j++)
        row[j] = j;
    for (size_t i = 1; i <= na; i++) {
        size_t diagonal = row[0];
        row[0] = i;
        for (size_t j = 1; j <= nb; j++) {
            size_t best = diagonal + (lower(a[i - 1]) != lower(b[j - 1]));
            diagonal = row[j];
            if (row[j] + 1 < best)
                best = row[j] + 1;
            if (row[j - 1] + 1 < best)
                best = row[j - 1] + 1;
            row[j] = best;
        }
    }
    return row[nb];
}

void sv_api_name_consider(const char *name, const char *candidate, const char **best, size_t *best_distance)
{
    size_t d = distance(name, candidate);
    if (d < *best_distance && d * 3 <= strlen(name) + 1) {
        *best = candidate;
        *best_distance = d;
    }
}

const char *sv_api_field_nearest(const char *name)
{
    const char *best = NULL;
    size_t best_distance = SIZE_MAX;
    for (int id = 0; id < SV_FIELD_COUNT; id++)
        sv_api_name_consider(name, sv_api_field_name((enum sv_field_id)id), &best, &best_distance);
    return best;
}

static int choice_count(const struct sv_field *field)
{
    int n = 0;
    while (field->choices && field->choices[n])
        n++;
    return n;
}

const char *sv_api_field_legal(enum sv_field_id id, char *out, size_t size)
{
    static const char *const kinds[] = {
#define X(id_, text) [id_] = text,
        SV_FIELD_TYPE_LIST(X)
#undef X
    };
    const struct sv_field *field = &table[id];
    const char *kind = kinds[field->type];
    char low[SV_API_NUMBER_BUFFER], high[SV_API_NUMBER_BUFFER];
    if (field->choices) {
        bool plain = field->type == SV_FIELD_INTEGER_SET;
        int used = snprintf(out, size, "%s%s", plain ? "one of" : kind, "");
        for (int k = 0; k < choice_count(field) && used > 0 && (size_t)used < size; k++)
            used += snprintf(out + used, size - (size_t)used, "%s %s", k ? "," : "", field->choices[k]);
        return out;
    }
    if (field->type == SV_FIELD_MOMENT) {
        snprintf(out, size, "%s from 1900 to 2100, like 2026-06-21T12:00:00+02:00", kind);
        return out;
    }
    sv_api_number_format(field->min, low);
    sv_api_number_format(field->max, high);
    snprintf(out, size, field->above_min ? "%s above %s, at most %s%s%s" : "%s from %s to %s%s%s", kind, low,
             high, field->unit[0] ? " " : "", field->unit);
    return out;
}

/* "... is not legal: expected ...", with the value as it can be shown. */
static void refuse(enum sv_field_id id, const char *text, size_t n, const char *what,
                   struct sv_errors *errors)
{
    char legal[256], shown[64];
    sv_api_utf8_show(text, n, shown, sizeof shown);
    sv_errors_add(errors, SV_EINVAL, sv_api_field_name(id), "\"%s\" %s: expected %s", shown, what,
                  sv_api_field_legal(id, legal, sizeof legal));
}

static bool in_range(const struct sv_field *field, double v)
{
    return isfinite(v) && v >= field->min && v <= field->max && !(field->above_min && v == field->min);
}

static int choice_find(const struct sv_field *field, const char *text, size_t n)
{
    for (int k = 0; k < choice_count(field); k++)
        if (strlen(field->choices[k]) == n && memcmp(field->choices[k], text, n) == 0)
            return k;
    return -1;
}

/* Refuses a name that is none of the choices, and says which one was likely meant. */
static void refuse_choice(enum sv_field_id id, const char *text, size_t n, struct sv_errors *errors)
{
    const char *best = NULL;
    size_t best_distance = SIZE_MAX;
    char word[32], what[96];
    snprintf(word, sizeof word, "%.*s", n < 31 ? (int)n : 0, text);
    for (int k = 0; word[0] && k < choice_count(&table[id]); k++)
        sv_api_name_consider(word, table[id].choices[k], &best, &best_distance);
    snprintf(what, sizeof what, best ? "is not a value of it (did you mean \"%s\"?)" : "is not a value of it",
             best);
    refuse(id, text, n, what, errors);
}

/* What is true of every number, however it was written: range, wholeness, the short list. text shows it. */
static void accept_number(enum sv_field_id id, double v, const char *text, size_t n,
                          struct sv_field_value *value, struct sv_errors *errors)
{
    const struct sv_field *field = &table[id];
    v = v == 0 ? 0 : v;
    if (field->type == SV_FIELD_INTEGER_SET) {
        for (int k = 0; k < choice_count(field); k++)
            if (v == atoi(field->choices[k])) {
                *value = (struct sv_field_value){
                    .present = true, .good = true, .number = v, .choice = (unsigned)k};
                return;
            }
        refuse(id, text, n, "is not a value of it", errors);
        return;
    }
    if (!in_range(field, v)) {
        refuse(id, text, n, "is out of range", errors);
        return;
    }
    if (field->type != SV_FIELD_NUMBER && v != floor(v)) {
        refuse(id, text, n, "is not a whole number", errors);
        return;
    }
    *value = (struct sv_field_value){.present = true, .good = true, .number = v};
}

static void read_choices(enum sv_field_id id, const char *text, size_t n, struct sv_field_value *value,
                         struct sv_errors *errors)
{
    unsigned bits = 0;
    for (size_t i = 0; i <= n;) {
        const char *comma = memchr(text + i, ',', n - i);
        size_t length = (comma ? (size_t)(comma - text) : n) - i;
        int k = choice_find(&table[id], text + i, length);
        if (k < 0) {
            refuse_choice(id, text + i, length, errors);
            return;
        }
        if (bits & 1u << k) {
            refuse(id, text, n, "names a value twice", errors);
            return;
        }
        bits |= 1u << k;
        i += length + 1;
    }
    *value = (struct sv_field_value){.present = true, .good = true, .choice = bits};
}

static void read_moment(enum sv_field_id id, const char *text, size_t n, struct sv_field_value *value,
                        struct sv_errors *errors)
{
    struct sv_error why;
    double unix_s;
    if (sv_rfc3339_parse(text, &unix_s, &why)) {
        /* "+02:00" in a query without %2B arrives as a blank and two digits. */
        bool lost_plus = n > 6 && text[n - 6] == ' ' && text[n - 3] == ':';
        refuse(id, text, n, lost_plus ? "has a blank before its offset (write + as %2B)" : why.message,
               errors);
        return;
    }
    if (!in_range(&table[id], unix_s)) {
        refuse(id, text, n, "is out of range", errors);
        return;
    }
    *value = (struct sv_field_value){.present = true, .good = true, .number = unix_s};
}

void sv_api_field_read(enum sv_field_id id, const char *text, size_t n, struct sv_field_value *value,
                       struct sv_errors *errors)
{
    const struct sv_field *field = &table[id];
    double v;
    int k;
    *value = (struct sv_field_value){.present = true};
    if (n == 0) {
        refuse(id, text, n, "is empty", errors);
        return;
    }
    switch (field->type) {
    case SV_FIELD_NUMBER:
    case SV_FIELD_INTEGER:
    case SV_FIELD_INTEGER_SET:
        if (sv_api_number_parse(text, n, &v))
            accept_number(id, v, text, n, value, errors);
        else
            refuse(id, text, n, "is not a decimal number", errors);
        break;
    case SV_FIELD_CHOICE:
    case SV_FIELD_SWITCH:
        k = choice_find(field, text, n);
        if (k >= 0)
            *value = (struct sv_field_value){.present = true, .good = true, .choice = (unsigned)k};
        else
            refuse_choice(id, text, n, errors);
        break;
    case SV_FIELD_CHOICES:
        read_choices(id, text, n, value, errors);
        break;
    case SV_FIELD_EPSG:
        if (n > 5 && memcmp(text, "EPSG:", 5) == 0 && strspn(text + 5, "0123456789") == n - 5 &&
            sv_api_number_parse(text + 5, n - 5, &v))
            accept_number(id, v, text, n, value, errors);
        else
            refuse(id, text, n, "does not name a coordinate system", errors);
        break;
    case SV_FIELD_MOMENT:
        read_moment(id, text, n, value, errors);
        break;
    case SV_FIELD_TYPE_COUNT:
        break;
    }
}

void sv_api_field_read_number(enum sv_field_id id, double number, struct sv_field_value *value,
                              struct sv_errors *errors)
{
    char text[SV_API_NUMBER_BUFFER];
    *value = (struct sv_field_value){.present = true};
    sv_api_number_format(number, text);
    accept_number(id, number, text, strlen(text), value, errors);
}

struct sv_field_value sv_api_field_preset(enum sv_field_id id)
{
    struct sv_field_value value = {0};
    struct sv_errors none;
    const char *preset = table[id].preset;
    sv_errors_init(&none);
    if (preset)
        sv_api_field_read(id, preset, strlen(preset), &value, &none);
    sv_errors_finish(&none);
    value.present = false;
    return value;
}
