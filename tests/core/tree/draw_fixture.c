#include "draw_fixture.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/color.h"
#include "core/base/rng.h"
#include "tests/core/tree/kept_bakes.h"

void fixture_ok(enum sv_status status, const struct sv_error *error)
{
    if (status != SV_OK)
        fail_msg("%s: %s: %s", sv_status_text(status), error->field, error->message);
}

/* ---- the tree ---- */

enum { SIDES = 8, TEXTURE = 32 };

static uint32_t add_vertex(struct sv_tree_mesh *m, struct sv_vec3 p, struct sv_vec3 n, float u, float v)
{
    struct sv_tree_vertex *o = &m->vertices[m->vertex_count];
    n = sv_normalize(n);
    *o = (struct sv_tree_vertex){
        .position = {(float)p.x, (float)p.y, (float)p.z},
        .normal = {(int16_t)(n.x * 32767), (int16_t)(n.y * 32767), (int16_t)(n.z * 32767)},
        .occlusion = (uint16_t)(30000 + 30000 * sv_clamp(p.z, 0, 1)),
        .open = {0, 0, 20, (int8_t)(60 + 40 * sv_clamp(p.z, 0, 1))},
        .uv = {u, v}};
    return m->vertex_count++;
}

static void add_quad(struct sv_tree_mesh *m, const struct sv_vec3 corner[4], struct sv_vec3 n)
{
    static const float uv[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    static const int order[6] = {0, 1, 2, 0, 2, 3};
    uint32_t index[4];
    for (int k = 0; k < 4; k++)
        index[k] = add_vertex(m, corner[k], n, uv[k][0], uv[k][1]);
    for (int k = 0; k < 6; k++)
        m->indices[m->index_count++] = index[order[k]];
}

static void add_stem(struct sv_tree_mesh *m, double top, double radius)
{
    for (int k = 0; k < SIDES; k++) {
        double a = 2 * SV_PI * k / SIDES, b = 2 * SV_PI * (k + 1) / SIDES;
        struct sv_vec3 corner[4] = {sv_vec3(radius * cos(a), radius * sin(a), 0),
                                    sv_vec3(radius * cos(b), radius * sin(b), 0),
                                    sv_vec3(0.5 * radius * cos(b), 0.5 * radius * sin(b), top),
                                    sv_vec3(0.5 * radius * cos(a), 0.5 * radius * sin(a), top)};
        add_quad(m, corner, sv_vec3(cos((a + b) / 2), sin((a + b) / 2), 0));
    }
}

static struct sv_vec3 random_direction(struct sv_rng *rng)
{
    double z = sv_rng_range(rng, -1, 1), a = sv_rng_range(rng, 0, 2 * SV_PI), c = sqrt(1 - z * z);
    return sv_vec3(c * cos(a), c * sin(a), z);
}

static void add_leaf(struct sv_tree_mesh *m, struct sv_rng *rng, struct sv_vec3 at, double half)
{
    struct sv_vec3 n = random_direction(rng), other = random_direction(rng);
    struct sv_vec3 a = sv_normalize(sv_cross(n, other)), b = sv_cross(n, a);
    struct sv_vec3 corner[4];
    for (int k = 0; k < 4; k++)
        corner[k] = sv_madd(sv_madd(at, a, k == 1 || k == 2 ? half : -half), b, k >= 2 ? half : -half);
    for (int k = 0; k < 4; k++)
        corner[k].z = sv_clamp(corner[k].z, 0, 1);
    add_quad(m, corner, n);
}

static void leaf_texture(struct sv_image *image)
{
    struct sv_error error;
    fixture_ok(sv_image_alloc(TEXTURE, TEXTURE, 4, SV_PIXEL_U8, image, &error), &error);
    uint8_t *p = image->data;
    for (int j = 0; j < TEXTURE; j++)
        for (int i = 0; i < TEXTURE; i++, p += 4) {
            double x = (i + 0.5) / TEXTURE * 2 - 1, y = (j + 0.5) / TEXTURE * 2 - 1;
            double edge = 1 - (x * x / 0.5 + y * y);
            p[0] = (uint8_t)(70 + 30 * x);
            p[1] = (uint8_t)(120 + 40 * y);
            p[2] = 50;
            p[3] = (uint8_t)(255 * sv_clamp(0.5 + 4 * edge, 0, 1));
        }
}

void fixture_tree(uint32_t leaves, uint64_t seed, struct sv_tree_mesh *mesh)
{
    struct sv_rng rng = sv_rng_seeded(seed, 1);
    struct sv_error error;
    size_t quads = (size_t)leaves + SIDES;
    *mesh = (struct sv_tree_mesh){.vertices = calloc(4 * quads + 4, sizeof(struct sv_tree_vertex)),
                                  .indices = calloc(6 * quads, sizeof(uint32_t)),
                                  .material_count = leaves ? 2 : 1,
                                  .leaf_count = leaves,
                                  .model_height = 1};
    add_stem(mesh, leaves ? 0.5 : 1, 0.03);
    mesh->materials[0] = (struct sv_tree_material){
        .name = "bark", .base_color = {0.2f, 0.14f, 0.09f, 1}, .index_count = mesh->index_count};
    uint32_t wood = mesh->index_count;
    double half = leaves ? 0.6 / sqrt((double)leaves) : 0;
    for (uint32_t k = 0; k < leaves; k++) {
        struct sv_vec3 d = sv_scale(random_direction(&rng), cbrt(sv_rng_unit(&rng)));
        bool bough = k % 5 == 0;
        struct sv_vec3 at = bough ? sv_vec3(0.38 + 0.12 * d.x, 0.08 * d.y, 0.42 + 0.07 * d.z)
                                  : sv_vec3(0.26 * d.x, 0.26 * d.y, 0.62 + 0.38 * d.z);
        add_leaf(mesh, &rng, at, half);
    }
    if (leaves) {
        mesh->materials[1] = (struct sv_tree_material){.name = "leaf",
                                                       .base_color = {1, 1, 1, 1},
                                                       .is_leaf = true,
                                                       .masked = true,
                                                       .two_sided = true,
                                                       .alpha_cutoff = 0.5f,
                                                       .translucency = 0.35f,
                                                       .first_index = wood,
                                                       .index_count = mesh->index_count - wood};
        leaf_texture(&mesh->materials[1].albedo);
        /* One card at the very top, so that the tree is 1 tall. */
        mesh->vertices[mesh->vertex_count - 1].position[2] = 1;
    }
    fixture_ok(sv_tree_mesh_measure(mesh, &error), &error);
}

/* ---- views ---- */

struct sv_camera fixture_camera(struct sv_vec3 eye, double heading_deg, double pitch_deg, int width,
                                int height)
{
    struct sv_camera c = {.eye = eye,
                          .projection = SV_PROJECTION_PERSPECTIVE,
                          .vfov_rad = sv_radians(60),
                          .width = width,
                          .height = height,
                          .near_m = 0.1};
    sv_camera_aim(&c, sv_radians(heading_deg), sv_radians(pitch_deg), 0);
    return c;
}

struct sv_light fixture_light(double azimuth_deg, double elevation_deg)
{
    struct sv_light light;
    sv_light_from_sun(&(struct sv_sun){sv_radians(azimuth_deg), sv_radians(elevation_deg)}, &light);
    return light;
}

void fixture_forest_init(struct fixture_forest *f, const struct sv_tree *trees, uint32_t count, float radius)
{
    struct sv_error error;
    struct sv_crown_bound bounds[16];
    for (int k = 0; k < 16; k++)
        bounds[k] = (struct sv_crown_bound){radius, 1, 0};
    fixture_ok(sv_arena_create((size_t)1 << 30, &f->arena, &error), &error);
    f->trees = sv_arena_copy(f->arena, trees, count * sizeof *trees);
    assert_non_null(f->trees);
    fixture_ok(sv_forest_build(f->trees, count, bounds, f->arena, &f->forest, &error), &error);
}

void fixture_forest_finish(struct fixture_forest *f)
{
    sv_arena_destroy(f->arena);
    memset(f, 0, sizeof *f);
}

static void read_layer(struct sv_gl_target *target, enum sv_layer layer, int w, int h, int channels,
                       enum sv_pixel_type type, void **out)
{
    struct sv_error error;
    struct sv_image image;
    fixture_ok(sv_image_alloc(w, h, channels, type, &image, &error), &error);
    fixture_ok(sv_gl_target_read(target, layer, &image, &error), &error);
    *out = image.data;
}

void fixture_draw(struct sv_tree_draw *draw, const struct sv_camera *camera, const struct sv_light *light,
                  const struct sv_tree_draw_options *options, struct fixture_view *view)
{
    struct sv_error error;
    struct sv_gl_target *target;
    int w = camera->width, h = camera->height;
    struct sv_gl_frame frame = {.camera = *camera, .light = *light};
    fixture_ok(sv_gl_target_create(w, h, 15, &target, &error), &error);
    sv_gl_target_begin(target);
    fixture_ok(sv_gl_frame_begin(&frame, &error), &error);
    bool on_canvas = sv_tree_form_on_canvas(options->form);
    if (!on_canvas)
        fixture_ok(sv_tree_draw_forest(draw, &frame, options, &view->stats, &error), &error);
    void *data[4];
    read_layer(target, SV_LAYER_COLOR, w, h, 4, SV_PIXEL_U8, &data[0]);
    read_layer(target, SV_LAYER_DEPTH, w, h, 1, SV_PIXEL_F32, &data[1]);
    read_layer(target, SV_LAYER_NORMAL, w, h, 3, SV_PIXEL_F32, &data[2]);
    read_layer(target, SV_LAYER_ID, w, h, 1, SV_PIXEL_U32, &data[3]);
    struct sv_canvas canvas = {.width = w,
                               .height = h,
                               .row_count = h,
                               .depth = data[1],
                               .color = data[0],
                               .id = data[3],
                               .normal = data[2]};
    struct sv_tree_draw_options over = *options;
    over.canvas = &canvas;
    if (on_canvas)
        fixture_ok(sv_tree_draw_forest(draw, &frame, &over, &view->stats, &error), &error);
    view->width = w;
    view->height = h;
    view->color = data[0];
    view->depth = data[1];
    view->normal = data[2];
    view->id = data[3];
    sv_gl_target_destroy(target);
}

void fixture_view_finish(struct fixture_view *view)
{
    free(view->color);
    free(view->depth);
    free(view->normal);
    free(view->id);
    memset(view, 0, sizeof *view);
}

void fixture_shrink(struct fixture_view *view, int k)
{
    int w = view->width / k, h = view->height / k;
    uint8_t *out = malloc(4 * (size_t)w * (size_t)h);
    assert_non_null(out);
    for (int j = 0; j < h; j++)
        for (int i = 0; i < w; i++) {
            float sum[4] = {0}, each = 1.0f / (float)(k * k);
            for (int n = 0; n < k * k; n++) {
                const uint8_t *p = view->color + 4 * ((size_t)(j * k + n / k) * (size_t)view->width +
                                                      (size_t)(i * k + n % k));
                for (int c = 0; c < 3; c++)
                    sum[c] += sv_linear_from_srgb8[p[c]] * each;
                sum[3] += (float)p[3] * each;
            }
            uint8_t *o = out + 4 * ((size_t)j * (size_t)w + (size_t)i);
            for (int c = 0; c < 3; c++)
                o[c] = sv_srgb8_from_linear(sum[c]);
            o[3] = (uint8_t)(sum[3] + 0.5f);
        }
    struct sv_tree_draw_stats stats = view->stats;
    fixture_view_finish(view);
    *view = (struct fixture_view){.width = w, .height = h, .color = out, .stats = stats};
}

struct fixture_look fixture_look_at(const struct fixture_view *view)
{
    struct fixture_look look = {.left = view->width, .top = view->height, .right = -1, .bottom = -1};
    for (int j = 0; j < view->height; j++)
        for (int i = 0; i < view->width; i++) {
            const uint8_t *p = view->color + 4 * ((size_t)j * (size_t)view->width + (size_t)i);
            look.coverage += p[3] / 255.0;
            for (int c = 0; c < 3; c++)
                look.rgb[c] += (double)sv_linear_from_srgb8[p[c]];
            if (p[3] < 64)
                continue;
            look.left = i < look.left ? i : look.left;
            look.right = i > look.right ? i : look.right;
            look.top = j < look.top ? j : look.top;
            look.bottom = j > look.bottom ? j : look.bottom;
        }
    for (int c = 0; c < 3; c++)
        look.rgb[c] /= look.coverage > 0 ? look.coverage : 1;
    return look;
}

void fixture_single_init(struct fixture_single *s, const struct sv_tree_mesh *mesh,
                         const struct sv_tree *tree, struct sv_store *store)
{
    struct sv_error error;
    struct sv_tree_draw_species species = {mesh, kept_bakes_key(mesh), 1};
    fixture_forest_init(&s->forest, tree, 1, mesh->radius);
    fixture_ok(sv_tree_draw_create(&species, 1, &s->forest.forest, store, &s->draw, &error), &error);
}

void fixture_single_finish(struct fixture_single *s)
{
    sv_tree_draw_destroy(s->draw);
    fixture_forest_finish(&s->forest);
}
