/* scene_doc.c - see scene_doc.h. */
#include "api/scene_doc.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "api/json_write.h"
#include "api/number.h"
#include "core/scene/id.h"
#include "core/view/request.h"

static cJSON *extent(const struct sv_scene_facts *f, bool *good)
{
    cJSON *object = cJSON_CreateObject();
    const double box[4] = {f->x_min, f->y_min, f->x_max, f->y_max};
    const double lonlat[4] = {f->lon_min, f->lat_min, f->lon_max, f->lat_max};
    sv_api_json_add_numbers(object, "scene", box, 4, good);
    if (f->has_lonlat)
        sv_api_json_add_numbers(object, "lonlat", lonlat, 4, good);
    else
        sv_api_json_add(object, "lonlat", cJSON_CreateNull(), good);
    return object;
}

static cJSON *terrain(const struct sv_scene_facts *f, bool *good)
{
    cJSON *object = cJSON_CreateObject();
    const double samples[2] = {f->terrain_width, f->terrain_height},
                 spacing[2] = {f->spacing_x_m, f->spacing_y_m};
    sv_api_json_add_text(object, "source", f->procedural ? "procedural" : "dem", good);
    sv_api_json_add_numbers(object, "samples", samples, 2, good);
    sv_api_json_add_numbers(object, "spacing_m", spacing, 2, good);
    sv_api_json_add_number(object, "z_min", f->z_min, good);
    sv_api_json_add_number(object, "z_max", f->z_max, good);
    /* Which of its two diagonals splits a cell of four samples (core/terrain/heightfield.h). */
    sv_api_json_add_text(
        object, "diagonal",
        "alternating: south-west to north-east where column + row of the cell's south-west sample is "
        "even (counted from the south-west corner), else south-east to north-west",
        good);
    sv_api_json_add_number(object, "voids_filled", (double)f->voids_filled, good);
    sv_api_json_add_bool(object, "imagery", f->has_imagery, good);
    return object;
}

static cJSON *one_species(const struct sv_species_facts *s, bool *good)
{
    cJSON *object = cJSON_CreateObject(), *forms = cJSON_CreateObject(), *built = cJSON_CreateArray();
    sv_api_json_add_text(object, "name", s->name, good);
    sv_api_json_add_number(object, "trees", s->tree_count, good);
    sv_api_json_add_number(object, "leaves", s->leaf_count, good);
    sv_api_json_add_number(object, "triangles", s->triangle_count, good);
    sv_api_json_add_number(object, "vertices", s->vertex_count, good);
    for (int k = 0; k < s->form_count && k < SV_FORM_FACTS_MAX; k++) {
        sv_api_json_add_number(forms, s->forms[k].form, (double)s->forms[k].bytes, good);
        if (s->forms[k].built)
            sv_api_json_append(built, cJSON_CreateString(s->forms[k].form), good);
    }
    sv_api_json_add(object, "bytes", forms, good);
    sv_api_json_add(object, "built", built, good);
    return object;
}

static cJSON *species(const struct sv_scene_facts *f, bool *good)
{
    cJSON *list = cJSON_CreateArray();
    for (int k = 0; list && k < f->species_count; k++)
        sv_api_json_append(list, one_species(&f->species[k], good), good);
    return list;
}

static cJSON *trees(const struct sv_scene_facts *f, bool *good)
{
    cJSON *object = cJSON_CreateObject();
    sv_api_json_add_number(object, "count", f->tree_count, good);
    sv_api_json_add_number(object, "outside_terrain", (double)f->outside_terrain, good);
    sv_api_json_add_number(object, "unusable", (double)f->unusable, good);
    sv_api_json_add_number(object, "not_placed", (double)f->not_placed, good);
    sv_api_json_add_number(object, "heights_defaulted", (double)f->heights_defaulted, good);
    sv_api_json_add_number(object, "species_defaulted", (double)f->species_defaulted, good);
    return object;
}

static cJSON *objects(const struct sv_scene_facts *f, bool *good)
{
    cJSON *list = cJSON_CreateArray();
    for (int k = 0; list && k < f->object_count; k++) {
        const struct sv_object_facts *o = &f->objects[k];
        const char *slash = o->model ? strrchr(o->model, '/') : NULL;
        cJSON *item = cJSON_CreateObject();
        sv_api_json_add_number(item, "index", k, good);
        sv_api_json_add_number(item, "id", (double)(SV_ID_OBJECT_FIRST + o->number), good); /* layer=id */
        sv_api_json_add_text(item, "model", slash ? slash + 1 : o->model,
                             good); /* the file's name: its folder is nobody's business */
        sv_api_json_add_number(item, "x", o->x, good);
        sv_api_json_add_number(item, "y", o->y, good);
        sv_api_json_add_number(item, "z", o->z, good);
        sv_api_json_add_number(item, "heading", sv_api_degrees(o->heading_rad), good);
        sv_api_json_add_number(item, "height_m", o->height_m, good);
        sv_api_json_add_number(item, "relief_resolution", o->relief_resolution, good);
        sv_api_json_add_number(item, "triangles", o->triangle_count, good);
        sv_api_json_add_number(item, "relief_bytes", (double)o->relief_bytes, good);
        sv_api_json_append(list, item, good);
    }
    return list;
}

static cJSON *limits(const struct sv_scene_facts *f, bool *good)
{
    cJSON *object = cJSON_CreateObject();
    sv_api_json_add_number(object, "side_px_min", SV_VIEW_SIDE_MIN, good);
    sv_api_json_add_number(object, "side_px_max", SV_VIEW_SIDE_MAX, good);
    if (f->pixels_max > 0)
        sv_api_json_add_number(object, "pixels_max", (double)f->pixels_max, good);
    if (f->sample_pixels_max > 0)
        sv_api_json_add_number(object, "sample_pixels_max", (double)f->sample_pixels_max, good);
    return object;
}

/* The legend of layer=id. */
static cJSON *legend(const struct sv_scene_facts *f, bool *good)
{
    cJSON *object = cJSON_CreateObject();
    sv_api_json_add_number(object, "sky", SV_ID_SKY, good);
    sv_api_json_add_number(object, "terrain", SV_ID_TERRAIN, good);
    sv_api_json_add_number(object, "object_first", SV_ID_OBJECT_FIRST, good);
    sv_api_json_add_number(object, "object_count", f->object_count, good);
    sv_api_json_add_number(object, "tree_first", SV_ID_TREE_FIRST, good);
    sv_api_json_add_number(object, "tree_count", f->tree_count, good);
    return object;
}

static void fill(cJSON *root, const struct sv_scene_facts *f, bool *good)
{
    char version[24];
    snprintf(version, sizeof version, "%016" PRIx64, f->version);
    sv_api_json_add_text(root, "name", f->name, good);
    sv_api_json_add_text(root, "version", version, good);
    cJSON *crs = cJSON_CreateObject();
    sv_api_json_add_text(crs, "name", f->crs_name, good);
    sv_api_json_add(crs, "epsg", f->epsg > 0 ? cJSON_CreateNumber(f->epsg) : cJSON_CreateNull(), good);
    sv_api_json_add_number(crs, "convergence", sv_api_degrees(f->convergence_rad), good);
    sv_api_json_add(root, "crs", crs, good);
    sv_api_json_add(root, "extent", extent(f, good), good);
    sv_api_json_add(root, "terrain", terrain(f, good), good);
    sv_api_json_add(root, "species", species(f, good), good);
    sv_api_json_add(root, "trees", trees(f, good), good);
    sv_api_json_add(root, "objects", objects(f, good), good);
    sv_api_json_add(root, "sun",
                    sv_api_json_pair("azimuth", sv_api_degrees(f->sun_azimuth_rad), "elevation",
                                     sv_api_degrees(f->sun_elevation_rad), good),
                    good);
    sv_api_json_add(
        root, "relief",
        sv_api_json_pair("distance_m", f->relief_distance_m, "resolution", f->relief_resolution, good), good);
    sv_api_json_add(root, "limits", limits(f, good), good);
    sv_api_json_add(root, "id", legend(f, good), good);
    cJSON *memory = cJSON_CreateObject();
    sv_api_json_add_number(memory, "shared_bytes", (double)f->shared_bytes, good);
    sv_api_json_add(root, "memory", memory, good);
    if (f->load_s >= 0)
        sv_api_json_add_number(root, "load_s", f->load_s, good);
}

char *sv_api_scene_doc(const struct sv_scene_facts *facts, size_t *bytes)
{
    bool good = true;
    cJSON *root = cJSON_CreateObject();
    fill(root, facts, &good);
    return sv_api_json_print(root, good, bytes);
}
