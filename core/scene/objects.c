/* objects.c - the scene file's "objects": each model once, each object on its ground.
 *
 * Nothing is drawn or baked here; core/relief/draw_object.h makes what is drawn of it. */
#include "core/scene/loading.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static int compare_files(const void *a, const void *b, void *context)
{
    const struct sv_object_spec *objects = context;
    const int *p = a, *q = b;
    int order = strcmp(objects[*p].model, objects[*q].model);
    return order ? order : (*p > *q) - (*p < *q);
}

/* Numbers the files: which[k] is the model of object k; returns how many there are. sorted has room for
 * count. */
static int group_files(const struct sv_object_spec *objects, int count, int *sorted, int *which)
{
    int models = 0;
    for (int k = 0; k < count; k++)
        sorted[k] = k;
    qsort_r(sorted, (size_t)count, sizeof *sorted, compare_files, (void *)(uintptr_t)objects);
    for (int k = 0; k < count; k++) {
        bool first = k == 0 || strcmp(objects[sorted[k]].model, objects[sorted[k - 1]].model) != 0;
        models += first;
        which[sorted[k]] = models - 1;
    }
    return models;
}

static bool load_model(struct sv_loading *l, int first_object, struct sv_object_model *m)
{
    struct sv_tree_mesh mesh = {0};
    struct sv_errors notes;
    struct sv_error error;
    sv_errors_init(&notes);
    m->file = l->spec->objects[first_object].model;
    enum sv_status status = sv_object_build(m->file, l->options->store, &mesh, &m->key, &notes, &error);
    if (status == SV_OK)
        status = sv_tree_mesh_to_arena(&mesh, l->scene->arena, &m->mesh, &error);
    if (status == SV_OK)
        sv_loading_note(l, 0, "objects: %s: %u of it, %u triangles, radius %.2f heights", m->file,
                        m->object_count, mesh.index_count / 3, (double)mesh.radius);
    else
        sv_loading_fail(l, &error, "objects[%d].model", first_object);
    for (size_t n = 0; n < notes.count; n++)
        sv_loading_note(l, 1, "objects: %s: %s", m->file, notes.items[n].message);
    sv_errors_finish(&notes);
    sv_tree_mesh_finish(&mesh);
    return status == SV_OK;
}

enum sv_status sv_loading_place(const struct sv_scene *scene, const struct sv_object_spec *spec,
                                struct sv_scene_object *out, struct sv_error *error)
{
    const struct sv_heightfield *f = &scene->terrain.field;
    double turn = fmod(spec->heading_deg, 360);
    *out = (struct sv_scene_object){.x = spec->x,
                                    .y = spec->y,
                                    .heading_rad = sv_radians(turn < 0 ? turn + 360 : turn),
                                    .height_m = spec->height_m,
                                    .relief_resolution = spec->relief_resolution};
    if (sv_heightfield_height(f, spec->x, spec->y, &out->z))
        return SV_OK;
    return sv_fail(error, SV_EOUTSIDE, "",
                   "x %.10g, y %.10g is outside the terrain (x %.10g .. %.10g, y %.10g .. %.10g in %s)",
                   spec->x, spec->y, f->x0, sv_heightfield_x1(f), f->y0, sv_heightfield_y1(f),
                   sv_crs_name(scene->crs));
}

static bool place(struct sv_loading *l, int k, int model, struct sv_scene_object *out)
{
    struct sv_error error;
    enum sv_status status = sv_loading_place(l->scene, &l->spec->objects[k], out, &error);
    out->model = model;
    out->number = (uint32_t)k;
    if (status != SV_OK)
        sv_loading_fail(l, &error, "objects[%d]", k);
    return status == SV_OK;
}

static bool load_all(struct sv_loading *l, int *which, int *sorted)
{
    struct sv_scene *s = l->scene;
    int count = l->spec->object_count;
    int models = group_files(l->spec->objects, count, sorted, which);
    struct sv_scene_object *objects = sv_arena_alloc(s->arena, (size_t)count, sizeof *objects);
    struct sv_object_model *made = sv_arena_alloc(s->arena, (size_t)models, sizeof *made);
    if (!objects || !made) {
        struct sv_error error;
        sv_fail(&error, SV_ENOMEM, NULL, "no room for %d objects", count);
        sv_loading_fail(l, &error, "objects");
        return false;
    }
    bool ok = true;
    for (int k = 0; k < count; k++) {
        ok = place(l, k, which[k], &objects[k]) && ok;
        made[which[k]].object_count++;
    }
    for (int k = 0; k < count; k++) /* in the order of the files, each by the first object that names it */
        if (k == 0 || which[sorted[k]] != which[sorted[k - 1]])
            ok = load_model(l, sorted[k], &made[which[sorted[k]]]) && ok;
    s->objects = objects;
    s->object_count = count;
    s->models = made;
    s->model_count = models;
    if (ok)
        sv_loading_note(l, 0, "objects: %d, of %d model%s", count, models, models == 1 ? "" : "s");
    return ok;
}

bool sv_loading_objects(struct sv_loading *l)
{
    size_t count = (size_t)l->spec->object_count;
    if (count == 0)
        return true;
    sv_loading_await_builders(l);
    int *which = malloc(2 * count * sizeof *which);
    if (!which) {
        struct sv_error error;
        sv_fail(&error, SV_ENOMEM, NULL, "no memory for %zu objects", count);
        sv_loading_fail(l, &error, "objects");
        return false;
    }
    bool ok = load_all(l, which, which + count);
    free(which);
    return ok;
}
