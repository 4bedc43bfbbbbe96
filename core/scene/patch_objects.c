/* patch_objects.c - objects that go and come, and the models of those that come. */
#include <stdlib.h>
#include <string.h>

#include "core/base/hash.h"
#include "core/scene/id.h"
#include "core/scene/patching.h"

static bool fail(struct sv_patching *p, enum sv_status code, const char *what)
{
    struct sv_error error;
    sv_fail(&error, code, "", "%s", what);
    sv_patching_fail(p, &error, "objects");
    return false;
}

static uint64_t object_hash(const struct sv_patching *p, const struct sv_scene_object *o)
{
    uint64_t h = sv_hash_u64(SV_HASH_INIT, p->models[o->model].key);
    h = sv_hash_double(sv_hash_double(sv_hash_double(h, o->x), o->y), o->z);
    h = sv_hash_double(sv_hash_double(h, o->heading_rad), o->height_m);
    return sv_hash_done(sv_hash_u64(sv_hash_u64(h, (uint64_t)o->relief_resolution), o->number));
}

/* An object's box, and what it does to the version. */
static void note(struct sv_patching *p, const struct sv_scene_object *o, bool comes)
{
    sv_patching_box(p, sv_vec3(o->x, o->y, o->z), o->height_m,
                    o->height_m * (double)p->models[o->model].mesh.radius);
    p->sum += comes ? object_hash(p, o) : -object_hash(p, o);
}

/* Room for all that may be there then, with what is there now. */
static bool copy_all(struct sv_patching *p)
{
    const struct sv_scene *s = p->scene;
    size_t more = (size_t)p->patch->object_count, changed = more + (size_t)p->patch->object_id_count;
    p->objects = sv_patching_alloc(p, ((size_t)s->object_count + more + 1) * sizeof *p->objects);
    p->models = sv_patching_alloc(p, ((size_t)s->model_count + more + 1) * sizeof *p->models);
    p->boxes = malloc((changed + 1) * sizeof *p->boxes);
    if (!p->objects || !p->models || !p->boxes)
        return fail(p, SV_ENOMEM, "no memory to change them");
    if (s->object_count)
        memcpy(p->objects, s->objects, (size_t)s->object_count * sizeof *p->objects);
    if (s->model_count)
        memcpy(p->models, s->models, (size_t)s->model_count * sizeof *p->models);
    p->object_count = s->object_count;
    p->model_count = s->model_count;
    return true;
}

static bool remove_ids(struct sv_patching *p)
{
    bool ok = true;
    for (int k = 0; k < p->patch->object_id_count; k++) {
        uint32_t number = p->patch->object_ids[k] - SV_ID_OBJECT_FIRST;
        int at = 0;
        while (at < p->object_count && p->objects[at].number != number)
            at++;
        if (at == p->object_count) {
            struct sv_error error;
            sv_fail(&error, SV_ENOENT, "", "no object has the id %u", p->patch->object_ids[k]);
            sv_patching_fail(p, &error, "objects.remove.ids[%d]", k);
            ok = false;
            continue;
        }
        note(p, &p->objects[at], false);
        p->models[p->objects[at].model].object_count--;
        p->object_count--;
        memmove(&p->objects[at], &p->objects[at + 1], (size_t)(p->object_count - at) * sizeof *p->objects);
        p->delta.change.objects_removed++;
    }
    return ok;
}

static bool build_model(struct sv_patching *p, int k, struct sv_object_model *m)
{
    const char *file = p->patch->objects[k].model;
    struct sv_tree_mesh mesh = {0};
    struct sv_errors notes;
    struct sv_error error;
    sv_errors_init(&notes);
    enum sv_status status = sv_object_build(file, p->options->store, &mesh, &m->key, &notes, &error);
    if (status == SV_OK)
        status = sv_patching_keep_mesh(p, &mesh, &m->mesh, &error);
    char *name = sv_patching_alloc(p, strlen(file) + 1);
    if (status == SV_OK && !name)
        status = sv_fail(&error, SV_ENOMEM, "", "no memory for it");
    if (status == SV_OK) {
        strcpy(name, file);
        m->file = name;
    } else {
        sv_patching_fail(p, &error, "objects.add[%d].model", k);
    }
    for (size_t n = 0; n < notes.count && p->options->log; n++)
        p->options->log(p->options->log_context, 1, notes.items[n].message);
    sv_errors_finish(&notes);
    sv_tree_mesh_finish(&mesh);
    return status == SV_OK;
}

/* Index of the model of an object to come; -1 after an error. */
static int want_model(struct sv_patching *p, int k)
{
    for (int m = 0; m < p->model_count; m++)
        if (strcmp(p->models[m].file, p->patch->objects[k].model) == 0)
            return m;
    return build_model(p, k, &p->models[p->model_count]) ? p->model_count++ : -1;
}

static bool add_objects(struct sv_patching *p)
{
    bool ok = true;
    struct sv_error error;
    for (int k = 0; k < p->patch->object_count; k++) {
        struct sv_scene_object *o = &p->objects[p->object_count];
        int model = want_model(p, k);
        if (sv_loading_place(p->scene, &p->patch->objects[k], o, &error) != SV_OK) {
            sv_patching_fail(p, &error, "objects.add[%d]", k);
            model = -1;
        }
        ok = model >= 0 && ok;
        if (model < 0)
            continue;
        o->model = model;
        o->number = p->next_object++;
        p->models[model].object_count++;
        p->object_count++;
        p->delta.change.objects_added++;
        note(p, o, true);
    }
    return ok;
}

bool sv_patching_objects(struct sv_patching *p)
{
    if (p->patch->object_count + p->patch->object_id_count == 0)
        return true;
    p->delta.objects = true;
    p->delta.change.first_object = p->next_object;
    if (!copy_all(p))
        return false;
    if ((uint64_t)p->next_object + (uint64_t)p->patch->object_count > SV_ID_TREE_FIRST - SV_ID_OBJECT_FIRST)
        return fail(p, SV_ELIMIT, "there are no ids for more of them");
    bool ok = remove_ids(p);
    return add_objects(p) && ok;
}
