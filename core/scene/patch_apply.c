/* patch_apply.c - see patch_apply.h: the sun, the version, and how a patched scene takes the place of the one
 * before. */
#include "core/scene/patch_apply.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/hash.h"
#include "core/scene/patching.h"

/* Memory that came with patches: a block, or an arena with a mesh. */
struct sv_scene_extra {
    struct sv_scene_extra *next;
    struct sv_arena *arena;
    max_align_t block[];
};

/* ---- what the parts share ---- */

void sv_patching_fail(struct sv_patching *p, const struct sv_error *error, const char *path, ...)
{
    char where[sizeof error->field];
    va_list args;
    va_start(args, path);
    vsnprintf(where, sizeof where, path, args);
    va_end(args);
    sv_errors_add(p->errors, error->code, where, "%s", error->message);
}

bool sv_patching_place(struct sv_patching *p, const double given[4], const char *path, double *x, double *y)
{
    struct sv_error error;
    *x = given[0];
    *y = given[1];
    if (isnan(given[0]) && !sv_crs_from_lonlat(p->scene->crs, given[2], given[3], x, y)) {
        sv_fail(&error, SV_EINVAL, "", "lon %.10g, lat %.10g has no place in the scene's system (%s)",
                given[2], given[3], sv_crs_name(p->scene->crs));
        sv_patching_fail(p, &error, "%s", path);
        return false;
    }
    return true;
}

static struct sv_scene_extra *add_extra(struct sv_scene *scene, size_t bytes)
{
    struct sv_scene_extra *e = calloc(1, sizeof *e + bytes);
    if (e) {
        e->next = scene->extras;
        scene->extras = e;
    }
    return e;
}

void *sv_patching_alloc(struct sv_patching *p, size_t bytes)
{
    struct sv_scene_extra *e = add_extra(p->scene, bytes);
    return e ? e->block : NULL;
}

enum sv_status sv_patching_keep_mesh(struct sv_patching *p, const struct sv_tree_mesh *mesh,
                                     struct sv_tree_mesh *kept, struct sv_error *error)
{
    static const size_t MESH_BYTES = (size_t)4 << 30; /* address space: more than any mesh */
    struct sv_scene_extra *e = add_extra(p->scene, 0);
    if (!e)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for a mesh");
    enum sv_status status = sv_arena_create(MESH_BYTES, &e->arena, error);
    if (status == SV_OK)
        status = sv_tree_mesh_to_arena(mesh, e->arena, kept, error);
    return status == SV_OK ? sv_arena_seal(e->arena, error) : status;
}

void sv_patching_box(struct sv_patching *p, struct sv_vec3 foot, double height_m, double radius_m)
{
    p->boxes[p->box_count++] =
        (struct sv_change_box){{foot.x - radius_m, foot.y - radius_m, foot.z},
                               {foot.x + radius_m, foot.y + radius_m, foot.z + height_m}};
}

void sv_scene_extras_finish(struct sv_scene *scene)
{
    for (struct sv_scene_extra *e = scene->extras, *next; e; e = next) {
        next = e->next;
        sv_arena_destroy(e->arena);
        free(e);
    }
    sv_arena_destroy(scene->forest_arena);
    scene->extras = NULL;
    scene->forest_arena = NULL;
}

/* ---- the sun ---- */

static uint64_t sun_hash(const struct sv_sun *sun)
{
    return sv_hash_done(sv_hash_double(sv_hash_double(SV_HASH_INIT, sun->azimuth_rad), sun->elevation_rad));
}

static bool patch_sun(struct sv_patching *p)
{
    const struct sv_scene_patch *patch = p->patch;
    struct sv_sun was = p->scene->sun;
    p->sun = was;
    if (!isnan(patch->sun_azimuth_deg))
        p->sun.azimuth_rad = sv_radians(patch->sun_azimuth_deg);
    if (!isnan(patch->sun_elevation_deg))
        p->sun.elevation_rad = sv_radians(patch->sun_elevation_deg);
    if (!isnan(patch->sun_time_s) && !sv_scene_sun_at(p->scene, patch->sun_time_s, &p->sun)) {
        struct sv_error error;
        sv_fail(&error, SV_EINVAL, "",
                "the scene has no place on Earth (its CRS is local): give azimuth_deg and elevation_deg");
        sv_patching_fail(p, &error, "sun.time");
        return false;
    }
    p->delta.change.sun = p->sun.azimuth_rad != was.azimuth_rad || p->sun.elevation_rad != was.elevation_rad;
    p->sum += sun_hash(&p->sun) - sun_hash(&was);
    return true;
}

/* ---- the whole ---- */

static void commit(struct sv_patching *p)
{
    struct sv_scene *s = p->scene;
    if (p->delta.trees) {
        struct sv_arena *old = s->forest_arena;
        s->forest = p->forest;
        s->forest_arena = p->arena;
        s->species = p->species;
        sv_arena_destroy(old); /* of the patch before; NULL for the first */
        p->arena = NULL;
    }
    if (p->delta.objects) {
        s->objects = p->objects;
        s->object_count = p->object_count;
        s->models = p->models;
        s->model_count = p->model_count;
    }
    s->next_tree = p->next_tree;
    s->next_object = p->next_object;
    s->sun = p->sun;
    s->counts.not_placed += p->delta.change.not_placed;
    s->generation++;
    s->patched = p->sum;
    s->version = p->sum ? sv_hash_done(sv_hash_u64(sv_hash_u64(SV_HASH_INIT, s->loaded_version), p->sum))
                        : s->loaded_version;
}

/* The numbers that come next: after all that were ever given. A scene that was patched knows them. */
static void find_next(struct sv_patching *p)
{
    const struct sv_scene *s = p->scene;
    p->next_tree = s->next_tree;
    p->next_object = s->next_object;
    if (s->generation > 0)
        return;
    for (uint32_t k = 0; k < s->forest.count; k++)
        if (s->forest.trees[k].number >= p->next_tree)
            p->next_tree = s->forest.trees[k].number + 1;
    for (int k = 0; k < s->object_count; k++)
        if (s->objects[k].number >= p->next_object)
            p->next_object = s->objects[k].number + 1;
}

enum sv_status sv_scene_patch_apply(struct sv_scene *scene, const struct sv_scene_patch *patch,
                                    const struct sv_scene_patch_options *options,
                                    struct sv_scene_delta *delta, struct sv_errors *errors)
{
    struct sv_patching p = {.scene = scene,
                            .patch = patch,
                            .options = options,
                            .errors = errors,
                            .errors_before = errors->total,
                            .sum = scene->patched};
    if (scene->patched == 0)
        scene->loaded_version = scene->version;
    size_t count = errors->count;
    find_next(&p);
    bool ok = patch_sun(&p);
    ok = sv_patching_objects(&p) && ok;
    ok = sv_patching_trees(&p) && ok; /* last: it makes the forest, when nothing was wrong */
    if (ok) {
        sv_scene_change_put(&p.delta.change, p.boxes, p.box_count);
        commit(&p);
        *delta = p.delta;
    } else {
        sv_scene_delta_finish(&p.delta);
        sv_arena_destroy(p.arena);
    }
    free(p.gone);
    free(p.come);
    free(p.boxes);
    return ok ? SV_OK : errors->count > count ? errors->items[count].code : SV_EINTERNAL;
}

void sv_scene_delta_finish(struct sv_scene_delta *delta)
{
    free(delta->gone);
    free(delta->from);
    free(delta->came);
    *delta = (struct sv_scene_delta){0};
}
