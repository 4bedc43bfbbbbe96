#include "tests/api/random_view.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/view/request.h"

static int below(struct sv_rng *rng, int n)
{
    return (int)(sv_rng_next(rng) % (uint64_t)n);
}

static int choices(const struct sv_field *field)
{
    int n = 0;
    while (field->choices[n])
        n++;
    return n;
}

static void random_number(struct sv_rng *rng, const struct sv_field *field, char out[64])
{
    double v = sv_rng_range(rng, field->min, field->max);
    int whole = field->type != SV_FIELD_NUMBER;
    if (whole)
        v = floor(v);
    switch (below(rng, 5)) {
    case 0:
        snprintf(out, 64, "%.17g", v);
        break;
    case 1:
        snprintf(out, 64, whole ? "%.0f.0" : "%.3f",
                 v < field->min + 1 || v > field->max - 1 ? field->max : v);
        break;
    case 2:
        snprintf(out, 64, "%.17g", field->max);
        break;
    default:
        snprintf(out, 64, "%.0f", ceil(v));
        break;
    }
}

void random_value(struct sv_rng *rng, enum sv_field_id id, char out[64])
{
    const struct sv_field *field = sv_api_field(id);
    out[0] = '\0';
    switch (field->type) {
    case SV_FIELD_NUMBER:
    case SV_FIELD_INTEGER:
        random_number(rng, field, out);
        break;
    case SV_FIELD_INTEGER_SET:
    case SV_FIELD_CHOICE:
    case SV_FIELD_SWITCH:
        snprintf(out, 64, "%s", field->choices[below(rng, choices(field))]);
        break;
    case SV_FIELD_CHOICES:
        while (!out[0])
            for (int k = 0; k < choices(field); k++)
                if (below(rng, 3) == 0)
                    snprintf(out + strlen(out), 64 - strlen(out), "%s%s", out[0] ? "," : "",
                             field->choices[k]);
        break;
    case SV_FIELD_EPSG:
        snprintf(out, 64, "EPSG:%d", 1 + below(rng, 999999));
        break;
    case SV_FIELD_MOMENT:
        snprintf(out, 64, "%d-%02d-%02dT%02d:%02d:%02d%s%s", 1901 + below(rng, 199), 1 + below(rng, 12),
                 1 + below(rng, 28), below(rng, 24), below(rng, 60), below(rng, 60),
                 (const char *[]){"", ".5", ".125", ".999999"}[below(rng, 4)],
                 (const char *[]){"Z", "+02:00", "-11:30", "z"}[below(rng, 4)]);
        break;
    case SV_FIELD_TYPE_COUNT:
        break;
    }
}

static void put(struct sv_rng *rng, struct random_view *view, enum sv_field_id id)
{
    struct random_pair *pair = &view->pairs[view->count++];
    pair->id = id;
    random_value(rng, id, pair->value);
}

static void maybe(struct sv_rng *rng, struct random_view *view, enum sv_field_id id)
{
    if (below(rng, 3) == 0)
        put(rng, view, id);
}

static void set(struct random_view *view, enum sv_field_id id, const char *value)
{
    struct random_pair *pair = &view->pairs[view->count++];
    pair->id = id;
    snprintf(pair->value, sizeof pair->value, "%s", value);
}

static void place(struct sv_rng *rng, struct random_view *view, const enum sv_field_id keys[6])
{
    int lonlat = below(rng, 2);
    put(rng, view, keys[lonlat ? 2 : 0]);
    put(rng, view, keys[lonlat ? 3 : 1]);
    if (below(rng, 2))
        put(rng, view, keys[below(rng, 2) ? 4 : 5]);
    if (!lonlat && view->pairs[0].id != SV_FIELD_CRS && below(rng, 3) == 0) {
        view->pairs[view->count] = view->pairs[0];
        view->count++;
        view->pairs[0].id = SV_FIELD_CRS;
        random_value(rng, SV_FIELD_CRS, view->pairs[0].value);
    }
}

static void camera(struct sv_rng *rng, struct random_view *view)
{
    static const enum sv_field_id eye[6] = {SV_FIELD_X,   SV_FIELD_Y, SV_FIELD_LON,
                                            SV_FIELD_LAT, SV_FIELD_Z, SV_FIELD_AGL};
    static const enum sv_field_id target[6] = {SV_FIELD_TARGET_X,   SV_FIELD_TARGET_Y, SV_FIELD_TARGET_LON,
                                               SV_FIELD_TARGET_LAT, SV_FIELD_TARGET_Z, SV_FIELD_TARGET_AGL};
    int form = below(rng, 3); /* eye; eye and target; orbit */
    if (form != 2)
        place(rng, view, eye);
    if (form != 0)
        place(rng, view, target);
    if (form == 2)
        put(rng, view, SV_FIELD_RANGE);
    if (form != 1) {
        maybe(rng, view, SV_FIELD_HEADING);
        maybe(rng, view, SV_FIELD_PITCH);
    }
    maybe(rng, view, SV_FIELD_ROLL);
    maybe(rng, view, SV_FIELD_NORTH);
    maybe(rng, view, SV_FIELD_VFOV);
    if (below(rng, 4) == 0) {
        set(view, SV_FIELD_PROJECTION, "orthographic");
        put(rng, view, SV_FIELD_ORTHO_HEIGHT);
    }
}

static void picture(struct sv_rng *rng, struct random_view *view)
{
    maybe(rng, view, SV_FIELD_WIDTH);
    maybe(rng, view, SV_FIELD_HEIGHT);
    maybe(rng, view, SV_FIELD_Q);
    maybe(rng, view, SV_FIELD_AIR);
    maybe(rng, view, SV_FIELD_F);
    switch (below(rng, 4)) {
    case 0:
        put(rng, view, SV_FIELD_FORMAT);
        break;
    case 1:
        put(rng, view, SV_FIELD_LAYER);
        put(rng, view, SV_FIELD_SKY);
        break;
    case 2:
        set(view, SV_FIELD_FORMAT, "exr");
        put(rng, view, SV_FIELD_LAYER);
        maybe(rng, view, SV_FIELD_SKY);
        break;
    default:
        break;
    }
}

void random_view(struct sv_rng *rng, struct random_view *view)
{
    static const char *const built[] = {"auto", "raycast", "polygon", "none"};
    memset(view, 0, sizeof *view);
    camera(rng, view);
    picture(rng, view);
    const char *trees = built[below(rng, 4)];
    int reference = strcmp(trees, "polygon") != 0 && below(rng, 3) == 0;
    if (below(rng, 2))
        set(view, SV_FIELD_TREES, trees);
    else
        trees = "auto";
    if (reference)
        set(view, SV_FIELD_QUALITY, "reference");
    else if (below(rng, 2))
        set(view, SV_FIELD_QUALITY, below(rng, 2) ? "fast" : "balanced");
    if (below(rng, 3) == 0)
        set(view, SV_FIELD_RELIEF, below(rng, 2) ? "auto" : "off");
    else
        maybe(rng, view, SV_FIELD_RELIEF_RESOLUTION);
    if (below(rng, 3) == 0)
        set(view, SV_FIELD_SHADOWS, below(rng, 2) ? "on" : "off");
    maybe(rng, view, SV_FIELD_SAMPLES);
    if (below(rng, 4) == 0) {
        put(rng, view, SV_FIELD_TIME);
    } else {
        maybe(rng, view, SV_FIELD_SUN_AZIMUTH);
        maybe(rng, view, SV_FIELD_SUN_ELEVATION);
    }
}

void random_view_shuffle(struct sv_rng *rng, struct random_view *view)
{
    for (int k = view->count - 1; k > 0; k--) {
        int j = below(rng, k + 1);
        struct random_pair swap = view->pairs[k];
        view->pairs[k] = view->pairs[j];
        view->pairs[j] = swap;
    }
}

size_t random_view_kvp(const struct random_view *view, char *out, size_t size)
{
    size_t used = 0;
    out[0] = '\0';
    for (int k = 0; k < view->count; k++) {
        used += (size_t)snprintf(out + used, size - used, "%s%s=", k ? "&" : "",
                                 sv_api_field_name(view->pairs[k].id));
        for (const char *p = view->pairs[k].value; *p; p++)
            used += (size_t)snprintf(out + used, size - used, *p == '+' ? "%%2B" : "%c", *p);
    }
    return used;
}

size_t random_view_json(struct sv_rng *rng, const struct random_view *view, char *out, size_t size)
{
    size_t used = (size_t)snprintf(out, size, "{");
    for (int k = 0; k < view->count; k++) {
        const struct random_pair *pair = &view->pairs[k];
        enum sv_field_type type = sv_api_field(pair->id)->type;
        int number = type == SV_FIELD_NUMBER || type == SV_FIELD_INTEGER || type == SV_FIELD_INTEGER_SET;
        int boolean = type == SV_FIELD_SWITCH && below(rng, 2);
        const char *value = boolean ? strcmp(pair->value, "on") == 0 ? "true" : "false" : pair->value;
        const char *quote = number || boolean ? "" : "\"";
        used += (size_t)snprintf(out + used, size - used, "%s\"%s\": %s%s%s", k ? ", " : "",
                                 sv_api_field_name(pair->id), quote, value, quote);
    }
    return used + (size_t)snprintf(out + used, size - used, "}");
}
