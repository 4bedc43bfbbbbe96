/* patch_schema.c - the schema of a patch, written from its tables. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "api/json_write.h"
#include "api/patch_parse.h"
#include "api/patch_tables.h"

static const struct {
    const char *path, *text;
} help[] = {
    {"", "A change of the scene. What is removed is taken of what stands before the change; then comes what "
         "is added. "
         "Trees and objects keep their ids for as long as they stand; those that come get the next ones, in "
         "the order "
         "of the patch."},
    {"sun", "As in the scene file (azimuth clockwise from grid north), or where it stands at a moment over "
            "the scene."},
    {"sun.time", "RFC 3339, 1900 to 2100. Excludes the angles."},
    {"trees.remove", "Every tree that one of these names."},
    {"trees.remove.ids", "Ids as layer=id and /v1/scene have them; one that no tree has is an error."},
    {"trees.remove.within",
     "A GeoJSON Polygon or MultiPolygon: degrees as in RFC 7946; metres of the scene's system when "
     "the numbers can be no degrees or the scene has no place on Earth, as for the files that a "
     "scene file names."},
    {"trees.remove.near", "Trees whose stem is at most radius_m from the place: x and y, or lon and lat."},
    {"trees.add",
     "Trees by place (x and y, or lon and lat), species, height; or {\"scatter\": ...} with the keys of "
     "the scene file."},
    {"trees.add.rotation_deg", "Clockwise seen from above; by a hash of the place when it is missing."},
    {"trees.add.scatter.within", "A geometry, as in trees.remove.within."},
    {"objects.remove.ids", "Ids as layer=id and /v1/scene have them."},
    {"objects.add",
     "As in the scene file; model is the path of a file that the service can read, from the scene file's "
     "folder."},
};

static void describe(cJSON *schema, const char *path, bool *good)
{
    for (size_t k = 0; k < sizeof help / sizeof help[0]; k++)
        if (strcmp(help[k].path, path) == 0)
            sv_api_json_add_text(schema, "description", help[k].text, good);
}

static cJSON *section_schema(const struct sv_value_section *section, const char *path, bool *good);

static void add_range(cJSON *schema, const struct sv_value_field *f, bool *good)
{
    sv_api_json_add_number(schema, "minimum", f->min, good);
    sv_api_json_add_number(schema, "maximum", f->max, good);
}

static cJSON *typed(const char *type, bool *good)
{
    cJSON *schema = cJSON_CreateObject();
    sv_api_json_add_text(schema, "type", type, good);
    return schema;
}

static void number_schema(cJSON *schema, const struct sv_value_field *f, bool *good)
{
    add_range(schema, f, good);
    if (!f->required && isfinite(f->fallback))
        sv_api_json_add_number(schema, "default", f->fallback, good);
    if (f->unit[0])
        sv_api_json_add_text(schema, "x-unit", f->unit, good);
}

/* A tree or a scatter. */
static cJSON *item_schema(const struct sv_value_field *f, const char *path, bool *good)
{
    cJSON *one = section_schema(f->section, path, good);
    if (strcmp(path, "trees.add") != 0)
        return one;
    cJSON *either = cJSON_CreateArray(), *both = cJSON_CreateObject();
    sv_api_json_append(either, one, good);
    sv_api_json_append(either, section_schema(sv_api_patch_scatter_section(), path, good), good);
    sv_api_json_add(both, "oneOf", either, good);
    return both;
}

static cJSON *ids_schema(const struct sv_value_field *f, bool *good)
{
    cJSON *item = typed("integer", good), *list = typed("array", good);
    add_range(item, f, good);
    sv_api_json_add(list, "items", item, good);
    return list;
}

static cJSON *range_schema(const struct sv_value_field *f, bool *good)
{
    cJSON *either = cJSON_CreateArray(), *both = cJSON_CreateObject();
    cJSON *one = typed("number", good), *item = typed("number", good), *list = typed("array", good);
    add_range(one, f, good);
    add_range(item, f, good);
    sv_api_json_add(list, "items", item, good);
    sv_api_json_add_number(list, "minItems", 2, good);
    sv_api_json_add_number(list, "maxItems", 2, good);
    sv_api_json_append(either, one, good);
    sv_api_json_append(either, list, good);
    sv_api_json_add(both, "oneOf", either, good);
    return both;
}

static cJSON *geometry_schema(bool *good)
{
    cJSON *schema = typed("object", good), *properties = cJSON_CreateObject();
    sv_api_json_add(properties, "type", cJSON_Parse("{\"enum\":[\"Polygon\",\"MultiPolygon\"]}"), good);
    sv_api_json_add(properties, "coordinates", typed("array", good), good);
    sv_api_json_add(schema, "properties", properties, good);
    sv_api_json_add(schema, "required", cJSON_Parse("[\"type\",\"coordinates\"]"), good);
    sv_api_json_add_bool(schema, "additionalProperties", false, good);
    return schema;
}

static cJSON *field_schema(const struct sv_value_field *f, const char *path, bool *good)
{
    cJSON *schema;
    bool number = strcmp(f->type, "number") == 0 || strcmp(f->type, "integer") == 0;
    if (strcmp(f->type, SV_PATCH_LIST) == 0) {
        schema = typed("array", good);
        sv_api_json_add(schema, "items", item_schema(f, path, good), good);
        sv_api_json_add_number(schema, "maxItems", f->max, good);
    } else if (strcmp(f->type, SV_PATCH_IDS) == 0) {
        schema = ids_schema(f, good);
    } else if (strcmp(f->type, SV_PATCH_GEOMETRY) == 0 || strcmp(path, "trees.add.scatter.within") == 0) {
        schema = geometry_schema(good);
    } else if (strncmp(f->type, "number or", 9) == 0) {
        schema = range_schema(f, good);
    } else if (f->section) {
        schema = section_schema(f->section, path, good);
    } else if (strcmp(f->type, "object") == 0) { /* shares of species */
        schema = typed("object", good);
        cJSON *share = typed("number", good);
        add_range(share, f, good);
        sv_api_json_add(schema, "additionalProperties", share, good);
    } else {
        schema = typed(number ? f->type : "string", good);
        if (number)
            number_schema(schema, f, good);
        if (strcmp(f->type, SV_PATCH_MOMENT) == 0)
            sv_api_json_add_text(schema, "format", "date-time", good);
    }
    describe(schema, path, good);
    return schema;
}

static cJSON *section_schema(const struct sv_value_section *section, const char *path, bool *good)
{
    cJSON *schema = typed("object", good), *properties = cJSON_CreateObject(),
          *required = cJSON_CreateArray();
    for (int k = 0; k < section->count; k++) {
        const struct sv_value_field *f = &section->fields[k];
        char deeper[128];
        snprintf(deeper, sizeof deeper, "%s%s%s", path, path[0] ? "." : "", f->key);
        sv_api_json_add(properties, f->key, field_schema(f, deeper, good), good);
        if (f->required)
            sv_api_json_append(required, cJSON_CreateString(f->key), good);
    }
    sv_api_json_add(schema, "properties", properties, good);
    if (required && required->child)
        sv_api_json_add(schema, "required", required, good);
    else
        cJSON_Delete(required);
    sv_api_json_add_bool(schema, "additionalProperties", false, good);
    return schema;
}

cJSON *sv_api_patch_schema(bool *good)
{
    cJSON *schema = section_schema(sv_api_patch_section(), "", good);
    describe(schema, "", good);
    sv_api_json_add_number(schema, "minProperties", 1, good);
    return schema;
}
