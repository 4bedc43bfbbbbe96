/* test_import.c - model files into tree space: every real model with the counts its source states, and small
 * files written here, one for each trap: transforms, units, NaN, missing normals, textures and faces,
 * atlases, mirrored nodes. */
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

#include "core/image/encode.h"
#include "core/tree/import.h"

static char folder[64];

static const char *data_path(const char *name)
{
    static char path[1024];
    const char *root = getenv("SV_DATA");
    snprintf(path, sizeof path, "%s/%s", root && *root ? root : "../shared/data", name);
    return path;
}

static const char *temp_path(const char *name)
{
    static char path[2][256];
    static int turn;
    turn = !turn;
    snprintf(path[turn], sizeof path[turn], "%s/%s", folder, name);
    return path[turn];
}

static const char *write_file(const char *name, const void *bytes, size_t size)
{
    const char *path = temp_path(name);
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(bytes, 1, size, f), size);
    assert_int_equal(fclose(f), 0);
    return path;
}

static const char *write_text(const char *name, const char *text)
{
    return write_file(name, text, strlen(text));
}

struct imported {
    struct sv_tree_mesh mesh;
    struct sv_errors notes;
};

static void import_file(const char *path, struct imported *in)
{
    struct sv_error e = {0};
    sv_errors_init(&in->notes);
    if (sv_tree_import(path, &in->mesh, &in->notes, &e) != SV_OK)
        fail_msg("%s: %s: %s", path, e.field, e.message);
}

static void drop(struct imported *in)
{
    sv_tree_mesh_finish(&in->mesh);
    sv_errors_finish(&in->notes);
}

static bool noted(const struct imported *in, const char *word)
{
    for (size_t i = 0; i < in->notes.count; i++)
        if (strstr(in->notes.items[i].message, word))
            return true;
    return false;
}

/* Lowest vertex at 0, highest at 1, each normal a unit, leaves and only they in leaf materials. */
static void check_frame(const struct sv_tree_mesh *m)
{
    float lo = INFINITY, hi = -INFINITY;
    for (uint32_t i = 0; i < m->vertex_count; i++) {
        const struct sv_tree_vertex *v = &m->vertices[i];
        lo = fminf(lo, v->position[2]), hi = fmaxf(hi, v->position[2]);
        double n = sqrt((double)v->normal[0] * v->normal[0] + (double)v->normal[1] * v->normal[1] +
                        (double)v->normal[2] * v->normal[2]);
        assert_true(fabs(n - 32767) < 2);
    }
    assert_true(lo == 0);
    assert_true(fabsf(hi - 1) < 1e-6f);
    for (uint32_t i = 0; i < m->index_count; i++)
        assert_true(m->indices[i] < m->vertex_count);
}

/* Counts: the data's own list (its "v/f as loaded"); dropped: triangles without area in the file, counted by
 * hand. Vertices are as many as there when the file has normals, else within the factor that creases cost. */
static const struct {
    const char *path;
    uint32_t vertices, triangles, dropped, leaves;
    float height, grows;
    int materials, leaf_materials, masked;
    const char *note;
} models[] = {
    {"models/eztree/ez_oak_medium.glb", 23964, 13806, 0, 5320, 64.7f, 1, 2, 1, 1, NULL},
    {"models/eztree/ez_ash_large.glb", 27711, 21512, 0, 4840, 96.0f, 1, 2, 1, 1, NULL},
    {"models/eztree/ez_aspen_large.glb", 17709, 13668, 0, 3234, 102.3f, 1, 2, 1, 1, NULL},
    {"models/eztree/ez_bush_1.glb", 16110, 13872, 0, 2496, 30.1f, 1, 2, 1, 1, NULL},
    {"models/eztree/ez_willowbark_custom.glb", 28102, 20000, 0, 5440, 70.6f, 1, 2, 1, 1, NULL},
    {"models/eztree/ez_aspen_small.glb", 3836, 3616, 0, 560, 39.0f, 1, 2, 1, 1, NULL},
    {"models/eztree/ez_aspen_small.obj", 3836, 3616, 0, 560, 39.0f, 1, 2, 1, 1, NULL},
    {"models/quaternius/Birch_1.obj", 1668, 2314, 6, 552, 9.48f, 1, 2, 1, 1, "no area"},
    {"models/quaternius/Birch_1.fbx", 1668, 2314, 6, 552, 948.f, 1, 2, 1, 0, "no area"},
    {"models/quaternius/Pine_1.obj", 614, 664, 0, 258, 7.58f, 1, 2, 1, 1, NULL},
    {"models/quaternius/Tree_3.obj", 1491, 2088, 0, 348, 5.72f, 1, 2, 1, 1, NULL},
    {"models/quaternius/DeadTree_4.obj", 723, 1000, 0, 0, 4.98f, 1, 1, 0, 0, "no leaves"},
    {"models/gazebo/pine_tree/pine_tree.dae", 459, 676, 0, 270, 5.08f, 1, 2, 1, 1, NULL},
    {"models/gazebo/pine_tree/pine_tree.original_untextured.dae", 459, 676, 0, 0, 5.08f, 1, 2, 0, 0,
     "no leaves"},
    {"models/sweethome3d/christmas_tree/christmas_tree.obj", 20188, 15552, 0, 3860, 203.f, 1, 6, 1, 1, NULL},
    {"models/sweethome3d/bonsai-tree/bonsai-tree.obj", 13563, 8128, 0, 2800, 42.9f, 1.1f, 4, 1, 1, NULL},
    {"models/sweethome3d/sabalPalmeto/sabalPalmeto.obj", 5756, 6906, 0, 2729, 1150.f, 2, 3, 2, 0, NULL},
    {"objects/german_house/germanvillagehouse1.ac", 26, 14, 0, 0, 7.6f, 1.1f, 1, 0, 0, "no leaves"},
    {"objects/church/big-church.ac", 53, 25, 0, 0, 30.8f, 1.2f, 1, 0, 0, "no leaves"},
    {"objects/rock1/rock1.obj", 274, 332, 0, 0, 50.f, 1.4f, 1, 0, 0, "no leaves"},
    {"objects/spot/spot_textured.obj", 3225, 5856, 0, 0, 1.69f, 1.1f, 1, 0, 0, "no leaves"},
    {"objects/spot/spot_triangulated.obj", 3225, 5856, 0, 0, 1.69f, 1.1f, 1, 0, 0, "no leaves"},
    {"objects/bunny/bunny.ply", 8146, 16301, 0, 0, 0.153f, 1.2f, 1, 0, 0, "no leaves"},
};

static void test_models(void **state)
{
    (void)state;
    if (access(data_path("models"), R_OK) != 0) {
        print_message("skipped: no real models (SV_DATA)\n");
        skip();
    }
    for (size_t i = 0; i < sizeof models / sizeof *models; i++) {
        struct imported in;
        import_file(data_path(models[i].path), &in);
        const struct sv_tree_mesh *m = &in.mesh;
        int leaf = 0, masked = 0;
        for (int k = 0; k < m->material_count; k++) {
            leaf += m->materials[k].is_leaf;
            masked += m->materials[k].masked;
            assert_true(!m->materials[k].is_leaf || m->materials[k].two_sided);
        }
        check_frame(m);
        if (m->index_count / 3 != models[i].triangles - models[i].dropped ||
            m->leaf_count != models[i].leaves || m->vertex_count < 0.99 * models[i].vertices ||
            m->vertex_count > (double)(models[i].grows * models[i].vertices) ||
            m->material_count != models[i].materials || leaf != models[i].leaf_materials ||
            masked != models[i].masked)
            fail_msg("%s: %u vertices, %u triangles, %u leaves, %d materials, %d leafy, %d masked",
                     models[i].path, m->vertex_count, m->index_count / 3, m->leaf_count, m->material_count,
                     leaf, masked);
        assert_true(fabsf(m->model_height / models[i].height - 1) < 0.01f);
        assert_true(models[i].note ? noted(&in, models[i].note) && in.notes.count == 1 : in.notes.count == 0);
        drop(&in);
    }
}

/* The same tree as GLB (linear factor, embedded textures) and OBJ (sRGB Kd, files, map_d) is the same tree.
 */
static void test_same_tree(void **state)
{
    (void)state;
    if (access(data_path("models"), R_OK) != 0)
        skip();
    struct imported a, b;
    import_file(data_path("models/eztree/ez_aspen_small.glb"), &a);
    import_file(data_path("models/eztree/ez_aspen_small.obj"), &b);
    for (int k = 0; k < 2; k++) {
        const struct sv_tree_material *p = &a.mesh.materials[k], *q = &b.mesh.materials[k];
        assert_string_equal(p->name, q->name);
        assert_int_equal(p->index_count, q->index_count);
        assert_true(p->masked == q->masked && p->is_leaf == q->is_leaf && p->alpha_cutoff == q->alpha_cutoff);
        for (int c = 0; c < 4; c++) /* the MTL has four digits */
            assert_true(fabsf(p->base_color[c] - q->base_color[c]) < 2e-3f);
    }
    for (uint32_t i = 0; i < a.mesh.index_count; i++) {
        const struct sv_tree_vertex *p = &a.mesh.vertices[a.mesh.indices[i]],
                                    *q = &b.mesh.vertices[b.mesh.indices[i]];
        for (int c = 0; c < 3; c++)
            assert_true(fabsf(p->position[c] - q->position[c]) < 1e-4f &&
                        abs(p->normal[c] - q->normal[c]) < 200);
        for (int c = 0; c < 2; c++)
            assert_true(fabsf(p->uv[c] - q->uv[c]) < 1e-3f);
    }
    drop(&a);
    drop(&b);
}

/* A trunk (an open box tube from y = 0 to 6) and `cards` leaf quads around y = 8, all moved and scaled. */
struct maker {
    char text[65536];
    size_t n;
    int vertex;
};

static void say(struct maker *m, const char *format, ...) SV_PRINTF(2, 3);
static void say(struct maker *m, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    m->n += (size_t)vsnprintf(m->text + m->n, sizeof m->text - m->n, format, args);
    va_end(args);
    assert_true(m->n < sizeof m->text);
}

static const double tube[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};

static void make_tree(struct maker *m, const char *head, const char *wood, const char *leaf, int cards,
                      double scale, double dx, double dy, double dz)
{
    *m = (struct maker){.vertex = 1};
    say(m, "%susemtl %s\n", head, wood);
    for (int level = 0; level < 2; level++)
        for (int k = 0; k < 4; k++)
            say(m, "v %.9g %.9g %.9g\n", dx + scale * 0.3 * tube[k][0], dy + scale * 6 * level,
                dz + scale * 0.3 * tube[k][1]);
    for (int k = 0; k < 4; k++) /* seen from above (y) the tube runs clockwise in x, z: outward faces */
        say(m, "vt %g 0\nvt %g 1\n", k * 0.1, k * 0.1);
    for (int k = 0; k < 4; k++) {
        int l = (k + 1) % 4;
        say(m, "f %d/1 %d/2 %d/2 %d/1\n", 1 + k, 5 + k, 5 + l, 1 + l);
    }
    m->vertex = 9;
    say(m, "usemtl %s\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n", leaf);
    for (int k = 0; k < cards; k++) {
        double a = 2.4 * k, x = 2 * cos(a), z = 2 * sin(a), y = 6 + 4.0 * k / (cards > 1 ? cards - 1 : 1);
        say(m, "v %.9g %.9g %.9g\nv %.9g %.9g %.9g\nv %.9g %.9g %.9g\nv %.9g %.9g %.9g\n", dx + scale * x,
            dy + scale * y, dz + scale * z, dx + scale * (x + 1), dy + scale * y, dz + scale * z,
            dx + scale * (x + 1), dy + scale * y, dz + scale * (z + 1), dx + scale * x, dy + scale * y,
            dz + scale * (z + 1));
        say(m, "f %d/9 %d/10 %d/11 %d/12\n", m->vertex, m->vertex + 1, m->vertex + 2, m->vertex + 3);
        m->vertex += 4;
    }
}

/* A PNG of side 32: left half opaque brown, right half green with alpha in a disc, as an atlas has it. */
static void write_atlas(const char *name, bool alpha)
{
    struct sv_image image;
    struct sv_error e;
    assert_int_equal(sv_image_alloc(32, 32, 4, SV_PIXEL_U8, &image, &e), SV_OK);
    for (int y = 0; y < 32; y++)
        for (int x = 0; x < 32; x++) {
            unsigned char *p = (unsigned char *)image.data + 4 * (32 * y + x);
            bool leaf = x >= 16;
            int r2 = (x - 24) * (x - 24) + (y - 16) * (y - 16);
            p[0] = leaf ? 30 : 110, p[1] = leaf ? 140 : 80, p[2] = leaf ? 20 : 50;
            p[3] = !alpha || !leaf || r2 < 30 ? 255 : 0;
            if (p[3] == 0)
                p[0] = p[2] = 255, p[1] = 0; /* what must never be seen */
        }
    struct sv_encode_layer layer = {&image, NULL};
    struct sv_encode_options options = {SV_FORMAT_PNG, 85, NULL};
    void *bytes;
    size_t size;
    assert_int_equal(sv_image_encode(&layer, 1, &options, &bytes, &size, &e), SV_OK);
    write_file(name, bytes, size);
    free(bytes);
    sv_image_free(&image);
}

/* Position, scale and units of the file do not matter: huge, tiny, off the origin, below it. */
static void test_places(void **state)
{
    (void)state;
    static const struct {
        double scale, x, y, z;
    } rows[] = {{1, 0, 0, 0},          {100, 0, 0, 0},      {1e-4, 0, 0, 0},
                {1, 5000, -300, 7000}, {1e6, 0, -5e6, 1e6}, {1, 0.25, 20, -0.5}};
    static struct maker m;
    struct imported base;
    make_tree(&m, "", "trunk", "leaves", 6, 1, 0, 0, 0);
    import_file(write_text("t.obj", m.text), &base);
    check_frame(&base.mesh);
    assert_int_equal(base.mesh.leaf_count, 6);
    assert_int_equal(base.mesh.index_count / 3, 8 + 12);
    assert_true(fabsf(base.mesh.model_height - 10) < 1e-5f);
    assert_true(fabsf(base.mesh.crown_base - 0.6f) < 1e-5f);
    for (size_t k = 0; k < sizeof rows / sizeof *rows; k++) {
        struct imported in;
        make_tree(&m, "", "trunk", "leaves", 6, rows[k].scale, rows[k].x, rows[k].y, rows[k].z);
        import_file(write_text("t.obj", m.text), &in);
        assert_int_equal(in.mesh.index_count, base.mesh.index_count);
        for (uint32_t i = 0; i < in.mesh.index_count; i++)
            for (int c = 0; c < 3; c++) /* floats in the file's own place: 7 digits of what is farthest out */
                assert_true(fabsf(in.mesh.vertices[in.mesh.indices[i]].position[c] -
                                  base.mesh.vertices[base.mesh.indices[i]].position[c]) < 2e-4f);
        drop(&in);
    }
    drop(&base);
}

/* Z up, Y north: the file's y is up, its -z is north. The trunk stands on the axis though the model does not
 * stand on its origin. */
static void test_axes(void **state)
{
    (void)state;
    static struct maker m;
    make_tree(&m, "", "trunk", "leaves", 1, 1, 40, 3, -20);
    /* the one leaf: x from 2 to 3, y = 6, z from 0 to 1 -> east 2..3, north 0..-1; and a tip at the top */
    say(&m, "v 40 13 -25\nv 41 13 -25\nv 40 13 -26\nf %d %d %d\n", m.vertex, m.vertex + 1, m.vertex + 2);
    struct imported in;
    import_file(write_text("t.obj", m.text), &in);
    float lo[3] = {9, 9, 9}, hi[3] = {-9, -9, -9};
    const struct sv_tree_material *leaf = NULL;
    for (int k = 0; k < in.mesh.material_count; k++)
        leaf = in.mesh.materials[k].is_leaf ? &in.mesh.materials[k] : leaf;
    assert_non_null(leaf);
    for (uint32_t i = 0; i < 6; i++)
        for (int c = 0; c < 3; c++) {
            float p = in.mesh.vertices[in.mesh.indices[leaf->first_index + i]].position[c] * 10;
            lo[c] = fminf(lo[c], p), hi[c] = fmaxf(hi[c], p);
        }
    assert_true(fabsf(lo[0] - 2) < 1e-4f && fabsf(hi[0] - 3) < 1e-4f);
    assert_true(fabsf(lo[1] + 1) < 1e-4f && fabsf(hi[1]) < 1e-4f);
    assert_true(fabsf(lo[2] - 6) < 1e-4f);
    const float *uv =
        in.mesh.vertices[in.mesh.indices[leaf->first_index]].uv; /* vt 0 0: the picture's lower left */
    assert_true(uv[0] == 0 && uv[1] == 1);
    float north = -9;
    for (uint32_t i = 0; i < in.mesh.vertex_count; i++)
        north = fmaxf(north, in.mesh.vertices[i].position[1] * 10);
    assert_true(fabsf(north - 6) < 1e-4f); /* z = -26 is 6 north of the trunk at -20 */
    drop(&in);
}

/* Without a trunk the model's own origin stands, or the middle of the ground plan when the origin is far off.
 */
static void test_no_trunk(void **state)
{
    (void)state;
    static struct maker m;
    struct imported in;
    for (int far = 0; far < 2; far++) {
        make_tree(&m, "", "leaves", "leaves", 6, 1, far ? 1000 : 0.5, 0, far ? 700 : 0.25);
        import_file(write_text("t.obj", m.text), &in);
        float lo[2] = {9, 9}, hi[2] = {-9, -9};
        for (uint32_t i = 0; i < in.mesh.vertex_count; i++)
            for (int c = 0; c < 2; c++) {
                lo[c] = fminf(lo[c], in.mesh.vertices[i].position[c]);
                hi[c] = fmaxf(hi[c], in.mesh.vertices[i].position[c]);
            }
        assert_true(noted(&in, "no trunk") == far);
        if (far)
            assert_true(fabsf(lo[0] + hi[0]) < 1e-4f && fabsf(lo[1] + hi[1]) < 1e-4f);
        else /* the tube's four sides are at 0.5 +- 0.3 east, 0.25 +- 0.3 south of the origin */
            assert_true(fabsf(in.mesh.vertices[0].position[0] - 0.02f) < 1e-5f &&
                        fabsf(in.mesh.vertices[0].position[1] - 0.005f) < 1e-5f);
        drop(&in);
    }
}

/* Wood without normals faces outward whichever way it was wound, and is smooth over 60 degrees only: the
 * square tube keeps its edges. */
static void test_normals(void **state)
{
    (void)state;
    static struct maker m;
    for (int flip = 0; flip < 2; flip++) {
        struct imported in;
        make_tree(&m, "", "trunk", "leaves", 2, 1, 0, 0, 0);
        if (flip) /* close the tube, so that its inside is known, and wind all of it inward */
            say(&m, "usemtl trunk\nf 1/1 4/1 3/1 2/1\nf 5/1 6/1 7/1 8/1\n");
        else
            say(&m, "usemtl trunk\nf 1/1 2/1 3/1 4/1\nf 5/1 8/1 7/1 6/1\n");
        if (flip) {
            char *p = strstr(m.text, "f 1/1 5/2");
            for (int k = 0; k < 4; k++) {
                int l = (k + 1) % 4;
                char line[64];
                int n = snprintf(line, sizeof line, "f %d/1 %d/1 %d/2 %d/2\n", 1 + k, 1 + l, 5 + l, 5 + k);
                memcpy(p, line, (size_t)n);
                p += n;
            }
        }
        import_file(write_text("t.obj", m.text), &in);
        const struct sv_tree_material *wood = &in.mesh.materials[0];
        assert_string_equal(wood->name, "trunk");
        for (uint32_t i = 0; i < wood->index_count; i += 3) {
            const struct sv_tree_vertex *v[3];
            for (int k = 0; k < 3; k++)
                v[k] = &in.mesh.vertices[in.mesh.indices[wood->first_index + i + (uint32_t)k]];
            double out = 0, axis = 0;
            for (int k = 0; k < 3; k++) {
                double n[3] = {v[k]->normal[0] / 32767.0, v[k]->normal[1] / 32767.0,
                               v[k]->normal[2] / 32767.0};
                double across = n[0] * (double)v[k]->position[0] + n[1] * (double)v[k]->position[1];
                out += fabs(n[2]) > 0.5 ? n[2] * ((double)v[k]->position[2] - 0.3) : across;
                axis = fmax(axis, fmax(fabs(n[0]), fmax(fabs(n[1]), fabs(n[2]))));
                assert_true(fmax(fabs(n[0]), fmax(fabs(n[1]), fabs(n[2]))) >
                            0.999); /* along an axis: not smoothed */
            }
            assert_true(out > 0);
            double a[3], b[3];
            for (int c = 0; c < 3; c++)
                a[c] = (double)(v[1]->position[c] - v[0]->position[c]),
                b[c] = (double)(v[2]->position[c] - v[0]->position[c]);
            double cross[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                               a[0] * b[1] - a[1] * b[0]};
            assert_true(cross[0] * v[0]->normal[0] + cross[1] * v[0]->normal[1] + cross[2] * v[0]->normal[2] >
                        0);
        }
        assert_false(wood->two_sided);
        drop(&in);
    }
}

/* NaN vertices and triangles without area go, are counted, and do not move the rest. */
static void test_broken(void **state)
{
    (void)state;
    static struct maker m;
    struct imported in;
    make_tree(&m, "", "trunk", "leaves", 3, 1, 0, 0, 0);
    int v = m.vertex;
    say(&m,
        "usemtl trunk\nv nan 0 0\nv 1e39 5 5\nv 3 -40 3\nf %d/1 1/1 2/1\nf %d/1 2/1 3/1\nf %d/1 %d/1 1/1\nf "
        "1/1 2/1 2/1\n",
        v, v + 1, v + 2, v + 2);
    import_file(write_text("t.obj", m.text), &in);
    check_frame(&in.mesh);
    assert_int_equal(in.mesh.index_count / 3, 8 + 6);
    assert_true(fabsf(in.mesh.model_height - 10) <
                1e-5f); /* the vertex at -40 is used by no triangle that stays */
    assert_true(noted(&in, "2 triangles have a vertex that is not finite"));
    assert_true(noted(&in, "2 triangles have no area"));
    drop(&in);
}

/* Leaves are found by alpha in the texture's used part, an atlas is split, names help where there is no
 * alpha. */
static void test_leaves(void **state)
{
    (void)state;
    static struct maker m;
    struct imported in;
    write_atlas("atlas.png", true);
    write_atlas("plain.png", false);
    write_text(
        "t.mtl",
        "newmtl stuff\nmap_Kd atlas.png\nnewmtl other\nmap_Kd plain.png\nnewmtl oak_leaf\nmap_Kd plain.png\n"
        "newmtl gone\nKd 0.5 0.25 1\nmap_Kd C:\\Users\\me\\missing.png\nnewmtl case\nmap_Kd "
        "D:\\x\\ATLAS.PNG\n"
        "newmtl cut\nKd 0.5 0.5 0.5\nmap_d mask.png\n");
    /* one material for all: the trunk shows u in 0..0.3, which is opaque */
    make_tree(&m, "mtllib t.mtl\n", "stuff", "stuff", 5, 1, 0, 0, 0);
    for (char *p = m.text; (p = strstr(p, "f 1/1 5/2")); p++) /* 16 more triangles make the trunk no card */
        break;
    for (int k = 0; k < 4; k++)
        say(&m, "v %g 0 %g\nv %g 6 %g\nf %d/1 %d/2 %d/2 %d/1\n", 0.3 * tube[k][0] * 0.9,
            0.3 * tube[k][1] * 0.9, 0.3 * tube[k][0] * 0.9, 0.3 * tube[k][1] * 0.9, 1 + k, 5 + k,
            m.vertex + 2 * k + 1, m.vertex + 2 * k);
    import_file(write_text("t.obj", m.text), &in);
    assert_int_equal(in.mesh.material_count, 2);
    assert_int_equal(in.mesh.leaf_count, 5);
    for (int k = 0; k < 2; k++) {
        const struct sv_tree_material *q = &in.mesh.materials[k];
        assert_true(q->is_leaf == q->masked);
        assert_int_equal(q->index_count / 3, q->is_leaf ? 10 : 16);
        for (int c = 0; c < 4; c++) /* no Kd: the reader's grey beside a texture is no tint */
            assert_true(q->base_color[c] == 1);
    }
    assert_int_equal(in.notes.count, 0);
    drop(&in);
    /* no alpha: the name says it; without either, all is wood */
    make_tree(&m, "mtllib t.mtl\n", "other", "oak_leaf", 5, 1, 0, 0, 0);
    import_file(write_text("t.obj", m.text), &in);
    assert_int_equal(in.mesh.leaf_count, 5);
    assert_false(in.mesh.materials[0].masked || in.mesh.materials[1].masked);
    assert_true(in.mesh.materials[1].is_leaf && !in.mesh.materials[0].is_leaf);
    drop(&in);
    make_tree(&m, "mtllib t.mtl\n", "other", "other", 5, 1, 0, 0, 0);
    import_file(write_text("t.obj", m.text), &in);
    assert_int_equal(in.mesh.leaf_count, 0);
    assert_true(noted(&in, "no leaves"));
    drop(&in);
    /* a texture that is not there: told once, the colour stays (Kd is sRGB: 0.5 -> 0.214, 0.25 -> 0.0509) */
    make_tree(&m, "mtllib t.mtl\n", "gone", "oak_leaf", 5, 1, 0, 0, 0);
    import_file(write_text("t.obj", m.text), &in);
    assert_true(noted(&in, "missing.png"));
    assert_int_equal(in.notes.count, 1);
    assert_null(in.mesh.materials[0].albedo.data);
    assert_true(fabsf(in.mesh.materials[0].base_color[0] - 0.2140f) < 1e-3f);
    assert_true(fabsf(in.mesh.materials[0].base_color[1] - 0.0509f) < 1e-3f);
    drop(&in);
    /* another machine's path in other case finds the file beside the model; the colour under alpha 0 is the
     * leaf's, not magenta */
    make_tree(&m, "mtllib t.mtl\n", "other", "case", 5, 1, 0, 0, 0);
    import_file(write_text("t.obj", m.text), &in);
    const struct sv_tree_material *leaf = &in.mesh.materials[1];
    assert_true(leaf->masked && leaf->is_leaf && leaf->albedo.width == 32);
    for (int i = 0; i < 32 * 32; i++) {
        const unsigned char *p = (unsigned char *)leaf->albedo.data + 4 * i;
        assert_true(p[3] == 255 || p[2] < 60);
    }
    drop(&in);
}

/* An opacity map of its own, without a colour texture: white with alpha. */
static void test_opacity_map(void **state)
{
    (void)state;
    static struct maker m;
    struct imported in;
    struct sv_image grey;
    struct sv_error e;
    assert_int_equal(sv_image_alloc(20, 10, 1, SV_PIXEL_U8, &grey, &e), SV_OK);
    for (int i = 0; i < 200; i++)
        ((unsigned char *)grey.data)[i] = i % 20 < 8 ? 255 : 0;
    struct sv_encode_layer layer = {&grey, NULL};
    struct sv_encode_options options = {SV_FORMAT_PNG, 85, NULL};
    void *bytes;
    size_t size;
    assert_int_equal(sv_image_encode(&layer, 1, &options, &bytes, &size, &e), SV_OK);
    write_file("mask.png", bytes, size);
    free(bytes);
    sv_image_free(&grey);
    write_text("t.mtl", "newmtl cut\nKd 0.1 0.5 0.1\nmap_d mask.png\nnewmtl trunk\n");
    make_tree(&m, "mtllib t.mtl\n", "trunk", "cut", 4, 1, 0, 0, 0);
    import_file(write_text("t.obj", m.text), &in);
    const struct sv_tree_material *leaf = &in.mesh.materials[1];
    assert_true(leaf->is_leaf && leaf->masked);
    assert_int_equal(leaf->albedo.width, 20);
    for (int i = 0; i < 200; i++) {
        const unsigned char *p = (unsigned char *)leaf->albedo.data + 4 * i;
        assert_int_equal(p[3], i % 20 < 8 ? 255 : 0);
        assert_int_equal(p[0], 255);
    }
    drop(&in);
}

/* glTF written by hand: a node that mirrors, turns and scales, used twice; alphaMode OPAQUE keeps alpha out
 * of it. */
static void test_nodes(void **state)
{
    (void)state;
    static const float triangle[] = {0, 0, 0, 1, 0, 0, 0, 1, 0,
                                     0, 0, 1, 0, 0, 1, 0, 0, 1}; /* positions, then normals +z */
    write_file("t.bin", triangle, sizeof triangle);
    const char *text =
        "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0,1]}],"
        "\"nodes\":[{\"mesh\":0,\"scale\":[-2,4,1],\"translation\":[10,0,0]},{\"mesh\":0,\"rotation\":[0,0."
        "70710678,0,0.70710678]}],"
        "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"NORMAL\":1},\"material\":0}]}],"
        "\"materials\":[{\"name\":\"foliage\",\"pbrMetallicRoughness\":{\"baseColorFactor\":[0.25,0.5,0.75,0."
        "3]}"
        "}],"
        "\"buffers\":[{\"uri\":\"t.bin\",\"byteLength\":72}],"
        "\"bufferViews\":[{\"buffer\":0,\"byteOffset\":0,\"byteLength\":36},{\"buffer\":0,\"byteOffset\":36,"
        "\"byteLength\":36}],"
        "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\",\"min\":[0,0,"
        "0],\"max\":[1,1,0]},"
        "{\"bufferView\":1,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}]}";
    struct imported in;
    import_file(write_text("t.gltf", text), &in);
    assert_int_equal(in.mesh.index_count, 6);
    assert_int_equal(in.mesh.material_count, 1);
    const float want[4] = {0.25f, 0.5f, 0.75f, 1}; /* linear as given; alpha means nothing without a mask */
    for (int c = 0; c < 4; c++)
        assert_true(fabsf(in.mesh.materials[0].base_color[c] - want[c]) < 1e-6f);
    assert_true(fabsf(in.mesh.model_height - 4) < 1e-6f);
    /* mirrored: normal still file's +z = south; winding agrees. turned by 90 degrees about y: +z -> +x = east
     */
    for (int t = 0; t < 2; t++) {
        const struct sv_tree_vertex *v[3];
        for (int k = 0; k < 3; k++)
            v[k] = &in.mesh.vertices[in.mesh.indices[3 * t + k]];
        bool mirrored = false;
        for (int k = 0; k < 3; k++)
            mirrored = mirrored || v[k]->position[2] > 0.9f; /* 4 high */
        assert_int_equal(v[0]->normal[mirrored ? 1 : 0], mirrored ? -32767 : 32767);
        double a[3], b[3];
        for (int c = 0; c < 3; c++)
            a[c] = (double)(v[1]->position[c] - v[0]->position[c]),
            b[c] = (double)(v[2]->position[c] - v[0]->position[c]);
        double cross[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
        assert_true(cross[0] * v[0]->normal[0] + cross[1] * v[0]->normal[1] + cross[2] * v[0]->normal[2] > 0);
    }
    assert_true(noted(&in, "only 2 triangles"));
    drop(&in);
}

static void test_refused(void **state)
{
    (void)state;
    static struct maker many;
    many = (struct maker){.vertex = 1};
    for (int k = 0; k < 70; k++)
        say(&many, "usemtl m%d\nv %d 0 0\nv %d 1 0\nv %d 0 1\nf %d %d %d\n", k, k, k, k, 3 * k + 1, 3 * k + 2,
            3 * k + 3);
    char mtl[4096];
    size_t n = 0;
    for (int k = 0; k < 70; k++)
        n += (size_t)snprintf(mtl + n, sizeof mtl - n, "newmtl m%d\nKd %g 0 1\n", k, k / 100.0);
    write_text("many.mtl", mtl);
    char head[sizeof many.text + 32];
    snprintf(head, sizeof head, "mtllib many.mtl\n%s", many.text);
    static const char ply_points[] =
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nend_header\n0 0 0\n1 0 0\n0 1 0\n";
    const struct {
        const char *name, *text;
        enum sv_status status;
    } rows[] = {
        {"empty.obj", "", SV_EFORMAT},
        {"garbage.obj", "\x01\x02 lorem ipsum \xff\xfe", SV_EFORMAT},
        {"garbage.glb", "glTF\x02", SV_EFORMAT},
        {"garbage.fbx", "Kaydara FBX Binary  \0\x1a", SV_EFORMAT},
        {"garbage.dae", "<COLLADA><library_", SV_EFORMAT},
        {"points.ply", ply_points, SV_EFORMAT},
        {"lines.obj", "v 0 0 0\nv 1 1 1\nl 1 2\n", SV_EFORMAT},
        {"flat.obj", "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n", SV_EFORMAT},
        {"thin.obj", "v 0 0 0\nv 1 0 0\nv 1 0 0\nf 1 2 3\n", SV_EFORMAT},
        {"nan.obj", "v nan nan nan\nv nan 1 0\nv 0 nan 1\nf 1 2 3\n", SV_EFORMAT},
        {"tree.xyz", "no such format", SV_EFORMAT},
        {"many.obj", head, SV_ELIMIT},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct sv_tree_mesh mesh;
        struct sv_errors notes;
        struct sv_error e = {0};
        sv_errors_init(&notes);
        memset(&mesh, 0x55, sizeof mesh);
        enum sv_status status = sv_tree_import(write_text(rows[i].name, rows[i].text), &mesh, &notes, &e);
        if (status != rows[i].status)
            fail_msg("%s: %s: %s", rows[i].name, sv_status_text(status), e.message);
        assert_int_equal(e.code, status);
        assert_true(e.message[0] != 0);
        assert_int_equal(mesh.vertex_count, 0x55555555); /* written on success only */
        sv_errors_finish(&notes);
    }
    struct sv_tree_mesh mesh;
    struct sv_error e;
    assert_int_equal(sv_tree_import(temp_path("absent.obj"), &mesh, NULL, &e), SV_ENOENT);
    assert_non_null(strstr(e.field, "absent.obj"));
    assert_int_equal(sv_tree_import(folder, &mesh, NULL, &e), SV_EFORMAT);
}

static int setup(void **state)
{
    (void)state;
    sv_image_init();
    snprintf(folder, sizeof folder, "/tmp/sv_import_XXXXXX");
    return mkdtemp(folder) ? 0 : -1;
}

static int teardown(void **state)
{
    (void)state;
    static const char *const names[] = {
        "t.obj",       "t.mtl",      "t.gltf",    "t.bin",    "atlas.png",   "plain.png",   "mask.png",
        "many.mtl",    "many.obj",   "empty.obj", "thin.obj", "garbage.obj", "garbage.glb", "garbage.fbx",
        "garbage.dae", "points.ply", "lines.obj", "flat.obj", "nan.obj",     "tree.xyz"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        unlink(temp_path(names[i]));
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_models), cmocka_unit_test(test_same_tree), cmocka_unit_test(test_places),
        cmocka_unit_test(test_axes),   cmocka_unit_test(test_no_trunk),  cmocka_unit_test(test_normals),
        cmocka_unit_test(test_broken), cmocka_unit_test(test_leaves),    cmocka_unit_test(test_opacity_map),
        cmocka_unit_test(test_nodes),  cmocka_unit_test(test_refused),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
