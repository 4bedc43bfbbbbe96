/* species.c - one species, or the model of an object, as a mesh: from the store, or imported, or grown, and
 * then kept.
 *
 * The key hashes all that the mesh is made from: for a grown tree habit, leaves, seed and the grower's
 * version; for a model its name, its bytes, and name, size and time of every file in its folder and one
 * folder deeper that could be a part of it (material libraries, buffers, textures). What the import had to
 * say is kept beside the mesh and said again whenever the mesh comes from the store. */
#include "core/scene/scene.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/base/hash.h"
#include "core/tree/grow.h"
#include "core/tree/import.h"

/* Blob: struct head, note texts one after the other with their NULs, zeros to a multiple of 8, the saved
 * mesh. Raise the number in KIND whenever import, measure or this layout change. */
static const char KIND[] = "mesh2";
static const char BLOB_MAGIC[8] = "SVMESHN";

struct head {
    char magic[8];
    uint64_t note_count, note_bytes, mesh_bytes;
};

/* ---- key ---- */

static enum sv_status hash_contents(const char *path, uint64_t *h, struct sv_error *error)
{
    struct stat st;
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0 || fstat(fd, &st) != 0) {
        int why = errno;
        if (fd >= 0)
            close(fd);
        return sv_fail(error, why == ENOENT || why == ENOTDIR ? SV_ENOENT : SV_EIO, path,
                       "cannot read the model: %s", strerror(why));
    }
    void *bytes = S_ISREG(st.st_mode) && st.st_size > 0
                      ? mmap(NULL, (size_t)st.st_size, PROT_READ, MAP_PRIVATE, fd, 0)
                      : MAP_FAILED;
    close(fd);
    if (bytes == MAP_FAILED)
        return sv_fail(error, SV_EFORMAT, path, "the model is empty or not a file");
    *h = sv_hash_bytes(sv_hash_u64(*h, (uint64_t)st.st_size), bytes, (size_t)st.st_size);
    munmap(bytes, (size_t)st.st_size);
    return SV_OK;
}

static bool is_companion(const char *name)
{
    static const char *const suffixes[] = {".mtl", ".bin", ".png",  ".jpg",  ".jpeg", ".tga",
                                           ".bmp", ".tif", ".tiff", ".webp", ".gif",  ".rgb",
                                           ".dds", ".psd", ".hdr",  ".exr",  ".sgi"};
    const char *dot = strrchr(name, '.');
    for (size_t k = 0; dot && k < sizeof suffixes / sizeof suffixes[0]; k++)
        if (strcasecmp(dot, suffixes[k]) == 0)
            return true;
    return false;
}

/* Sum over a folder's files, so that their order does not matter; `deeper` more levels of folders. */
static uint64_t hash_folder(const char *folder, const char *inner, int deeper)
{
    uint64_t sum = 0;
    char path[4096], name[1024];
    DIR *dir = opendir(folder);
    for (const struct dirent *e = dir ? readdir(dir) : NULL; e; e = readdir(dir)) {
        struct stat st;
        if (e->d_name[0] == '.')
            continue;
        snprintf(path, sizeof path, "%s/%s", folder, e->d_name);
        snprintf(name, sizeof name, "%s/%s", inner, e->d_name);
        if (stat(path, &st) != 0)
            continue;
        if (S_ISDIR(st.st_mode) && deeper > 0) {
            sum += hash_folder(path, name, deeper - 1);
        } else if (S_ISREG(st.st_mode) && is_companion(e->d_name)) {
            uint64_t h = sv_hash_u64(sv_hash_string(SV_HASH_INIT, name), (uint64_t)st.st_size);
            h = sv_hash_u64(sv_hash_u64(h, (uint64_t)st.st_mtim.tv_sec), (uint64_t)st.st_mtim.tv_nsec);
            sum += sv_hash_done(h);
        }
    }
    if (dir)
        closedir(dir);
    return sum;
}

/* way: how the file is read; the same file as a tree and as an object are two meshes. */
static enum sv_status model_key(const char *model, const char *way, uint64_t *key, struct sv_error *error)
{
    const char *slash = strrchr(model, '/');
    uint64_t h = sv_hash_string(sv_hash_string(SV_HASH_INIT, way), slash ? slash + 1 : model);
    enum sv_status status = hash_contents(model, &h, error);
    if (status != SV_OK)
        return status;
    char *folder = slash ? strndup(model, (size_t)(slash - model) + 1) : strdup(".");
    if (!folder)
        return sv_fail(error, SV_ENOMEM, model, "no memory for its folder's name");
    *key = sv_hash_done(sv_hash_u64(h, hash_folder(folder, "", 1)));
    free(folder);
    return SV_OK;
}

static uint64_t grown_key(const struct sv_species_spec *s)
{
    uint64_t h = sv_hash_u64(sv_hash_string(SV_HASH_INIT, "grow"), SV_GROW_VERSION);
    h = sv_hash_u64(sv_hash_u64(h, (uint64_t)s->habit), s->leaves);
    return sv_hash_done(sv_hash_u64(h, s->seed));
}

/* ---- the store ---- */

static size_t padded(size_t n)
{
    return (n + 7) / 8 * 8;
}

static void keep(struct sv_store *store, uint64_t key, const struct sv_tree_mesh *mesh,
                 const struct sv_errors *notes)
{
    void *saved = NULL;
    size_t bytes = 0, text = 0;
    if (!store || sv_tree_mesh_save(mesh, &saved, &bytes, NULL) != SV_OK)
        return; /* the store only saves time */
    for (size_t k = 0; k < notes->count; k++)
        text += strlen(notes->items[k].message) + 1;
    struct head head = {.note_count = notes->count, .note_bytes = text, .mesh_bytes = bytes};
    memcpy(head.magic, BLOB_MAGIC, sizeof head.magic);
    size_t whole = sizeof head + padded(text) + bytes;
    char *blob = calloc(1, whole), *p = blob + sizeof head;
    if (blob) {
        memcpy(blob, &head, sizeof head);
        for (size_t k = 0; k < notes->count; k++) {
            size_t n = strlen(notes->items[k].message) + 1;
            memcpy(p, notes->items[k].message, n);
            p += n;
        }
        memcpy(blob + whole - bytes, saved, bytes);
        sv_store_put(store, KIND, key, blob, whole, NULL);
    }
    free(blob);
    free(saved);
}

static bool unpack(const char *blob, size_t bytes, struct sv_tree_mesh *mesh, struct sv_errors *notes)
{
    struct head head;
    if (bytes < sizeof head)
        return false;
    memcpy(&head, blob, sizeof head);
    size_t room = bytes - sizeof head;
    if (memcmp(head.magic, BLOB_MAGIC, sizeof head.magic) != 0 || head.note_bytes > room ||
        padded(head.note_bytes) > room || head.mesh_bytes != room - padded(head.note_bytes))
        return false;
    const char *p = blob + sizeof head, *end = p + head.note_bytes;
    if (head.note_bytes > 0 && end[-1] != '\0')
        return false;
    if (sv_tree_mesh_load(blob + bytes - head.mesh_bytes, head.mesh_bytes, mesh, NULL) != SV_OK)
        return false;
    for (; p < end; p += strlen(p) + 1)
        sv_errors_add(notes, SV_OK, "", "%s", p);
    return true;
}

static bool recall(struct sv_store *store, uint64_t key, struct sv_tree_mesh *mesh, struct sv_errors *notes)
{
    void *blob = NULL;
    size_t bytes = 0;
    if (sv_store_get(store, KIND, key, &blob, &bytes, NULL) != SV_OK)
        return false;
    bool ok = unpack(blob, bytes, mesh, notes);
    free(blob);
    return ok;
}

/* ---- building ---- */

/* What is to be made: a species, or (species NULL) the model of an object. */
struct wanted {
    const struct sv_species_spec *species;
    const char *model;
};

static enum sv_status make(const struct wanted *wanted, struct sv_tree_mesh *mesh, struct sv_errors *notes,
                           struct sv_error *error)
{
    const struct sv_species_spec *s = wanted->species;
    if (!s)
        return sv_object_import(wanted->model, mesh, notes, error);
    return s->model ? sv_tree_import(s->model, mesh, notes, error)
                    : sv_tree_grow(s->habit, s->leaves, s->seed, mesh, error);
}

/* From the store, or made and kept there; told what was told when it was made. */
static enum sv_status obtain(const struct wanted *wanted, uint64_t key, struct sv_store *store,
                             struct sv_tree_mesh *mesh, struct sv_errors *notes, struct sv_error *error)
{
    struct sv_errors said;
    enum sv_status status = SV_OK;
    sv_errors_init(&said);
    if (!recall(store, key, mesh, &said)) {
        struct sv_tree_mesh made = {0};
        status = make(wanted, &made, &said, error);
        if (status == SV_OK) {
            *mesh = made;
            keep(store, key, mesh, &said);
        }
    }
    for (size_t k = 0; notes && k < said.count; k++)
        sv_errors_add(notes, said.items[k].code, said.items[k].field, "%s", said.items[k].message);
    sv_errors_finish(&said);
    return status;
}

enum sv_status sv_species_build(const struct sv_species_spec *spec, struct sv_store *store,
                                struct sv_tree_mesh *mesh, uint64_t *key, struct sv_errors *notes,
                                struct sv_error *error)
{
    uint64_t made_of = 0;
    enum sv_status status = SV_OK;
    if (spec->model)
        status = model_key(spec->model, "import", &made_of, error);
    else
        made_of = grown_key(spec);
    if (status == SV_OK)
        status = obtain(&(struct wanted){.species = spec}, made_of, store, mesh, notes, error);
    if (status == SV_OK)
        *key = made_of;
    return status;
}

enum sv_status sv_object_build(const char *model, struct sv_store *store, struct sv_tree_mesh *mesh,
                               uint64_t *key, struct sv_errors *notes, struct sv_error *error)
{
    uint64_t made_of = 0;
    enum sv_status status = model_key(model, "object2", &made_of, error);
    if (status == SV_OK)
        status = obtain(&(struct wanted){.model = model}, made_of, store, mesh, notes, error);
    if (status == SV_OK)
        *key = made_of;
    return status;
}
