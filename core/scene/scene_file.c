/* scene_file.c - the scene file: its tables of keys, and what is special about some of them.
 *
 * Text -> checks of the bytes (UTF-8, no NUL) -> cJSON -> tables -> struct sv_scene_spec. A row of a table
 * says key, type, unit, legal range, default and where the value goes; everything an error says comes from it
 * (scene_values.h). Sections are read in the order of their tables, species before forest, so that names can
 * be looked up. JSON is used in these two files alone. cJSON bounds nesting (1000) and turns 1e999 into
 * infinity, which no range holds. Nothing named in the file is opened; when the file is read from disk, each
 * named file is looked for. */
#include "core/scene/scene_file.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/scene/forest.h"
#include "core/scene/scene_values.h"

enum { FILE_BYTES_MAX = 64 << 20, MAP_MAX = 4096, FOREST_MAX = 1024, OBJECTS_MAX = 65536 };

/* ---- values of special form ---- */

static void read_nodata(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                        void *base)
{
    struct sv_terrain_spec *t = base;
    t->has_nodata = json && sv_value_number_in(r, json, f, false, &t->nodata);
}

static void read_habit(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                       void *base)
{
    static const char *const names[] = {
#define X(name, text) [name] = text,
        SV_HABIT_LIST(X)
#undef X
    };
    if (!json)
        return;
    if (!cJSON_IsString(json)) {
        sv_value_complain_type(r, json, "a string");
        return;
    }
    for (int k = 0; k < SV_HABIT_COUNT; k++)
        if (strcmp(json->valuestring, names[k]) == 0) {
            *(enum sv_habit *)((char *)base + f->offset) = (enum sv_habit)k;
            return;
        }
    sv_value_complain(r, SV_EINVAL, "\"%s\" is none of broadleaf, conifer, poplar, shrub, palm",
                      sv_value_show(json->valuestring).text);
}

/* The names of a points file's columns: without the key, the key's own name. */
static void read_column(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                        void *base)
{
    const char *s = json ? sv_value_string_in(r, json, f) : f->key;
    if (s)
        *(char **)((char *)base + f->offset) = sv_value_copy(r, s, "");
}

static void read_name(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                      void *base)
{
    const char *s = json ? sv_value_string_in(r, json, f) : f->required ? NULL : "scene";
    if (s)
        snprintf((char *)base + f->offset, SV_SCENE_NAME_MAX, "%s", s);
}

static void read_bands(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                       void *base)
{
    int *bands = (int *)(void *)((char *)base + f->offset);
    if (!json)
        return;
    if (!cJSON_IsArray(json) || cJSON_GetArraySize(json) != 3) {
        sv_value_complain(r, SV_EINVAL,
                          "must be an array of three band numbers [red, green, blue], counted from 1");
        return;
    }
    int k = 0;
    for (const cJSON *item = json->child; item; item = item->next, k++) {
        double v = 0;
        size_t at = sv_value_enter(r, "[%d]", k);
        if (sv_value_number_in(r, item, f, true, &v))
            bands[k] = (int)v;
        sv_value_leave(r, at);
    }
}

static void read_heights(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                         void *base)
{
    struct sv_scatter_spec *s = base;
    s->height_m[0] = 8;
    s->height_m[1] = 22;
    if (json)
        sv_value_range(r, json, f, base);
}

/* ---- references to species ---- */

static int species_named(struct sv_value_reader *r, const char *name)
{
    for (int k = 0; k < r->spec->species_count; k++)
        if (strcmp(r->spec->species[k].name, name) == 0)
            return k;
    char known[200] = "";
    size_t used = 0;
    int shown = 0;
    for (int k = 0; k < r->spec->species_count && used < 140; k++)
        if (r->spec->species[k].name[0] && ++shown) /* one without a name is an error of its own */
            used += (size_t)snprintf(known + used, sizeof known - used, "%s%s", used ? ", " : "",
                                     sv_value_show(r->spec->species[k].name).text);
    sv_value_complain(r, SV_EINVAL, "no species is named \"%s\"; there %s %s", sv_value_show(name).text,
                      shown == 1 ? "is" : "are", used ? known : "none");
    return -1;
}

void sv_value_species(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                      void *base)
{
    int *index = (int *)(void *)((char *)base + f->offset);
    *index = -1;
    const char *s = json ? sv_value_string_in(r, json, f) : NULL;
    if (s)
        *index = species_named(r, s);
}

static void read_species_map(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                             void *base)
{
    struct sv_points_spec *p = base;
    if (!json)
        return;
    if (!cJSON_IsObject(json)) {
        sv_value_complain_type(r, json, "an object {\"name in the data\": \"species\"}");
        return;
    }
    int count = cJSON_GetArraySize(json);
    if (count > MAP_MAX) {
        sv_value_complain(r, SV_ELIMIT, "%d entries are more than %d", count, MAP_MAX);
        return;
    }
    p->map = calloc(count ? (size_t)count : 1, sizeof *p->map);
    if (!p->map) {
        sv_value_complain(r, SV_ENOMEM, "no memory for it");
        return;
    }
    for (const cJSON *item = json->child; item; item = item->next) {
        size_t at = sv_value_enter_key(r, item->string);
        bool twice = false;
        for (int k = 0; k < p->map_count; k++)
            twice = twice || (p->map[k].from && strcmp(p->map[k].from, item->string) == 0);
        if (twice)
            sv_value_complain(r, SV_EINVAL, "the key is there twice");
        struct sv_species_map *m = &p->map[p->map_count++];
        m->from = sv_value_copy(r, item->string, "");
        const char *s = sv_value_string_in(r, item, f);
        m->species = s ? species_named(r, s) : -1;
        sv_value_leave(r, at);
    }
}

static void normalise_mix(struct sv_value_reader *r, double *mix, bool ok)
{
    double sum = 0;
    for (int k = 0; k < r->spec->species_count; k++)
        sum += mix[k];
    if (!(sum > 0)) {
        if (ok) /* else something was said already */
            sv_value_complain(r, SV_EINVAL, "the shares sum to 0; at least one must be above 0");
        return;
    }
    for (int k = 0; k < r->spec->species_count; k++)
        mix[k] /= sum;
}

/* Shares by species name, any scale; without the key every species has the same share. */
static void read_mix(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f, void *base)
{
    struct sv_scatter_spec *s = base;
    int n = r->spec->species_count;
    s->mix = calloc(n ? (size_t)n : 1, sizeof *s->mix);
    if (!s->mix) {
        sv_value_complain(r, SV_ENOMEM, "no memory for it");
        return;
    }
    if (json && !cJSON_IsObject(json)) {
        sv_value_complain_type(r, json, "an object {\"species\": share}");
        return;
    }
    if (!json) {
        for (int k = 0; k < n; k++)
            s->mix[k] = 1;
        normalise_mix(r, s->mix, true);
        return;
    }
    bool seen[SV_SCENE_SPECIES_MAX] = {false}, ok = true;
    for (const cJSON *item = json->child; item; item = item->next) {
        double share = 0;
        size_t at = sv_value_enter_key(r, item->string);
        int k = species_named(r, item->string);
        if (k >= 0 && seen[k])
            sv_value_complain(r, SV_EINVAL, "the key is there twice");
        ok = sv_value_number_in(r, item, f, false, &share) && k >= 0 && !seen[k] && ok;
        if (k >= 0) {
            seen[k] = true;
            s->mix[k] = share;
        }
        sv_value_leave(r, at);
    }
    normalise_mix(r, s->mix, ok);
}

static void read_terrain(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                         void *base);
static void read_species(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                         void *base);
static void read_forest(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                        void *base);
static void read_objects(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                         void *base);

static void read_relief(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                        void *base)
{
    ((struct sv_scene_spec *)base)->has_relief = json != NULL;
    sv_value_object(r, json, f, base);
}

/* ---- the tables: key, type, unit, least, most, default, reader, section, place, required ---- */

#define SECTION(rows) ((const struct sv_value_section){rows, sizeof(rows) / sizeof((rows)[0])})
#define NAME_BYTES 1, SV_SCENE_NAME_MAX - 1, 0
#define TEXT_BYTES 1, SV_VALUE_PATH_BYTES_MAX, 0
#define SEEDS 0, 0x1p53, 1
#define IN(type, member) offsetof(struct type, member), false
#define MUST(type, member) offsetof(struct type, member), true

static const struct sv_value_field TERRAIN_PROCEDURAL[] = {
    {"size_m", "number", "m", 1, 1e6, 2000, sv_value_number, NULL, IN(sv_terrain_spec, size_m)},
    {"samples", "integer", "", 2, 8192, 1024, sv_value_int, NULL, IN(sv_terrain_spec, samples)},
    {"relief_m", "number", "m", 0, 9000, 150, sv_value_number, NULL, IN(sv_terrain_spec, relief_m)},
    {"seed", "integer", "", SEEDS, sv_value_u64, NULL, IN(sv_terrain_spec, seed)},
};
static const struct sv_value_section TERRAIN_PROCEDURAL_SECTION = SECTION(TERRAIN_PROCEDURAL);

/* "dem" with its companions, or "procedural" alone. */
static const struct sv_value_field TERRAIN_DEM[] = {
    {"dem", "path", "", TEXT_BYTES, sv_value_path, NULL, MUST(sv_terrain_spec, dem)},
    {"imagery", "path", "", TEXT_BYTES, sv_value_path, NULL, IN(sv_terrain_spec, imagery)},
    {"imagery_bands", "three integers", "", 1, 65535, 0, read_bands, NULL,
     IN(sv_terrain_spec, imagery_bands)},
    {"crs", "string", "", TEXT_BYTES, sv_value_string, NULL, IN(sv_terrain_spec, crs)},
    {"nodata", "number", "", -1.7976931348623157e308, 1.7976931348623157e308, 0, read_nodata, NULL,
     IN(sv_terrain_spec, nodata)},
    {"height_unit_m", "number", "m", 1e-3, 1e3, 0, sv_value_number, NULL, IN(sv_terrain_spec, height_unit_m)},
};
static const struct sv_value_section TERRAIN_DEM_SECTION = SECTION(TERRAIN_DEM);
static const struct sv_value_field TERRAIN_MADE[] = {
    {"procedural", "object", "", 0, 0, 0, sv_value_object, &TERRAIN_PROCEDURAL_SECTION, 0, true},
};
static const struct sv_value_section TERRAIN_MADE_SECTION = SECTION(TERRAIN_MADE);

static const struct sv_value_field SPECIES_PROCEDURAL[] = {
    {"habit", "string", "", 0, 0, 0, read_habit, NULL, MUST(sv_species_spec, habit)},
    {"leaves", "integer", "", 0, SV_GROW_LEAVES_MAX, 38952, sv_value_u32, NULL, IN(sv_species_spec, leaves)},
    {"seed", "integer", "", SEEDS, sv_value_u64, NULL, IN(sv_species_spec, seed)},
};
static const struct sv_value_section SPECIES_PROCEDURAL_SECTION = SECTION(SPECIES_PROCEDURAL);
static const struct sv_value_field SPECIES_MADE[] = {
    {"name", "string", "", NAME_BYTES, read_name, NULL, MUST(sv_species_spec, name)},
    {"procedural", "object", "", 0, 0, 0, sv_value_object, &SPECIES_PROCEDURAL_SECTION, 0, true},
};
static const struct sv_value_section SPECIES_MADE_SECTION = SECTION(SPECIES_MADE);
static const struct sv_value_field SPECIES_MODEL[] = {
    {"name", "string", "", NAME_BYTES, read_name, NULL, MUST(sv_species_spec, name)},
    {"model", "path", "", TEXT_BYTES, sv_value_path, NULL, MUST(sv_species_spec, model)},
};
static const struct sv_value_section SPECIES_MODEL_SECTION = SECTION(SPECIES_MODEL);

static const struct sv_value_field FOREST_POINTS[] = {
    {"points", "path", "", TEXT_BYTES, sv_value_path, NULL, MUST(sv_points_spec, points)},
    {"x", "string", "", TEXT_BYTES, read_column, NULL, IN(sv_points_spec, x)},
    {"y", "string", "", TEXT_BYTES, read_column, NULL, IN(sv_points_spec, y)},
    {"species", "string", "", TEXT_BYTES, sv_value_string, NULL, IN(sv_points_spec, species)},
    {"height_m", "string", "", TEXT_BYTES, sv_value_string, NULL, IN(sv_points_spec, height)},
    {"rotation_deg", "string", "", TEXT_BYTES, sv_value_string, NULL, IN(sv_points_spec, rotation)},
    {"crs", "string", "", TEXT_BYTES, sv_value_string, NULL, IN(sv_points_spec, crs)},
    {"where", "string", "", TEXT_BYTES, sv_value_string, NULL, IN(sv_points_spec, where)},
    {"default_species", "string", "", NAME_BYTES, sv_value_species, NULL,
     IN(sv_points_spec, default_species)},
    {"default_height_m", "number", "m", SV_TREE_HEIGHT_MIN_M, SV_TREE_HEIGHT_MAX_M, 12, sv_value_number, NULL,
     IN(sv_points_spec, default_height_m)},
    {"min_height_m", "number", "m", 0, SV_TREE_HEIGHT_MAX_M, 0, sv_value_number, NULL,
     IN(sv_points_spec, min_height_m)},
    {"species_map", "object", "", NAME_BYTES, read_species_map, NULL, IN(sv_points_spec, map)},
};
static const struct sv_value_section FOREST_POINTS_SECTION = SECTION(FOREST_POINTS);

static const struct sv_value_field SCATTER[] = {
    {"count", "integer", "", 0, SV_FOREST_TREES_MAX, 0, sv_value_u32, NULL, MUST(sv_scatter_spec, count)},
    {"seed", "integer", "", SEEDS, sv_value_u64, NULL, IN(sv_scatter_spec, seed)},
    {"mix", "object", "", 0, 1e9, 0, read_mix, NULL, IN(sv_scatter_spec, mix)},
    {"height_m", "number or [least, most]", "m", SV_TREE_HEIGHT_MIN_M, SV_TREE_HEIGHT_MAX_M, 0, read_heights,
     NULL, IN(sv_scatter_spec, height_m)},
    {"min_spacing_m", "number", "m", 0, 10000, 2, sv_value_number, NULL, IN(sv_scatter_spec, min_spacing_m)},
    {"max_slope_deg", "number", "deg", 0, 90, 45, sv_value_number, NULL, IN(sv_scatter_spec, max_slope_deg)},
    {"within", "path", "", TEXT_BYTES, sv_value_path, NULL, IN(sv_scatter_spec, within)},
};
const struct sv_value_section sv_scene_scatter_section = {SCATTER, sizeof SCATTER / sizeof SCATTER[0]};
static const struct sv_value_field FOREST_SCATTER[] = {
    {"scatter", "object", "", 0, 0, 0, sv_value_object, &sv_scene_scatter_section, 0, true},
};
static const struct sv_value_section FOREST_SCATTER_SECTION = SECTION(FOREST_SCATTER);

static const struct sv_value_field OBJECT[] = {
    {"model", "path", "", TEXT_BYTES, sv_value_path, NULL, MUST(sv_object_spec, model)},
    {"x", "number", "m", -1e9, 1e9, 0, sv_value_number, NULL, MUST(sv_object_spec, x)},
    {"y", "number", "m", -1e9, 1e9, 0, sv_value_number, NULL, MUST(sv_object_spec, y)},
    {"heading_deg", "number", "deg", -360, 360, 0, sv_value_number, NULL, IN(sv_object_spec, heading_deg)},
    {"height_m", "number", "m", 0.01, 10000, 0, sv_value_number, NULL, MUST(sv_object_spec, height_m)},
    {"relief_resolution", "integer", "texels", 8, 2048, 128, sv_value_int, NULL,
     IN(sv_object_spec, relief_resolution)},
};
const struct sv_value_section sv_scene_object_section = {OBJECT, sizeof OBJECT / sizeof OBJECT[0]};

static const struct sv_value_field SUN[] = {
    {"azimuth_deg", "number", "deg", -360, 360, 135, sv_value_number, NULL,
     IN(sv_scene_spec, sun_azimuth_deg)},
    {"elevation_deg", "number", "deg", -90, 90, 40, sv_value_number, NULL,
     IN(sv_scene_spec, sun_elevation_deg)},
};
static const struct sv_value_section SUN_SECTION = SECTION(SUN);
static const struct sv_value_field RELIEF[] = {
    {"distance_m", "number", "m", 1, 100000, 100, sv_value_number, NULL,
     IN(sv_scene_spec, relief_distance_m)},
    {"resolution", "integer", "texels", 16, 8192, 1024, sv_value_int, NULL,
     IN(sv_scene_spec, relief_resolution)},
};
static const struct sv_value_section RELIEF_SECTION = SECTION(RELIEF);

/* species stands before forest: trees refer to species by name. */
static const struct sv_value_field SCENE[] = {
    {"name", "string", "", NAME_BYTES, read_name, NULL, IN(sv_scene_spec, name)},
    {"terrain", "object", "", 0, 0, 0, read_terrain, NULL, MUST(sv_scene_spec, terrain)},
    {"species", "array", "", 0, SV_SCENE_SPECIES_MAX, 0, read_species, NULL, IN(sv_scene_spec, species)},
    {"forest", "array", "", 0, FOREST_MAX, 0, read_forest, NULL, IN(sv_scene_spec, forest)},
    {"objects", "array", "", 0, OBJECTS_MAX, 0, read_objects, NULL, IN(sv_scene_spec, objects)},
    {"sun", "object", "", 0, 0, 0, sv_value_object, &SUN_SECTION, 0, false},
    {"relief", "object", "", 0, 0, 0, read_relief, &RELIEF_SECTION, 0, false},
};
static const struct sv_value_section SCENE_SECTION = SECTION(SCENE);

/* ---- the sections that choose between two tables ---- */

static void read_terrain(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                         void *base)
{
    struct sv_terrain_spec *t = (void *)((char *)base + f->offset);
    if (!json)
        return;
    bool made = cJSON_GetObjectItemCaseSensitive(json, "procedural");
    if (cJSON_IsObject(json) && !sv_value_one_of(r, json, "dem", "procedural"))
        return;
    sv_value_section(r, json, made ? &TERRAIN_MADE_SECTION : &TERRAIN_DEM_SECTION, t);
    if (t->imagery_bands[0] && !t->imagery)
        sv_value_complain(r, SV_EINVAL, "\"imagery_bands\" needs \"imagery\"");
}

static void read_species(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                         void *base)
{
    struct sv_scene_spec *spec = base;
    spec->species = sv_value_list(r, json, f, sizeof *spec->species, &spec->species_count);
    if (!spec->species)
        return;
    int k = 0;
    for (const cJSON *item = json->child; item; item = item->next, k++) {
        size_t at = sv_value_enter(r, "[%d]", k);
        struct sv_species_spec *s = &spec->species[k];
        bool made = cJSON_GetObjectItemCaseSensitive(item, "procedural");
        if (!cJSON_IsObject(item) || sv_value_one_of(r, item, "model", "procedural"))
            sv_value_section(r, item, made ? &SPECIES_MADE_SECTION : &SPECIES_MODEL_SECTION, s);
        for (int other = 0; other < k && s->name[0]; other++)
            if (strcmp(spec->species[other].name, s->name) == 0)
                sv_value_complain(r, SV_EINVAL, "the name \"%s\" is that of species[%d], too",
                                  sv_value_show(s->name).text, other);
        sv_value_leave(r, at);
    }
}

static void read_forest(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                        void *base)
{
    struct sv_scene_spec *spec = base;
    spec->forest = sv_value_list(r, json, f, sizeof *spec->forest, &spec->forest_count);
    if (!spec->forest)
        return;
    int k = 0;
    for (const cJSON *item = json->child; item; item = item->next, k++) {
        size_t at = sv_value_enter(r, "[%d]", k);
        struct sv_forest_spec *s = &spec->forest[k];
        s->is_scatter = cJSON_GetObjectItemCaseSensitive(item, "scatter");
        if (spec->species_count == 0)
            sv_value_complain(r, SV_EINVAL, "trees need at least one entry in \"species\"");
        else if (cJSON_IsObject(item) && !sv_value_one_of(r, item, "points", "scatter"))
            ;
        else if (s->is_scatter)
            sv_value_section(r, item, &FOREST_SCATTER_SECTION, &s->scatter);
        else
            sv_value_section(r, item, &FOREST_POINTS_SECTION, &s->points);
        sv_value_leave(r, at);
    }
}

static void read_objects(struct sv_value_reader *r, const cJSON *json, const struct sv_value_field *f,
                         void *base)
{
    struct sv_scene_spec *spec = base;
    spec->objects = sv_value_list(r, json, f, sizeof *spec->objects, &spec->object_count);
    if (!spec->objects)
        return;
    int k = 0;
    for (const cJSON *item = json->child; item; item = item->next, k++) {
        size_t at = sv_value_enter(r, "[%d]", k);
        sv_value_section(r, item, &sv_scene_object_section, &spec->objects[k]);
        sv_value_leave(r, at);
    }
}

/* ---- the bytes ---- */

/* Line and column of an offset, counted from 1, in characters. */
static void locate(const char *text, size_t offset, int *line, int *column)
{
    *line = *column = 1;
    for (size_t k = 0; k < offset; k++) {
        if (text[k] == '\n') {
            ++*line;
            *column = 1;
        } else if (((unsigned char)text[k] & 0xC0) != 0x80) {
            ++*column;
        }
    }
}

static void complain_at(struct sv_value_reader *r, const char *text, size_t offset, const char *what)
{
    int line, column;
    locate(text, offset, &line, &column);
    sv_value_complain(r, SV_EFORMAT, "line %d, column %d: %s", line, column, what);
}

/* Length of the UTF-8 sequence at p (RFC 3629: shortest form, no surrogates), 0 when it is none. A NUL ends
 * the text, so that nothing is read beyond it. */
static size_t utf8_length(const unsigned char *p)
{
    size_t n = p[0] < 0x80 ? 1 : p[0] < 0xC2 ? 0 : p[0] < 0xE0 ? 2 : p[0] < 0xF0 ? 3 : p[0] < 0xF5 ? 4 : 0;
    for (size_t k = 1; k < n; k++)
        if ((p[k] & 0xC0) != 0x80)
            return 0;
    if ((p[0] == 0xE0 && p[1] < 0xA0) || (p[0] == 0xED && p[1] > 0x9F) || (p[0] == 0xF0 && p[1] < 0x90) ||
        (p[0] == 0xF4 && p[1] > 0x8F))
        return 0;
    return n;
}

/* What cJSON would let pass or cut short: NUL bytes and escapes, broken UTF-8. */
static bool bytes_ok(struct sv_value_reader *r, const char *text, size_t bytes)
{
    for (size_t k = 0; k < bytes;) {
        size_t n = utf8_length((const unsigned char *)text + k);
        if (text[k] == '\0' || n == 0) {
            complain_at(r, text, k, n ? "a NUL byte" : "not UTF-8");
            return false;
        }
        if (strncmp(text + k, "\\u0000", 6) == 0) {
            complain_at(r, text, k, "a NUL character is not allowed");
            return false;
        }
        k += text[k] == '\\' && text[k + 1] != '\0' && (unsigned char)text[k + 1] < 0x80 ? 2 : n;
    }
    return true;
}

static void read_text(struct sv_value_reader *r, const char *text, size_t bytes)
{
    if (!bytes_ok(r, text, bytes))
        return;
    const char *end = NULL;
    cJSON *json = cJSON_ParseWithLengthOpts(text, bytes + 1, &end, 1);
    if (!json) {
        size_t offset = end && end >= text ? (size_t)(end - text) : 0;
        complain_at(r, text, offset < bytes ? offset : bytes, "not valid JSON from here on");
        return;
    }
    sv_value_section(r, json, &SCENE_SECTION, r->spec);
    cJSON_Delete(json);
}

static enum sv_status parse(const char *text, size_t bytes, const char *path, bool look_for_files,
                            struct sv_scene_spec *spec, struct sv_errors *errors)
{
    struct sv_scene_spec made = {0};
    struct sv_value_reader r = {
        .file = path, .look_for_files = look_for_files, .spec = &made, .errors = errors};
    size_t count = errors->count, total = errors->total;
    const char *slash = strrchr(path, '/');
    r.folder = strndup(path, slash ? (size_t)(slash - path) + 1 : 0);
    made.path = strdup(path);
    if (r.folder && made.path)
        read_text(&r, text, bytes);
    else
        sv_value_complain(&r, SV_ENOMEM, "no memory to read it");
    free(r.folder);
    if (errors->total == total) {
        *spec = made;
        return SV_OK;
    }
    sv_scene_spec_finish(&made);
    return errors->count > count ? errors->items[count].code : SV_EINVAL;
}

enum sv_status sv_scene_spec_parse(const char *text, size_t bytes, const char *path,
                                   struct sv_scene_spec *spec, struct sv_errors *errors)
{
    return parse(text, bytes, path, false, spec, errors);
}

/* The whole file with a NUL behind it, heap. */
static char *read_file(const char *path, size_t *bytes, struct sv_errors *errors, enum sv_status *status)
{
    struct stat st;
    char *text = NULL;
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    const char *why = NULL;
    *status = SV_EIO;
    if (fd < 0 || fstat(fd, &st) != 0) {
        *status = errno == ENOENT || errno == ENOTDIR ? SV_ENOENT : SV_EIO;
        why = strerror(errno);
    } else if (!S_ISREG(st.st_mode)) {
        why = "not a file";
    } else if (st.st_size > FILE_BYTES_MAX) {
        *status = SV_ELIMIT;
        why = "more than 64 MiB";
    } else if (!(text = malloc((size_t)st.st_size + 1))) {
        *status = SV_ENOMEM;
        why = "no memory to read it";
    } else {
        size_t used = 0, size = (size_t)st.st_size;
        ssize_t n = 1;
        while (used < size && (n = read(fd, text + used, size - used)) > 0)
            used += (size_t)n;
        if (n < 0)
            why = strerror(errno);
        text[used] = '\0';
        *bytes = used;
    }
    if (fd >= 0)
        close(fd);
    if (!why)
        return text;
    free(text);
    sv_errors_add(errors, *status, "", "%s: cannot read the scene file: %s", path, why);
    return NULL;
}

enum sv_status sv_scene_spec_read(const char *path, struct sv_scene_spec *spec, struct sv_errors *errors)
{
    size_t bytes = 0;
    enum sv_status status;
    char *text = read_file(path, &bytes, errors, &status);
    if (!text)
        return status;
    status = parse(text, bytes, path, true, spec, errors);
    free(text);
    return status;
}

static void points_finish(struct sv_points_spec *p)
{
    char *const owned[] = {p->points, p->x, p->y, p->species, p->height, p->rotation, p->crs, p->where};
    for (size_t k = 0; k < sizeof owned / sizeof owned[0]; k++)
        free(owned[k]);
    for (int k = 0; k < p->map_count; k++)
        free(p->map[k].from);
    free(p->map);
}

void sv_scene_spec_finish(struct sv_scene_spec *spec)
{
    free(spec->path);
    free(spec->terrain.dem);
    free(spec->terrain.imagery);
    free(spec->terrain.crs);
    for (int k = 0; k < spec->species_count; k++)
        free(spec->species[k].model);
    for (int k = 0; k < spec->forest_count; k++) {
        points_finish(&spec->forest[k].points);
        free(spec->forest[k].scatter.mix);
        free(spec->forest[k].scatter.within);
    }
    for (int k = 0; k < spec->object_count; k++)
        free(spec->objects[k].model);
    free(spec->species);
    free(spec->forest);
    free(spec->objects);
    *spec = (struct sv_scene_spec){0};
}
