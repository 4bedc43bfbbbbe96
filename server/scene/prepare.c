#include "server/scene/prepare.h"

#include <errno.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/gl/context.h"
#include "core/relief/draw_object.h"
#include "core/scene/scene.h"
#include "core/tree/draw.h"
#include "server/log.h"

enum { PROCESSES_MAX = 64 };

struct sv_prepare {
    const struct sv_scene_spec *spec;
    struct sv_store *store;
    int jobs[SV_SCENE_SPECIES_MAX], job_count; /* indices of species */
    int *objects;                              /* indices of objects by model, then resolution; heap */
    int *models, model_count;                  /* where in objects each model begins; heap */
    atomic_int *next;                          /* of jobs, then of models; shared with the children */
    pid_t children[PROCESSES_MAX];
    int child_count;
};

/* Whether some tree may be of the species. Which names the points hold is known only when they are read: then
 * every species may be among them. */
static bool may_grow(const struct sv_scene_spec *spec, int species)
{
    for (int k = 0; k < spec->forest_count; k++) {
        const struct sv_forest_spec *f = &spec->forest[k];
        if (!f->is_scatter || (f->scatter.count > 0 && f->scatter.mix[species] > 0))
            return true;
    }
    return false;
}

/* Errors are told by whoever needs the species, and meets them again. */
static void build(const struct sv_prepare *p, int species)
{
    struct sv_tree_mesh mesh = {0};
    struct sv_tree_draw_species draw = {.mesh = &mesh, .tree_count = 1};
    struct sv_error error;
    if (sv_species_build(&p->spec->species[species], p->store, &mesh, &draw.key, NULL, &error) != SV_OK)
        return;
    if (sv_tree_draw_prepare(&draw, p->store, &error) != SV_OK)
        sv_log(SV_LOG_DEBUG, "prepare", "%s: %s", p->spec->species[species].name, error.message);
    sv_tree_mesh_finish(&mesh);
}

static const struct sv_object_spec *object_at(const struct sv_prepare *p, int k)
{
    return &p->spec->objects[p->objects[k]];
}

/* The model that begins at objects[first], and its reliefs of every resolution that some object wants. */
static void build_model(const struct sv_prepare *p, int first)
{
    struct sv_tree_mesh mesh = {0};
    uint64_t key;
    struct sv_error error;
    const char *model = object_at(p, first)->model;
    if (sv_object_build(model, p->store, &mesh, &key, NULL, &error) != SV_OK)
        return;
    for (int k = first; k < p->spec->object_count && strcmp(object_at(p, k)->model, model) == 0; k++) {
        int resolution = object_at(p, k)->relief_resolution;
        if (k > first && object_at(p, k - 1)->relief_resolution == resolution)
            continue;
        if (sv_object_relief_prepare(&mesh, key, resolution, p->store, &error) != SV_OK)
            sv_log(SV_LOG_DEBUG, "prepare", "%s: %s", model, error.message);
    }
    sv_tree_mesh_finish(&mesh);
}

static int compare_objects(const void *a, const void *b, void *context)
{
    const struct sv_object_spec *objects = context;
    const struct sv_object_spec *p = &objects[*(const int *)a], *q = &objects[*(const int *)b];
    int order = strcmp(p->model, q->model);
    return order ? order
                 : (p->relief_resolution > q->relief_resolution) -
                       (p->relief_resolution < q->relief_resolution);
}

/* Without memory nothing is built ahead: whoever needs it builds it. */
static void list_models(struct sv_prepare *p)
{
    int count = p->spec->object_count;
    p->objects = malloc(((size_t)count + 1) * sizeof *p->objects);
    p->models = malloc(((size_t)count + 1) * sizeof *p->models);
    if (!p->objects || !p->models)
        return;
    for (int k = 0; k < count; k++)
        p->objects[k] = k;
    qsort_r(p->objects, (size_t)count, sizeof *p->objects, compare_objects, p->spec->objects);
    for (int k = 0; k < count; k++)
        if (k == 0 || strcmp(object_at(p, k)->model, object_at(p, k - 1)->model) != 0)
            p->models[p->model_count++] = k;
}

_Noreturn static void be_child(const struct sv_prepare *p, pid_t parent)
{
    /* The parent may have died before prctl: then nobody will ever send the signal. */
    if (prctl(PR_SET_PDEATHSIG, SIGKILL) || getppid() != parent)
        _exit(1);
    prctl(PR_SET_NAME, "silvista-build");
    struct sv_gl_context *context = NULL; /* reliefs are drawn */
    struct sv_error error;
    int all = p->job_count + p->model_count;
    for (int k = atomic_fetch_add(p->next, 1); k < all; k = atomic_fetch_add(p->next, 1)) {
        if (k < p->job_count)
            build(p, p->jobs[k]);
        else if (context || sv_gl_context_create(&context, &error) == SV_OK)
            build_model(p, p->models[k - p->job_count]);
    }
    _exit(0);
}

static void fork_children(struct sv_prepare *p, int count)
{
    pid_t parent = getpid();
    for (int k = 0; k < count; k++) {
        pid_t pid = fork();
        if (pid == 0)
            be_child(p, parent);
        if (pid < 0) {
            sv_log(SV_LOG_WARNING, "prepare", "fork: %s", strerror(errno));
            return;
        }
        p->children[p->child_count++] = pid;
    }
}

struct sv_prepare *sv_prepare_start(const struct sv_scene_spec *spec, struct sv_store *store, int processes)
{
    if (!store || processes < 2)
        return NULL;
    struct sv_prepare *p = calloc(1, sizeof *p);
    void *shared = mmap(NULL, sizeof *p->next, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (!p || shared == MAP_FAILED)
        goto fail;
    *p = (struct sv_prepare){.spec = spec, .store = store, .next = shared};
    for (int k = 0; k < spec->species_count; k++)
        if (may_grow(spec, k))
            p->jobs[p->job_count++] = k;
    list_models(p);
    int count = processes < PROCESSES_MAX ? processes : PROCESSES_MAX, all = p->job_count + p->model_count;
    fork_children(p, count < all ? count : all);
    if (p->child_count > 0)
        return p;
fail:
    if (p) {
        free(p->objects);
        free(p->models);
    }
    if (shared != MAP_FAILED)
        munmap(shared, sizeof *p->next);
    free(p);
    return NULL;
}

static void reap(struct sv_prepare *p)
{
    while (p->child_count > 0) {
        pid_t pid = p->children[--p->child_count];
        int status = 0;
        while (waitpid(pid, &status, 0) < 0 && errno == EINTR)
            ;
        if (WIFSIGNALED(status) && WTERMSIG(status) != SIGKILL)
            sv_log(SV_LOG_WARNING, "prepare", "a child died of signal %d: its work is done again",
                   WTERMSIG(status));
    }
}

void sv_prepare_wait(struct sv_prepare *prepare)
{
    if (prepare)
        reap(prepare);
}

void sv_prepare_destroy(struct sv_prepare *prepare)
{
    if (!prepare)
        return;
    for (int k = 0; k < prepare->child_count; k++)
        kill(prepare->children[k], SIGKILL);
    reap(prepare);
    munmap(prepare->next, sizeof *prepare->next);
    free(prepare->objects);
    free(prepare->models);
    free(prepare);
}
