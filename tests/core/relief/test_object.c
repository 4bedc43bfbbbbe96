/* test_object.c - relief objects against the same mesh ray cast (tests/experiments/object_truth.h): orbits
 * without cracks and without popping, shadows of the faces on themselves and on each other, the store.
 *
 * SV_SHEETS names a folder: each body's orbit is then written there as one PPM, ours beside the truth. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/base/color.h"
#include "core/base/frames.h"
#include "core/base/rng.h"
#include "core/gl/context.h"
#include "core/relief/object.h"
#include "core/base/simd.h"
#include "core/relief/object_lookup.h"
#include "core/relief/object_shadow.h"
#include "core/relief/object_splat_kernel.h"
#include "tests/experiments/object_kit.h"
#include "tests/experiments/object_truth.h"

enum { RESOLUTION = 128, SIDE = 192, STEPS = 36, LEVELS = 3 };
static const double ELEVATION_DEG[LEVELS] = {-8, 22, 58};
static const struct sv_relief_place PLACE = {{512345.5, 6012345.25, 37}, 12, 0.35};

struct body {
    struct sv_tree_mesh mesh;
    struct sv_relief_object object;
    struct sv_relief_look *look;
    struct object_truth *truth;
};

static struct body bodies[OBJECT_KIT_COUNT];

static int set_up(void **state)
{
    (void)state;
    struct sv_gl_context *context;
    struct sv_error error = {0};
    sv_color_init();
    if (sv_gl_context_create(&context, &error) != SV_OK)
        fail_msg("%s", error.message);
    for (int k = 0; k < OBJECT_KIT_COUNT; k++) {
        struct body *b = &bodies[k];
        b->mesh = object_kit_make((enum object_kit_body)k);
        if (sv_relief_object_bake(&b->mesh, RESOLUTION, &b->object, &error) != SV_OK ||
            sv_relief_look_create(&b->object, &b->look, &error) != SV_OK)
            fail_msg("%s: %s", error.field, error.message);
        b->truth = object_truth_create(&b->mesh);
    }
    sv_gl_context_destroy(context);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    for (int k = 0; k < OBJECT_KIT_COUNT; k++) {
        object_truth_destroy(bodies[k].truth);
        sv_relief_look_destroy(bodies[k].look);
        sv_relief_object_finish(&bodies[k].object);
        sv_tree_mesh_finish(&bodies[k].mesh);
    }
    return 0;
}

/* A camera that looks at the object's middle from outside; the object fills most of the picture. */
static struct sv_camera orbit_camera(const struct sv_relief_object *object, double azimuth, double elevation,
                                     int side)
{
    struct sv_camera c = {.vfov_rad = 0.5, .width = side, .height = side, .near_m = 0.1};
    struct sv_vec3 size = sv_sub(object->box_max, object->box_min);
    double reach = 0.5 * sv_length(size) * PLACE.height_m / sin(0.25) * 1.02;
    struct sv_vec3 to = sv_vec3(cos(elevation) * sin(azimuth), cos(elevation) * cos(azimuth), sin(elevation));
    struct sv_vec3 middle = sv_madd(PLACE.place, sv_vec3(0, 0, 1), 0.5 * PLACE.height_m);
    c.eye = sv_madd(middle, to, reach);
    sv_camera_aim(&c, azimuth + SV_PI, -elevation, 0);
    return c;
}

struct picture {
    uint8_t (*rgba)[4], (*true_rgba)[4];
    float *depth, *true_depth; /* m; INFINITY: nothing */
};

static void *must(void *memory)
{
    assert_non_null(memory);
    return memory;
}

static struct picture picture_make(size_t n)
{
    struct picture p = {must(calloc(n, 4)), must(calloc(n, 4)), must(calloc(n, 4)), must(calloc(n, 4))};
    return p;
}

static void picture_free(struct picture *p)
{
    free(p->rgba);
    free(p->true_rgba);
    free(p->depth);
    free(p->true_depth);
}

static void draw(const struct body *b, const struct sv_camera *camera, const struct sv_light *light,
                 struct sv_warp_buffer *buffer, struct picture *p)
{
    struct sv_relief_look_options options = {
        .shadow = SV_RELIEF_SHADOW_ROW_FRONT, .lit = true, .shade_height_m = -INFINITY};
    struct sv_error error = {0};
    const struct sv_warp_source *sources = NULL;
    struct sv_warp_stats stats = {0};
    unsigned count = 0, faces = sv_relief_object_faces(&b->object, &PLACE, camera);
    if (sv_relief_look_light(b->look, &PLACE, light, &options, faces, &error) != SV_OK ||
        sv_relief_look_warp(b->look, &PLACE, camera, 0, 0, faces, buffer, &sources, &count, &stats, &error) !=
            SV_OK)
        fail_msg("%s: %s", error.field, error.message);
    size_t n = (size_t)buffer->width * (size_t)buffer->height;
    memset(p->rgba, 0, 4 * n);
    sv_warp_resolve(sources, count, buffer, p->rgba);
    for (size_t i = 0; i < n; i++) {
        bool held = buffer->texel[i] != SV_WARP_EMPTY;
        p->depth[i] = held ? (float)(camera->near_m / (double)buffer->depth[i]) : INFINITY;
        if (!held)
            memset(p->rgba[i], 0, 4);
    }
    object_truth_draw(b->truth, &PLACE, camera, light, true, p->true_depth, p->true_rgba);
}

struct judged {
    long inside, empty, isolated, outside, outline, deep;
    double error;
};

/* inside: the truth and its eight neighbours hit, so that an outline half a texel off is no crack. */
static void judge(const struct picture *p, int side, float deep_m, struct judged *sum)
{
    for (int j = 1; j + 1 < side; j++)
        for (int i = 1; i + 1 < side; i++) {
            size_t at = (size_t)(j * side + i);
            int near_hits = 0;
            for (int y = -1; y <= 1; y++)
                for (int x = -1; x <= 1; x++)
                    near_hits += isfinite(p->true_depth[at + (size_t)(y * side + x)]);
            bool held = isfinite(p->depth[at]);
            sum->outline += near_hits > 0 && near_hits < 9;
            sum->outside += near_hits == 0 && held;
            if (near_hits < 9)
                continue;
            sum->inside++;
            sum->empty += !held;
            sum->isolated += !held && isfinite(p->depth[at - 1]) && isfinite(p->depth[at + 1]) &&
                             isfinite(p->depth[at - (size_t)side]) && isfinite(p->depth[at + (size_t)side]);
            sum->deep += held && p->depth[at] > p->true_depth[at] + deep_m;
            for (int c = 0; c < 3 && held; c++)
                sum->error += abs(p->rgba[at][c] - p->true_rgba[at][c]) / 3.0;
        }
}

/* Mean change a pixel between two pictures, alpha counted: what a viewer of the orbit sees move. */
static double change(const uint8_t (*a)[4], const uint8_t (*b)[4], size_t n)
{
    double sum = 0;
    for (size_t i = 0; i < n; i++)
        for (int c = 0; c < 3; c++)
            sum += abs((a[i][3] ? a[i][c] : 160) - (b[i][3] ? b[i][c] : 160));
    return sum / (3.0 * (double)n);
}

/* Every fourth step of each elevation, ours above the truth. */
static void add_to_sheet(uint8_t *sheet, int level, int step, const struct picture *p)
{
    if (step % 4)
        return;
    for (int k = 0; k < 2; k++)
        for (int j = 0; j < SIDE; j++)
            for (int i = 0; i < SIDE; i++) {
                const uint8_t *from = k ? p->true_rgba[j * SIDE + i] : p->rgba[j * SIDE + i];
                size_t row = (size_t)((2 * level + k) * SIDE + j), width = STEPS / 4 * SIDE;
                uint8_t *to = sheet + 3 * (row * width + (size_t)(step / 4 * SIDE + i));
                for (int c = 0; c < 3; c++)
                    to[c] = from[3] ? from[c] : 160;
            }
}

static void write_sheet(const char *name, const uint8_t *sheet)
{
    char path[512];
    const char *folder = getenv("SV_SHEETS");
    if (!folder)
        return;
    snprintf(path, sizeof path, "%s/orbit_%s.ppm", folder, name);
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    fprintf(f, "P6 %d %d 255\n", STEPS / 4 * SIDE, 2 * LEVELS * SIDE);
    fwrite(sheet, 3, (size_t)(STEPS / 4 * SIDE) * (size_t)(2 * LEVELS * SIDE), f);
    assert_int_equal(fclose(f), 0);
}

/* What of a body six views can know differs: `deep` (a surface missed, another seen through it) and `outside`
 * (more than there is) as shares of the inside. */
static const struct {
    double deep, outside, error;
} BOUNDS[OBJECT_KIT_COUNT] = {
    [OBJECT_KIT_SPHERE] = {0.001, 0.001, 5}, [OBJECT_KIT_BOX] = {0.001, 0.001, 5},
    [OBJECT_KIT_TORUS] = {0.002, 0.005, 7},  [OBJECT_KIT_COURTYARD] = {0.005, 0.001, 7},
    [OBJECT_KIT_KNOT] = {0.04, 0.03, 11},    [OBJECT_KIT_URN] = {0.01, 0.01, 8}};

static void orbit(int body)
{
    const struct body *b = &bodies[body];
    struct sv_warp_buffer buffer;
    assert_int_equal(sv_warp_buffer_create(SIDE, SIDE, &buffer, NULL), SV_OK);
    const size_t n = (size_t)SIDE * SIDE;
    struct picture now = picture_make(n), before = picture_make(n);
    uint8_t *sheet = must(calloc(3 * n, STEPS / 4 * 2 * LEVELS));
    const struct sv_sun sun = {2.4, 0.75};
    struct sv_light light;
    sv_light_from_sun(&sun, &light);
    struct judged sum = {0};
    double worst_ratio = 0, worst_change = 0;
    for (int level = 0; level < LEVELS; level++)
        for (int step = 0; step <= STEPS; step++) {
            struct sv_camera camera = orbit_camera(&b->object, 2 * SV_PI * (step + 0.3) / STEPS,
                                                   sv_radians(ELEVATION_DEG[level]), SIDE);
            draw(b, &camera, &light, &buffer, &now);
            if (step > 0) {
                double ours = change((const uint8_t(*)[4])now.rgba, (const uint8_t(*)[4])before.rgba, n);
                double truth =
                    change((const uint8_t(*)[4])now.true_rgba, (const uint8_t(*)[4])before.true_rgba, n);
                worst_ratio = fmax(worst_ratio, ours / truth);
                worst_change = fmax(worst_change, ours);
            }
            if (step < STEPS) {
                judge(&now, SIDE, (float)(3 * b->object.texel * PLACE.height_m), &sum);
                add_to_sheet(sheet, level, step, &now);
            }
            struct picture swap = now;
            now = before;
            before = swap;
        }
    write_sheet(object_kit_names[body], sheet);
    double inside = (double)sum.inside;
    printf("%-9s inside %ld: empty %ld (%.4f %%), isolated %ld, seen through %.3f %%, beyond the outline "
           "%.3f %%, mean "
           "error %.2f levels; adjacent steps change at most %.2f levels, at most %.3f of the truth's\n",
           object_kit_names[body], sum.inside, sum.empty, 100 * (double)sum.empty / inside, sum.isolated,
           100 * (double)sum.deep / inside, 100 * (double)sum.outside / inside, sum.error / inside,
           worst_change, worst_ratio);
    assert_true((double)sum.empty < 0.001 * inside);
    assert_int_equal(sum.isolated, 0);
    assert_true((double)sum.deep <= BOUNDS[body].deep * inside);
    assert_true((double)sum.outside <= BOUNDS[body].outside * inside);
    assert_true(sum.error / inside <= BOUNDS[body].error);
    assert_true(worst_ratio < 1.25);
    free(sheet);
    picture_free(&now);
    picture_free(&before);
    sv_warp_buffer_finish(&buffer);
}

static void test_orbits(void **state)
{
    (void)state;
    for (int k = 0; k < OBJECT_KIT_COUNT; k++)
        orbit(k);
}

static struct sv_vec3 texel_normal(const struct sv_relief *r, size_t k)
{
    struct sv_vec3 a = sv_normalize(r->frame.a), b = sv_normalize(r->frame.b);
    struct sv_vec3 n = sv_add(sv_scale(a, r->normal[k][0]), sv_scale(b, r->normal[k][1]));
    return sv_normalize(sv_madd(n, r->frame.f, r->normal[k][2]));
}

struct sheets {
    struct sv_relief sheet[SV_RELIEF_SHEETS];
    uint8_t *lit[SV_RELIEF_SHEETS];
    struct sv_relief_shade *shade;
};

/* The sheets as a look has them: alpha 0 where not kept. */
static struct sheets sheets_make(const struct sv_relief_object *object)
{
    struct sheets s;
    for (int k = 0; k < SV_RELIEF_SHEETS; k++) {
        s.sheet[k] = *sv_relief_sheet(object, k);
        size_t texels = (size_t)s.sheet[k].width * (size_t)s.sheet[k].height;
        s.lit[k] = must(malloc(texels));
        s.sheet[k].color = must(malloc(4 * texels));
        memcpy(s.sheet[k].color, sv_relief_sheet(object, k)->color, 4 * texels);
        for (size_t i = 0; k < SV_RELIEF_FACES && i < texels; i++)
            s.sheet[k].color[i][3] = object->keep[k][i] ? s.sheet[k].color[i][3] : 0;
    }
    assert_int_equal(sv_relief_shade_create(object, &s.shade, NULL), SV_OK);
    return s;
}

static void sheets_free(struct sheets *s)
{
    for (int k = 0; k < SV_RELIEF_SHEETS; k++) {
        free(s->lit[k]);
        free(s->sheet[k].color);
    }
    sv_relief_shade_destroy(s->shade);
}

/* Kept texels of the six faces that turn to the sun by more than 6 degrees: the rest is dark by n.l itself.
 */
static void judge_shadow(const struct body *b, const struct sheets *s, struct sv_vec3 to_sun, long *judged,
                         long *dark, long *light)
{
    for (int k = 0; k < SV_RELIEF_FACES; k++) {
        const struct sv_relief *r = &s->sheet[k];
        for (size_t i = 0; i < (size_t)r->width * (size_t)r->height; i++) {
            if (!sv_relief_solid(r, i))
                continue;
            struct sv_vec3 n = texel_normal(r, i);
            if (sv_dot(n, to_sun) < 0.1)
                continue;
            struct sv_vec3 at = sv_relief_point(&r->frame, (double)(i % (size_t)r->width) + 0.5,
                                                (double)(i / (size_t)r->width) + 0.5, (double)r->displ[i]);
            bool sees = object_truth_sunlit(b->truth, at, n, to_sun, 0.25 * b->object.texel);
            ++*judged;
            *dark += sees && s->lit[k][i] < 128;
            *light += !sees && s->lit[k][i] >= 128;
        }
    }
}

/* Convex bodies: no texel that the sun reaches is dark. Others: 97 % of texels agree with rays. */
static void test_shadows(void **state)
{
    (void)state;
    static const double SUN_DEG[] = {5, 15, 30, 45, 60, 75, 90};
    const char *wish = getenv("SV_TEST_FULL");
    bool full = wish && strcmp(wish, "1") == 0;
    for (int body = 0; body < OBJECT_KIT_COUNT; body++) {
        const struct body *b = &bodies[body];
        struct sheets s = sheets_make(&b->object);
        for (int form = SV_RELIEF_SHADOW_LINE_SWEEP; form <= SV_RELIEF_SHADOW_ROW_FRONT; form++) {
            long judged = 0, dark = 0, light = 0;
            double worst = 0;
            for (size_t e = 0; e < sizeof SUN_DEG / sizeof *SUN_DEG; e++)
                for (int azimuth = 0; azimuth < 360; azimuth += full ? 45 : 120) {
                    double az = sv_radians(azimuth + (e & 1 ? 17 : 0)), el = sv_radians(SUN_DEG[e]);
                    struct sv_vec3 to_sun = sv_vec3(cos(el) * sin(az), cos(el) * cos(az), sin(el));
                    long judged0 = judged, wrong0 = dark + light;
                    assert_int_equal(sv_relief_shade_light(s.shade, s.sheet, to_sun,
                                                           (enum sv_relief_shadow_form)form, 63, NULL, s.lit,
                                                           NULL),
                                     SV_OK);
                    judge_shadow(b, &s, to_sun, &judged, &dark, &light);
                    worst =
                        fmax(worst, (double)(dark + light - wrong0) / fmax(1, (double)(judged - judged0)));
                }
            double total = (double)judged;
            bool front = form == SV_RELIEF_SHADOW_ROW_FRONT;
            printf("%-9s %s: of %ld sunward texels %.3f %% dark by mistake, %.3f %% lit by mistake; worst "
                   "sun %.2f %%\n",
                   object_kit_names[body], front ? "row front " : "line sweep", judged,
                   100 * (double)dark / total, 100 * (double)light / total, 100 * worst);
            if (body == OBJECT_KIT_SPHERE || body == OBJECT_KIT_BOX)
                assert_true((double)dark <= (front ? 0 : 0.02) * total);
            assert_true(!front || (double)(dark + light) <= 0.03 * total);
        }
        sheets_free(&s);
    }
}

/* faces and spans leave out nothing that faces the eye: every kept texel whose normal is towards it is in. */
static void test_faces(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(5, 0);
    long checked = 0, spared = 0;
    for (int round = 0; round < 60; round++) {
        const struct body *b = &bodies[round % OBJECT_KIT_COUNT];
        bool is_place = round % 3 != 0;
        struct sv_vec3 eye =
            sv_vec3(sv_rng_range(&rng, -1, 1), sv_rng_range(&rng, -1, 1), sv_rng_range(&rng, -1, 1));
        eye = is_place ? sv_madd(sv_vec3(0, 0, 0.5), eye, exp(sv_rng_range(&rng, -1, 3))) : sv_normalize(eye);
        unsigned faces = sv_relief_object_seen_from(&b->object, eye, is_place);
        for (int k = 0; k < SV_RELIEF_SHEETS; k++) {
            const struct sv_relief *r = sv_relief_sheet(&b->object, k);
            struct sv_relief_span *spans =
                must(malloc((size_t)sv_relief_object_spans_max(&b->object) * sizeof *spans));
            uint8_t *in = must(calloc((size_t)r->width, (size_t)r->height));
            int count = sv_relief_object_spans(&b->object, k, eye, is_place, spans);
            spared += r->width * r->height;
            for (int s = 0; s < count; s++)
                for (int j = spans[s].row0; j < spans[s].row1; j++)
                    for (int i = spans[s].column0; i < spans[s].column1; i++, spared--)
                        in[j * r->width + i] = 1;
            for (int j = 0; j < r->height; j++)
                for (int i = 0; i < r->width; i++) {
                    size_t t = (size_t)j * (size_t)r->width + (size_t)i;
                    if (!sv_relief_solid(r, t) || (k < SV_RELIEF_FACES && !b->object.keep[k][t]))
                        continue;
                    struct sv_vec3 at = sv_relief_point(&r->frame, i + 0.5, j + 0.5, (double)r->displ[t]);
                    if (!(sv_dot(texel_normal(r, t), is_place ? sv_sub(eye, at) : eye) > 0))
                        continue;
                    checked++;
                    assert_true(in[t]);
                    assert_true(faces >> k % SV_RELIEF_FACES & 1);
                }
            free(in);
            free(spans);
        }
    }
    printf("faces: %ld texels towards eyes, all in; %ld texels spared\n", checked, spared);
    assert_true(spared > 0);
}

/* Kernels of the look-up: the same bits, at every count, with every kind of number in them. */
static void test_lookup_avx2(void **state)
{
    (void)state;
    if (sv_simd_level() < SV_SIMD_AVX2) {
        printf("skipped: no AVX2 here\n");
        skip();
    }
    enum { MAP = 40, LEAST = 8, MOST = 67 };
    static const float ODD[] = {NAN, INFINITY, -INFINITY, 1e-40f, -0.0f, 3e38f, -3e38f, 0};
    struct sv_rng rng = sv_rng_seeded(21, 0);
    float *map = must(malloc(MAP * MAP * sizeof *map));
    long shaded = 0, part = 0;
    for (int round = 0; round < 3000; round++) {
        int n = LEAST + round % (MOST - LEAST);
        /* Exactly as much as is named, so that a read beyond is seen by the address sanitizer. */
        struct sv_relief_lookup_sheet sheet = {.width = n};
        struct sv_relief_lookup how = {.depth = map, .width = MAP, .height = MAP, .low = 0.1f, .high = 0.5f};
        int16_t *normal[3];
        float *displ = must(malloc((size_t)n * 4 + 1)), *incoming = must(malloc((size_t)n * 4 + 1));
        uint8_t(*color)[4] = must(malloc((size_t)n * 4 + 1)), *a = must(malloc((size_t)n + 1)),
        *b = must(malloc((size_t)n + 1));
        for (int k = 0; k < 3; k++) {
            sheet.normal[k] = normal[k] = must(malloc((size_t)n * 2 + 1));
            how.sun[k] = (float)sv_rng_range(&rng, -1, 1);
            for (int c = 0; c < 3; c++) {
                how.at[k][c] = (float)sv_rng_range(&rng, -0.5, 1);
                how.offset[k][c] = (float)sv_rng_range(&rng, -1, 1) / 32767;
            }
            how.at[k][3] = k < 2 ? (float)sv_rng_range(&rng, -5, 10) : 0;
        }
        for (int i = 0; i < MAP * MAP; i++)
            map[i] = (float)sv_rng_range(&rng, -20, 40);
        for (int i = 0; i < n; i++) {
            for (int k = 0; k < 3; k++)
                normal[k][i] = (int16_t)(sv_rng_next(&rng) >> 48);
            bool odd = sv_rng_unit(&rng) < 0.05;
            displ[i] = odd ? ODD[sv_rng_next(&rng) >> 61] : (float)sv_rng_range(&rng, -3, 3);
            incoming[i] = sv_rng_unit(&rng) < 0.05 ? ODD[sv_rng_next(&rng) >> 61]
                                                   : displ[i] + (float)sv_rng_range(&rng, -1, 1);
            memset(color[i], sv_rng_unit(&rng) < 0.8 ? 255 : 100, 4);
        }
        sheet.displ = displ;
        sheet.incoming = round & 1 ? incoming : NULL;
        sheet.color = (const uint8_t(*)[4])color;
        struct sv_relief_eight list[SV_RELIEF_LIST_ROOM];
        int first = 0, count = sv_relief_list_eights(NULL, n, 1, &first, list);
        sheet.lit = a;
        sv_relief_lookup_scalar(&how, &sheet, list, count);
        sheet.lit = b;
        sv_relief_lookup_avx2(&how, &sheet, list, count);
        assert_memory_equal(a, b, (size_t)n);
        for (int i = 0; i < n; i++) {
            shaded += color[i][3] == 255 && a[i] == 0;
            part += a[i] > 0 && a[i] < 255;
        }
        for (int k = 0; k < 3; k++)
            free(normal[k]);
        free(displ);
        free(incoming);
        free(color);
        free(a);
        free(b);
    }
    printf("look-up: the same bits; %ld texels in shade, %ld partly\n", shaded, part);
    assert_true(part > 1000);
    free(map);
}

/* Layout: square texels, the box covered by less than a texel too much, f outward. */
static void test_layout(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(8, 0);
    for (int round = 0; round < 500; round++) {
        struct sv_relief_object o = {0};
        struct sv_vec3 lo = sv_vec3(sv_rng_range(&rng, -2, 0), sv_rng_range(&rng, -2, 0), 0);
        struct sv_vec3 size =
            sv_vec3(exp(sv_rng_range(&rng, -6, 1)), exp(sv_rng_range(&rng, -6, 1)), round % 5);
        int resolution = 8 + (int)(sv_rng_unit(&rng) * 2040);
        assert_int_equal(sv_relief_object_set_box(&o, lo, sv_add(lo, size), resolution, SV_EINVAL, NULL),
                         SV_OK);
        int longest = 0;
        for (int k = 0; k < SV_RELIEF_FACES; k++) {
            struct sv_relief_frame f;
            int width, height;
            sv_relief_object_face_layout(&o, k, o.texel, &f, &width, &height);
            assert_int_equal(sv_relief_frame_check(&f, NULL), SV_OK);
            longest = width > longest ? width : height > longest ? height : longest;
            for (int corner = 0; corner < 8; corner++) {
                struct sv_vec3 p =
                    sv_vec3(corner & 1 ? o.box_max.x : o.box_min.x, corner & 2 ? o.box_max.y : o.box_min.y,
                            corner & 4 ? o.box_max.z : o.box_min.z);
                double u, v, d;
                sv_relief_locate(&f, p, &u, &v, &d);
                assert_true(u > -1e-5 && u < width + 1e-5 && v > -1e-5 && v < height + 1e-5 && d < 1e-9);
                assert_true(fmin(u, width - u) <= 0.5 + 1e-5 && fmin(v, height - v) <= 0.5 + 1e-5);
            }
        }
        assert_int_equal(longest, resolution);
    }
    struct sv_relief_object o;
    struct sv_error error;
    const struct sv_vec3 zero = {0, 0, 0}, one = {1, 1, 1}, odd = {1, NAN, 1};
    assert_int_equal(sv_relief_object_set_box(&o, zero, one, 7, SV_EINVAL, &error), SV_EINVAL);
    assert_string_equal(error.field, "resolution");
    assert_int_equal(sv_relief_object_set_box(&o, zero, odd, 8, SV_EINVAL, &error), SV_EINVAL);
    assert_int_equal(sv_relief_object_set_box(&o, zero, zero, 8, SV_EINVAL, &error), SV_EINVAL);
    assert_int_equal(sv_relief_object_set_box(&o, one, zero, 8, SV_EINVAL, &error), SV_EINVAL);
}

static void same_object(const struct sv_relief_object *a, const struct sv_relief_object *b)
{
    for (int k = 0; k < SV_RELIEF_SHEETS; k++) {
        const struct sv_relief *r = sv_relief_sheet(a, k), *s = sv_relief_sheet(b, k);
        size_t texels = (size_t)r->width * (size_t)r->height;
        assert_int_equal(r->width, s->width);
        assert_int_equal(r->height, s->height);
        assert_memory_equal(&r->frame, &s->frame, sizeof r->frame);
        assert_memory_equal(r->displ, s->displ, texels * 4);
        assert_memory_equal(r->color, s->color, texels * 4);
        assert_memory_equal(r->normal, s->normal, texels * 8);
        assert_int_equal(r->solid_count, s->solid_count);
    }
}

static void test_store(void **state)
{
    (void)state;
    const struct sv_relief_object *o = &bodies[OBJECT_KIT_COURTYARD].object;
    struct sv_relief_object again;
    struct sv_error error;
    void *data;
    size_t bytes;
    assert_int_equal(sv_relief_object_save(o, &data, &bytes, NULL), SV_OK);
    assert_int_equal(sv_relief_object_load(data, bytes, &again, NULL), SV_OK);
    same_object(o, &again);
    sv_relief_object_finish(&again);
    /* Any byte changed, any length cut: refused with a reason. */
    struct sv_rng rng = sv_rng_seeded(11, 0);
    for (int k = 0; k < 300; k++) {
        uint8_t *at = (uint8_t *)data + (k < 100 ? (size_t)k : (size_t)(sv_rng_unit(&rng) * (double)bytes));
        *at ^= 0x40;
        memset(&error, 0, sizeof error);
        assert_int_equal(sv_relief_object_load(data, bytes, &again, &error), SV_EFORMAT);
        assert_true(error.message[0] != 0);
        *at ^= 0x40;
        size_t shorter = (size_t)(sv_rng_unit(&rng) * (double)bytes);
        assert_int_equal(sv_relief_object_load(data, shorter, &again, NULL), SV_EFORMAT);
    }
    assert_int_equal(sv_relief_object_load(NULL, 0, &again, NULL), SV_EFORMAT);
    free(data);
}

/* The second call reads what the first one wrote: no GL context is there by now, so a bake would fail. */
static void test_obtain(void **state)
{
    (void)state;
    char folder[] = "/tmp/sv_object_XXXXXX";
    struct sv_store *store;
    struct sv_gl_context *context;
    struct sv_relief_object first, second;
    assert_non_null(mkdtemp(folder));
    assert_int_equal(sv_store_open(folder, 64 << 20, &store, NULL), SV_OK);
    const struct sv_tree_mesh *mesh = &bodies[OBJECT_KIT_TORUS].mesh;
    assert_int_equal(sv_gl_context_create(&context, NULL), SV_OK);
    assert_int_equal(sv_relief_object_obtain(mesh, 77, 40, store, &first, NULL), SV_OK);
    sv_gl_context_destroy(context);
    const struct sv_tree_mesh none = {0}; /* cannot be baked */
    assert_int_equal(sv_relief_object_obtain(&none, 77, 40, store, &second, NULL), SV_OK);
    same_object(&first, &second);
    sv_relief_object_finish(&second);
    assert_int_equal(sv_relief_object_obtain(&none, 77, 41, store, &second, NULL), SV_EINVAL);
    assert_int_equal(sv_relief_object_obtain(&none, 78, 40, store, &second, NULL), SV_EINVAL);
    assert_int_equal(sv_relief_object_obtain(&none, 77, 40, NULL, &second, NULL), SV_EINVAL);
    sv_relief_object_finish(&first);
    sv_store_close(store);
    char command[64];
    snprintf(command, sizeof command, "rm -r %s", folder);
    assert_int_equal(system(command), 0);
}

/* The shade of the surroundings rises through a box: above it nothing changes, below it the sun is gone, and
 * the brightness of a row never jumps by more than the fade's slope. */
static void test_shade_height(void **state)
{
    (void)state;
    const struct body *b = &bodies[OBJECT_KIT_BOX];
    struct sv_warp_buffer buffer;
    assert_int_equal(sv_warp_buffer_create(SIDE, SIDE, &buffer, NULL), SV_OK);
    struct sv_light light;
    const struct sv_sun sun = {0.4, 0.5};
    sv_light_from_sun(&sun, &light);
    struct sv_camera camera = orbit_camera(&b->object, 0.35, 0, SIDE);
    double mean[3];
    for (int k = 0; k < 3; k++) { /* no shade, half, all */
        const double heights[3] = {-INFINITY, PLACE.place.z + 0.5 * PLACE.height_m, INFINITY};
        struct sv_relief_look_options options = {.lit = true, .shade_height_m = heights[k]};
        const struct sv_warp_source *sources;
        struct sv_warp_stats stats = {0};
        unsigned count, faces = sv_relief_object_faces(&b->object, &PLACE, &camera);
        uint8_t(*rgba)[4] = must(calloc((size_t)SIDE * SIDE, 4));
        assert_int_equal(sv_relief_look_light(b->look, &PLACE, &light, &options, faces, NULL), SV_OK);
        assert_int_equal(sv_relief_look_warp(b->look, &PLACE, &camera, 0, 0, faces, &buffer, &sources, &count,
                                             &stats, NULL),
                         SV_OK);
        sv_warp_resolve(sources, count, &buffer, rgba);
        double sum = 0;
        long held = 0;
        for (int i = 0; i < SIDE * SIDE; i++)
            if (buffer.texel[i] != SV_WARP_EMPTY)
                sum += rgba[i][1], held++;
        mean[k] = sum / (double)held;
        free(rgba);
    }
    printf("shade height: mean level %.1f in the sun, %.1f half in shade, %.1f in shade\n", mean[0], mean[1],
           mean[2]);
    assert_true(mean[2] < 0.7 * mean[0]);
    assert_true(fabs(mean[1] - 0.5 * (mean[0] + mean[2])) < 0.05 * mean[0]);
    sv_warp_buffer_finish(&buffer);
}

static void test_refusals(void **state)
{
    (void)state;
    const struct body *b = &bodies[OBJECT_KIT_BOX];
    struct sv_light light;
    const struct sv_sun sun = {0.4, 0.5};
    sv_light_from_sun(&sun, &light);
    struct sv_relief_look_options options = {.lit = true, .shininess = 1};
    struct sv_error error;
    struct sv_relief_place place = PLACE;
    place.height_m = 0;
    assert_int_equal(sv_relief_look_light(b->look, &place, &light, &options, 63, &error), SV_EINVAL);
    assert_string_equal(error.field, "place.height_m");
    place = PLACE;
    place.place.x = NAN;
    assert_int_equal(sv_relief_look_light(b->look, &place, &light, &options, 63, &error), SV_EINVAL);
    options.specular = 2;
    assert_int_equal(sv_relief_look_light(b->look, &PLACE, &light, &options, 63, &error), SV_EINVAL);
    assert_string_equal(error.field, "specular");
    struct sv_camera camera = orbit_camera(&b->object, 0, 0, 512);
    camera.eye = sv_madd(PLACE.place, sv_vec3(0, 0, 1), 6); /* inside of the body */
    assert_true(sv_relief_object_texel_px(&b->object, &PLACE, &camera) > 100);
    assert_true(sv_relief_object_faces(&b->object, &PLACE, &camera) <= 63);
}

/* All sheets of a body as a camera of model space sees them, at one SIMD level. */
static void splat_all(const struct sv_relief_object *object, const struct sv_camera *camera,
                      enum sv_simd level, struct sv_warp_buffer *buffer, struct sv_warp_stats *stats)
{
    struct sv_relief_span *spans = malloc((size_t)sv_relief_object_spans_max(object) * sizeof *spans);
    assert_non_null(spans);
    sv_warp_clear(buffer);
    for (int k = 0; k < SV_RELIEF_SHEETS; k++) {
        const struct sv_relief *r = sv_relief_sheet(object, k);
        int count = sv_relief_object_spans(object, k, camera->eye, true, spans);
        struct sv_warp_source source = {.width = r->width,
                                        .height = r->height,
                                        .t = r->displ,
                                        .color = (const uint8_t(*)[4])r->color,
                                        .cut = r->cut};
        if (count == 0)
            continue;
        struct sv_relief_facing facing = sv_relief_object_facing(object, k, camera->eye, true);
        sv_warp_map_from_camera(&r->frame, camera, 0, 0, &source.map);
        sv_relief_splat_at(level, &source, (unsigned)k, object->rims[k], &facing, spans, count, buffer,
                           stats);
    }
    free(spans);
}

/* Levels draw the same bits, from cells of a tenth of a pixel to cells of fifty, cut by the picture's edges.
 */
static void test_levels(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(77, 0);
    uint64_t pixels = 0;
    for (int round = 0; round < 60; round++) {
        const struct sv_relief_object *object = &bodies[round % OBJECT_KIT_COUNT].object;
        double azimuth = 2 * SV_PI * sv_rng_unit(&rng), elevation = SV_PI * (sv_rng_unit(&rng) - 0.5);
        double distance = 1.1 * pow(10, sv_rng_unit(&rng));
        struct sv_camera camera = {.vfov_rad = 0.4, .width = 203, .height = 150, .near_m = 0.01};
        struct sv_warp_buffer first, other;
        camera.eye = sv_madd(sv_vec3(0, 0, 0.5), sv_direction(azimuth, elevation), distance);
        sv_camera_aim(&camera, azimuth + SV_PI, -elevation, 0);
        assert_int_equal(sv_warp_buffer_create(203, 150, &first, NULL), SV_OK);
        assert_int_equal(sv_warp_buffer_create(203, 150, &other, NULL), SV_OK);
        struct sv_warp_stats of_first = {0};
        splat_all(object, &camera, SV_SIMD_SCALAR, &first, &of_first);
        for (int level = SV_SIMD_SSE2; level <= (int)sv_simd_level(); level++) {
            struct sv_warp_stats stats = {0};
            splat_all(object, &camera, (enum sv_simd)level, &other, &stats);
            assert_memory_equal(&stats, &of_first, sizeof stats);
            for (size_t p = 0; p < (size_t)203 * 150; p++) {
                assert_memory_equal(&first.depth[p], &other.depth[p], sizeof(float));
                assert_int_equal(first.texel[p], other.texel[p]);
                assert_true(first.texel[p] == SV_WARP_EMPTY || first.place[p] == other.place[p]);
            }
        }
        pixels += of_first.pixels;
        sv_warp_buffer_finish(&first);
        sv_warp_buffer_finish(&other);
    }
    printf("levels: the same bits, %llu pixels\n", (unsigned long long)pixels);
    assert_true(pixels > 100000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_layout),       cmocka_unit_test(test_faces),
        cmocka_unit_test(test_store),        cmocka_unit_test(test_obtain),
        cmocka_unit_test(test_shade_height), cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_lookup_avx2),  cmocka_unit_test(test_orbits),
        cmocka_unit_test(test_shadows),      cmocka_unit_test(test_levels),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
