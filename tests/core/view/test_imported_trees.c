/* test_imported_trees.c - models as authors hand them over, through the scene loader into pictures: leaves
 * without alpha, one giant texture for the whole tree, several leaf materials, no leaves at all; and what is
 * refused, with its reason. Models are written here. Every form's share of the picture is held to the ray
 * cast's. */
#include <ftw.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/scene/id.h"
#include "tests/core/tree/kept_bakes.h"
#include "tests/core/view/scene_kit.h"

enum { LEAVES = 400, NOTES_BYTES = 4096 };

static char folder[] = "/tmp/silvista-import-XXXXXX";

static int remove_one(const char *path, const struct stat *s, int type, struct FTW *f)
{
    (void)s, (void)type, (void)f;
    return remove(path);
}

static int make_folder(void **state)
{
    (void)state;
    sv_geo_init();
    sv_image_init();
    return mkdtemp(folder) ? 0 : -1;
}

static int remove_folder(void **state)
{
    (void)state;
    return nftw(folder, remove_one, 8, FTW_DEPTH | FTW_PHYS);
}

static FILE *create(const char *name)
{
    char path[512];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    return f;
}

/* ---- models ---- */

/* A picture: bark over u < bark_share, over the rest a leaf, which fills its box as a disc, as opaque as
 * `channels` says. */
static void write_texture(const char *name, int width, int height, int channels, double bark_share,
                          const uint8_t leaf_rgb[3])
{
    struct sv_image image;
    struct sv_error error;
    void *bytes;
    size_t size;
    static const char *const names[] = {"R", "G", "B", "A"};
    assert_int_equal(sv_image_alloc(width, height, channels, SV_PIXEL_U8, &image, &error), SV_OK);
    for (int j = 0; j < height; j++)
        for (int i = 0; i < width; i++) {
            uint8_t *p = (uint8_t *)image.data + (size_t)channels * ((size_t)j * (size_t)width + (size_t)i);
            double u = (i + 0.5) / width, y = 2 * (j + 0.5) / height - 1;
            double x = 2 * (u - bark_share) / (1 - bark_share) - 1;
            bool bark = u < bark_share;
            static const uint8_t brown[3] = {110, 80, 60};
            memcpy(p, bark ? brown : leaf_rgb, 3);
            if (channels == 4)
                p[3] = bark || x * x + y * y < 0.8 ? 255 : 0;
        }
    const struct sv_encode_layer layer = {&image, names};
    const struct sv_encode_options options = {.format = SV_FORMAT_PNG, .quality = 90};
    assert_int_equal(sv_image_encode(&layer, 1, &options, &bytes, &size, &error), SV_OK);
    FILE *f = create(name);
    assert_int_equal(fwrite(bytes, 1, size, f), size);
    fclose(f);
    free(bytes);
    sv_image_free(&image);
}

/* A tapered tube of four sides and ROWS rows, model's axes (Y up), leaning by `lean` towards `turn`. at: the
 * next vertex's number. */
static void write_tube(FILE *f, double low, double thick, double lean, double turn, double u_wide, int *at)
{
    enum { ROWS = 8, SIDES = 4 };
    for (int row = 0; row <= ROWS; row++)
        for (int k = 0; k < SIDES; k++) {
            double up = (double)row / ROWS, a = k * 2 * SV_PI / SIDES, r = thick * (1 - 0.4 * up);
            fprintf(f, "v %.4f %.4f %.4f\nvt %.4f %.4f\n", cos(a) * r + up * lean * cos(turn),
                    low + (8 - low) * up, sin(a) * r + up * lean * sin(turn), u_wide * (k % 2), up);
        }
    for (int row = 0; row < ROWS; row++)
        for (int k = 0; k < SIDES; k++) {
            int p[4] = {row * SIDES + k, row * SIDES + (k + 1) % SIDES, 0, 0};
            p[2] = p[1] + SIDES;
            p[3] = p[0] + SIDES;
            fprintf(f, "f");
            for (int c = 0; c < 4; c++)
                fprintf(f, " %d/%d", *at + p[c], *at + p[c]);
            fprintf(f, "\n");
        }
    *at += (ROWS + 1) * SIDES;
}

/* A stem and LEAVES square cards in a ball about its upper end; leaf k is of material 1 + k % (count - 1),
 * its texture coordinates u from `left` on, the stem's up to there. One material: the stem and four boughs,
 * no leaf. */
static void write_model(const char *name, const char *mtl, const char *const *materials, int material_count,
                        double left)
{
    struct sv_rng rng = sv_rng_seeded(41, 1);
    FILE *f = create(name);
    int at = 1;
    fprintf(f, "mtllib %s\nusemtl %s\n", mtl, materials[0]);
    write_tube(f, 0, 0.3, 0, 0, 0.99 * left, &at);
    for (int part = 0; part < 4 && material_count == 1; part++)
        write_tube(f, 3, 0.15, 2.5, part * SV_PI / 2, left, &at);
    for (int k = 0; k < LEAVES && material_count > 1; k++) {
        double z = sv_rng_range(&rng, -1, 1), a = sv_rng_range(&rng, 0, 2 * SV_PI),
               r = cbrt(sv_rng_unit(&rng)) * 2.4;
        double middle[3] = {r * sqrt(1 - z * z) * cos(a), 7.4 + r * z, r * sqrt(1 - z * z) * sin(a)};
        struct sv_vec3 n = sv_normalize(sv_vec3(sv_rng_range(&rng, -1, 1), sv_rng_range(&rng, -1, 1), 0.3));
        struct sv_vec3 u = sv_normalize(sv_cross(n, sv_vec3(0.3, 0.2, 1))), v = sv_cross(n, u);
        fprintf(f, "usemtl %s\n", materials[1 + k % (material_count - 1)]);
        for (int c = 0; c < 4; c++) {
            double s = c == 1 || c == 2 ? 0.25 : -0.25, t = c >= 2 ? 0.25 : -0.25;
            fprintf(f, "v %.4f %.4f %.4f\nvt %.4f %.4f\n", middle[0] + s * u.x + t * v.x,
                    middle[1] + s * u.y + t * v.y, middle[2] + s * u.z + t * v.z, s > 0 ? 1.0 : left,
                    t > 0 ? 1.0 : 0.0);
        }
        fprintf(f, "f %d/%d %d/%d %d/%d %d/%d\n", at, at, at + 1, at + 1, at + 2, at + 2, at + 3, at + 3);
        at += 4;
    }
    fclose(f);
}

static void write_mtl(const char *name, const char *const *materials, const char *const *textures, int count)
{
    FILE *f = create(name);
    for (int k = 0; k < count; k++) {
        fprintf(f, "newmtl %s\nKd %s\n", materials[k], textures[k] ? "1 1 1" : "0.4 0.3 0.2");
        if (textures[k])
            fprintf(f, "map_Kd %s\n", textures[k]);
    }
    fclose(f);
}

/* ---- scenes ---- */

static void note(void *context, int level, const char *message)
{
    char *notes = context;
    (void)level;
    size_t used = strlen(notes);
    snprintf(notes + used, NOTES_BYTES - used, "%s\n", message);
}

/* One tree of the model, 10 m tall, in the middle of a field. notes: what the loader says, its errors too. */
static enum sv_status load(const char *model, struct sv_scene **scene, char notes[NOTES_BYTES])
{
    char text[1024], base[512];
    struct sv_scene_spec spec;
    struct sv_errors errors;
    FILE *f = create("trees.csv");
    fprintf(f, "x,y,height_m,rotation_deg\n100,100,10,20\n");
    fclose(f);
    snprintf(base, sizeof base, "%s/scene.json", folder);
    int bytes =
        snprintf(text, sizeof text,
                 "{\"name\": \"one\", \"terrain\": {\"procedural\": {\"size_m\": 200, \"samples\": 33, "
                 "\"relief_m\": 1, \"seed\": 1}}, \"species\": [{\"name\": \"it\", \"model\": \"%s\"}], "
                 "\"forest\": [{\"points\": \"trees.csv\", \"x\": \"x\", \"y\": \"y\", \"height_m\": "
                 "\"height_m\", \"rotation_deg\": \"rotation_deg\", \"default_species\": \"it\"}], "
                 "\"sun\": {\"azimuth_deg\": 135, \"elevation_deg\": 40}}",
                 model);
    sv_errors_init(&errors);
    notes[0] = 0;
    enum sv_status status = sv_scene_spec_parse(text, (size_t)bytes, base, &spec, &errors);
    assert_int_equal(status, SV_OK);
    status =
        sv_scene_load(&spec, &(struct sv_scene_options){.log = note, .log_context = notes}, scene, &errors);
    if (status)
        sv_scene_spec_finish(&spec);
    for (size_t k = 0; k < errors.count; k++) {
        note(notes, 2, errors.items[k].field);
        note(notes, 2, errors.items[k].message);
    }
    sv_errors_finish(&errors);
    return status;
}

/* Pixels of trees by the ids' layer. */
static int tree_pixels(struct sv_renderer *renderer, const struct sv_scene *scene, enum sv_trees trees,
                       int side, const char *keep)
{
    struct sv_view_request r = kit_request();
    struct sv_resolved_view view;
    struct sv_picture picture;
    struct sv_error error = {0};
    r.width = r.height = side;
    r.eye.x = 100;
    r.eye.y = 88;
    r.eye.agl = 5;
    r.trees = trees;
    r.shadows = false;
    r.layers = 1u << SV_LAYER_COLOR | 1u << SV_LAYER_ID;
    enum sv_status status = sv_view_resolve(scene, &r, &view, NULL, &error);
    if (!status)
        status = sv_renderer_draw(renderer, &r, &view, &picture, NULL, NULL, &error);
    if (status)
        fail_msg("%s: %s: %s", keep, error.field, error.message);
    int count = 0;
    const uint32_t *id = picture.layer[SV_LAYER_ID].data;
    for (int p = 0; p < side * side; p++)
        count += id[p] >= SV_ID_TREE_FIRST;
    char name[64];
    snprintf(name, sizeof name, "imported-%s-%s", keep, sv_trees_name(trees));
    kit_keep(&picture.layer[SV_LAYER_COLOR], name);
    sv_picture_finish(&picture);
    return count;
}

struct want {
    int leaves, leaf_materials;
    bool drawn;       /* or loaded alone */
    bool planes;      /* as density textures, too, in a plain run */
    const char *note; /* in the loader's notes; NULL: there are none */
};

/* Exact forms draw the same triangles at the same pixels but for rounding at their rims; `auto` draws leaves
 * at that size, beyond what it fades in. Sprites have
 * their ids where a pixel is covered by enough, so that the sum of coverage is kept: of small thin crowns to
 * a tenth (test_impostor's bound). Planes keep theirs each by itself, and leaves that are laid on two dozen
 * of them hide one another less than in the crown: a sixth more. */
static const struct {
    enum sv_trees trees;
    bool full; /* with SV_TEST_FULL alone: bakes of seconds */
    int side;
    double off;
} FORMS[] = {{SV_TREES_POLYGON, false, 192, 0.01},     {SV_TREES_AUTO, false, 448, 0.01},
             {SV_TREES_COARSE, false, 192, 0.1},       {SV_TREES_DENSITY, true, 192, 1.0 / 6},
             {SV_TREES_BILLBOARD, true, 192, 1.0 / 6}, {SV_TREES_INDIRECT, true, 192, 1.0 / 6}};

static void check_pictures(const struct sv_scene *scene, const char *name, bool planes)
{
    struct sv_renderer *renderer;
    struct sv_error error = {0};
    enum sv_status status = sv_renderer_create(
        scene, &(struct sv_renderer_options){.store = kept_bakes(), .truth = true}, &renderer, &error);
    if (status)
        fail_msg("%s: %s", error.field, error.message);
    for (size_t k = 0; k < sizeof FORMS / sizeof *FORMS; k++) {
        if (FORMS[k].full && !getenv("SV_TEST_FULL") && !(planes && FORMS[k].trees == SV_TREES_DENSITY))
            continue;
        int truth = tree_pixels(renderer, scene, SV_TREES_RAYCAST, FORMS[k].side, name);
        int shown = tree_pixels(renderer, scene, FORMS[k].trees, FORMS[k].side, name);
        printf("  %-10s %d of %d pixels\n", sv_trees_name(FORMS[k].trees), shown, truth);
        assert_true(truth > 400);
        assert_true(abs(shown - truth) <= FORMS[k].off * truth);
    }
    sv_renderer_destroy(renderer);
}

static void check(const char *name, const struct want *want)
{
    char model[64], notes[NOTES_BYTES];
    struct sv_scene *scene;
    snprintf(model, sizeof model, "%s.obj", name);
    enum sv_status status = load(model, &scene, notes);
    if (status)
        fail_msg("%s: %s", name, notes);
    const struct sv_tree_mesh *mesh = &scene->species[0].mesh;
    int leaf_materials = 0;
    for (int m = 0; m < mesh->material_count; m++)
        leaf_materials += mesh->materials[m].is_leaf;
    printf("%s: %u leaves, %d materials, %d of leaves\n", name, mesh->leaf_count, mesh->material_count,
           leaf_materials);
    assert_int_equal(mesh->leaf_count, want->leaves);
    assert_int_equal(leaf_materials, want->leaf_materials);
    if (want->note && !strstr(notes, want->note))
        fail_msg("%s: no note of '%s' in:\n%s", name, want->note, notes);
    if (want->drawn)
        check_pictures(scene, name, want->planes);
    sv_scene_destroy(scene);
}

static const uint8_t GREEN[3] = {80, 130, 60}, YELLOW[3] = {180, 170, 60}, RED[3] = {170, 60, 40};

/* Leaves are cards that show all of themselves: their name says what they are. */
static void leaves_without_alpha(void **state)
{
    (void)state;
    static const char *const names[] = {"bark", "leaf"}, *const textures[] = {NULL, "opaque.png"};
    write_texture("opaque.png", 64, 64, 3, 0, GREEN);
    write_mtl("opaque.mtl", names, textures, 2);
    write_model("opaque.obj", "opaque.mtl", names, 2, 0);
    check("opaque", &(struct want){LEAVES, 1, true, false, NULL});
}

/* One material and one picture of 8192 px, bark and leaf, for the whole tree: averaged down to what is kept
 * of a texture (mesh.h), and split into leaves and wood. */
static void one_giant_texture(void **state)
{
    (void)state;
    static const char *const names[] = {"tree", "tree"}, *const textures[] = {"giant.png"};
    write_texture("giant.png", 8192, 512, 4, 0.5, GREEN);
    write_mtl("giant.mtl", names, textures, 1);
    write_model("giant.obj", "giant.mtl", names, 2, 0.5);
    check("giant", &(struct want){LEAVES, 1, true, false, NULL});
}

/* Larger than can be read (encode.h): the plain colour is used, and the loader says so. */
static void a_texture_beyond_the_limit(void **state)
{
    (void)state;
    static const char *const names[] = {"bark", "leaf"}, *const textures[] = {NULL, "beyond.png"};
    write_texture("beyond.png", SV_DECODE_SIDE_MAX + 1, 2, 4, 0, GREEN);
    write_mtl("beyond.mtl", names, textures, 2);
    write_model("beyond.obj", "beyond.mtl", names, 2, 0);
    check("beyond", &(struct want){LEAVES, 1, false, false, "beyond.png"});
}

static void several_leaf_materials(void **state)
{
    (void)state;
    static const char *const names[] = {"bark", "leaf_green", "leaf_yellow", "leaf_red"},
                             *const textures[] = {NULL, "green.png", "yellow.png", "red.png"};
    write_texture("green.png", 64, 64, 4, 0, GREEN);
    write_texture("yellow.png", 128, 32, 4, 0, YELLOW);
    write_texture("red.png", 64, 64, 3, 0, RED); /* this one without alpha */
    write_mtl("several.mtl", names, textures, 4);
    write_model("several.obj", "several.mtl", names, 4, 0);
    check("several", &(struct want){LEAVES, 3, true, true, NULL});
}

static void no_leaves_at_all(void **state)
{
    (void)state;
    static const char *const names[] = {"bark"}, *const textures[] = {NULL};
    write_mtl("dead.mtl", names, textures, 1);
    write_model("dead.obj", "dead.mtl", names, 1, 1);
    check("dead", &(struct want){0, 0, true, true, "leaves"});
}

/* What is no tree is refused, and the message names the species' key and the file. */
static void what_is_no_tree_is_refused(void **state)
{
    (void)state;
    static const struct {
        const char *name, *text, *reason;
    } cases[] = {{"flat.obj", "v 0 0 0\nv 1 0 0\nv 1 0 1\nf 1 2 3\n", "high and"},
                 {"empty.obj", "v 0 0 0\n", "cannot be read"},
                 {"broken.glb", "glTF what is this", "broken.glb"},
                 {"missing.obj", NULL, "missing.obj"}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        char notes[NOTES_BYTES];
        struct sv_scene *scene;
        if (cases[k].text) {
            FILE *f = create(cases[k].name);
            fputs(cases[k].text, f);
            fclose(f);
        }
        assert_int_not_equal(load(cases[k].name, &scene, notes), SV_OK);
        printf("%s: %s", cases[k].name, notes);
        assert_non_null(strstr(notes, "species[0]"));
        assert_non_null(strstr(notes, cases[k].reason));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(leaves_without_alpha),       cmocka_unit_test(one_giant_texture),
        cmocka_unit_test(a_texture_beyond_the_limit), cmocka_unit_test(several_leaf_materials),
        cmocka_unit_test(no_leaves_at_all),           cmocka_unit_test(what_is_no_tree_is_refused)};
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
