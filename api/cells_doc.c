/* cells_doc.c - see cells_doc.h. */
#include "api/cells_doc.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>

#include "api/json_write.h"

static void add_id(cJSON *object, const char *name, uint64_t id, bool *good)
{
    char text[24];
    snprintf(text, sizeof text, "%016" PRIx64, id);
    sv_api_json_add_text(object, name, text, good);
}

static void add_vec(cJSON *object, const char *name, struct sv_vec3 v, bool *good)
{
    const double values[3] = {v.x, v.y, v.z};
    sv_api_json_add_numbers(object, name, values, 3, good);
}

static cJSON *panel(const struct sv_cell_cache_item *item, bool *good)
{
    static const char *const faces[SV_CELL_FACES] = {
        [SV_CELL_EAST] = "east",   [SV_CELL_NORTH] = "north", [SV_CELL_WEST] = "west",
        [SV_CELL_SOUTH] = "south", [SV_CELL_DOWN] = "down",   [SV_CELL_UP] = "up"};
    static const char *const layers[] = {"other", "crowns", "ground"};
    unsigned face = item->label.parts.face, layer = (unsigned)item->label.parts.layer;
    cJSON *object = cJSON_CreateObject();
    add_id(object, "id", item->label.key, good);
    sv_api_json_add_text(object, "face", face < SV_CELL_FACES ? faces[face] : "other", good);
    sv_api_json_add_text(object, "layer", layers[layer < 3 ? layer : 0], good);
    sv_api_json_add_text(object, "state",
                         item->building  ? "building"
                         : item->refined ? "refined"
                                         : "drawn",
                         good);
    sv_api_json_add_number(object, "bytes", (double)item->bytes, good);
    sv_api_json_add_number(object, "hits", (double)item->hits, good);
    sv_api_json_add_number(object, "age_s", item->age_s, good);
    sv_api_json_add_number(object, "build_ms", item->build_s * 1e3, good);
    return object;
}

static cJSON *cell(const struct sv_cells_facts *facts, const struct sv_cell_listed *c, bool *good)
{
    cJSON *object = cJSON_CreateObject(), *region = cJSON_CreateObject(), *panels = cJSON_CreateArray();
    add_id(object, "id", c->id, good);
    add_vec(object, "centre", c->centre, good);
    add_vec(object, "reference", c->place.v, good);
    sv_api_json_add_text(region, "shape", "rhombic dodecahedron", good);
    sv_api_json_add_number(region, "half_axis_m", c->half_axis_m, good);
    sv_api_json_add(object, "region", region, good);
    sv_api_json_add_number(object, "ring", c->place.ring, good);
    sv_api_json_add_number(object, "distance_m", c->distance_m, good);
    sv_api_json_add_number(object, "outer_m", c->outer_m, good); /* null: no end */
    sv_api_json_add_number(object, "resolution", c->size, good);
    sv_api_json_add_number(object, "bytes", (double)c->bytes, good);
    sv_api_json_add_number(object, "hits", (double)c->hits, good);
    sv_api_json_add_number(object, "age_s", c->age_s, good); /* null: nothing is built yet */
    for (size_t k = 0; k < c->count; k++)
        sv_api_json_append(panels, panel(&facts->items[c->first + k], good), good);
    sv_api_json_add(object, "panels", panels, good);
    return object;
}

char *sv_api_cells_doc(const struct sv_cells_facts *facts, size_t *bytes)
{
    const struct sv_cell_cache_stats *s = &facts->stats;
    bool good = true;
    cJSON *root = cJSON_CreateObject(), *cells = cJSON_CreateArray();
    sv_api_json_add_number(root, "budget_bytes", (double)s->budget_bytes, &good);
    sv_api_json_add_number(root, "used_bytes", (double)s->used_bytes, &good);
    sv_api_json_add_number(root, "panels", fmax((double)s->panels - (double)facts->shadows, 0), &good);
    sv_api_json_add_number(root, "shadow_pages", (double)facts->shadows, &good);
    sv_api_json_add_number(root, "building", s->building, &good);
    sv_api_json_add_number(root, "hits", (double)s->hits, &good);
    sv_api_json_add_number(root, "misses", (double)s->misses, &good);
    sv_api_json_add_number(root, "evictions", (double)s->evictions, &good);
    sv_api_json_add_number(root, "jobs_ahead", (double)facts->ahead, &good);
    sv_api_json_add_number(root, "jobs_refine", (double)facts->refine, &good);
    for (size_t k = 0; k < facts->cell_count; k++)
        sv_api_json_append(cells, cell(facts, &facts->cells[k], &good), &good);
    sv_api_json_add(root, "cells", cells, &good);
    return sv_api_json_print(root, good, bytes);
}

char *sv_api_cells_jobs(const uint64_t *ids, size_t count, size_t *bytes)
{
    bool good = true;
    cJSON *root = cJSON_CreateObject(), *jobs = cJSON_CreateArray();
    for (size_t k = 0; k < count; k++) {
        cJSON *job = cJSON_CreateObject();
        add_id(job, "id", ids[k], &good);
        sv_api_json_append(jobs, job, &good);
    }
    sv_api_json_add(root, "jobs", jobs, &good);
    return sv_api_json_print(root, good, bytes);
}
