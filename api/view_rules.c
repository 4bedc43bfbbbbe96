/* view_rules.c - see view_rules.h. */
#include "api/view_rules.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "api/accept.h"
#include "core/base/vec.h"

struct build {
    const struct sv_field_value *values;
    const char *accept;
    const struct sv_api_view_limits *limits;
    struct sv_errors *errors;
    struct sv_api_view view;
    bool acceptable;
};

static bool present(const struct build *b, enum sv_field_id id)
{
    return b->values[id].present;
}

/* The field's value, or its default. */
static struct sv_field_value get(const struct build *b, enum sv_field_id id)
{
    return b->values[id].good ? b->values[id] : sv_api_field_preset(id);
}

static double number(const struct build *b, enum sv_field_id id)
{
    return get(b, id).number;
}

static double angle(const struct build *b, enum sv_field_id id)
{
    return sv_radians(number(b, id));
}

#define BAD(b, id, ...) sv_errors_add((b)->errors, SV_EINVAL, sv_api_field_name(id), __VA_ARGS__)

static void missing(struct build *b, enum sv_field_id id, const char *why)
{
    char legal[256];
    BAD(b, id, "is missing: %s; expected %s", why, sv_api_field_legal(id, legal, sizeof legal));
}

/* One error for a field that is given beside others that exclude it; it names them all. */
static void exclude(struct build *b, enum sv_field_id id, const enum sv_field_id *others, size_t count,
                    const char *advice)
{
    char list[128] = "";
    if (!present(b, id))
        return;
    for (size_t k = 0; k < count; k++)
        if (others[k] != id && present(b, others[k]))
            snprintf(list + strlen(list), sizeof list - strlen(list), "%s%s", list[0] ? ", " : "",
                     sv_api_field_name(others[k]));
    if (list[0])
        BAD(b, id, "excludes %s: %s", list, advice);
}

/* At most one of the fields may be given: each that is given beside others is named once. */
static void exclude_each_other(struct build *b, const enum sv_field_id *ids, size_t count)
{
    for (size_t k = 0; k < count; k++)
        exclude(b, ids[k], ids, count, "give one of them");
}

struct place_keys {
    enum sv_field_id x, y, lon, lat, z, agl;
    const char *what;
};

static const struct place_keys eye_keys = {SV_FIELD_X, SV_FIELD_Y,   SV_FIELD_LON, SV_FIELD_LAT,
                                           SV_FIELD_Z, SV_FIELD_AGL, "the eye"};
static const struct place_keys target_keys = {SV_FIELD_TARGET_X,   SV_FIELD_TARGET_Y, SV_FIELD_TARGET_LON,
                                              SV_FIELD_TARGET_LAT, SV_FIELD_TARGET_Z, SV_FIELD_TARGET_AGL,
                                              "the target"};

static void pair(struct build *b, enum sv_field_id a, enum sv_field_id c)
{
    char why[64];
    for (int k = 0; k < 2; k++) {
        enum sv_field_id have = k ? c : a, want = k ? a : c;
        if (present(b, have) && !present(b, want)) {
            snprintf(why, sizeof why, "%s needs it", sv_api_field_name(have));
            missing(b, want, why);
        }
    }
}

static void build_place(struct build *b, const struct place_keys *k, struct sv_place *place)
{
    bool xy = present(b, k->x) || present(b, k->y), lonlat = present(b, k->lon) || present(b, k->lat);
    *place = (struct sv_place){.form = xy ? SV_PLACE_XY : lonlat ? SV_PLACE_LONLAT : SV_PLACE_NONE};
    if (xy && lonlat) {
        const enum sv_field_id all[] = {k->x, k->y, k->lon, k->lat};
        for (size_t i = 0; i < 4; i++)
            if (present(b, all[i]))
                BAD(b, all[i], "%s is given by %s, %s and by %s, %s: give one pair", k->what,
                    sv_api_field_name(k->x), sv_api_field_name(k->y), sv_api_field_name(k->lon),
                    sv_api_field_name(k->lat));
    } else {
        pair(b, k->x, k->y);
        pair(b, k->lon, k->lat);
    }
    exclude_each_other(b, (const enum sv_field_id[]){k->z, k->agl}, 2);
    if (place->form == SV_PLACE_NONE)
        return;
    place->x = number(b, lonlat ? k->lon : k->x);
    place->y = number(b, lonlat ? k->lat : k->y);
    place->has_z = present(b, k->z);
    place->z = place->has_z ? number(b, k->z) : 0;
    place->agl = place->has_z ? 0 : number(b, k->agl);
}

/* Fields that a camera form gives no meaning to. */
static void useless(struct build *b, enum sv_field_id id, const char *why)
{
    if (present(b, id))
        BAD(b, id, "has no meaning here: %s", why);
}

static void build_camera(struct build *b, struct sv_view_request *r)
{
    build_place(b, &eye_keys, &r->eye);
    build_place(b, &target_keys, &r->target);
    bool eye = r->eye.form != SV_PLACE_NONE, target = r->target.form != SV_PLACE_NONE;
    if (!eye && !target)
        missing(b, SV_FIELD_X, "a view needs an eye (x and y, or lon and lat) or a target with range");
    if (!eye) {
        useless(b, SV_FIELD_Z,
                target ? "the eye follows from target, range, heading and pitch" : "it needs x, y");
        useless(b, SV_FIELD_AGL,
                target ? "the eye follows from target, range, heading and pitch" : "it needs x, y");
    }
    if (!target) {
        useless(b, SV_FIELD_TARGET_Z, "it needs target_x, target_y or target_lon, target_lat");
        useless(b, SV_FIELD_TARGET_AGL, "it needs target_x, target_y or target_lon, target_lat");
        useless(b, SV_FIELD_RANGE, "it needs a target and no eye");
    } else if (eye) {
        useless(b, SV_FIELD_HEADING, "eye and target give it");
        useless(b, SV_FIELD_PITCH, "eye and target give it");
        useless(b, SV_FIELD_RANGE, "eye and target give it");
    } else if (!present(b, SV_FIELD_RANGE)) {
        missing(b, SV_FIELD_RANGE, "a target without an eye needs it");
    }
    if (r->eye.form != SV_PLACE_XY && r->target.form != SV_PLACE_XY)
        useless(b, SV_FIELD_CRS, "neither x, y nor target_x, target_y is given");
    bool aimed = eye && target;
    r->range_m = target && !eye ? number(b, SV_FIELD_RANGE) : 0;
    r->crs_epsg = (int)number(b, SV_FIELD_CRS);
    r->heading_rad = aimed ? 0 : angle(b, SV_FIELD_HEADING);
    r->pitch_rad = aimed ? 0 : angle(b, SV_FIELD_PITCH);
    r->roll_rad = angle(b, SV_FIELD_ROLL);
    r->north_true = get(b, SV_FIELD_NORTH).choice == 1;
}

static void build_projection(struct build *b, struct sv_view_request *r)
{
    r->projection = (enum sv_projection)get(b, SV_FIELD_PROJECTION).choice;
    r->vfov_rad = angle(b, SV_FIELD_VFOV);
    r->ortho_height_m = 0;
    if (r->projection == SV_PROJECTION_ORTHOGRAPHIC) {
        if (!present(b, SV_FIELD_ORTHO_HEIGHT))
            missing(b, SV_FIELD_ORTHO_HEIGHT, "projection=orthographic needs it");
        r->ortho_height_m = number(b, SV_FIELD_ORTHO_HEIGHT);
    } else if (!present(b, SV_FIELD_PROJECTION) || b->values[SV_FIELD_PROJECTION].good) {
        useless(b, SV_FIELD_ORTHO_HEIGHT, "it needs projection=orthographic");
    }
}

#define BIT(k) (1u << (k))

/* Which layers a format can hold; beside that several need exr, and jpeg has no transparency. */
static const unsigned holds[SV_FORMAT_COUNT] = {
    [SV_FORMAT_JPEG] = BIT(SV_LAYER_COLOR),
    [SV_FORMAT_PNG] = BIT(SV_LAYER_COLOR) | BIT(SV_LAYER_NORMAL),
    [SV_FORMAT_WEBP] = BIT(SV_LAYER_COLOR),
    [SV_FORMAT_TIFF] = BIT(SV_LAYER_COLOR) | BIT(SV_LAYER_DEPTH) | BIT(SV_LAYER_NORMAL) | BIT(SV_LAYER_ID),
    [SV_FORMAT_EXR] = BIT(SV_LAYER_COLOR) | BIT(SV_LAYER_DEPTH) | BIT(SV_LAYER_NORMAL) | BIT(SV_LAYER_ID),
};

static bool can_hold(enum sv_format format, const struct sv_view_request *r)
{
    bool several = (r->layers & (r->layers - 1)) != 0;
    if ((r->layers & ~holds[format]) != 0 || (several && format != SV_FORMAT_EXR))
        return false;
    return r->sky || format != SV_FORMAT_JPEG || !(r->layers & BIT(SV_LAYER_COLOR));
}

/* "depth with sky=off": the layers, and what else decides which formats can hold the picture. */
static const char *picture_text(const struct sv_view_request *r, char *out, size_t size)
{
    out[0] = '\0';
    for (int k = 0; k < SV_LAYER_COUNT; k++)
        if (r->layers & BIT(k))
            snprintf(out + strlen(out), size - strlen(out), "%s%s", out[0] ? "," : "",
                     sv_layer_name((enum sv_layer)k));
    if (!r->sky)
        snprintf(out + strlen(out), size - strlen(out), " with sky=off");
    return out;
}

static void refuse_format(struct build *b, enum sv_format format, const struct sv_view_request *r)
{
    char list[64] = "", picture[64];
    for (int k = 0; k < SV_FORMAT_COUNT; k++)
        if (can_hold((enum sv_format)k, r))
            snprintf(list + strlen(list), sizeof list - strlen(list), "%s%s", list[0] ? ", " : "",
                     sv_format_name((enum sv_format)k));
    BAD(b, SV_FIELD_FORMAT, "%s cannot hold layer=%s: use %s", sv_format_name(format),
        picture_text(r, picture, sizeof picture), list);
}

/* The Accept header leaves nothing: names every media type that can hold the picture. */
static void refuse_accept(struct build *b)
{
    const struct sv_view_request *r = &b->view.request;
    char list[256] = "", picture[64];
    for (int k = 0; k < SV_FORMAT_COUNT; k++)
        if (can_hold((enum sv_format)k, r))
            snprintf(list + strlen(list), sizeof list - strlen(list), "%s%s (format=%s)", list[0] ? ", " : "",
                     sv_format_media((enum sv_format)k), sv_format_name((enum sv_format)k));
    sv_errors_add(b->errors, SV_EUNSUPPORTED, "Accept",
                  "takes no format that can hold layer=%s: accept or give one of %s",
                  picture_text(r, picture, sizeof picture), list);
}

/* By the client's word, by its Accept header among what can hold the picture, or the first that can. Layers
 * of numbers prefer exr, which holds them exactly. */
static void build_format(struct build *b, struct sv_view_request *r)
{
    static const enum sv_format for_color[] = {SV_FORMAT_JPEG, SV_FORMAT_PNG, SV_FORMAT_WEBP, SV_FORMAT_TIFF,
                                               SV_FORMAT_EXR};
    static const enum sv_format for_numbers[] = {SV_FORMAT_EXR, SV_FORMAT_TIFF, SV_FORMAT_PNG, SV_FORMAT_WEBP,
                                                 SV_FORMAT_JPEG};
    b->acceptable = true;
    if (present(b, SV_FIELD_FORMAT)) {
        r->format = (enum sv_format)b->values[SV_FIELD_FORMAT].choice;
        if (b->values[SV_FIELD_FORMAT].good && !can_hold(r->format, r))
            refuse_format(b, r->format, r);
        return;
    }
    const enum sv_format *order = r->layers == BIT(SV_LAYER_COLOR) ? for_color : for_numbers;
    enum sv_format offered[SV_FORMAT_COUNT];
    const char *media[SV_FORMAT_COUNT];
    int count = 0;
    for (int k = 0; k < SV_FORMAT_COUNT; k++)
        if (can_hold(order[k], r)) {
            offered[count] = order[k];
            media[count++] = sv_format_media(order[k]);
        }
    /* f=json draws nothing: its Accept header speaks of the JSON answer, not of a picture. */
    int best = r->describe ? 0 : sv_api_accept_choose(b->accept, media, count);
    b->view.negotiated = !r->describe;
    b->acceptable = best >= 0;
    r->format = offered[best >= 0 ? best : 0];
}

static void build_picture(struct build *b, struct sv_view_request *r)
{
    r->width = (int)number(b, SV_FIELD_WIDTH);
    r->height = (int)number(b, SV_FIELD_HEIGHT);
    r->q = (int)number(b, SV_FIELD_Q);
    r->layers = get(b, SV_FIELD_LAYER).choice;
    r->sky = get(b, SV_FIELD_SKY).choice == 1;
    r->describe = get(b, SV_FIELD_F).choice == 1;
    build_format(b, r);
}

static void build_effort(struct build *b, struct sv_view_request *r)
{
    static const enum sv_field_id efforts[] = {SV_FIELD_QUALITY, SV_FIELD_MAX_ERROR, SV_FIELD_BUDGET_MS};
    exclude_each_other(b, efforts, sizeof efforts / sizeof efforts[0]);
    r->quality = (enum sv_quality)get(b, SV_FIELD_QUALITY).choice;
    r->max_error_px = number(b, SV_FIELD_MAX_ERROR);
    r->budget_ms = number(b, SV_FIELD_BUDGET_MS);
    r->trees = (enum sv_trees)get(b, SV_FIELD_TREES).choice;
    r->relief = (enum sv_relief_mode)get(b, SV_FIELD_RELIEF).choice;
    r->relief_distance_m = number(b, SV_FIELD_RELIEF_DISTANCE);
    r->relief_resolution = (int)number(b, SV_FIELD_RELIEF_RESOLUTION);
    r->shadows = get(b, SV_FIELD_SHADOWS).choice == 1;
    r->samples = (int)number(b, SV_FIELD_SAMPLES);
    r->air = get(b, SV_FIELD_AIR).choice == 1;
    if (r->quality == SV_QUALITY_REFERENCE && r->trees != SV_TREES_AUTO && r->trees != SV_TREES_RAYCAST &&
        r->trees != SV_TREES_NONE)
        BAD(b, SV_FIELD_TREES,
            "quality=reference is ray cast and has no trees=%s: expected auto, raycast, none",
            sv_trees_name(r->trees));
}

static void build_sun(struct build *b, struct sv_view_request *r)
{
    static const enum sv_field_id time[] = {SV_FIELD_TIME};
    static const enum sv_field_id angles[] = {SV_FIELD_SUN_AZIMUTH, SV_FIELD_SUN_ELEVATION};
    static const char advice[] = "give the time or the sun's angles";
    exclude(b, SV_FIELD_TIME, angles, 2, advice);
    exclude(b, SV_FIELD_SUN_AZIMUTH, time, 1, advice);
    exclude(b, SV_FIELD_SUN_ELEVATION, time, 1, advice);
    r->has_sun_azimuth = present(b, SV_FIELD_SUN_AZIMUTH);
    r->has_sun_elevation = present(b, SV_FIELD_SUN_ELEVATION);
    r->has_time = present(b, SV_FIELD_TIME);
    r->sun_azimuth_rad = angle(b, SV_FIELD_SUN_AZIMUTH);
    r->sun_elevation_rad = angle(b, SV_FIELD_SUN_ELEVATION);
    r->time_unix_s = number(b, SV_FIELD_TIME);
}

enum sv_field_id sv_api_view_cell_bar(const struct sv_view_request *request)
{
    return request->projection != SV_PROJECTION_PERSPECTIVE                           ? SV_FIELD_PROJECTION
           : request->layers != BIT(SV_LAYER_COLOR)                                   ? SV_FIELD_LAYER
           : request->quality == SV_QUALITY_REFERENCE                                 ? SV_FIELD_QUALITY
           : request->trees != SV_TREES_AUTO && request->trees != SV_TREES_NONE       ? SV_FIELD_TREES
           : sv_api_view_samples(request) != 1                                        ? SV_FIELD_SAMPLES
                                                                                      : SV_FIELD_COUNT;
}

/* What is asked to be drawn from panels must be what they can draw, and only panels have a distance and a size. */
static void check_relief(struct build *b, const struct sv_view_request *r)
{
    static const enum sv_field_id of_panels[] = {SV_FIELD_RELIEF_DISTANCE, SV_FIELD_RELIEF_RESOLUTION};
    bool asked = r->relief == SV_RELIEF_ON || r->relief == SV_RELIEF_PAPER;
    enum sv_field_id bar = asked ? sv_api_view_cell_bar(r) : SV_FIELD_COUNT;
    if (bar != SV_FIELD_COUNT)
        BAD(b, SV_FIELD_RELIEF,
            "%s excludes this %s: panels show layer=color in perspective, with 1 sample and trees=auto or none",
            sv_relief_name(r->relief), sv_api_field_name(bar));
    for (size_t k = 0; k < 2 && r->relief == SV_RELIEF_OFF; k++)
        useless(b, of_panels[k], "relief=off draws everything directly");
}

/* The configured limits. A width or height that is bad by itself has its default here, and its own error
 * already. */
static void check_limits(struct build *b, const struct sv_view_request *r)
{
    uint64_t pixels = (uint64_t)r->width * (uint64_t)r->height;
    int samples = sv_api_view_samples(r);
    if (pixels > b->limits->pixels_max) {
        for (int k = 0; k < 2; k++)
            if (present(b, k ? SV_FIELD_HEIGHT : SV_FIELD_WIDTH))
                BAD(b, k ? SV_FIELD_HEIGHT : SV_FIELD_WIDTH,
                    "%d x %d px is %" PRIu64 " pixels: this service draws at most %" PRIu64, r->width,
                    r->height, pixels, b->limits->pixels_max);
        if (!present(b, SV_FIELD_WIDTH) && !present(b, SV_FIELD_HEIGHT))
            BAD(b, SV_FIELD_WIDTH,
                "the default size is over this service's limit of %" PRIu64 " pixels: give a smaller",
                b->limits->pixels_max);
    } else if (pixels * (uint64_t)samples > b->limits->sample_pixels_max) {
        BAD(b, SV_FIELD_SAMPLES,
            "%d samples of %" PRIu64 " pixels are %" PRIu64 ": this service draws at most %" PRIu64
            " samples a picture; ask for fewer samples or pixels",
            samples, pixels, pixels * (uint64_t)samples, b->limits->sample_pixels_max);
    }
}

static void not_built(struct build *b, enum sv_field_id id, const char *value)
{
    sv_errors_add(b->errors, SV_EUNSUPPORTED, sv_api_field_name(id), "%s%s%s is not built yet: leave it out",
                  sv_api_field_name(id), value ? "=" : "", value ? value : "");
}

/* What is legal and waits for a later version. */
static void check_built(struct build *b)
{
    for (int k = 0; k < SV_FIELD_COUNT; k++) {
        enum sv_field_id id = (enum sv_field_id)k;
        const struct sv_field *field = sv_api_field(id);
        if (!present(b, id))
            continue;
        if (field->unbuilt)
            not_built(b, id, NULL);
        else if (field->choices && field->type == SV_FIELD_CHOICE &&
                 (field->unbuilt_choices & BIT(b->values[id].choice)))
            not_built(b, id, field->choices[b->values[id].choice]);
    }
}

bool sv_api_view_is_raycast(const struct sv_view_request *request)
{
    return request->quality == SV_QUALITY_REFERENCE || request->trees == SV_TREES_RAYCAST;
}

int sv_api_view_samples(const struct sv_view_request *request)
{
    return request->samples ? request->samples : request->quality == SV_QUALITY_REFERENCE ? 16 : 1;
}

enum sv_problem_kind sv_api_view_rules(const struct sv_field_value *values, const char *accept,
                                       const struct sv_api_view_limits *limits, struct sv_api_view *view,
                                       struct sv_errors *errors)
{
    struct build b = {.values = values, .accept = accept, .limits = limits, .errors = errors};
    memset(&b.view, 0, sizeof b.view); /* padding too: requests are compared and sent as bytes */
    struct sv_view_request *r = &b.view.request;
    build_camera(&b, r);
    build_projection(&b, r);
    build_picture(&b, r);
    build_effort(&b, r);
    build_sun(&b, r);
    check_relief(&b, r);
    check_limits(&b, r);
    if (errors->total > 0)
        return SV_PROBLEM_BAD_REQUEST;
    check_built(&b);
    if (errors->total > 0)
        return SV_PROBLEM_NOT_BUILT;
    if (!b.acceptable) {
        refuse_accept(&b);
        return SV_PROBLEM_NOT_ACCEPTABLE;
    }
    *view = b.view;
    return SV_PROBLEM_NONE;
}
