/* test_prepare.c - children leave the meshes and impostors in the store, of the species that may grow and no
 * others; whatever happens to them, waiting ends and the work can be done again. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <errno.h>
#include <glob.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
#include <cmocka.h>

#include "core/base/color.h"
#include "core/scene/scene.h"
#include "server/scene/prepare.h"

struct folder {
    char path[64];
    struct sv_store *store;
    struct sv_scene_spec spec;
};

/* Three small species; the scatter plants the first and the third. */
static const char SCENE[] =
    "{\"name\": \"t\", \"terrain\": {\"procedural\": {\"size_m\": 100, \"samples\": 33, \"relief_m\": 5, "
    "\"seed\": 1}},"
    "\"species\": [{\"name\": \"a\", \"procedural\": {\"habit\": \"broadleaf\", \"leaves\": 300, \"seed\": "
    "1}},"
    "{\"name\": \"b\", \"procedural\": {\"habit\": \"conifer\", \"leaves\": 300, \"seed\": 2}},"
    "{\"name\": \"c\", \"procedural\": {\"habit\": \"shrub\", \"leaves\": 300, \"seed\": 3}}],"
    "\"forest\": [{\"scatter\": {\"count\": 20, \"seed\": 1, \"mix\": {\"a\": 0.5, \"c\": 0.5}, "
    "\"height_m\": [4, 5], \"min_spacing_m\": 1, \"max_slope_deg\": 80}}]}";

static int set_up(void **state)
{
    struct folder *f = calloc(1, sizeof *f);
    char name[100];
    struct sv_errors errors;
    strcpy(f->path, "/tmp/sv-prepare-XXXXXX");
    if (!mkdtemp(f->path))
        return -1;
    snprintf(name, sizeof name, "%s/s.json", f->path);
    FILE *file = fopen(name, "w");
    if (!file || fputs(SCENE, file) < 0 || fclose(file))
        return -1;
    sv_errors_init(&errors);
    if (sv_scene_spec_read(name, &f->spec, &errors) != SV_OK) {
        print_error("%s: %s\n", errors.items[0].field, errors.items[0].message);
        return -1;
    }
    sv_errors_finish(&errors);
    sv_color_init();
    *state = f;
    return sv_store_open(f->path, UINT64_C(1) << 30, &f->store, NULL) == SV_OK ? 0 : -1;
}

static int tear_down(void **state)
{
    struct folder *f = *state;
    char command[100];
    snprintf(command, sizeof command, "rm -rf %s", f->path);
    sv_store_close(f->store);
    sv_scene_spec_finish(&f->spec);
    int failed = system(command);
    free(f);
    return failed;
}

static size_t count(const struct folder *f, const char *pattern)
{
    char path[160];
    glob_t found;
    snprintf(path, sizeof path, "%s/%s", f->path, pattern);
    size_t n = glob(path, 0, NULL, &found) == 0 ? found.gl_pathc : 0;
    globfree(&found);
    return n;
}

static void assert_no_child(void)
{
    assert_int_equal(waitpid(-1, NULL, WNOHANG), -1);
    assert_int_equal(errno, ECHILD);
}

static void test_builds_what_may_grow(void **state)
{
    struct folder *f = *state;
    struct sv_prepare *prepare = sv_prepare_start(&f->spec, f->store, 2);
    assert_non_null(prepare);
    sv_prepare_wait(prepare);
    assert_no_child();
    sv_prepare_wait(prepare); /* again is legal */
    sv_prepare_destroy(prepare);
    assert_int_equal(count(f, "mesh*.svb"), 2);
    assert_int_equal(count(f, "spr*.svb"), 2);
    assert_int_equal(count(f, "ladder*.svb"), 2);
    static const struct {
        int species;
        bool kept;
    } rows[] = {{0, true}, {1, false}, {2, true}};
    for (size_t k = 0; k < 3; k++) { /* the blobs have the key that a load will ask for */
        struct sv_tree_mesh mesh;
        struct sv_error error;
        uint64_t key;
        char pattern[40];
        size_t before = count(f, "mesh*.svb");
        assert_int_equal(
            sv_species_build(&f->spec.species[rows[k].species], f->store, &mesh, &key, NULL, &error), SV_OK);
        assert_int_equal(count(f, "mesh*.svb") == before, rows[k].kept);
        snprintf(pattern, sizeof pattern, "spr*-%016llx.svb", (unsigned long long)key);
        assert_int_equal(count(f, pattern), rows[k].kept);
        sv_tree_mesh_finish(&mesh);
    }
}

static void test_nothing_to_do(void **state)
{
    struct folder *f = *state;
    assert_null(sv_prepare_start(&f->spec, NULL, 2));
    assert_null(sv_prepare_start(&f->spec, f->store, 1));
    assert_null(sv_prepare_start(&f->spec, f->store, 0));
    f->spec.forest_count = 0;
    assert_null(sv_prepare_start(&f->spec, f->store, 2));
    f->spec.forest_count = 1;
    assert_no_child();
    sv_prepare_wait(NULL);
    sv_prepare_destroy(NULL);
}

/* Children that end in the middle leave no half blob and nobody waiting. */
static void test_killed(void **state)
{
    struct folder *f = *state;
    struct sv_prepare *prepare = sv_prepare_start(&f->spec, f->store, 2);
    assert_non_null(prepare);
    sv_prepare_destroy(prepare); /* at once: kills them */
    assert_no_child();
    size_t left = count(f, "mesh*.svb");
    assert_true(left <= 2);
    prepare = sv_prepare_start(&f->spec, f->store, 2);
    sv_prepare_wait(prepare);
    sv_prepare_destroy(prepare);
    assert_int_equal(count(f, "mesh*.svb"), 2);
    assert_int_equal(count(f, "spr*.svb"), 2);
    assert_int_equal(count(f, "ladder*.svb"), 2);
}

/* A species that cannot be built does not keep the others from it. */
static void test_bad_model(void **state)
{
    struct folder *f = *state;
    struct sv_species_spec *bad = &f->spec.species[0];
    char *model = bad->model;
    bad->model = strdup("/nonexistent/tree.obj");
    struct sv_prepare *prepare = sv_prepare_start(&f->spec, f->store, 2);
    sv_prepare_wait(prepare);
    sv_prepare_destroy(prepare);
    free(bad->model);
    bad->model = model;
    assert_int_equal(count(f, "mesh*.svb"), 1);
    assert_int_equal(count(f, "spr*.svb"), 1);
    assert_int_equal(count(f, "ladder*.svb"), 1);
}

/* The scene and its store are as good with children as without. */
static void test_same_mesh(void **state)
{
    struct folder *f = *state;
    struct sv_prepare *prepare = sv_prepare_start(&f->spec, f->store, 2);
    sv_prepare_wait(prepare);
    sv_prepare_destroy(prepare);
    struct sv_tree_mesh kept, made;
    uint64_t kept_key, made_key;
    struct sv_error error;
    assert_int_equal(sv_species_build(&f->spec.species[2], f->store, &kept, &kept_key, NULL, &error), SV_OK);
    assert_int_equal(sv_species_build(&f->spec.species[2], NULL, &made, &made_key, NULL, &error), SV_OK);
    assert_int_equal(kept_key, made_key);
    assert_int_equal(kept.vertex_count, made.vertex_count);
    assert_memory_equal(kept.vertices, made.vertices, made.vertex_count * sizeof *made.vertices);
    assert_int_equal(kept.index_count, made.index_count);
    assert_memory_equal(kept.indices, made.indices, made.index_count * sizeof *made.indices);
    sv_tree_mesh_finish(&kept);
    sv_tree_mesh_finish(&made);
}

int main(void)
{
#define T(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {T(test_builds_what_may_grow), T(test_nothing_to_do), T(test_killed),
                                       T(test_bad_model), T(test_same_mesh)};
#undef T
    return cmocka_run_group_tests(tests, NULL, NULL);
}
