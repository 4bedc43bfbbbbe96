/* patch_trees.c - trees that go and come: which ones, the species they need, and the forest of what is left.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/hash.h"
#include "core/scene/id.h"
#include "core/scene/patching.h"
#include "core/scene/scatter.h"

/* Numbers that ids have room for. */
static const uint64_t NUMBERS = UINT64_C(1) << 31;

static bool fail(struct sv_patching *p, enum sv_status code, const char *path, const char *what)
{
    struct sv_error error;
    sv_fail(&error, code, "", "%s", what);
    sv_patching_fail(p, &error, "%s", path);
    return false;
}

static uint64_t tree_hash(const struct sv_tree *t)
{
    uint64_t h = sv_hash_double(sv_hash_double(sv_hash_double(SV_HASH_INIT, t->x), t->y), t->z);
    h = sv_hash_double(sv_hash_double(h, (double)t->height_m), (double)t->rotation_rad);
    return sv_hash_done(sv_hash_u64(sv_hash_u64(h, t->species), t->number));
}

/* ---- what goes ---- */

static int compare_ids(const void *a, const void *b)
{
    uint32_t p = *(const uint32_t *)a, q = *(const uint32_t *)b;
    return (p > q) - (p < q);
}

/* Complains of ids that no tree has; sorted rises, seen[k]: there is one. */
static bool complain_ids(struct sv_patching *p, const uint32_t *sorted, const uint8_t *seen, size_t count)
{
    bool ok = true;
    for (int k = 0; k < p->patch->tree_id_count; k++) {
        uint32_t id = p->patch->tree_ids[k];
        const uint32_t *at = bsearch(&id, sorted, count, sizeof *sorted, compare_ids);
        if (seen[at - sorted])
            continue;
        struct sv_error error;
        sv_fail(&error, SV_ENOENT, "", "no tree has the id %u", id);
        sv_patching_fail(p, &error, "trees.remove.ids[%d]", k);
        ok = false;
    }
    return ok;
}

static bool remove_ids(struct sv_patching *p)
{
    const struct sv_forest *f = &p->scene->forest;
    size_t count = (size_t)p->patch->tree_id_count, unique = 0;
    if (count == 0)
        return true;
    uint32_t *sorted = malloc(count * sizeof *sorted);
    uint8_t *seen = calloc(count, 1);
    bool ok = sorted && seen;
    if (ok) {
        memcpy(sorted, p->patch->tree_ids, count * sizeof *sorted);
        qsort(sorted, count, sizeof *sorted, compare_ids);
        for (size_t k = 0; k < count; k++)
            if (k == 0 || sorted[k] != sorted[k - 1])
                sorted[unique++] = sorted[k];
        for (uint32_t k = 0; k < f->count; k++) {
            uint32_t id = SV_ID_TREE_FIRST + f->trees[k].number;
            if (id < sorted[0] || id > sorted[unique - 1])
                continue;
            const uint32_t *at = bsearch(&id, sorted, unique, sizeof *sorted, compare_ids);
            if (at)
                seen[at - sorted] = p->gone[k] = 1;
        }
        ok = complain_ids(p, sorted, seen, unique);
    } else {
        fail(p, SV_ENOMEM, "trees.remove.ids", "no memory for them");
    }
    free(sorted);
    free(seen);
    return ok;
}

static bool read_within(struct sv_patching *p, const char *geojson, struct sv_polygons **polygons,
                        const char *path)
{
    struct sv_error error;
    if (!geojson || sv_polygons_parse(geojson, p->scene->crs, polygons, &error) == SV_OK)
        return true;
    sv_patching_fail(p, &error, "%s", path);
    return false;
}

static bool remove_areas(struct sv_patching *p)
{
    const struct sv_forest *f = &p->scene->forest;
    const struct sv_patch_near *near = &p->patch->near;
    struct sv_polygons *polygons = NULL;
    double x = 0, y = 0, r2 = p->patch->has_near ? near->radius_m * near->radius_m : -1;
    bool ok = read_within(p, p->patch->within, &polygons, "trees.remove.within");
    if (p->patch->has_near)
        ok = sv_patching_place(p, (const double[4]){near->x, near->y, near->lon, near->lat},
                               "trees.remove.near", &x, &y) &&
             ok;
    for (uint32_t k = 0; k < f->count && ok && (polygons || r2 >= 0); k++) {
        double dx = f->trees[k].x - x, dy = f->trees[k].y - y;
        p->gone[k] |= dx * dx + dy * dy <= r2 ||
                      (polygons && sv_polygons_contain(polygons, f->trees[k].x, f->trees[k].y));
    }
    sv_polygons_destroy(polygons);
    return ok;
}

/* ---- what comes ---- */

static bool make_room(struct sv_patching *p, uint32_t more, int entry)
{
    uint64_t need = (uint64_t)p->come_count + more;
    struct sv_tree *come = need <= SV_FOREST_TREES_MAX ? realloc(p->come, (need + 1) * sizeof *come) : NULL;
    struct sv_error error;
    if (come && p->next_tree + (uint64_t)more <= NUMBERS) {
        p->come = come;
        return true;
    }
    sv_fail(&error, SV_ELIMIT, "", "no room for %u more trees, or no ids for them", more);
    sv_patching_fail(p, &error, "trees.add[%d]", entry);
    return false;
}

static bool add_tree(struct sv_patching *p, int entry, const struct sv_patch_tree *given)
{
    const struct sv_heightfield *f = &p->scene->terrain.field;
    struct sv_tree t = {.species = (uint16_t)given->species, .height_m = (float)given->height_m};
    struct sv_error error;
    char path[64];
    snprintf(path, sizeof path, "trees.add[%d]", entry);
    if (!sv_patching_place(p, (const double[4]){given->x, given->y, given->lon, given->lat}, path, &t.x,
                           &t.y) ||
        !make_room(p, 1, entry))
        return false;
    if (!sv_heightfield_height(f, t.x, t.y, &t.z)) {
        sv_fail(&error, SV_EOUTSIDE, "",
                "x %.10g, y %.10g is outside the terrain (x %.10g .. %.10g, y %.10g .. %.10g in %s)", t.x,
                t.y, f->x0, sv_heightfield_x1(f), f->y0, sv_heightfield_y1(f), sv_crs_name(p->scene->crs));
        sv_patching_fail(p, &error, "%s", path);
        return false;
    }
    t.rotation_rad = sv_loading_rotation(given->rotation_deg, t.x, t.y);
    t.number = p->next_tree++;
    p->come[p->come_count++] = t;
    return true;
}

static bool add_scatter(struct sv_patching *p, int entry, const struct sv_scatter_spec *spec)
{
    struct sv_polygons *polygons = NULL;
    struct sv_scatter_report report = {0};
    struct sv_error error = {0};
    char path[64];
    snprintf(path, sizeof path, "trees.add[%d].scatter.within", entry);
    if (!make_room(p, spec->count, entry) || !read_within(p, spec->within, &polygons, path))
        return false;
    bool ok = sv_scatter(spec, p->scene->species_count, &p->scene->terrain.field, polygons,
                         p->come + p->come_count, &report, &error) == SV_OK;
    sv_polygons_destroy(polygons);
    if (!ok) {
        sv_patching_fail(p, &error, "trees.add[%d].scatter", entry);
        return false;
    }
    for (uint32_t k = 0; k < report.placed; k++)
        p->come[p->come_count++].number = p->next_tree++;
    p->delta.change.not_placed += spec->count - report.placed;
    return true;
}

/* ---- species ---- */

static bool build_species(struct sv_patching *p, int k, struct sv_species *s)
{
    struct sv_tree_mesh mesh = {0};
    struct sv_errors notes;
    struct sv_error error;
    sv_errors_init(&notes);
    enum sv_status status =
        sv_species_build(&p->scene->spec.species[k], p->options->store, &mesh, &s->key, &notes, &error);
    if (status == SV_OK)
        status = sv_patching_keep_mesh(p, &mesh, &s->mesh, &error);
    for (size_t n = 0; n < notes.count && p->options->log; n++)
        p->options->log(p->options->log_context, 1, notes.items[n].message);
    if (status != SV_OK)
        sv_patching_fail(p, &error, "trees.add");
    sv_errors_finish(&notes);
    sv_tree_mesh_finish(&mesh);
    return status == SV_OK;
}

/* The first tree from k on that goes; the forest's count where there is none. */
static uint32_t next_gone(const struct sv_patching *p, uint32_t k)
{
    uint32_t count = p->scene->forest.count;
    const uint8_t *gone = k < count ? memchr(p->gone + k, 1, count - k) : NULL;
    return gone ? (uint32_t)(gone - p->gone) : count;
}

/* Counts of now, and meshes of those that get their first tree. */
static bool count_species(struct sv_patching *p)
{
    const struct sv_scene *s = p->scene;
    size_t bytes = (size_t)s->species_count * sizeof *p->species;
    bool ok = true;
    p->species = sv_patching_alloc(p, bytes + 1);
    if (!p->species)
        return fail(p, SV_ENOMEM, "trees", "no memory for the species");
    if (bytes > 0)
        memcpy(p->species, s->species, bytes);
    for (uint32_t k = next_gone(p, 0); k < s->forest.count; k = next_gone(p, k + 1))
        p->species[s->forest.trees[k].species].tree_count--;
    for (uint32_t k = 0; k < p->come_count; k++)
        p->species[p->come[k].species].tree_count++;
    for (int k = 0; k < s->species_count; k++)
        if (p->species[k].tree_count > 0 && p->species[k].mesh.vertex_count == 0)
            ok = build_species(p, k, &p->species[k]) && ok;
    return ok;
}

/* ---- the forest ---- */

static int compare_numbers(const void *a, const void *b)
{
    const struct sv_tree *p = a, *q = b;
    return (p->number > q->number) - (p->number < q->number);
}

/* Lists what goes, and where everything that changed stands. */
static bool list_gone(struct sv_patching *p)
{
    const struct sv_forest *f = &p->scene->forest;
    uint32_t *count = &p->delta.change.trees_removed;
    for (uint32_t k = next_gone(p, 0); k < f->count; k = next_gone(p, k + 1))
        ++*count;
    size_t changed = (size_t)*count + p->come_count;
    struct sv_change_box *boxes = realloc(p->boxes, (p->box_count + changed + 1) * sizeof *boxes);
    if (boxes)
        p->boxes = boxes;
    p->delta.gone = malloc(((size_t)*count + 1) * sizeof *p->delta.gone);
    if (!boxes || !p->delta.gone)
        return fail(p, SV_ENOMEM, "trees", "no memory to change them");
    *count = 0;
    for (uint32_t k = next_gone(p, 0); k < f->count; k = next_gone(p, k + 1))
        p->delta.gone[(*count)++] = f->trees[k];
    qsort(p->delta.gone, *count, sizeof *p->delta.gone, compare_numbers);
    const struct sv_tree *lists[2] = {p->delta.gone, p->come};
    const uint32_t counts[2] = {*count, p->come_count};
    for (int l = 0; l < 2; l++)
        for (uint32_t k = 0; k < counts[l]; k++) {
            const struct sv_tree *t = &lists[l][k];
            double h = (double)t->height_m;
            sv_patching_box(p, sv_vec3(t->x, t->y, t->z), h, h * (double)p->species[t->species].mesh.radius);
            p->sum += l ? tree_hash(t) : -tree_hash(t);
        }
    return true;
}

static bool build_forest(struct sv_patching *p)
{
    struct sv_crown_bound bounds[SV_SCENE_SPECIES_MAX] = {{0}};
    uint32_t count = p->scene->forest.count - p->delta.change.trees_removed + p->come_count, came = 0;
    struct sv_forest_turnover turnover = {&p->scene->forest, p->gone, p->come, p->come_count};
    struct sv_error error;
    for (int k = 0; k < p->scene->species_count; k++)
        bounds[k] = (struct sv_crown_bound){p->species[k].mesh.radius, 1, 0};
    p->delta.from = malloc(((size_t)count + 1) * sizeof *p->delta.from);
    p->delta.came = malloc(((size_t)p->come_count + 1) * sizeof *p->delta.came);
    if (!p->delta.from || !p->delta.came)
        return fail(p, SV_ENOMEM, "trees", "no memory to change them");
    enum sv_status status = sv_arena_create(sv_forest_bytes(count), &p->arena, &error);
    if (status == SV_OK)
        status = sv_forest_turn_over(&turnover, bounds, p->arena, &p->forest, p->delta.from, &error);
    if (status == SV_OK)
        status = sv_arena_seal(p->arena, &error);
    if (status != SV_OK) {
        sv_patching_fail(p, &error, "trees");
        return false;
    }
    for (uint32_t k = 0; k < count; k++)
        if (p->delta.from[k] == SV_FOREST_CAME)
            p->delta.came[came++] = k;
    return true;
}

bool sv_patching_trees(struct sv_patching *p)
{
    const struct sv_scene_patch *patch = p->patch;
    uint32_t first = p->next_tree;
    p->gone = calloc((size_t)p->scene->forest.count + 1, 1);
    if (!p->gone)
        return fail(p, SV_ENOMEM, "trees", "no memory to change them");
    bool ok = remove_ids(p);
    ok = remove_areas(p) && ok;
    for (int k = 0; k < patch->add_count; k++)
        ok = (patch->add[k].is_scatter ? add_scatter(p, k, &patch->add[k].scatter)
                                       : add_tree(p, k, &patch->add[k].tree)) &&
             ok;
    if (!ok || p->errors->total > p->errors_before)
        return false;
    p->delta.change.trees_added = p->come_count;
    p->delta.change.first_tree = first;
    p->delta.trees = p->come_count > 0 || memchr(p->gone, 1, p->scene->forest.count);
    return !p->delta.trees || (count_species(p) && list_gone(p) && build_forest(p));
}
