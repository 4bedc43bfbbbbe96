/* test_object_extremes.c - random extreme inputs to what test_relief_extremes leaves out: bakes of meshes,
 * objects and their looks, meshes as the sun sees them; and tables of the error of lighting towards its
 * singular places. What goes in lies between pages that may not be touched; nothing that comes out is NaN or
 * infinite, nothing crashes. SV_TEST_FULL=1 takes ten times as many. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/frames.h"
#include "core/gl/context.h"
#include "core/relief/build.h"
#include "core/relief/object.h"
#include "core/relief/object_splat_kernel.h"
#include "core/relief/object_sun.h"
#include "tests/core/relief/extremes_kit.h"

static struct sv_gl_context *context;

static int set_up(void **state)
{
    struct sv_error error;
    return extremes_set_up(state) || sv_gl_context_create(&context, &error);
}

static int tear_down(void **state)
{
    (void)state;
    sv_gl_context_destroy(context);
    return 0;
}

/* ---- extreme meshes ---- */

/* Anything that a float holds, or (tame) something near 1; both rarely all the same. */
static float any_coordinate(struct sv_rng *rng, bool tame)
{
    static const float named[] = {0, -0.0f, 1, -1, 1e9f, -1e9f, 1e-42f, 3e38f, -3.4e38f, NAN, INFINITY};
    if (tame || extremes_pick(rng, 30))
        return (float)sv_rng_range(rng, -1, 1) * (extremes_pick(rng, 9) ? 1 : 0);
    return named[extremes_pick(rng, sizeof named / sizeof *named)];
}

/* One to six triangles of up to eight vertices, one or two materials, albedo of a few texels; all guarded. */
static struct sv_tree_mesh any_mesh(struct sv_rng *rng)
{
    struct sv_tree_mesh m = {.vertex_count = 1 + extremes_pick(rng, 8),
                             .index_count = 3 * (1 + extremes_pick(rng, 6)),
                             .material_count = 1 + (int)extremes_pick(rng, 2)};
    bool tame = extremes_pick(rng, 2);
    m.vertices = extremes_guarded(rng, EXTREMES_SLOT_DISPL, m.vertex_count * sizeof *m.vertices);
    m.indices = extremes_guarded(rng, EXTREMES_SLOT_COLOR, m.index_count * sizeof *m.indices);
    for (uint32_t k = 0; k < m.vertex_count; k++) {
        struct sv_tree_vertex *v = &m.vertices[k];
        *v = (struct sv_tree_vertex){.occlusion = (uint16_t)sv_rng_next(rng)};
        for (int c = 0; c < 3; c++) {
            v->position[c] = any_coordinate(rng, tame);
            v->normal[c] = (int16_t)(extremes_pick(rng, 4) ? sv_rng_next(rng) : 0);
        }
        for (int c = 0; c < 2; c++)
            v->uv[c] = any_coordinate(rng, extremes_pick(rng, 9));
    }
    for (uint32_t k = 0; k < m.index_count; k++)
        m.indices[k] = extremes_pick(rng, m.vertex_count);
    for (int k = 0; k < m.material_count; k++) {
        struct sv_tree_material *material = &m.materials[k];
        int width = extremes_side(rng), height = extremes_side(rng);
        *material = (struct sv_tree_material){.base_color = {1, 0.5f, 0, extremes_pick(rng, 3) ? 1 : 0.2f},
                                              .alpha_cutoff = 0.5f,
                                              .masked = extremes_pick(rng, 2),
                                              .first_index = k ? 3 : 0,
                                              .index_count = k                       ? m.index_count - 3
                                                             : m.material_count == 1 ? m.index_count
                                                                                     : 3};
        if (extremes_pick(rng, 2))
            continue;
        size_t bytes = (size_t)width * (size_t)height * 4;
        uint8_t *texels = extremes_guarded(rng, k ? EXTREMES_SLOT_IN : EXTREMES_SLOT_NORMAL, bytes);
        for (size_t t = 0; t < bytes; t++)
            texels[t] = (uint8_t)sv_rng_next(rng);
        material->albedo = (struct sv_image){
            .width = width, .height = height, .channels = 4, .type = SV_PIXEL_U8, .data = texels};
    }
    return m;
}

static void check_relief(const struct sv_relief *r)
{
    uint32_t solid = 0;
    assert_true(isfinite(r->displ_min) && isfinite(r->displ_max) && r->displ_min <= r->displ_max);
    for (size_t t = 0; t < (size_t)r->width * (size_t)r->height; t++) {
        assert_true(isfinite(r->displ[t]));
        if (!sv_relief_solid(r, t))
            continue;
        double x = r->normal[t][0], y = r->normal[t][1], z = r->normal[t][2];
        assert_true(fabs(sqrt(x * x + y * y + z * z) - 32767) < 3 && r->normal[t][3] >= 0);
        solid++;
    }
    assert_int_equal(solid, r->solid_count);
}

/* ---- one input each: true unless it was refused ---- */

static bool try_bake(struct sv_rng *rng)
{
    struct sv_tree_mesh mesh = any_mesh(rng);
    struct sv_relief_frame frame = extremes_frame(rng);
    if (extremes_pick(rng, 3))
        frame.origin = sv_scale(sv_add(frame.a, frame.b), -4); /* about the mesh */
    if (extremes_pick(rng, 60) == 0)
        frame.a = extremes_pick(rng, 2) ? frame.b : sv_vec3(0, NAN, 0);
    struct sv_relief_bake_options options = {.width = extremes_side(rng),
                                             .height = extremes_side(rng),
                                             .samples = 1 + (int)extremes_pick(rng, 3),
                                             .front_m = extremes_displ(rng, 1),
                                             .depth_m = fabs((double)extremes_displ(rng, 1)),
                                             .cut = extremes_pick(rng, 8) ? 1 : extremes_displ(rng, 1)};
    if (extremes_pick(rng, 3))
        options.front_m = extremes_pick(rng, 2) ? 1 : 0;
    if (extremes_pick(rng, 3))
        options.depth_m = extremes_length(rng);
    struct sv_relief r;
    struct sv_error error;
    enum sv_status status = sv_relief_from_mesh(&mesh, &frame, &options, &r, &error);
    if (status) {
        assert_int_equal(status, SV_EINVAL);
        return false;
    }
    check_relief(&r);
    for (size_t t = 0; t < (size_t)r.width * (size_t)r.height; t++)
        if (sv_relief_solid(&r, t)) { /* to float's rounding, and the depth range's margin */
            double d = (double)r.displ[t], room = (options.front_m + options.depth_m) / 1024;
            assert_true(d <= options.front_m + room && d >= -options.depth_m - room);
        }
    sv_relief_finish(&r);
    return true;
}

/* Faces of a box of any proportions, filled with anything. */
static enum sv_status any_object(struct sv_rng *rng, struct sv_relief_object *object, struct sv_error *error)
{
    int resolution = 8 + (int)extremes_pick(rng, 9);
    if (extremes_pick(rng, 2)) {
        struct sv_tree_mesh mesh = any_mesh(rng);
        return sv_relief_object_bake(&mesh, resolution, object, error);
    }
    struct sv_relief_object made = {0};
    struct sv_vec3 lo = sv_vec3(sv_rng_range(rng, -1, 0), sv_rng_range(rng, -1, 0), 0);
    struct sv_vec3 size = sv_vec3(extremes_length(rng), extremes_pick(rng, 3) ? 1 : 0, extremes_pick(rng, 3));
    enum sv_status status =
        sv_relief_object_set_box(&made, lo, sv_add(lo, size), resolution, SV_EINVAL, error);
    if (!status)
        status = sv_relief_object_alloc(&made, error);
    for (int k = 0; !status && k < SV_RELIEF_FACES; k++) {
        struct sv_relief *face = &made.face[k];
        for (size_t t = 0; t < (size_t)face->width * (size_t)face->height; t++) {
            bool odd = extremes_pick(rng, 20) == 0;
            face->displ[t] =
                odd ? extremes_displ(rng, 1) : -(float)(made.texel * (double)extremes_pick(rng, 9));
            for (int c = 0; c < 4; c++)
                face->color[t][c] = (uint8_t)sv_rng_next(rng), face->normal[t][c] = (int16_t)sv_rng_next(rng);
        }
        sv_relief_measure(face);
    }
    if (!status)
        status = sv_relief_object_choose(&made, error);
    if (!status)
        status = sv_relief_object_derive(&made, error);
    if (status)
        sv_relief_object_finish(&made);
    else
        *object = made;
    return status;
}

/* Inside, on the box, a hair beside it, far away; any way of looking. */
static struct sv_camera any_camera(struct sv_rng *rng, const struct sv_relief_place *place)
{
    struct sv_camera c = {.projection =
                              extremes_pick(rng, 3) ? SV_PROJECTION_PERSPECTIVE : SV_PROJECTION_ORTHOGRAPHIC,
                          .vfov_rad = sv_radians(extremes_pick(rng, 2) ? 1 : 150),
                          .ortho_height_m = extremes_length(rng),
                          .width = extremes_side(rng),
                          .height = extremes_side(rng),
                          .near_m = extremes_pick(rng, 2) ? 0.1 : 1e-6,
                          .far_m = 1e5};
    double away = extremes_pick(rng, 5) ? pow(10, sv_rng_range(rng, -9, 3)) : 0;
    struct sv_vec3 to = extremes_unit(rng);
    c.eye = sv_madd(place->place, to, away * place->height_m);
    if (extremes_pick(rng, 3))
        sv_camera_aim(&c, atan2(-to.x, -to.y), asin(sv_clamp(-to.z, -1, 1)), 0);
    else
        sv_camera_aim(&c, sv_rng_range(rng, 0, 7), sv_rng_range(rng, -1.57, 1.57), sv_rng_range(rng, -3, 3));
    return c;
}

static void check_picture(const struct sv_warp_buffer *buffer, const struct sv_warp_source *sources,
                          unsigned count)
{
    size_t n = (size_t)buffer->width * (size_t)buffer->height;
    float *depth = calloc(n, sizeof *depth);
    uint8_t(*rgba)[4] = calloc(n, 4);
    assert_true(depth && rgba);
    sv_warp_resolve(sources, count, buffer, rgba);
    sv_warp_resolve_depth(sources, buffer, depth);
    for (size_t k = 0; k < n; k++) {
        bool there = buffer->texel[k] != SV_WARP_EMPTY;
        assert_true(isfinite(buffer->depth[k]) && buffer->depth[k] >= 0 && buffer->depth[k] <= 1);
        assert_true(isfinite(depth[k]));
        if (there) {
            const struct sv_warp_source *s =
                &sources[(buffer->texel[k] & ~SV_WARP_FILLED) >> SV_WARP_TEXEL_BITS];
            assert_true(s < sources + count);
            assert_true((buffer->texel[k] & SV_WARP_TEXEL_MASK) < (uint32_t)(s->width * s->height));
        }
    }
    free(depth);
    free(rgba);
}

static void look_at(struct sv_rng *rng, const struct sv_relief_object *object, struct sv_relief_look *look)
{
    struct sv_error error;
    struct sv_relief_place place = {sv_vec3(sv_rng_range(rng, -9, 9), 4e6, 12),
                                    extremes_pick(rng, 2) ? 1 : extremes_length(rng),
                                    extremes_pick(rng, 3) ? sv_rng_range(rng, -9, 9) : SV_PI / 2};
    struct sv_camera camera = any_camera(rng, &place);
    struct sv_sun sun = {sv_rng_range(rng, 0, 7), sv_rng_range(rng, -0.2, 1.57)};
    if (extremes_pick(rng, 3) == 0)
        sun.elevation_rad = extremes_pick(rng, 2) ? SV_PI / 2 : 0;
    struct sv_light light;
    sv_light_from_sun(&sun, &light);
    struct sv_relief_look_options options = {.shadow = (enum sv_relief_shadow_form)extremes_pick(rng, 3),
                                             .lit = extremes_pick(rng, 4),
                                             .specular = (float)sv_rng_unit(rng),
                                             .shininess = extremes_pick(rng, 2) ? 1 : 1000,
                                             .has_viewer = extremes_pick(rng, 2),
                                             .eye = camera.eye,
                                             .in_warp = extremes_pick(rng, 2),
                                             .taken = sv_rng_unit(rng),
                                             .shade_height_m = extremes_pick(rng, 2) ? -INFINITY : 12.5};
    struct sv_warp_buffer buffer;
    struct sv_warp_stats stats = {0};
    const struct sv_warp_source *sources = NULL;
    unsigned count = 0, faces = sv_relief_object_faces(object, &place, &camera);
    double px = sv_relief_object_texel_px(object, &place, &camera);
    assert_true(faces < 64 && isfinite(px) && px >= 0);
    if (extremes_pick(rng, 2))
        faces = 63;
    if (sv_relief_look_light(look, &place, &light, &options, faces, &error))
        fail_msg("light: %s: %s", error.field, error.message);
    assert_int_equal(sv_warp_buffer_create(camera.width, camera.height, &buffer, &error), SV_OK);
    if (sv_relief_look_warp(look, &place, &camera, 0, 0, faces, &buffer, &sources, &count, &stats, &error))
        fail_msg("warp: %s: %s", error.field, error.message);
    check_picture(&buffer, sources, count);
    sv_warp_buffer_finish(&buffer);
}

static bool try_object(struct sv_rng *rng)
{
    struct sv_relief_object object, again;
    struct sv_relief_look *look;
    struct sv_error error;
    enum sv_status status = any_object(rng, &object, &error);
    if (status) {
        assert_int_equal(status, SV_EINVAL);
        return false;
    }
    void *data = NULL;
    size_t bytes = 0;
    assert_int_equal(sv_relief_object_save(&object, &data, &bytes, &error), SV_OK);
    status = sv_relief_object_load(data, bytes, &again, &error);
    assert_true(status == SV_OK || status == SV_EFORMAT);
    if (!status)
        sv_relief_object_finish(&again);
    free(data);
    if (sv_relief_look_create(&object, &look, &error))
        fail_msg("%s: %s", error.field, error.message);
    for (int k = 0; k < 3; k++)
        look_at(rng, &object, look);
    sv_relief_look_destroy(look);
    sv_relief_object_finish(&object);
    return true;
}

static bool try_object_sun(struct sv_rng *rng)
{
    struct sv_tree_mesh mesh = any_mesh(rng);
    struct sv_object_sun sun;
    struct sv_error error;
    double heading = extremes_pick(rng, 3) ? sv_rng_range(rng, -9, 9) : (double)extremes_displ(rng, 1);
    enum sv_status status =
        sv_object_sun_create(&mesh, heading, sv_scale(extremes_unit(rng), extremes_length(rng)),
                             16 + (int)extremes_pick(rng, 50), &sun, &error);
    if (status) {
        assert_int_equal(status, SV_EINVAL);
        return false;
    }
    const struct sv_silhouette *s = &sun.silhouette;
    assert_true(s->width >= 1 && s->height >= 1 && s->width <= 70 && s->height <= 70);
    assert_true(isfinite(s->corner.x) && isfinite(s->corner.y) && isfinite(s->corner.z));
    assert_true(isfinite(s->width_m) && isfinite(s->height_m) && isfinite(s->first_m) && isfinite(s->last_m));
    for (int t = 0; t < s->width * s->height; t++)
        assert_true((s->coverage[t] == 255) == isfinite(s->first[t]) && !isnan(s->first[t]));
    for (int k = 0; k < 8; k++) {
        struct sv_vec3 p = extremes_pick(rng, 2)
                               ? extremes_unit(rng)
                               : sv_vec3((double)extremes_displ(rng, 1), (double)extremes_displ(rng, 1), 0);
        float seen = sv_object_sun_seen(&sun, p, extremes_pick(rng, 2) ? 0 : 1e-3);
        assert_true(seen >= 0 && seen <= 1);
    }
    sv_object_sun_finish(&sun);
    return true;
}

static const struct {
    const char *name;
    bool (*one)(struct sv_rng *rng);
    long count;
} trials[] = {
    {"bake", try_bake, 4000}, {"objects", try_object, 800}, {"object's sun", try_object_sun, 40000}};

static void extreme_inputs(void **state)
{
    (void)state;
    const char *full = getenv("SV_TEST_FULL");
    long times = full && strcmp(full, "1") == 0 ? 10 : 1;
    for (size_t k = 0; k < sizeof trials / sizeof *trials; k++) {
        long taken = 0, count = trials[k].count * times;
        extremes_doing = trials[k].name;
        for (extremes_case = 0; extremes_case < count; extremes_case++) {
            struct sv_rng rng = sv_rng_seeded(EXTREMES_SEED + 100 + k, (uint64_t)extremes_case);
            taken += trials[k].one(&rng);
        }
        print_message("%-20s %7ld extreme inputs, %ld refused\n", trials[k].name, count, count - taken);
        assert_true(taken * 3 > count);
    }
}

/* ---- quarters of cells, as small as float can tell corners apart ---- */

/* Quarter k about the middle of some pixel, of edges of a few units of rounding: its corners, which are
 * rounded each by itself, may lie far from those of a parallelogram. */
static struct sv_relief_corners tiny_quarter(struct sv_rng *rng, int k, int side)
{
    struct sv_relief_corners q = {.texel = extremes_pick(rng, 1000)};
    float from[2], e[2][2], det, size;
    do {
        for (int i = 0; i < 2; i++) {
            from[i] = (float)extremes_pick(rng, (uint32_t)side) + 0.5f;
            float half = 0.5f * (nextafterf(from[i], INFINITY) - from[i]);
            from[i] += half * (float)((int)extremes_pick(rng, 13) - 6);
            e[0][i] = half * (float)((int)extremes_pick(rng, 11) - 5);
            e[1][i] = half * (float)((int)extremes_pick(rng, 11) - 5);
        }
        det = e[0][0] * e[1][1] - e[0][1] * e[1][0];
        size = fabsf(e[0][0]) + fabsf(e[0][1]) + fabsf(e[1][0]) + fabsf(e[1][1]);
    } while (!((k == 1 || k == 2 ? -det : det) > size * size * SV_RELIEF_EDGE_ON));
    for (int c = 0; c < 4; c++) {
        q.x[c] = from[0] + (c & 1 ? e[0][0] : 0) + (c >> 1 ? e[1][0] : 0);
        q.y[c] = from[1] + (c & 1 ? e[0][1] : 0) + (c >> 1 ? e[1][1] : 0);
        q.d[c] = (float)sv_rng_unit(rng);
    }
    return q;
}

static void same_buffers(const struct sv_warp_buffer *a, const struct sv_warp_buffer *b)
{
    size_t n = (size_t)a->width * (size_t)a->height;
    assert_memory_equal(a->depth, b->depth, n * sizeof *a->depth);
    assert_memory_equal(a->texel, b->texel, n * sizeof *a->texel);
    for (size_t p = 0; p < n; p++)
        assert_true(a->texel[p] == SV_WARP_EMPTY || a->place[p] == b->place[p]);
}

/* Alone, eight at a time (what lies about them in memory is not read) and by pixels of a row: the same
 * pixels. */
static void tiny_quarters_agree(void **state)
{
    (void)state;
    enum { ROUNDS = 2000, SIDE = 24 };
    struct sv_rng rng = sv_rng_seeded(EXTREMES_SEED + 200, 0);
    uint32_t pixels = 0;
    if (sv_simd_level() < SV_SIMD_AVX2)
        skip();
    for (int round = 0; round < ROUNDS; round++) {
        static struct sv_relief_waiting waiting;
        struct sv_warp_buffer buffer[3];
        struct sv_warp_job job[3];
        for (int way = 0; way < 3; way++) {
            assert_int_equal(sv_warp_buffer_create(SIDE, SIDE, &buffer[way], NULL), SV_OK);
            job[way] = (struct sv_warp_job){.buffer = &buffer[way]};
        }
        waiting.count = 1 + (int)extremes_pick(&rng, SV_RELIEF_WAITING);
        for (int n = 0; n < waiting.count; n++) {
            int k = (int)extremes_pick(&rng, 4);
            struct sv_relief_corners q = tiny_quarter(&rng, k, SIDE);
            for (int c = 0; c < 4; c++)
                waiting.x[c][n] = q.x[c], waiting.y[c][n] = q.y[c], waiting.d[c][n] = q.d[c];
            waiting.texel[n] = q.texel;
            waiting.needed[n] = (uint32_t)k;
            sv_relief_draw_quarter(&job[0], &q, k, false);
            sv_relief_draw_quarter(&job[1], &q, k, true);
        }
        sv_relief_draw_quarters_avx2(&job[2], &waiting, waiting.count);
        pixels += job[0].pixels;
        for (int way = 1; way < 3; way++)
            same_buffers(&buffer[0], &buffer[way]);
        for (int way = 0; way < 3; way++)
            sv_warp_buffer_finish(&buffer[way]);
    }
    printf("tiny quarters: the same bits, %u pixels\n", pixels);
    assert_true(pixels > ROUNDS);
}

/* ---- lighting towards its singular places ---- */

typedef long double real;

/* Tangents' slope from nearly level to a cliff. The stored normal is whole numbers of 1/32767: half a step
 * in each of three components is 2.7e-5 rad. */
static void error_towards_the_cliff(void **state)
{
    (void)state;
    enum { ROWS = 20, TRIES = 400 };
    struct extremes_row rows[ROWS];
    for (int k = 0; k < ROWS; k++) {
        double slope = pow(10, -3 + 2 * k);
        struct sv_rng rng = sv_rng_seeded(EXTREMES_SEED, 7000 + (uint64_t)k);
        rows[k] = (struct extremes_row){slope, 0};
        for (int n = 0; n < TRIES; n++) {
            float displ[9];
            uint8_t color[9][4];
            int16_t normal[9][4] = {{0}};
            double su = slope * sv_rng_range(&rng, -1, 1), sv = slope * sv_rng_range(&rng, -1, 1);
            memset(color, 255, sizeof color);
            for (int t = 0; t < 9; t++)
                displ[t] = (float)(su * (t % 3 - 1) + sv * (t / 3 - 1));
            struct sv_relief r = {.frame = extremes_square_frame(&rng),
                                  .width = 3,
                                  .height = 3,
                                  .displ = displ,
                                  .color = color,
                                  .normal = normal,
                                  .cut = INFINITY};
            sv_relief_measure(&r);
            sv_relief_normals(&r);
            real x = -((real)displ[5] - displ[3]) / 2, y = -((real)displ[7] - displ[1]) / 3, z = 1;
            real length = sqrtl(x * x + y * y + z * z);
            x /= length, y /= length, z /= length;
            real cx = y * normal[4][2] - z * normal[4][1], cy = z * normal[4][0] - x * normal[4][2],
                 cz = x * normal[4][1] - y * normal[4][0];
            real dot = x * normal[4][0] + y * normal[4][1] + z * normal[4][2];
            real angle = atan2l(sqrtl(cx * cx + cy * cy + cz * cz), dot);
            rows[k].error = fmax(rows[k].error, (double)angle);
        }
    }
    extremes_judge("normals, slope of the surface: m a m, angle to the normal by long double", "rad", rows,
                   ROWS, 2, 2e-5, 3e-5);
}

static real linear(uint8_t code)
{
    real c = code / 255.0L;
    return c <= 0.04045L ? c / 12.92L : powl((c + 0.055L) / 1.055L, 2.4L);
}

static real levels(real exposed)
{
    real t = 2 * exposed - 1, c = exposed <= 0.5L ? fmaxl(exposed, 0) : 0.5L + t / (2 * (1 + t));
    return 255 * (c <= 0.0031308L ? 12.92L * c : 1.055L * powl(c, 1 / 2.4L) - 0.055L);
}

/* light.h's surface rule and Blinn's term for one texel of a level relief with f up, by long double. */
static real light_l(const struct sv_light *light, const struct sv_relief_light *how, const real n[3],
                    const real at[3], uint8_t code, int channel)
{
    const real l[3] = {light->to_sun.x, light->to_sun.y, light->to_sun.z};
    real e[3] = {how->eye.x - at[0], how->eye.y - at[1], how->eye.z - at[2]}, h[3], n_l = 0, n_e = 0, n_h = 0;
    real distance = sqrtl(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]), size = 0, shine = 0;
    for (int c = 0; c < 3; c++) {
        h[c] = l[c] + e[c] / distance;
        n_l += n[c] * l[c];
        n_e += n[c] * e[c];
        size += h[c] * h[c];
    }
    for (int c = 0; c < 3; c++)
        n_h += n[c] * h[c] / sqrtl(size);
    if (how->has_viewer && n_l > 0 && n_e > 0 && n_h > 0)
        shine = how->specular * powl(n_h, how->shininess);
    real up = 0.5L + 0.5L * n[2];
    real ambient = light->ground_rgb[channel] + (light->sky_rgb[channel] - light->ground_rgb[channel]) * up;
    real sun = light->sun_rgb[channel];
    return levels((linear(code) * (sun * fmaxl(n_l, 0) + ambient) + sun * shine) * SV_LIGHT_EXPOSURE);
}

/* The largest difference, in levels, of a 16 x 1 relief whose texels all have the normal n. */
static double light_off(const struct sv_light *light, const struct sv_relief_light *how, const int16_t n[4],
                        struct sv_rng *rng)
{
    enum { N = 16 };
    float displ[N] = {0};
    uint8_t color[N][4], rgba[N][4];
    int16_t normal[N][4];
    for (int t = 0; t < N; t++) {
        memcpy(normal[t], n, sizeof normal[t]);
        for (int c = 0; c < 4; c++)
            color[t][c] = c == 3 ? 255 : (uint8_t)sv_rng_next(rng);
    }
    struct sv_relief r = {.frame = how->frame,
                          .width = N,
                          .height = 1,
                          .displ = displ,
                          .color = color,
                          .normal = normal,
                          .cut = INFINITY};
    sv_relief_light(&r, how, rgba);
    double worst = 0;
    for (int t = 0; t < N; t++)
        for (int c = 0; c < 3; c++) {
            const real m[3] = {n[0] / 32767.0L, n[1] / 32767.0L, n[2] / 32767.0L};
            const real at[3] = {t + 0.5L, 0.5L, 0};
            real want = light_l(light, how, m, at, color[t][c], c);
            worst = fmax(worst, fabs((double)(rgba[t][c] - want)));
        }
    return worst;
}

static const struct sv_relief_frame LEVEL = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};

/* From square to the surface to grazing it, and behind: half a level is rounding to bytes. */
static void error_towards_grazing_light(void **state)
{
    (void)state;
    static const double degrees[] = {90, 60, 30, 10, 3, 1, 0.1, 1e-2, 1e-4, 1e-6, 0, -1e-6, -1e-2, -10};
    enum { ROWS = sizeof degrees / sizeof *degrees };
    struct extremes_row rows[ROWS];
    static const int16_t up[4] = {0, 0, 32767, 32767};
    struct sv_light light;
    sv_light_from_sun(&(struct sv_sun){1, 0.7}, &light);
    for (int k = 0; k < ROWS; k++) {
        struct sv_rng rng = sv_rng_seeded(EXTREMES_SEED, 8000 + (uint64_t)k);
        rows[k] = (struct extremes_row){degrees[k], 0};
        for (int n = 0; n < 200; n++) {
            light.to_sun = sv_direction(sv_rng_range(&rng, 0, 7), sv_radians(degrees[k]));
            struct sv_relief_light how = {.light = &light, .frame = LEVEL, .shininess = 1};
            rows[k].error = fmax(rows[k].error, light_off(&light, &how, up, &rng));
        }
    }
    extremes_judge("diffuse light: degrees of the sun above the surface, error against long double", "levels",
                   rows, ROWS, 1.5, 0.5, 1);
}

/* The viewer comes down to a texel, where the direction to it is left to float's rounding of 16 texels: 1e-6
 * m. It grows as that over the distance, and with the exponent. */
static void error_towards_the_viewer(void **state)
{
    (void)state;
    enum { ROWS = 21 };
    struct extremes_row rows[ROWS];
    static const int16_t up[4] = {0, 0, 32767, 32767};
    struct sv_light light;
    sv_light_from_sun(&(struct sv_sun){1, 0.7}, &light);
    for (int k = 0; k < ROWS; k++) {
        double near = pow(10, 3 - 0.5 * k);
        struct sv_rng rng = sv_rng_seeded(EXTREMES_SEED, 9000 + (uint64_t)k);
        rows[k] = (struct extremes_row){near, 0};
        for (int n = 0; n < 400; n++) {
            struct sv_relief_light how = {.light = &light,
                                          .frame = LEVEL,
                                          .has_viewer = true,
                                          .specular = 0.5f,
                                          .shininess = n & 1 ? 200 : 5};
            /* one after the other: compilers differ in which argument of a call comes first */
            double elevation = sv_rng_range(&rng, 0.1, 1.5), azimuth = sv_rng_range(&rng, 0, 7);
            struct sv_vec3 to = sv_direction(azimuth, elevation);
            how.eye = sv_madd(sv_vec3((int)sv_rng_range(&rng, 0, 16) + 0.5, 0.5, 0), to, near);
            rows[k].error = fmax(rows[k].error, light_off(&light, &how, up, &rng));
        }
    }
    extremes_judge("specular light: m from the viewer to a texel, error against long double", "levels", rows,
                   ROWS, 10, 0.5, 256);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tiny_quarters_agree),      cmocka_unit_test(extreme_inputs),
        cmocka_unit_test(error_towards_the_cliff),  cmocka_unit_test(error_towards_grazing_light),
        cmocka_unit_test(error_towards_the_viewer),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
