/* loading.c - news, errors and the version of a scene. */
#include "core/scene/loading.h"

#include <dirent.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "core/base/hash.h"
#include "core/terrain/coloring.h"
#include "core/terrain/procedural.h"

/* Raise it whenever the same inputs give another scene (placing, filling). */
enum { SCENE_BUILD_VERSION = 1 };

void sv_loading_note(const struct sv_loading *l, int level, const char *format, ...)
{
    if (!l->options->log)
        return;
    char text[1024];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    l->options->log(l->options->log_context, level, text);
}

void sv_loading_fail(const struct sv_loading *l, const struct sv_error *error, const char *path, ...)
{
    char where[sizeof error->field];
    va_list args;
    va_start(args, path);
    vsnprintf(where, sizeof where, path, args);
    va_end(args);
    const char *file = l->spec->path ? l->spec->path : "scene";
    bool named = error->field[0] && strcmp(error->field, where) != 0 && !strstr(error->message, error->field);
    sv_errors_add(l->errors, error->code, where, "%s: %s%s%s", file, named ? error->field : "",
                  named ? ": " : "", error->message);
}

void sv_loading_await_builders(struct sv_loading *l)
{
    if (!l->waited && l->options->before_species)
        l->options->before_species(l->options->before_species_context);
    l->waited = true;
}

static uint64_t hash_stat(uint64_t h, const char *name, const struct stat *st)
{
    h = sv_hash_string(h, name);
    h = sv_hash_u64(h, (uint64_t)st->st_size);
    h = sv_hash_u64(h, (uint64_t)st->st_mtim.tv_sec);
    return sv_hash_u64(h, (uint64_t)st->st_mtim.tv_nsec);
}

/* Sum over the entries of a folder whose names begin with stem: the order in which they are listed does not
 * matter. */
static uint64_t hash_siblings(const char *folder, const char *stem, size_t stem_bytes)
{
    uint64_t sum = 0;
    char path[4096];
    DIR *dir = opendir(folder);
    for (const struct dirent *e = dir ? readdir(dir) : NULL; e; e = readdir(dir)) {
        struct stat st;
        if (strncmp(e->d_name, stem, stem_bytes) != 0 || strcmp(e->d_name, ".") == 0 ||
            strcmp(e->d_name, "..") == 0)
            continue;
        snprintf(path, sizeof path, "%s/%s", folder, e->d_name);
        if (stat(path, &st) == 0 && S_ISREG(st.st_mode))
            sum += sv_hash_done(hash_stat(SV_HASH_INIT, e->d_name, &st));
    }
    if (dir)
        closedir(dir);
    return sum;
}

uint64_t sv_loading_input_hash(uint64_t h, const char *path)
{
    struct stat st;
    if (!path)
        return sv_hash_u64(h, 0);
    h = sv_hash_string(h, path);
    if (stat(path, &st) != 0)
        return sv_hash_u64(h, 1);
    if (S_ISDIR(st.st_mode))
        return sv_hash_u64(h, hash_siblings(path, "", 0));
    h = hash_stat(h, "", &st);
    const char *slash = strrchr(path, '/');
    char *folder = slash ? strndup(path, slash == path ? 1 : (size_t)(slash - path)) : strdup(".");
    const char *name = slash ? slash + 1 : path, *dot = strrchr(name, '.');
    if (folder && dot && dot > name)
        h = sv_hash_u64(h, hash_siblings(folder, name, (size_t)(dot + 1 - name)));
    free(folder);
    return h;
}

static uint64_t hash_text(uint64_t h, const char *s)
{
    return s ? sv_hash_string(h, s) : sv_hash_u64(h, UINT64_MAX);
}

static uint64_t hash_terrain(uint64_t h, const struct sv_terrain_spec *t)
{
    h = sv_loading_input_hash(h, t->dem);
    h = sv_loading_input_hash(h, t->imagery);
    h = hash_text(h, t->crs);
    h = sv_hash_double(sv_hash_u64(h, t->has_nodata), t->nodata);
    h = sv_hash_double(h, t->height_unit_m);
    for (int k = 0; k < 3; k++)
        h = sv_hash_u64(h, (uint64_t)t->imagery_bands[k]);
    h = sv_hash_double(sv_hash_double(h, t->size_m), t->relief_m);
    return sv_hash_u64(sv_hash_u64(h, (uint64_t)t->samples), t->seed);
}

static uint64_t hash_points(uint64_t h, const struct sv_points_spec *p)
{
    const char *const texts[] = {p->x, p->y, p->species, p->height, p->rotation, p->crs, p->where};
    h = sv_loading_input_hash(h, p->points);
    for (size_t k = 0; k < sizeof texts / sizeof texts[0]; k++)
        h = hash_text(h, texts[k]);
    h = sv_hash_u64(h, (uint64_t)p->default_species);
    h = sv_hash_double(sv_hash_double(h, p->default_height_m), p->min_height_m);
    for (int k = 0; k < p->map_count; k++)
        h = sv_hash_u64(hash_text(h, p->map[k].from), (uint64_t)p->map[k].species);
    return h;
}

static uint64_t hash_scatter(uint64_t h, const struct sv_scatter_spec *s, int species_count)
{
    h = sv_hash_u64(sv_hash_u64(h, s->count), s->seed);
    for (int k = 0; k < species_count; k++)
        h = sv_hash_double(h, s->mix[k]);
    h = sv_hash_double(sv_hash_double(h, s->height_m[0]), s->height_m[1]);
    h = sv_hash_double(sv_hash_double(h, s->min_spacing_m), s->max_slope_deg);
    return sv_loading_input_hash(h, s->within);
}

uint64_t sv_loading_version(const struct sv_loading *l)
{
    const struct sv_scene_spec *spec = l->spec;
    uint64_t h = sv_hash_string(sv_hash_u64(SV_HASH_INIT, SCENE_BUILD_VERSION), SV_VERSION);
    h = sv_hash_u64(sv_hash_u64(h, SV_PROCEDURAL_VERSION), SV_COLORING_VERSION);
    h = sv_hash_string(h, spec->name);
    h = hash_terrain(h, &spec->terrain);
    for (int k = 0; k < spec->species_count; k++) {
        h = sv_hash_string(h, spec->species[k].name);
        h = sv_hash_u64(h, l->scene->species[k].key); /* of all that the mesh was made from; 0 when unused */
    }
    for (int k = 0; k < spec->forest_count; k++) {
        const struct sv_forest_spec *f = &spec->forest[k];
        h = f->is_scatter ? hash_scatter(h, &f->scatter, spec->species_count) : hash_points(h, &f->points);
    }
    for (int k = 0; k < spec->object_count; k++) {
        const struct sv_object_spec *o = &spec->objects[k];
        h = sv_hash_u64(h, l->scene->models[l->scene->objects[k].model].key);
        h = sv_hash_double(sv_hash_double(h, o->x), o->y);
        h = sv_hash_double(sv_hash_double(h, o->heading_deg), o->height_m);
        h = sv_hash_u64(h, (uint64_t)o->relief_resolution);
    }
    h = sv_hash_double(sv_hash_double(h, spec->sun_azimuth_deg), spec->sun_elevation_deg);
    h = sv_hash_double(sv_hash_u64(h, (uint64_t)spec->relief_resolution), spec->relief_distance_m);
    return sv_hash_done(h);
}
