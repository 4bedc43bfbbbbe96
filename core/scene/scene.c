/* scene.c - a scene from its spec: terrain, colours, trees, the species they need, hierarchy, objects; then
 * sealed.
 *
 * Steps run in the order of what they need. One that fails adds its errors; those that do not depend on it
 * still run, so that one load tells all. Only what the scene uses is built: a species without a tree is not.
 */
#include "core/scene/scene.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/scene/loading.h"

/* Address space, not memory: far more than any scene that the limits allow. */
static const size_t ARENA_BYTES_DEFAULT = (size_t)64 << 30;

/* ---- trees ---- */

static bool load_one_species(struct sv_loading *l, int k, struct sv_species *s)
{
    const struct sv_species_spec *spec = &l->spec->species[k];
    struct sv_tree_mesh mesh = {0};
    struct sv_errors notes;
    struct sv_error error;
    sv_errors_init(&notes);
    enum sv_status status = sv_species_build(spec, l->options->store, &mesh, &s->key, &notes, &error);
    if (status == SV_OK)
        status = sv_tree_mesh_to_arena(&mesh, l->scene->arena, &s->mesh, &error);
    if (status == SV_OK)
        sv_loading_note(l, 0, "species \"%s\": %u trees, %u triangles, %u leaves, crown radius %.2f heights",
                        s->name, s->tree_count, mesh.index_count / 3, mesh.leaf_count, (double)mesh.radius);
    else
        sv_loading_fail(l, &error, spec->model ? "species[%d].model" : "species[%d].procedural", k);
    for (size_t n = 0; n < notes.count; n++)
        sv_loading_note(l, 1, "species \"%s\": %s", s->name, notes.items[n].message);
    sv_errors_finish(&notes);
    sv_tree_mesh_finish(&mesh);
    return status == SV_OK;
}

/* Names all species, builds those that have trees. */
static bool load_species(struct sv_loading *l, const struct sv_tree *trees, uint32_t count)
{
    int n = l->spec->species_count;
    struct sv_species *species = sv_arena_alloc(l->scene->arena, (size_t)n, sizeof *species);
    if (!species) {
        struct sv_error error;
        sv_fail(&error, SV_ENOMEM, NULL, "no room for %d species", n);
        sv_loading_fail(l, &error, "species");
        return false;
    }
    for (uint32_t k = 0; k < count; k++)
        species[trees[k].species].tree_count++;
    bool ok = true;
    for (int k = 0; k < n; k++) {
        memcpy(species[k].name, l->spec->species[k].name, sizeof species[k].name);
        if (species[k].tree_count > 0)
            ok = load_one_species(l, k, &species[k]) && ok;
        else
            sv_loading_note(l, 0, "species \"%s\": no tree of it, not built", species[k].name);
    }
    l->scene->species = species;
    l->scene->species_count = n;
    return ok;
}

/* Where the crowns of each species end, and the hierarchy. Trees go to the arena. */
static enum sv_status build_forest(struct sv_loading *l, const struct sv_tree *trees, uint32_t count,
                                   struct sv_error *error)
{
    struct sv_scene *s = l->scene;
    struct sv_crown_bound bounds[SV_SCENE_SPECIES_MAX] = {{0}};
    for (int k = 0; k < s->species_count; k++)
        bounds[k] = (struct sv_crown_bound){s->species[k].mesh.radius, 1, 0};
    struct sv_tree *kept = sv_arena_copy(s->arena, trees, (size_t)count * sizeof *trees);
    if (!kept)
        return sv_fail(error, SV_ENOMEM, NULL, "no room for %u trees", count);
    return sv_forest_build(kept, count, bounds, s->arena, &s->forest, error);
}

static bool load_forest(struct sv_loading *l)
{
    struct sv_tree *trees = NULL;
    uint32_t count = 0;
    struct sv_error error;
    if (!sv_loading_plant(l, &trees, &count))
        return false;
    if (count > 0)
        sv_loading_await_builders(l);
    bool ok = load_species(l, trees, count);
    if (ok && build_forest(l, trees, count, &error) != SV_OK) {
        sv_loading_fail(l, &error, "forest");
        ok = false;
    }
    free(trees);
    if (ok)
        sv_loading_note(l, 0, "forest: %u trees in all", count);
    return ok;
}

/* ---- the whole ---- */

static bool load_all(struct sv_loading *l)
{
    const struct sv_scene_spec *spec = l->spec;
    struct sv_scene *s = l->scene;
    memcpy(s->name, spec->name, sizeof s->name);
    s->sun = (struct sv_sun){sv_radians(spec->sun_azimuth_deg), sv_radians(spec->sun_elevation_deg)};
    s->relief_distance_m = spec->relief_distance_m;
    s->relief_resolution = spec->relief_resolution;
    if (!sv_loading_ground(l))
        return false; /* everything else stands on it */
    bool ok = sv_loading_colors(l);
    ok = load_forest(l) && ok;
    ok = sv_loading_objects(l) && ok;
    if (!ok)
        return false;
    if (spec->has_relief)
        sv_loading_note(l, 0,
                        "relief: distance %g m, resolution %d kept; this version does not draw relief panels",
                        spec->relief_distance_m, spec->relief_resolution);
    s->version = sv_loading_version(l);
    struct sv_error error;
    if (sv_arena_seal(s->arena, &error) != SV_OK) {
        sv_loading_fail(l, &error, "scene");
        return false;
    }
    sv_loading_note(l, 0, "scene \"%s\" version %016llx: %.1f MB", s->name, (unsigned long long)s->version,
                    (double)sv_arena_used(s->arena) / 1e6);
    return true;
}

enum sv_status sv_scene_load(struct sv_scene_spec *spec, const struct sv_scene_options *options,
                             struct sv_scene **scene, struct sv_errors *errors)
{
    size_t known = errors->count;
    struct sv_scene *s = calloc(1, sizeof *s);
    struct sv_loading l = {.spec = spec, .options = options, .scene = s, .errors = errors};
    struct sv_error error;
    size_t reserve = options->arena_bytes ? options->arena_bytes : ARENA_BYTES_DEFAULT;
    if (!s || sv_arena_create(reserve, &s->arena, &error) != SV_OK) {
        if (!s)
            sv_fail(&error, SV_ENOMEM, NULL, "no memory for a scene");
        sv_loading_fail(&l, &error, "scene");
    } else if (load_all(&l)) {
        s->spec = *spec;
        *spec = (struct sv_scene_spec){0};
        *scene = s;
        return SV_OK;
    }
    sv_scene_destroy(s);
    return errors->count > known ? errors->items[known].code : SV_EINTERNAL;
}

uint64_t sv_scene_loaded_version(const struct sv_scene *scene)
{
    return scene->patched ? scene->loaded_version : scene->version;
}

bool sv_scene_sun_at(const struct sv_scene *scene, double unix_s, struct sv_sun *sun)
{
    const struct sv_heightfield *f = &scene->terrain.field;
    double x = (f->x0 + sv_heightfield_x1(f)) / 2, y = (f->y0 + sv_heightfield_y1(f)) / 2, lon, lat;
    struct sv_sun at;
    if (!sv_crs_to_lonlat(scene->crs, x, y, &lon, &lat))
        return false;
    sv_sun_position(unix_s, lon, lat, &at.azimuth_rad, &at.elevation_rad);
    at.azimuth_rad += sv_crs_convergence_rad(scene->crs, x, y);
    at.azimuth_rad -= 2 * SV_PI * floor(at.azimuth_rad / (2 * SV_PI));
    *sun = at;
    return true;
}

void sv_scene_destroy(struct sv_scene *scene)
{
    if (!scene)
        return;
    sv_scene_extras_finish(scene);
    sv_arena_destroy(scene->arena);
    sv_crs_destroy(scene->crs);
    sv_scene_spec_finish(&scene->spec);
    free(scene);
}
