/* test_scene.c - whole scenes: what is planted, counted, told, left out and refused; versions; the store;
 * real places. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>
#include <cmocka.h>

#include "core/base/hash.h"
#include "core/scene/scene.h"

struct work {
    char folder[64], scene[96];
    struct sv_store *store;
    char log[1 << 16]; /* all lines of the last load */
    struct sv_errors errors;
    struct sv_scene *last;
};

static void note(void *context, int level, const char *message)
{
    struct work *w = context;
    size_t n = strlen(w->log);
    snprintf(w->log + n, sizeof w->log - n, "%s%s\n", level ? "! " : "", message);
}

static void write_file(const struct work *w, const char *name, const char *text)
{
    char path[200];
    snprintf(path, sizeof path, "%s/%s", w->folder, name);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    assert_true(fputs(text, f) >= 0);
    assert_int_equal(fclose(f), 0);
}

/* Loads a scene of this text; the last one goes. */
static enum sv_status load(struct work *w, const char *text)
{
    struct sv_scene_spec spec;
    const struct sv_scene_options options = {
        .store = w->store, .log = note, .log_context = w, .arena_bytes = (size_t)1 << 32};
    w->log[0] = '\0';
    sv_errors_finish(&w->errors);
    sv_scene_destroy(w->last);
    w->last = NULL;
    write_file(w, "s.json", text);
    enum sv_status status = sv_scene_spec_read(w->scene, &spec, &w->errors);
    if (status != SV_OK)
        return status;
    status = sv_scene_load(&spec, &options, &w->last, &w->errors);
    if (status != SV_OK) {
        assert_non_null(spec.path); /* still the caller's */
        assert_null(w->last);
        sv_scene_spec_finish(&spec);
    } else {
        assert_null(spec.path);
    }
    return status;
}

static const struct sv_scene *load_ok(struct work *w, const char *text)
{
    if (load(w, text) != SV_OK)
        fail_msg("%s: %s", w->errors.items[0].field, w->errors.items[0].message);
    assert_int_equal(w->errors.total, 0);
    return w->last;
}

static void assert_told(const struct work *w, const char *line)
{
    if (!strstr(w->log, line))
        fail_msg("the log does not say: %s\nbut:\n%s", line, w->log);
}

#define TERRAIN "\"terrain\":{\"procedural\":{\"size_m\":1000,\"samples\":65,\"relief_m\":40,\"seed\":3}}"
#define SPECIES                                                                               \
    "\"species\":[{\"name\":\"oak\",\"procedural\":{\"habit\":\"broadleaf\",\"leaves\":60}}," \
    "{\"name\":\"fir\",\"procedural\":{\"habit\":\"conifer\",\"leaves\":60}},"                \
    "{\"name\":\"spare\",\"procedural\":{\"habit\":\"palm\",\"leaves\":60}}]"

static void check_trees(const struct sv_scene *s)
{
    uint32_t counts[SV_SCENE_SPECIES_MAX] = {0};
    unsigned char *seen = calloc(s->forest.count + 1, 1);
    for (uint32_t k = 0; k < s->forest.count; k++) {
        const struct sv_tree *t = &s->forest.trees[k];
        double z;
        assert_true(sv_heightfield_height(&s->terrain.field, t->x, t->y, &z) && z == t->z);
        assert_true((double)t->height_m >= SV_TREE_HEIGHT_MIN_M * 0.999 &&
                    (double)t->height_m <= SV_TREE_HEIGHT_MAX_M);
        assert_true(t->rotation_rad >= 0 && (double)t->rotation_rad < 2 * SV_PI);
        assert_true(t->species < s->species_count && t->number < s->forest.count);
        counts[t->species]++;
        seen[t->number]++;
    }
    for (uint32_t k = 0; k < s->forest.count; k++)
        assert_int_equal(seen[k], 1);
    for (int k = 0; k < s->species_count; k++) {
        assert_int_equal(s->species[k].tree_count, counts[k]);
        assert_true((s->species[k].mesh.vertex_count > 0) == (counts[k] > 0));
        assert_true((s->species[k].key != 0) == (counts[k] > 0));
    }
    free(seen);
    size_t texels = (size_t)s->terrain.albedo.width * (size_t)s->terrain.albedo.height;
    assert_true(texels > 0 && s->terrain.albedo.channels == 4);
    assert_int_equal(s->terrain.normal.width, s->terrain.field.width);
}

static const struct sv_tree *tree_number(const struct sv_scene *s, uint32_t number)
{
    for (uint32_t k = 0; k < s->forest.count; k++)
        if (s->forest.trees[k].number == number)
            return &s->forest.trees[k];
    fail_msg("no tree %u", number);
    return NULL;
}

/* Every kind of row that an inventory may hold. */
static void test_points(void **state)
{
    struct work *w = *state;
    write_file(w, "t.csv",
               "x,y,art,h,rot\n"
               "100,100,oak,10,0\n"      /* 0: by its very name */
               "200,100,Abies,20.5,90\n" /* 1: by the map */
               "300,100,Ulmus,7,-90\n"   /* 2: unknown: the default */
               "400,100,,8,720\n"        /* 3: none: the default */
               "500,100,oak,,10\n"       /* 4: no height: 14 m */
               "600,100,oak,0,10\n"      /* 5: absurd */
               "700,100,oak,-3,10\n"     /* 6 */
               "800,100,oak,151,10\n"    /* 7 */
               "900,100,oak,tall,\n"     /* 8: and no rotation */
               "100,200,oak,150,x\n"     /* 9: the highest legal; no rotation */
               "100,300,oak,1.5,0\n"     /* left out: lower than 2 m */
               "100,400,oak,0.01,0\n"    /* left out */
               "-1,100,oak,10,0\n"       /* outside */
               "100,1000.5,oak,10,0\n"   /* outside */
               "1000,1000,fir,10,45\n"   /* 10: the very corner */
               "nowhere,100,oak,10,0\n"  /* no place */
    );
    const struct sv_scene *s = load_ok(
        w,
        "{" TERRAIN "," SPECIES
        ",\"forest\":[{\"points\":\"t.csv\",\"species\":\"art\",\"height_m\":\"h\",\"rotation_deg\":\"rot\","
        "\"species_map\":{\"Abies\":\"fir\"},\"default_species\":\"fir\",\"default_height_m\":14,\"min_"
        "height_m\":2}]}");
    check_trees(s);
    assert_int_equal(s->forest.count, 11);
    static const struct {
        int species;
        double height, turn_deg; /* turn < 0: from a hash */
    } rows[] = {{0, 10, 0},  {1, 20.5, 90}, {1, 7, 270}, {1, 8, 0},    {0, 14, 10}, {0, 14, 10},
                {0, 14, 10}, {0, 14, 10},   {0, 14, -1}, {0, 150, -1}, {1, 10, 45}};
    for (uint32_t k = 0; k < 11; k++) {
        const struct sv_tree *t = tree_number(s, k);
        assert_int_equal(t->species, rows[k].species);
        assert_true((double)t->height_m == rows[k].height);
        if (rows[k].turn_deg >= 0)
            assert_true(fabs(sv_degrees((double)t->rotation_rad) - rows[k].turn_deg) < 1e-4);
    }
    assert_true(tree_number(s, 8)->rotation_rad != tree_number(s, 9)->rotation_rad);
    assert_told(w, "forest[0]: 11 trees from 15 points");
    assert_told(w, "! forest[0]: 1 features without a usable place left out");
    assert_told(w, "! forest[0]: 2 points outside the terrain left out");
    assert_int_equal(w->last->counts.outside_terrain, 2);
    assert_told(w, "forest[0]: 2 trees lower than 2 m left out");
    assert_told(w, "! forest[0]: 5 trees without a height of 0 .. 150 m stand at 14 m");
    assert_told(w, "! forest[0]: 2 trees of no or unknown species are \"fir\"");
    assert_told(w, "species \"spare\": no tree of it, not built");
}

/* min_height_m above default_height_m: what was measured low goes, what was not measured stands. */
static void test_min_height(void **state)
{
    struct work *w = *state;
    write_file(w, "t.csv", "x,y,h\n100,100,\n200,100,tall\n300,100,9.5\n400,100,15\n500,100,0\n");
    const struct sv_scene *s =
        load_ok(w, "{" TERRAIN "," SPECIES ",\"forest\":[{\"points\":\"t.csv\",\"height_m\":\"h\","
                   "\"default_species\":\"fir\",\"default_height_m\":8,\"min_height_m\":10}]}");
    assert_int_equal(s->forest.count, 4);
    static const double heights[4] = {8, 8, 15, 8};
    for (uint32_t k = 0; k < 4; k++)
        assert_true((double)tree_number(s, k)->height_m == heights[k]);
    assert_told(w, "forest[0]: 1 trees lower than 10 m left out");
    assert_told(w, "! forest[0]: 3 trees without a height of 0 .. 150 m stand at 8 m");
}

/* The log speaks of relief when the scene does. */
static void test_relief_told(void **state)
{
    struct work *w = *state;
    load_ok(w, "{" TERRAIN "}");
    assert_null(strstr(w->log, "relief:"));
    load_ok(w, "{" TERRAIN ",\"relief\":{\"distance_m\":70}}");
    assert_told(w, "relief: distance 70 m, resolution 1024 kept");
}

/* "*" in the map covers what nothing else does; a name that nothing covers is an error that names it. */
static void test_names(void **state)
{
    struct work *w = *state;
    write_file(w, "t.csv", "x,y,art\n100,100,oak\n200,100,Ulmus\n300,100,\n");
    const struct sv_scene *s =
        load_ok(w, "{" TERRAIN "," SPECIES ",\"forest\":[{\"points\":\"t.csv\",\"species\":\"art\","
                   "\"species_map\":{\"*\":\"fir\"}}]}");
    assert_int_equal(tree_number(s, 0)->species, 0);
    assert_int_equal(tree_number(s, 1)->species, 1);
    assert_int_equal(tree_number(s, 2)->species, 1);
    assert_int_equal(
        load(w, "{" TERRAIN "," SPECIES ",\"forest\":[{\"points\":\"t.csv\",\"species\":\"art\"}]}"),
        SV_EINVAL);
    assert_string_equal(w->errors.items[0].field, "forest[0].points");
    assert_non_null(strstr(w->errors.items[0].message,
                           "no species for 1 names in the data: \"Ulmus\"; give species_map"));
    assert_int_equal(load(w, "{" TERRAIN "," SPECIES ",\"forest\":[{\"points\":\"t.csv\"}]}"), SV_EINVAL);
    assert_non_null(strstr(w->errors.items[0].message, "some points name no species; give default_species"));
    s = load_ok(w, "{" TERRAIN
                   ",\"species\":[{\"name\":\"only\",\"procedural\":{\"habit\":\"shrub\",\"leaves\":60}}],"
                   "\"forest\":[{\"points\":\"t.csv\"}]}");
    assert_int_equal(s->forest.count, 3);
}

static uint64_t hash_ground(const struct sv_scene *s)
{
    const struct sv_terrain *t = &s->terrain;
    uint64_t h =
        sv_hash_bytes(SV_HASH_INIT, t->field.h, (size_t)(t->field.width * t->field.height) * sizeof(float));
    h = sv_hash_bytes(h, t->albedo.data, sv_image_bytes(&t->albedo));
    h = sv_hash_bytes(h, t->normal.data, sv_image_bytes(&t->normal));
    return sv_hash_done(sv_hash_double(sv_hash_double(h, t->field.dx), (double)t->field.h_max));
}

/* A tent on the ground: a triangular prism along x. */
static const char HUT[] = "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv -1 1 0\nv 1 1 0\n"
                          "f 4 3 6 5\nf 2 1 5 6\nf 1 4 5\nf 3 2 6\nf 1 2 3 4\n";

static void test_scatter(void **state)
{
    struct work *w = *state;
    static const char text[] =
        "{" TERRAIN "," SPECIES ",\"forest\":[{\"scatter\":{\"count\":500,\"mix\":{\"oak\":1,\"fir\":3}}},"
        "{\"scatter\":{\"count\":90000,\"min_spacing_m\":20,\"mix\":{\"fir\":1}}}],"
        "\"objects\":[{\"model\":\"hut.obj\",\"x\":1,\"y\":2,\"height_m\":3}],"
        "\"sun\":{\"azimuth_deg\":90,\"elevation_deg\":30},\"relief\":{\"distance_m\":70,\"resolution\":256}"
        "}";
    write_file(w, "hut.obj", HUT);
    const struct sv_scene *s = load_ok(w, text);
    check_trees(s);
    assert_int_equal(s->species[0].tree_count, 125);
    assert_true(s->forest.count > 1000 && s->forest.count < 4000);
    assert_told(w, "forest[0]: strewed 500 of 500 trees");
    assert_told(w, "! forest[1]: no room for more at min_spacing_m 20");
    assert_told(w, "objects: 1, of 1 model");
    assert_told(w, "relief: distance 70 m, resolution 256 kept");
    assert_true(fabs(s->sun.azimuth_rad - SV_PI / 2) < 1e-12 &&
                fabs(s->sun.elevation_rad - SV_PI / 6) < 1e-12);
    assert_true(s->object_count == 1 && s->objects[0].height_m == 3 && s->relief_distance_m == 70);
    uint64_t version = s->version;
    struct sv_tree first = *tree_number(s, 0);
    uint64_t ground = hash_ground(s);
    s = load_ok(w, text); /* again, now from the store: the same */
    assert_true(s->version == version);
    assert_memory_equal(tree_number(s, 0), &first, sizeof first);
    assert_true(hash_ground(s) == ground);
    sv_store_close(w->store);
    w->store = NULL; /* and the same without any store */
    s = load_ok(w, text);
    assert_true(s->version == version && hash_ground(s) == ground);
}

static void test_objects(void **state)
{
    struct work *w = *state;
    write_file(w, "hut.obj", HUT);
    write_file(w, "rock.obj", "v 5 1 5\nv 6 1 5\nv 5 2 5\nv 5 1 6\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
    static const char text[] =
        "{" TERRAIN ",\"objects\":[{\"model\":\"rock.obj\",\"x\":20,\"y\":30,\"height_m\":2},"
        "{\"model\":\"hut.obj\",\"x\":40,\"y\":30,\"height_m\":3,\"heading_deg\":-90,"
        "\"relief_resolution\":64},"
        "{\"model\":\"rock.obj\",\"x\":50,\"y\":10,\"height_m\":4}]}";
    const struct sv_scene *s = load_ok(w, text);
    assert_int_equal(s->object_count, 3);
    assert_int_equal(s->model_count, 2);
    assert_int_equal(s->objects[0].model, s->objects[2].model); /* one mesh for equal files */
    assert_true(s->objects[0].model != s->objects[1].model);
    for (int k = 0; k < 3; k++) {
        double z = NAN;
        const struct sv_scene_object *o = &s->objects[k];
        const struct sv_object_model *m = &s->models[o->model];
        assert_true(sv_heightfield_height(&s->terrain.field, o->x, o->y, &z) && o->z == z);
        assert_non_null(strstr(m->file, k == 1 ? "hut.obj" : "rock.obj"));
        assert_int_equal(m->object_count, k == 1 ? 1 : 2);
        assert_int_equal(m->mesh.index_count / 3, k == 1 ? 8 : 4);
        assert_int_equal(m->mesh.leaf_count, 0);
    }
    assert_true(s->objects[1].height_m == 3 && fabs(s->objects[1].heading_rad - 1.5 * SV_PI) < 1e-12);
    assert_int_equal(s->objects[1].relief_resolution, 64);
    assert_told(w, "objects: 3, of 2 models");
    assert_told(w, "the plan's middle stands at the place"); /* the rock lies beside its origin */
    uint64_t version = s->version;
    s = load_ok(w, text); /* from the store: the same, and the note is said again */
    assert_true(s->version == version);
    assert_told(w, "the plan's middle stands at the place");
    write_file(w, "hut.obj", "v -1 0 -1\nv 1 0 -1\nv 0 0 1\nv 0 2 0\nf 1 4 2\nf 2 4 3\nf 3 4 1\n");
    s = load_ok(w, text);
    assert_true(s->version != version); /* another model is another scene */
}

static void test_objects_refused(void **state)
{
    struct work *w = *state;
    write_file(w, "hut.obj", HUT);
    write_file(w, "flat.obj", "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n");
    static const char text[] =
        "{" TERRAIN ",\"objects\":[{\"model\":\"hut.obj\",\"x\":20,\"y\":1e7,\"height_m\":2},"
        "{\"model\":\"hut.obj\",\"x\":40,\"y\":30,\"height_m\":3},"
        "{\"model\":\"flat.obj\",\"x\":50,\"y\":10,\"height_m\":4}]}";
    assert_int_equal(load(w, text), SV_EOUTSIDE);
    assert_int_equal(w->errors.total, 2); /* one run tells all */
    assert_string_equal(w->errors.items[0].field, "objects[0]");
    assert_non_null(strstr(w->errors.items[0].message, "y 10000000 is outside the terrain (x "));
    assert_non_null(strstr(w->errors.items[0].message, "s.json"));
    assert_string_equal(w->errors.items[1].field, "objects[2].model");
    assert_non_null(strstr(w->errors.items[1].message, "flat.obj"));
    assert_non_null(strstr(w->errors.items[1].message, "no object stands in it"));
}

static void test_empty(void **state)
{
    struct work *w = *state;
    const struct sv_scene *s = load_ok(w, "{" TERRAIN "}");
    assert_int_equal(s->forest.count, 0);
    assert_int_equal(s->species_count, 0);
    assert_true(sv_crs_is_local(s->crs));
    write_file(w, "none.csv", "x,y\n");
    s = load_ok(
        w,
        "{" TERRAIN "," SPECIES
        ",\"forest\":[{\"points\":\"none.csv\",\"default_species\":\"oak\"},{\"scatter\":{\"count\":0}}]}");
    check_trees(s);
    assert_int_equal(s->forest.count, 0);
}

/* The arena is sealed: what a scene holds cannot be written by mistake. */
static void test_sealed(void **state)
{
    struct work *w = *state;
    const struct sv_scene *s = load_ok(w, "{" TERRAIN "}");
    assert_null(sv_arena_alloc(s->arena, 1, 1));
}

/* The version follows what a picture depends on, and nothing else. */
static void test_version(void **state)
{
    struct work *w = *state;
    write_file(w, "t.csv", "x,y\n100,100\n");
#define FOREST(more) ",\"forest\":[{\"points\":\"t.csv\",\"default_species\":\"oak\"" more "}]"
    uint64_t base = load_ok(w, "{" TERRAIN "," SPECIES FOREST("") "}")->version;
    assert_true(load_ok(w, "{ " SPECIES ",\n" TERRAIN FOREST("") "}")->version == base);
    static const char *const changed[] = {
        "{" TERRAIN "," SPECIES FOREST("") ",\"name\":\"x\"}",
        "{" TERRAIN "," SPECIES FOREST("") ",\"sun\":{\"elevation_deg\":41}}",
        "{" TERRAIN "," SPECIES FOREST(",\"default_height_m\":13") "}",
        "{" TERRAIN "," SPECIES FOREST("") ",\"relief\":{\"distance_m\":101}}",
        "{" TERRAIN "," SPECIES "}",
        "{\"terrain\":{\"procedural\":{\"size_m\":1000,\"samples\":65,\"relief_m\":40,\"seed\":4}}," SPECIES
            FOREST("") "}",
    };
    for (size_t k = 0; k < sizeof changed / sizeof changed[0]; k++)
        assert_true(load_ok(w, changed[k])->version != base);
    write_file(w, "t.csv", "x,y\n100,200\n"); /* as long as before, but a moment later */
    assert_true(load_ok(w, "{" TERRAIN "," SPECIES FOREST("") "}")->version != base);
#undef FOREST
}

/* Errors of parts that do not depend on each other come together, each under its key path. */
static void test_errors(void **state)
{
    struct work *w = *state;
    write_file(w, "bad.csv", "lon,lat\n1,2\n");
    write_file(w, "bad.json", "{}");
    write_file(w, "bad.obj", "nothing here\n");
    write_file(w, "bad.tif", "no image");
    write_file(w, "t.csv", "x,y\n100,100\n");
    enum sv_status status =
        load(w, "{" TERRAIN
                ",\"species\":[{\"name\":\"a\",\"model\":\"bad.obj\"}],\"forest\":[{\"points\":\"bad.csv\"},"
                "{\"scatter\":{\"count\":5,\"within\":\"bad.json\"}}]}");
    assert_int_equal(status, w->errors.items[0].code);
    assert_int_equal(w->errors.total, 2);
    assert_string_equal(w->errors.items[0].field, "forest[0].x");
    assert_string_equal(w->errors.items[1].field, "forest[1].scatter.within");
    assert_non_null(strstr(w->errors.items[0].message, w->scene));
    assert_non_null(strstr(w->errors.items[0].message, "bad.csv: has no column \"x\" (x), \"y\" (y); its"));
    /* each under its key, several columns in one go */
    status = load(w, "{" TERRAIN "," SPECIES ",\"forest\":["
                     "{\"points\":\"t.csv\",\"height_m\":\"h\",\"rotation_deg\":\"r\"},"
                     "{\"points\":\"t.csv\",\"where\":\"dbh > 2\"},"
                     "{\"points\":\"t.csv\",\"crs\":\"EPSG:4326\"},"
                     "{\"points\":\"bad.tif\"}]}");
    assert_int_equal(status, SV_ENOENT);
    static const char *const fields[] = {"forest[0].height_m", "forest[1].where", "forest[2].crs",
                                         "forest[3].points"};
    assert_int_equal(w->errors.total, 4);
    for (size_t k = 0; k < 4; k++)
        assert_string_equal(w->errors.items[k].field, fields[k]);
    assert_non_null(strstr(w->errors.items[0].message, "\"h\" (height_m), \"r\" (rotation_deg)"));
    assert_int_not_equal(
        load(w, "{" TERRAIN
                ",\"species\":[{\"name\":\"a\",\"model\":\"bad.obj\"},{\"name\":\"b\",\"model\":\"t.csv\"}],"
                "\"forest\":[{\"scatter\":{\"count\":9}}]}"),
        SV_OK);
    assert_int_equal(w->errors.total, 2);
    assert_string_equal(w->errors.items[0].field, "species[0].model");
    assert_string_equal(w->errors.items[1].field, "species[1].model");
    assert_int_not_equal(load(w, "{\"terrain\":{\"dem\":\"bad.tif\"}}"), SV_OK);
    assert_int_equal(w->errors.total, 1);
    assert_string_equal(w->errors.items[0].field, "terrain.dem");
    /* What no tree uses is not even opened. */
    load_ok(w, "{" TERRAIN ",\"species\":[{\"name\":\"a\",\"model\":\"bad.obj\"},{\"name\":\"b\","
               "\"procedural\":{\"habit\":\"palm\",\"leaves\":60}}],"
               "\"forest\":[{\"scatter\":{\"count\":9,\"mix\":{\"b\":1}}}]}");
}

/* ---- species and the store ---- */

static const char OBJ[] = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 2 1\nusemtl bark\nf 1 2 3\nf 1 3 4\n";

static uint64_t key_of(struct work *w, const char *name, enum sv_status expected)
{
    char path[200];
    snprintf(path, sizeof path, "%s/%s", w->folder, name);
    struct sv_species_spec spec = {.name = "s", .model = path};
    struct sv_tree_mesh mesh = {0};
    struct sv_error e = {0};
    uint64_t key = 0;
    assert_int_equal(sv_species_build(&spec, w->store, &mesh, &key, NULL, &e), expected);
    if (expected == SV_OK)
        assert_int_equal(mesh.index_count, 6);
    sv_tree_mesh_finish(&mesh);
    return key;
}

/* Model, material library and textures beside it all belong to the key; other files do not. */
static void test_model_key(void **state)
{
    struct work *w = *state;
    char textures[128];
    snprintf(textures, sizeof textures, "%s/textures", w->folder);
    write_file(w, "m.obj", OBJ);
    write_file(w, "m.mtl", "newmtl bark\nKd 0.5 0.4 0.3\n");
    uint64_t base = key_of(w, "m.obj", SV_OK);
    assert_true(base != 0 && key_of(w, "m.obj", SV_OK) == base);
    write_file(w, "readme.txt", "not a part");
    assert_true(key_of(w, "m.obj", SV_OK) == base);
    write_file(w, "m.mtl", "newmtl bark\nKd 0.5 0.4 0.2\n");
    uint64_t other = key_of(w, "m.obj", SV_OK);
    assert_true(other != base);
    assert_int_equal(mkdir(textures, 0700), 0);
    write_file(w, "textures/leaf.PNG", "x");
    uint64_t third = key_of(w, "m.obj", SV_OK);
    assert_true(third != other);
    write_file(w, "m.obj",
               "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 3 0\nv 0 2 1\nusemtl bark\nf 1 2 3\nf 1 3 4\n");
    assert_true(key_of(w, "m.obj", SV_OK) != third);
    key_of(w, "absent.obj", SV_ENOENT);
    write_file(w, "empty.obj", "");
    key_of(w, "empty.obj", SV_EFORMAT);
}

/* From the store or not, a species is the same; notes are said each time; a damaged blob is built again. */
static void test_species_store(void **state)
{
    struct work *w = *state;
    char path[200], command[300];
    write_file(w, "m.obj", OBJ);
    write_file(w, "m.mtl", "newmtl bark\nKd 0.5 0.4 0.3\nmap_Kd missing.png\n");
    snprintf(path, sizeof path, "%s/m.obj", w->folder);
    struct sv_species_spec specs[2] = {{.name = "a", .model = path},
                                       {.name = "b", .habit = SV_HABIT_CONIFER, .leaves = 300, .seed = 5}};
    for (int k = 0; k < 2; k++) {
        void *bytes[3] = {NULL};
        size_t sizes[3];
        size_t notes[3];
        for (int turn = 0; turn < 3; turn++) {
            struct sv_tree_mesh mesh = {0};
            struct sv_errors said;
            struct sv_error e = {0};
            uint64_t key;
            sv_errors_init(&said);
            if (turn == 2) { /* cut every blob short */
                snprintf(command, sizeof command, "for f in %s/store/*.svb; do truncate -s 100 $f; done",
                         w->folder);
                assert_int_equal(system(command), 0);
            }
            if (sv_species_build(&specs[k], w->store, &mesh, &key, &said, &e) != SV_OK)
                fail_msg("%s: %s", e.field, e.message);
            assert_int_equal(sv_tree_mesh_save(&mesh, &bytes[turn], &sizes[turn], &e), SV_OK);
            notes[turn] = said.count;
            sv_errors_finish(&said);
            sv_tree_mesh_finish(&mesh);
        }
        for (int turn = 1; turn < 3; turn++) {
            assert_int_equal(sizes[turn], sizes[0]);
            assert_memory_equal(bytes[turn], bytes[0], sizes[0]);
            assert_int_equal(notes[turn], notes[0]);
        }
        assert_true(k == 1 || notes[0] > 0); /* the texture that is not there */
        for (int turn = 0; turn < 3; turn++)
            free(bytes[turn]);
    }
}

static uint64_t grown_key(enum sv_habit habit, uint32_t leaves, uint64_t seed)
{
    struct sv_species_spec spec = {.name = "s", .habit = habit, .leaves = leaves, .seed = seed};
    struct sv_tree_mesh mesh = {0};
    uint64_t key = 0;
    assert_int_equal(sv_species_build(&spec, NULL, &mesh, &key, NULL, NULL), SV_OK);
    assert_int_equal(mesh.leaf_count, leaves);
    sv_tree_mesh_finish(&mesh);
    return key;
}

static void test_grown_key(void **state)
{
    (void)state;
    uint64_t base = grown_key(SV_HABIT_SHRUB, 50, 1);
    assert_true(grown_key(SV_HABIT_SHRUB, 50, 1) == base);
    assert_true(grown_key(SV_HABIT_SHRUB, 51, 1) != base);
    assert_true(grown_key(SV_HABIT_SHRUB, 50, 2) != base);
    assert_true(grown_key(SV_HABIT_POPLAR, 50, 1) != base);
}

/* ---- real places ---- */

/* The scene with every @ replaced by the data folder; skips the test when there is none. */
static const struct sv_scene *load_real(struct work *w, const char *text)
{
    const char *data = getenv("SV_DATA");
    char folder[4096], *full = calloc(1, 1 << 16);
    if (!realpath(data ? data : "../shared/data", folder)) {
        free(full);
        print_message("skipped: no real inputs\n");
        skip();
    }
    for (size_t n = 0; *text; text++)
        n += (size_t)(*text == '@' ? snprintf(full + n, 4096, "%s", folder)
                                   : snprintf(full + n, 2, "%c", *text));
    const struct sv_scene *s = load_ok(w, full);
    free(full);
    return s;
}

static void test_olinda(void **state)
{
    struct work *w = *state;
    const struct sv_scene *s =
        load_real(w, "{\"name\":\"olinda\",\"terrain\":{\"dem\":\"@/dem/"
                     "olinda_srtm_utm25s.tif\",\"imagery\":\"@/ortho/olinda_landsat7_utm25s.tif\","
                     "\"imagery_bands\":[3,2,1]},"
                     "\"species\":[{\"name\":\"pine\",\"model\":\"@/models/quaternius/Pine_1.obj\"},"
                     "{\"name\":\"palm\",\"procedural\":{\"habit\":\"palm\",\"leaves\":900}}],"
                     "\"forest\":[{\"scatter\":{\"count\":20000,\"mix\":{\"pine\":1,\"palm\":3},\"height_m\":"
                     "[4,15],\"min_spacing_m\":3}}]}");
    check_trees(s);
    assert_true(s->terrain.has_imagery);
    assert_int_equal(s->terrain.field.width, 111);
    assert_int_equal(s->forest.count, 20000);
    assert_int_equal(s->species[1].tree_count, 15000);
    assert_told(w, "bands 3,2,1");
    double lon, lat; /* 8 S 35 W, the corner of Brazil */
    assert_true(sv_crs_to_lonlat(s->crs, s->forest.trees[0].x, s->forest.trees[0].y, &lon, &lat));
    assert_true(fabs(lon + 34.9) < 0.2 && fabs(lat + 8.0) < 0.2);
}

static void test_scbi(void **state)
{
    struct work *w = *state;
    const struct sv_scene *s =
        load_real(w, "{\"name\":\"scbi\",\"terrain\":{\"dem\":\"@/dem/scbi_10m_utm17n.tif\"},"
                     "\"species\":[{\"name\":\"oak\",\"model\":\"@/models/eztree/ez_oak_medium.glb\"},"
                     "{\"name\":\"ash\",\"model\":\"@/models/eztree/ez_ash_large.glb\"}],"
                     "\"forest\":[{\"points\":\"@/trees/"
                     "scbi_forestgeo_utm17n.csv\",\"species\":\"species\",\"height_m\":\"height_m\","
                     "\"crs\":\"EPSG:26917\",\"species_map\":{\"Quercus "
                     "alba\":\"oak\",\"*\":\"ash\"},\"default_height_m\":18}]}");
    check_trees(s);
    assert_int_equal(s->forest.count, 8832);
    assert_false(s->terrain.has_imagery);
    assert_told(w, "8350 trees without a height"); /* 8832 stems, 482 heights */
    assert_int_equal(w->last->counts.heights_defaulted, 8350);
    for (uint32_t k = 0; k < s->forest.count; k++)
        assert_true(s->forest.trees[k].z > 270 &&
                    s->forest.trees[k].z < 341); /* gdallocationinfo: 271 .. 340 */
}

/* ---- */

static int set_up(void **state)
{
    struct work *w = calloc(1, sizeof *w);
    char store[128];
    strcpy(w->folder, "/tmp/sv-scene-XXXXXX");
    if (!mkdtemp(w->folder))
        return -1;
    snprintf(w->scene, sizeof w->scene, "%s/s.json", w->folder);
    snprintf(store, sizeof store, "%s/store", w->folder);
    sv_geo_init();
    sv_errors_init(&w->errors);
    *state = w;
    return sv_store_open(store, (uint64_t)1 << 30, &w->store, NULL) == SV_OK ? 0 : -1;
}

static int tear_down(void **state)
{
    struct work *w = *state;
    char command[128];
    sv_scene_destroy(w->last);
    sv_store_close(w->store);
    sv_errors_finish(&w->errors);
    snprintf(command, sizeof command, "rm -rf %s", w->folder);
    int failed = system(command);
    free(w);
    return failed;
}

int main(void)
{
#define T(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        T(test_points),        T(test_min_height),      T(test_relief_told), T(test_names),
        T(test_objects),       T(test_objects_refused), T(test_scatter),     T(test_empty),
        T(test_sealed),        T(test_version),         T(test_errors),      T(test_model_key),
        T(test_species_store), T(test_grown_key),       T(test_olinda),      T(test_scbi)};
#undef T
    return cmocka_run_group_tests(tests, NULL, NULL);
}
