/* plant.c - the trees of a scene file: from inventories and by scattering, set on the terrain's surface.
 *
 * A point becomes a tree when it lies on the terrain and has a species; its height and rotation may be
 * missing. Nothing is dropped in silence: what was left out or mended is counted and told. Which species a
 * name in the data means: the entry of species_map, else the scene's species of that very name, else the
 * map's "*", else default_species, else the scene's only species; a name that none of these covers is an
 * error. */
#include "core/scene/loading.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/hash.h"
#include "core/scene/scatter.h"

struct planting {
    const struct sv_loading *l;
    struct sv_tree *trees;
    uint32_t count, room;
};

struct tally {
    uint64_t outside, defaulted_height, low, defaulted_species;
};

static bool make_room(struct planting *p, size_t more, struct sv_error *error)
{
    size_t need = p->count + more;
    if (need > SV_FOREST_TREES_MAX) {
        sv_fail(error, SV_ELIMIT, NULL, "more than %d trees in all", SV_FOREST_TREES_MAX);
        return false;
    }
    if (need <= p->room)
        return true;
    struct sv_tree *trees = realloc(p->trees, need * sizeof *trees);
    if (!trees) {
        sv_fail(error, SV_ENOMEM, NULL, "no memory for %zu trees", need);
        return false;
    }
    p->trees = trees;
    p->room = (uint32_t)need;
    return true;
}

/* ---- names ---- */

static int mapped(const struct sv_points_spec *s, const char *name)
{
    for (int k = 0; k < s->map_count; k++)
        if (strcmp(s->map[k].from, name) == 0)
            return s->map[k].species;
    return -1;
}

/* Species for a name in the data; -1: none. */
static int species_for(const struct sv_scene_spec *spec, const struct sv_points_spec *s, const char *name)
{
    int k = mapped(s, name);
    for (int n = 0; k < 0 && n < spec->species_count; n++)
        k = strcmp(spec->species[n].name, name) == 0 ? n : -1;
    return k >= 0 ? k : mapped(s, "*");
}

/* What stands where the data name no species, or one that nothing covers; -1: an error. */
static int fallback_species(const struct sv_scene_spec *spec, const struct sv_points_spec *s)
{
    return s->default_species >= 0 ? s->default_species : spec->species_count == 1 ? 0 : -1;
}

/* Index of the species for each name, and for points without one at [name_count]: the map's "*" covers those,
 * too. */
static int *resolve_names(const struct sv_scene_spec *spec, const struct sv_points_spec *s,
                          const struct sv_points *points, struct sv_error *error)
{
    int *species = malloc((points->name_count + 1) * sizeof *species);
    if (!species) {
        sv_fail(error, SV_ENOMEM, NULL, "no memory for %zu names", points->name_count);
        return NULL;
    }
    for (size_t k = 0; k < points->name_count; k++)
        species[k] = species_for(spec, s, points->names[k]);
    species[points->name_count] = mapped(s, "*");
    return species;
}

/* The names among the points that no species covers, as text. */
static void complain_names(const struct planting *p, int entry, const struct sv_points *points,
                           const int *species)
{
    struct sv_error error;
    char names[256] = "";
    size_t used = 0, bad = 0;
    for (size_t k = 0; k < points->name_count; k++) {
        if (species[k] >= 0)
            continue;
        if (used < 180)
            used += (size_t)snprintf(names + used, sizeof names - used, "%s\"%.40s\"", bad ? ", " : "",
                                     points->names[k]);
        bad++;
    }
    if (bad > 0)
        sv_fail(&error, SV_EINVAL, NULL,
                "no species for %zu names in the data: %.200s%s; give species_map or default_species", bad,
                names, used >= 180 ? " ..." : "");
    else
        sv_fail(&error, SV_EINVAL, NULL, "some points name no species; give default_species");
    sv_loading_fail(p->l, &error, "forest[%d].points", entry);
}

/* ---- points ---- */

float sv_loading_rotation(double rotation_deg, double x, double y)
{
    double turns =
        isfinite(rotation_deg)
            ? rotation_deg / 360
            : (double)(sv_hash_done(sv_hash_double(sv_hash_double(SV_HASH_INIT, x), y)) >> 11) * 0x1p-53;
    float r = (float)((turns - floor(turns)) * (2 * SV_PI));
    return r >= 0 && r < (float)(2 * SV_PI) ? r : 0;
}

/* Adds the tree of one point, or counts why not. */
static void plant_point(struct planting *p, const struct sv_points_spec *s, const struct sv_point *q,
                        int species, struct tally *tally)
{
    struct sv_tree t = {.x = q->x, .y = q->y, .species = (uint16_t)species};
    if (!sv_heightfield_height(&p->l->scene->terrain.field, q->x, q->y, &t.z)) {
        tally->outside++;
        return;
    }
    t.rotation_rad = sv_loading_rotation(q->rotation_deg, q->x, q->y);
    double h = q->height_m;
    bool absurd = !(h > 0 && h <= SV_TREE_HEIGHT_MAX_M);
    h = absurd ? s->default_height_m : h;
    /* min_height_m judges what was measured; a tree without a height stands at the default. */
    if ((!absurd && h < s->min_height_m) || h < SV_TREE_HEIGHT_MIN_M) {
        tally->low++;
        return;
    }
    tally->defaulted_height += absurd;
    t.height_m = (float)h;
    t.number = p->count;
    p->trees[p->count++] = t;
}

/* No point is on the terrain: says where both are. */
static void tell_apart(const struct planting *p, int entry, const struct sv_points *points)
{
    const struct sv_heightfield *f = &p->l->scene->terrain.field;
    double min[2] = {INFINITY, INFINITY}, max[2] = {-INFINITY, -INFINITY};
    for (size_t k = 0; k < points->count; k++) {
        min[0] = fmin(min[0], points->items[k].x);
        min[1] = fmin(min[1], points->items[k].y);
        max[0] = fmax(max[0], points->items[k].x);
        max[1] = fmax(max[1], points->items[k].y);
    }
    sv_loading_note(p->l, 1,
                    "forest[%d]: none of %zu points is on the terrain: they lie at x %.1f .. %.1f, y %.1f .. "
                    "%.1f, the terrain "
                    "at x %.1f .. %.1f, y %.1f .. %.1f (%s); \"crs\" may be wrong or missing",
                    entry, points->count, min[0], max[0], min[1], max[1], f->x0, sv_heightfield_x1(f), f->y0,
                    sv_heightfield_y1(f), sv_crs_name(p->l->scene->crs));
}

static void tell_points(const struct planting *p, int entry, const struct sv_points_spec *s,
                        const struct sv_points *points, uint32_t planted, const struct tally *t)
{
    const struct sv_loading *l = p->l;
    struct sv_scene_counts *counts = &l->scene->counts;
    counts->outside_terrain += t->outside;
    counts->unusable += points->skipped;
    counts->heights_defaulted += t->defaulted_height;
    counts->species_defaulted += t->defaulted_species;
    sv_loading_note(l, 0, "forest[%d]: %u trees from %zu points of %s", entry, planted, points->count,
                    s->points);
    if (points->skipped)
        sv_loading_note(l, 1, "forest[%d]: %llu features without a usable place left out", entry,
                        (unsigned long long)points->skipped);
    if (t->outside == points->count && t->outside > 0)
        tell_apart(p, entry, points);
    else if (t->outside)
        sv_loading_note(l, 1, "forest[%d]: %llu points outside the terrain left out", entry,
                        (unsigned long long)t->outside);
    if (t->low)
        sv_loading_note(l, 0, "forest[%d]: %llu trees lower than %g m left out", entry,
                        (unsigned long long)t->low, fmax(s->min_height_m, SV_TREE_HEIGHT_MIN_M));
    if (t->defaulted_height)
        sv_loading_note(l, s->height ? 1 : 0,
                        "forest[%d]: %llu trees without a height of 0 .. %g m stand at %g m", entry,
                        (unsigned long long)t->defaulted_height, SV_TREE_HEIGHT_MAX_M, s->default_height_m);
    if (t->defaulted_species)
        sv_loading_note(l, s->species ? 1 : 0, "forest[%d]: %llu trees of no or unknown species are \"%s\"",
                        entry, (unsigned long long)t->defaulted_species,
                        l->spec->species[fallback_species(l->spec, s)].name);
    if (points->crs_suspect)
        sv_loading_note(
            l, 1, "forest[%d]: %s claims degrees, but its coordinates are none: read as metres of the scene",
            entry, s->points);
}

static void plant_all(struct planting *p, int entry, const struct sv_points_spec *s,
                      const struct sv_points *points, const int *species)
{
    int fallback = fallback_species(p->l->spec, s);
    uint32_t before = p->count;
    struct tally tally = {0};
    for (size_t k = 0; k < points->count; k++) {
        const struct sv_point *q = &points->items[k];
        int which = species[q->species < points->name_count ? q->species : points->name_count];
        uint32_t count = p->count;
        plant_point(p, s, q, which >= 0 ? which : fallback, &tally);
        tally.defaulted_species += which < 0 && p->count > count;
    }
    tell_points(p, entry, s, points, p->count - before, &tally);
}

static bool any_uncovered(const struct sv_points *points, const int *species)
{
    for (size_t k = 0; k < points->count; k++) {
        uint32_t n = points->items[k].species;
        if (species[n < points->name_count ? n : points->name_count] < 0)
            return true;
    }
    return false;
}

/* An error of the points' file, under the key that it belongs to. */
static void fail_points(const struct planting *p, int entry, const struct sv_error *error)
{
    static const char *const keys[] = {"x", "y", "species", "height_m", "rotation_deg", "where", "crs"};
    struct sv_error plain = *error;
    for (size_t k = 0; k < sizeof keys / sizeof keys[0]; k++)
        if (strcmp(error->field, keys[k]) == 0) {
            plain.field[0] = '\0';
            sv_loading_fail(p->l, &plain, "forest[%d].%s", entry, keys[k]);
            return;
        }
    sv_loading_fail(p->l, error, "forest[%d].points", entry);
}

static bool plant_points(struct planting *p, int entry, const struct sv_points_spec *s)
{
    const struct sv_points_options options = {s->points,  s->crs,    s->x,        s->y,
                                              s->species, s->height, s->rotation, s->where};
    struct sv_points points = {0};
    struct sv_error error;
    int *species = NULL;
    bool ok = false;
    if (sv_points_read(&options, p->l->scene->crs, &points, &error) != SV_OK) {
        fail_points(p, entry, &error);
        return false;
    }
    if (!(species = resolve_names(p->l->spec, s, &points, &error)) || !make_room(p, points.count, &error)) {
        sv_loading_fail(p->l, &error, "forest[%d].points", entry);
    } else if (fallback_species(p->l->spec, s) < 0 && any_uncovered(&points, species)) {
        complain_names(p, entry, &points, species);
    } else {
        plant_all(p, entry, s, &points, species);
        ok = true;
    }
    free(species);
    sv_points_finish(&points);
    return ok;
}

/* ---- scatter ---- */

static void tell_scatter(const struct planting *p, int entry, const struct sv_scatter_spec *s,
                         const struct sv_scatter_report *r)
{
    p->l->scene->counts.not_placed += s->count - r->placed;
    sv_loading_note(p->l, r->placed < s->count, "forest[%d]: strewed %u of %u trees", entry, r->placed,
                    s->count);
    if (r->placed < s->count)
        sv_loading_note(
            p->l, 1,
            "forest[%d]: no room for more at min_spacing_m %g; refused: %llu places too near, %llu steeper "
            "than %g deg, %llu outside \"within\"",
            entry, s->min_spacing_m, (unsigned long long)r->rejected_spacing,
            (unsigned long long)r->rejected_slope, s->max_slope_deg, (unsigned long long)r->rejected_polygon);
}

static bool plant_scatter(struct planting *p, int entry, const struct sv_scatter_spec *s)
{
    struct sv_polygons *polygons = NULL;
    struct sv_scatter_report report = {0};
    struct sv_error error;
    if (s->within && sv_polygons_read(s->within, p->l->scene->crs, &polygons, &error) != SV_OK) {
        sv_loading_fail(p->l, &error, "forest[%d].scatter.within", entry);
        return false;
    }
    bool ok = make_room(p, s->count, &error) &&
              sv_scatter(s, p->l->spec->species_count, &p->l->scene->terrain.field, polygons,
                         p->trees + p->count, &report, &error) == SV_OK;
    sv_polygons_destroy(polygons);
    if (!ok) {
        sv_loading_fail(p->l, &error, "forest[%d].scatter", entry);
        return false;
    }
    for (uint32_t k = 0; k < report.placed; k++, p->count++)
        p->trees[p->count].number = p->count;
    tell_scatter(p, entry, s, &report);
    return true;
}

bool sv_loading_plant(const struct sv_loading *l, struct sv_tree **trees, uint32_t *count)
{
    struct planting p = {.l = l};
    bool ok = true;
    for (int k = 0; k < l->spec->forest_count; k++) {
        const struct sv_forest_spec *f = &l->spec->forest[k];
        ok = (f->is_scatter ? plant_scatter(&p, k, &f->scatter) : plant_points(&p, k, &f->points)) && ok;
    }
    if (!ok) {
        free(p.trees);
        return false;
    }
    *trees = p.trees;
    *count = p.count;
    return true;
}
