/* patch_parse.c - see patch_parse.h: the tables, and what is special about some keys. Rows as in
 * core/scene/scene_file.c; scatter and objects are its own. */
#include "api/patch_parse.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "api/json.h"
#include "api/patch_tables.h"
#include "core/base/rfc3339.h"
#include "core/scene/forest.h"
#include "core/scene/id.h"

enum { ADD_MAX = 1 << 20, IDS_MAX = 1 << 20, OBJECTS_MAX = 65536 };
/* Moments for which the sun's formula is good: 1900 .. 2100. */
static const double TIME_MIN_S = -2208988800.0, TIME_MAX_S = 4133980799.0;

/* ---- values of special form ---- */

static void read_moment(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                        void *base)
{
    double *at = (double *)(void *)((char *)base + f->offset);
    struct sv_error error;
    *at = NAN;
    const char *s = json ? sv_value_string_in(r, json, f) : NULL;
    if (!s)
        return;
    if (sv_rfc3339_parse(s, at, &error) != SV_OK)
        sv_value_complain(r, SV_EINVAL, "\"%s\" %s; it must be a date and time as in RFC 3339",
                          sv_value_show(s).text, error.message);
    else if (!(*at >= TIME_MIN_S && *at <= TIME_MAX_S))
        sv_value_complain(r, SV_EINVAL, "\"%s\" is outside the years 1900 .. 2100", sv_value_show(s).text);
}

static void read_ids(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                     uint32_t **ids, int *count)
{
    struct sv_value_field list = *f;
    list.max = IDS_MAX;
    *ids = sv_value_list(r, json, &list, sizeof **ids, count);
    int k = 0;
    for (const cJSON *item = *ids ? json->child : NULL; item; item = item->next, k++) {
        double v = 0;
        size_t at = sv_value_enter(r, "[%d]", k);
        if (sv_value_number_in(r, item, f, true, &v))
            (*ids)[k] = (uint32_t)v;
        sv_value_leave(r, at);
    }
}

static void read_tree_ids(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                          void *base)
{
    struct sv_scene_patch *p = base;
    read_ids(r, json, f, &p->tree_ids, &p->tree_id_count);
}

static void read_object_ids(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                            void *base)
{
    struct sv_scene_patch *p = base;
    read_ids(r, json, f, &p->object_ids, &p->object_id_count);
}

/* ---- GeoJSON ---- */

static bool is_position(const cJSON *json)
{
    int n = cJSON_IsArray(json) ? cJSON_GetArraySize(json) : 0;
    for (const cJSON *c = n ? json->child : NULL; c; c = c->next)
        if (!cJSON_IsNumber(c) || !isfinite(c->valuedouble))
            return false;
    return n == 2 || n == 3;
}

/* What is wrong with a ring; NULL: nothing. */
static const char *ring_fault(const cJSON *ring)
{
    int n = 0;
    const cJSON *last = NULL;
    if (!cJSON_IsArray(ring))
        return "must be an array of positions";
    for (const cJSON *p = ring->child; p; p = p->next, n++) {
        last = p;
        if (!is_position(p))
            return "holds a position that is not two or three numbers";
    }
    if (n < 4)
        return "needs four positions or more";
    return cJSON_Compare(ring->child, last, true) ? NULL : "must end where it begins";
}

static void check_polygon(struct sv_value_reader *r, const cJSON *polygon)
{
    int k = 0;
    if (!cJSON_IsArray(polygon) || !polygon->child)
        sv_value_complain(r, SV_EINVAL, "must be an array of rings, the outer one first");
    for (const cJSON *ring = cJSON_IsArray(polygon) ? polygon->child : NULL; ring; ring = ring->next, k++) {
        size_t at = sv_value_enter(r, "[%d]", k);
        const char *fault = ring_fault(ring);
        if (fault)
            sv_value_complain(r, SV_EINVAL, "the ring %s", fault);
        sv_value_leave(r, at);
    }
}

static void check_coordinates(struct sv_value_reader *r, const cJSON *coordinates, bool multi)
{
    size_t at = sv_value_enter_key(r, "coordinates");
    int k = 0;
    if (!coordinates)
        sv_value_complain(r, SV_EINVAL, "is missing; it must be an array");
    else if (!multi)
        check_polygon(r, coordinates);
    else if (!cJSON_IsArray(coordinates) || !coordinates->child)
        sv_value_complain(r, SV_EINVAL, "must be an array of polygons");
    else
        for (const cJSON *polygon = coordinates->child; polygon; polygon = polygon->next, k++) {
            size_t in = sv_value_enter(r, "[%d]", k);
            check_polygon(r, polygon);
            sv_value_leave(r, in);
        }
    sv_value_leave(r, at);
}

/* Kept as text: core/geo reads it as it reads files. */
static void read_geometry(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                          void *base)
{
    if (!json)
        return;
    if (!cJSON_IsObject(json)) {
        sv_value_complain_type(r, json, "a GeoJSON Polygon or MultiPolygon");
        return;
    }
    size_t before = r->errors->total;
    const char *type = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(json, "type"));
    bool multi = type && strcmp(type, "MultiPolygon") == 0;
    for (const cJSON *item = json->child; item; item = item->next)
        if (strcmp(item->string, "type") != 0 && strcmp(item->string, "coordinates") != 0) {
            size_t at = sv_value_enter_key(r, sv_value_show(item->string).text);
            sv_value_complain(r, SV_EINVAL, "is not a known key here; known: type, coordinates");
            sv_value_leave(r, at);
        }
    if (!type || (!multi && strcmp(type, "Polygon") != 0))
        sv_value_complain(r, SV_EINVAL, "\"type\" must be Polygon or MultiPolygon");
    check_coordinates(r, cJSON_GetObjectItemCaseSensitive(json, "coordinates"), multi);
    if (r->errors->total > before)
        return;
    char *text = cJSON_PrintUnformatted(json);
    *(char **)((char *)base + f->offset) = text;
    if (!text)
        sv_value_complain(r, SV_ENOMEM, "no memory for it");
}

/* ---- the sections with rules of their own ---- */

/* A place is x with y, or lon with lat. */
static void check_place(struct sv_value_reader *r, const cJSON *json)
{
    static const char *const keys[4] = {"x", "y", "lon", "lat"};
    bool has[4];
    if (!cJSON_IsObject(json))
        return;
    for (int k = 0; k < 4; k++)
        has[k] = cJSON_HasObjectItem(json, keys[k]);
    if (has[0] != has[1] || has[2] != has[3] || has[0] == has[2])
        sv_value_complain(r, SV_EINVAL,
                          "needs a place: \"x\" and \"y\" (metres of the scene's system), or \"lon\" "
                          "and \"lat\" (degrees)");
}

static void read_sun(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f, void *base)
{
    sv_value_section(r, json, f->section, base);
    bool time = cJSON_HasObjectItem(json, "time"),
         angles = cJSON_HasObjectItem(json, "azimuth_deg") || cJSON_HasObjectItem(json, "elevation_deg");
    if (cJSON_IsObject(json) && time == angles)
        sv_value_complain(r, SV_EINVAL,
                          time ? "has \"time\" and angles; give one"
                               : "needs \"azimuth_deg\", \"elevation_deg\" or \"time\"");
}

static void read_near(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                      void *base)
{
    struct sv_scene_patch *p = base;
    p->has_near = json != NULL;
    if (!json)
        return;
    sv_value_section(r, json, f->section, &p->near);
    check_place(r, json);
}

/* Parts of the patch: objects whose rows write into the patch itself. */
static void read_part(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                      void *base)
{
    if (json)
        sv_value_section(r, json, f->section, base);
    if (cJSON_IsObject(json) && !json->child)
        sv_value_complain(r, SV_EINVAL, "says nothing to do");
}

static void read_adds(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                      void *base);
static void read_objects(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                         void *base);
static void read_scatter(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                         void *base);

/* ---- the tables: key, type, unit, least, most, default, reader, section, place, required ---- */

#define SECTION(rows)                          \
    {                                          \
        rows, sizeof(rows) / sizeof((rows)[0]) \
    }
#define IN(type, member) offsetof(struct type, member), false
#define MUST(type, member) offsetof(struct type, member), true
#define PLACE_ROWS(type)                                                                \
    {"x", "number", "m", -1e9, 1e9, NAN, sv_value_number, NULL, IN(type, x)},           \
        {"y", "number", "m", -1e9, 1e9, NAN, sv_value_number, NULL, IN(type, y)},       \
        {"lon", "number", "deg", -180, 180, NAN, sv_value_number, NULL, IN(type, lon)}, \
    {                                                                                   \
        "lat", "number", "deg", -90, 90, NAN, sv_value_number, NULL, IN(type, lat)      \
    }

static const struct sv_value_field SUN[] = {
    {"azimuth_deg", "number", "deg", -360, 360, NAN, sv_value_number, NULL,
     IN(sv_scene_patch, sun_azimuth_deg)},
    {"elevation_deg", "number", "deg", -90, 90, NAN, sv_value_number, NULL,
     IN(sv_scene_patch, sun_elevation_deg)},
    {"time", SV_PATCH_MOMENT, "", 1, 64, 0, read_moment, NULL, IN(sv_scene_patch, sun_time_s)},
};
static const struct sv_value_section SUN_SECTION = SECTION(SUN);

/* A tree, or a scatter: which of the two tables is read goes by "scatter". */
static const struct sv_value_field TREE[] = {
    PLACE_ROWS(sv_patch_tree),
    {"species", "string", "", 1, SV_SCENE_NAME_MAX - 1, 0, sv_value_species, NULL,
     MUST(sv_patch_tree, species)},
    {"height_m", "number", "m", SV_TREE_HEIGHT_MIN_M, SV_TREE_HEIGHT_MAX_M, 0, sv_value_number, NULL,
     MUST(sv_patch_tree, height_m)},
    {"rotation_deg", "number", "deg", -360, 360, NAN, sv_value_number, NULL, IN(sv_patch_tree, rotation_deg)},
};
static const struct sv_value_section TREE_SECTION = SECTION(TREE);
static const struct sv_value_field SCATTER[] = {
    {"scatter", "object", "", 0, 0, 0, read_scatter, &sv_scene_scatter_section, IN(sv_patch_add, scatter)},
};
static const struct sv_value_section SCATTER_SECTION = SECTION(SCATTER);

static const struct sv_value_field NEAR[] = {
    PLACE_ROWS(sv_patch_near),
    {"radius_m", "number", "m", 0, 1e6, 0, sv_value_number, NULL, MUST(sv_patch_near, radius_m)},
};
static const struct sv_value_section NEAR_SECTION = SECTION(NEAR);

static const struct sv_value_field REMOVE_TREES[] = {
    {"ids", SV_PATCH_IDS, "", SV_ID_TREE_FIRST, UINT32_MAX, 0, read_tree_ids, NULL, 0, false},
    {"within", SV_PATCH_GEOMETRY, "", 0, 0, 0, read_geometry, NULL, IN(sv_scene_patch, within)},
    {"near", "object", "", 0, 0, 0, read_near, &NEAR_SECTION, 0, false},
};
static const struct sv_value_section REMOVE_TREES_SECTION = SECTION(REMOVE_TREES);
static const struct sv_value_field TREES[] = {
    {"remove", "object", "", 0, 0, 0, read_part, &REMOVE_TREES_SECTION, 0, false},
    {"add", SV_PATCH_LIST, "", 0, ADD_MAX, 0, read_adds, &TREE_SECTION, 0, false},
};
static const struct sv_value_section TREES_SECTION = SECTION(TREES);

static const struct sv_value_field REMOVE_OBJECTS[] = {
    {"ids", SV_PATCH_IDS, "", SV_ID_OBJECT_FIRST, SV_ID_TREE_FIRST - 1, 0, read_object_ids, NULL, 0, false},
};
static const struct sv_value_section REMOVE_OBJECTS_SECTION = SECTION(REMOVE_OBJECTS);
static const struct sv_value_field OBJECTS[] = {
    {"remove", "object", "", 0, 0, 0, read_part, &REMOVE_OBJECTS_SECTION, 0, false},
    {"add", SV_PATCH_LIST, "", 0, OBJECTS_MAX, 0, read_objects, &sv_scene_object_section, 0, false},
};
static const struct sv_value_section OBJECTS_SECTION = SECTION(OBJECTS);

static const struct sv_value_field PATCH[] = {
    {"sun", "object", "", 0, 0, 0, read_sun, &SUN_SECTION, 0, false},
    {"trees", "object", "", 0, 0, 0, read_part, &TREES_SECTION, 0, false},
    {"objects", "object", "", 0, 0, 0, read_part, &OBJECTS_SECTION, 0, false},
};
static const struct sv_value_section PATCH_SECTION = SECTION(PATCH);

const struct sv_value_section *sv_api_patch_section(void)
{
    return &PATCH_SECTION;
}

const struct sv_value_section *sv_api_patch_scatter_section(void)
{
    return &SCATTER_SECTION;
}

/* ---- lists ---- */

/* The scene file's keys; "within" is a geometry here, not a file. */
static void read_scatter(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                         void *base)
{
    struct sv_value_field rows[SV_VALUE_FIELDS_MAX];
    struct sv_value_section section = {rows, f->section->count};
    memcpy(rows, f->section->fields, (size_t)section.count * sizeof *rows);
    for (int k = 0; k < section.count; k++)
        if (rows[k].read == sv_value_path) {
            rows[k].type = SV_PATCH_GEOMETRY;
            rows[k].read = read_geometry;
        }
    sv_value_section(r, json, &section, (char *)base + f->offset);
}

static void read_adds(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                      void *base)
{
    struct sv_scene_patch *p = base;
    p->add = sv_value_list(r, json, f, sizeof *p->add, &p->add_count);
    int k = 0;
    for (const cJSON *item = p->add ? json->child : NULL; item; item = item->next, k++) {
        struct sv_patch_add *a = &p->add[k];
        size_t at = sv_value_enter(r, "[%d]", k);
        a->is_scatter = cJSON_HasObjectItem(item, "scatter");
        if (a->is_scatter) {
            sv_value_section(r, item, &SCATTER_SECTION, a);
        } else {
            sv_value_section(r, item, f->section, &a->tree);
            check_place(r, item);
        }
        sv_value_leave(r, at);
    }
}

static void read_objects(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                         void *base)
{
    struct sv_scene_patch *p = base;
    p->objects = sv_value_list(r, json, f, sizeof *p->objects, &p->object_count);
    int k = 0;
    for (const cJSON *item = p->objects ? json->child : NULL; item; item = item->next, k++) {
        size_t at = sv_value_enter(r, "[%d]", k);
        sv_value_section(r, item, f->section, &p->objects[k]);
        sv_value_leave(r, at);
    }
}

/* ---- the whole ---- */

static void read_body(struct sv_value_reader *r, const cJSON *root, struct sv_scene_patch *patch)
{
    sv_value_section(r, root, &PATCH_SECTION, patch);
    if (cJSON_IsObject(root) && !root->child)
        sv_value_complain(r, SV_EINVAL, "says nothing to do: give \"sun\", \"trees\" or \"objects\"");
}

enum sv_status sv_api_patch_parse(const char *text, size_t bytes, const struct sv_scene_spec *scene,
                                  struct sv_scene_patch *patch, struct sv_errors *errors)
{
    struct sv_scene_patch made = {.sun_azimuth_deg = NAN, .sun_elevation_deg = NAN, .sun_time_s = NAN};
    struct sv_scene_spec known = *scene; /* a reader looks names up in it, and writes nothing */
    struct sv_value_reader r = {.look_for_files = true, .spec = &known, .errors = errors};
    size_t count = errors->count, total = errors->total;
    struct sv_error error;
    cJSON *root = NULL;
    const char *slash = scene->path ? strrchr(scene->path, '/') : NULL;
    r.folder = strndup(scene->path ? scene->path : "", slash ? (size_t)(slash - scene->path) + 1 : 0);
    if (!r.folder)
        sv_value_complain(&r, SV_ENOMEM, "no memory to read it");
    else if (sv_api_json_parse(text, bytes, &root, &error) != SV_OK)
        sv_errors_add(errors, error.code, error.field, "%s", error.message);
    else
        read_body(&r, root, &made);
    cJSON_Delete(root);
    free(r.folder);
    if (errors->total == total) {
        *patch = made;
        return SV_OK;
    }
    sv_scene_patch_finish(&made);
    return errors->count > count ? errors->items[count].code : SV_EINVAL;
}
