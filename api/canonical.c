/* canonical.c - see canonical.h. */
#include "api/canonical.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "api/fields.h"
#include "api/number.h"
#include "api/view_parse.h"
#include "core/base/rfc3339.h"

struct text {
    char *out;
    size_t used;
};

static void put(struct text *t, enum sv_field_id id, const char *value)
{
    size_t left = SV_API_CANONICAL_MAX - t->used;
    int n = snprintf(t->out + t->used, left, "%s%s=%s", t->used ? "&" : "", sv_api_field_name(id), value);
    t->used += n > 0 && (size_t)n < left ? (size_t)n : 0;
}

static void put_number(struct text *t, enum sv_field_id id, double value)
{
    char text[SV_API_NUMBER_BUFFER];
    put(t, id, sv_api_number_format(value, text));
}

static void put_angle(struct text *t, enum sv_field_id id, double radians)
{
    put_number(t, id, sv_api_degrees(radians));
}

/* RFC 3339 in UTC with the fewest decimals that read back as the same moment. Civil date from days: Hinnant,
 * "chrono-Compatible Low-Level Date Algorithms", civil_from_days. */
static void put_moment(struct text *t, enum sv_field_id id, double unix_s)
{
    char text[64];
    double whole = floor(unix_s), fraction = unix_s - whole;
    int64_t seconds = (int64_t)whole;
    int64_t days = seconds >= 0 ? seconds / 86400 : -((86399 - seconds) / 86400);
    int64_t clock = seconds - days * 86400;
    int64_t z = days + 719468, era = z / 146097;
    int64_t doe = z - era * 146097, yoe = (doe - doe / 1460 + doe / 36524 - doe / 146096) / 365;
    int64_t doy = doe - (365 * yoe + yoe / 4 - yoe / 100), mp = (5 * doy + 2) / 153;
    int day = (int)(doy - (153 * mp + 2) / 5 + 1), month = (int)(mp < 10 ? mp + 3 : mp - 9);
    int year = (int)(yoe + era * 400 + (month <= 2));
    for (int digits = 0; digits <= 9; digits++) {
        char decimals[16];
        double back;
        snprintf(decimals, sizeof decimals, "%.*f", digits, fraction);
        if (decimals[0] != '0') /* 0.99999 rounded up to the next second */
            continue;
        snprintf(text, sizeof text, "%04d-%02d-%02dT%02d:%02d:%02d%sZ", year, month, day, (int)(clock / 3600),
                 (int)(clock / 60 % 60), (int)(clock % 60), decimals + 1);
        if (!sv_rfc3339_parse(text, &back, NULL) && back == unix_s)
            break;
    }
    put(t, id, text);
}

static void put_choice(struct text *t, enum sv_field_id id, unsigned value)
{
    put(t, id, sv_api_field(id)->choices[value]);
}

static void put_place(struct text *t, const struct sv_place *place, const enum sv_field_id keys[6])
{
    bool lonlat = place->form == SV_PLACE_LONLAT;
    if (place->form == SV_PLACE_NONE)
        return;
    put_number(t, keys[lonlat ? 2 : 0], place->x);
    put_number(t, keys[lonlat ? 3 : 1], place->y);
    put_number(t, keys[place->has_z ? 4 : 5], place->has_z ? place->z : place->agl);
}

static void put_camera(struct text *t, const struct sv_view_request *r)
{
    static const enum sv_field_id eye[6] = {SV_FIELD_X,   SV_FIELD_Y, SV_FIELD_LON,
                                            SV_FIELD_LAT, SV_FIELD_Z, SV_FIELD_AGL};
    static const enum sv_field_id target[6] = {SV_FIELD_TARGET_X,   SV_FIELD_TARGET_Y, SV_FIELD_TARGET_LON,
                                               SV_FIELD_TARGET_LAT, SV_FIELD_TARGET_Z, SV_FIELD_TARGET_AGL};
    bool has_eye = r->eye.form != SV_PLACE_NONE, has_target = r->target.form != SV_PLACE_NONE;
    put_place(t, &r->eye, eye);
    if (r->crs_epsg) {
        char text[24];
        snprintf(text, sizeof text, "EPSG:%d", r->crs_epsg);
        put(t, SV_FIELD_CRS, text);
    }
    if (!has_eye || !has_target) {
        put_angle(t, SV_FIELD_HEADING, r->heading_rad);
        put_angle(t, SV_FIELD_PITCH, r->pitch_rad);
    }
    put_angle(t, SV_FIELD_ROLL, r->roll_rad);
    put_choice(t, SV_FIELD_NORTH, r->north_true);
    put_place(t, &r->target, target);
    if (!has_eye)
        put_number(t, SV_FIELD_RANGE, r->range_m);
    if (r->projection == SV_PROJECTION_PERSPECTIVE)
        put_angle(t, SV_FIELD_VFOV, r->vfov_rad);
    put_choice(t, SV_FIELD_PROJECTION, r->projection);
    if (r->projection == SV_PROJECTION_ORTHOGRAPHIC)
        put_number(t, SV_FIELD_ORTHO_HEIGHT, r->ortho_height_m);
    put_number(t, SV_FIELD_WIDTH, r->width);
    put_number(t, SV_FIELD_HEIGHT, r->height);
}

static void put_encoding(struct text *t, const struct sv_view_request *r)
{
    char layers[64] = "";
    put_choice(t, SV_FIELD_FORMAT, r->format);
    if (r->format == SV_FORMAT_JPEG || r->format == SV_FORMAT_WEBP)
        put_number(t, SV_FIELD_Q, r->q);
    for (int k = 0; k < SV_LAYER_COUNT; k++)
        if (r->layers & 1u << k)
            snprintf(layers + strlen(layers), sizeof layers - strlen(layers), "%s%s", layers[0] ? "," : "",
                     sv_layer_name((enum sv_layer)k));
    put(t, SV_FIELD_LAYER, layers);
    put_choice(t, SV_FIELD_SKY, r->sky);
}

static void put_effort(struct text *t, const struct sv_view_request *r)
{
    if (r->max_error_px > 0)
        put_number(t, SV_FIELD_MAX_ERROR, r->max_error_px);
    else if (r->budget_ms > 0)
        put_number(t, SV_FIELD_BUDGET_MS, r->budget_ms);
    else
        put_choice(t, SV_FIELD_QUALITY, r->quality);
    put_choice(t, SV_FIELD_TREES, r->trees);
    put_choice(t, SV_FIELD_RELIEF, r->relief);
    if (r->relief_distance_m > 0)
        put_number(t, SV_FIELD_RELIEF_DISTANCE, r->relief_distance_m);
    if (r->relief_resolution > 0)
        put_number(t, SV_FIELD_RELIEF_RESOLUTION, r->relief_resolution);
    put_choice(t, SV_FIELD_SHADOWS, r->shadows);
    put_number(t, SV_FIELD_SAMPLES, sv_api_view_samples(r));
    if (r->has_sun_azimuth)
        put_angle(t, SV_FIELD_SUN_AZIMUTH, r->sun_azimuth_rad);
    if (r->has_sun_elevation)
        put_angle(t, SV_FIELD_SUN_ELEVATION, r->sun_elevation_rad);
    if (r->has_time)
        put_moment(t, SV_FIELD_TIME, r->time_unix_s);
    put_choice(t, SV_FIELD_AIR, r->air);
}

size_t sv_api_canonical_resolve(const struct sv_view_request *request, char out[SV_API_CANONICAL_MAX])
{
    struct text t = {.out = out};
    put_camera(&t, request);
    put_effort(&t, request);
    return t.used;
}

size_t sv_api_canonical(const struct sv_view_request *request, char out[SV_API_CANONICAL_MAX])
{
    struct text t = {.out = out};
    put_camera(&t, request);
    put_encoding(&t, request);
    put_effort(&t, request);
    put_choice(&t, SV_FIELD_F, request->describe);
    return t.used;
}
