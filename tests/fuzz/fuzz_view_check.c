#include "tests/fuzz/fuzz_view_check.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/canonical.h"
#include "api/fields.h"
#include "api/json.h"
#include "api/utf8.h"
#include "core/base/vec.h"

const struct sv_api_view_limits fuzz_limits = {.pixels_max = 8000000, .sample_pixels_max = 200000000};

static unsigned long seen[SV_PROBLEM_KIND_COUNT];

const char *fuzz_accept(size_t size)
{
    static const char *const headers[] = {
        NULL, "*/*", "image/webp,*/*;q=0.5", "image/png;q=0, image/*", "text/html", "\"", "image/tiff"};
    return headers[size % (sizeof headers / sizeof headers[0])];
}

static void broken(const char *promise, const uint8_t *data, size_t size)
{
    fprintf(stderr, "broken: %s\ninput of %zu bytes: ", promise, size);
    fwrite(data, 1, size, stderr);
    fputc('\n', stderr);
    abort();
}

#define HOLD(promise)                     \
    do {                                  \
        if (!(promise))                   \
            broken(#promise, data, size); \
    } while (0)

/* In the field's range; radians against a range in degrees. */
static bool in(enum sv_field_id id, double v, bool radians)
{
    const struct sv_field *f = sv_api_field(id);
    double min = radians ? sv_radians(f->min) : f->min, max = radians ? sv_radians(f->max) : f->max;
    return isfinite(v) && v >= min && v <= max;
}

static bool place(const struct sv_place *p)
{
    bool lonlat = p->form == SV_PLACE_LONLAT;
    return in(lonlat ? SV_FIELD_LON : SV_FIELD_X, p->x, false) &&
           in(lonlat ? SV_FIELD_LAT : SV_FIELD_Y, p->y, false) && in(SV_FIELD_Z, p->z, false) &&
           in(SV_FIELD_AGL, p->agl, false);
}

static void check_request(const struct sv_view_request *r, const uint8_t *data, size_t size)
{
    bool eye = r->eye.form != SV_PLACE_NONE, target = r->target.form != SV_PLACE_NONE;
    HOLD(eye || (target && in(SV_FIELD_RANGE, r->range_m, false)));
    HOLD((eye && target) ? r->range_m == 0 && r->heading_rad == 0 && r->pitch_rad == 0 : true);
    HOLD(place(&r->eye) && place(&r->target));
    HOLD(in(SV_FIELD_HEADING, r->heading_rad, true) && in(SV_FIELD_PITCH, r->pitch_rad, true));
    HOLD(in(SV_FIELD_ROLL, r->roll_rad, true) && in(SV_FIELD_VFOV, r->vfov_rad, true));
    HOLD(r->crs_epsg == 0 || in(SV_FIELD_CRS, r->crs_epsg, false));
    HOLD(r->projection == SV_PROJECTION_PERSPECTIVE ? r->ortho_height_m == 0
                                                    : in(SV_FIELD_ORTHO_HEIGHT, r->ortho_height_m, false));
    HOLD(in(SV_FIELD_WIDTH, r->width, false) && in(SV_FIELD_HEIGHT, r->height, false));
    HOLD((uint64_t)r->width * (uint64_t)r->height <= fuzz_limits.pixels_max);
    HOLD((uint64_t)r->width * (uint64_t)r->height * (uint64_t)sv_api_view_samples(r) <=
         fuzz_limits.sample_pixels_max);
    HOLD((unsigned)r->format < SV_FORMAT_COUNT && in(SV_FIELD_Q, r->q, false));
    HOLD(r->layers > 0 && r->layers < 1u << SV_LAYER_COUNT);
    HOLD(r->layers == 1u << SV_LAYER_COLOR || (r->format != SV_FORMAT_JPEG && r->format != SV_FORMAT_WEBP));
    HOLD(r->sky || r->format != SV_FORMAT_JPEG);
    HOLD((unsigned)r->quality < SV_QUALITY_COUNT && (unsigned)r->trees < SV_TREES_COUNT);
    HOLD(r->trees == SV_TREES_AUTO || r->trees == SV_TREES_RAYCAST || r->trees == SV_TREES_POLYGON ||
         r->trees == SV_TREES_NONE);
    HOLD(r->relief >= 0 && r->relief < SV_RELIEF_COUNT);
    HOLD(r->max_error_px == 0 && r->budget_ms == 0);
    HOLD(r->relief_distance_m == 0 || (r->relief_distance_m >= 25 && r->relief_distance_m <= 400));
    HOLD(r->relief_resolution == 0 || (r->relief_resolution >= 256 && r->relief_resolution <= 2048));
    if (r->relief == SV_RELIEF_ON || r->relief == SV_RELIEF_PAPER) /* what panels can show */
        HOLD(r->layers == 1u << SV_LAYER_COLOR && r->projection == SV_PROJECTION_PERSPECTIVE && r->samples <= 1 &&
             (r->trees == SV_TREES_AUTO || r->trees == SV_TREES_NONE));
    HOLD(r->samples == 0 || r->samples == 1 || r->samples == 4 || r->samples == 16 || r->samples == 64);
    HOLD(in(SV_FIELD_SUN_AZIMUTH, r->sun_azimuth_rad, true) &&
         in(SV_FIELD_SUN_ELEVATION, r->sun_elevation_rad, true));
    HOLD(!r->has_time ||
         (in(SV_FIELD_TIME, r->time_unix_s, false) && !r->has_sun_azimuth && !r->has_sun_elevation));
}

/* The canonical text is a legal query that means the same. */
static void check_canonical(const struct sv_view_request *r, const uint8_t *data, size_t size)
{
    char text[SV_API_CANONICAL_MAX], again[SV_API_CANONICAL_MAX];
    struct sv_api_view view;
    struct sv_errors errors;
    size_t n = sv_api_canonical(r, text);
    HOLD(n == strlen(text) && n > 0);
    sv_errors_init(&errors);
    HOLD(sv_api_view_parse_kvp(text, n, NULL, &fuzz_limits, &view, &errors) == SV_PROBLEM_NONE);
    sv_api_canonical(&view.request, again);
    HOLD(strcmp(text, again) == 0);
    sv_errors_finish(&errors);
}

static void check_errors(enum sv_problem_kind kind, const struct sv_errors *errors, const uint8_t *data,
                         size_t size)
{
    HOLD(kind == SV_PROBLEM_BAD_REQUEST || kind == SV_PROBLEM_NOT_BUILT || kind == SV_PROBLEM_NOT_ACCEPTABLE);
    HOLD(errors->count > 0 && errors->total >= errors->count);
    for (size_t k = 0; k < errors->count; k++) {
        HOLD(errors->items[k].message[0]);
        HOLD(sv_api_utf8_valid(errors->items[k].field, strlen(errors->items[k].field)));
        HOLD(sv_api_utf8_valid(errors->items[k].message, strlen(errors->items[k].message)));
    }
    const struct sv_problem problem = {.kind = kind, .errors = errors};
    size_t bytes;
    cJSON *root = NULL;
    char *text = sv_api_problem_document(&problem, &bytes);
    HOLD(text && sv_api_json_parse(text, bytes, &root, NULL) == SV_OK);
    cJSON_Delete(root);
    free(text);
}

void fuzz_view_check(enum sv_problem_kind kind, const struct sv_api_view *view,
                     const struct sv_errors *errors, const uint8_t *data, size_t size)
{
    HOLD((unsigned)kind < SV_PROBLEM_KIND_COUNT);
    seen[kind]++;
    if (kind != SV_PROBLEM_NONE) {
        check_errors(kind, errors, data, size);
        return;
    }
    HOLD(errors->total == 0);
    check_request(&view->request, data, size);
    check_canonical(&view->request, data, size);
}

void fuzz_view_report(void)
{
    printf("%lu legal, %lu bad, %lu not built yet, %lu not acceptable\n", seen[SV_PROBLEM_NONE],
           seen[SV_PROBLEM_BAD_REQUEST], seen[SV_PROBLEM_NOT_BUILT], seen[SV_PROBLEM_NOT_ACCEPTABLE]);
}
