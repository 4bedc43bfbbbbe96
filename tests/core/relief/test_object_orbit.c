/* test_object_orbit.c - pictures of relief objects against the same mesh ray cast
 * (tests/experiments/object_truth.h): orbits without cracks and without popping, shadows of the faces on
 * themselves and on each other.
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

#include "core/base/frames.h"
#include "core/relief/object_shadow.h"
#include "tests/core/relief/object_bodies.h"

enum { SIDE = 192, STEPS = 36, LEVELS = 3 };
static const double ELEVATION_DEG[LEVELS] = {-8, 22, 58};

struct picture {
    uint8_t (*rgba)[4], (*true_rgba)[4];
    float *depth, *true_depth; /* m; INFINITY: nothing */
};

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
    unsigned count = 0, faces = sv_relief_object_faces(&b->object, &BODIES_PLACE, camera);
    if (sv_relief_look_light(b->look, &BODIES_PLACE, light, &options, faces, &error) != SV_OK ||
        sv_relief_look_warp(b->look, &BODIES_PLACE, camera, 0, 0, faces, buffer, &sources, &count, &stats,
                            &error) != SV_OK)
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
    object_truth_draw(b->truth, &BODIES_PLACE, camera, light, true, p->true_depth, p->true_rgba);
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
            struct sv_camera camera = bodies_orbit_camera(&b->object, 2 * SV_PI * (step + 0.3) / STEPS,
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
                judge(&now, SIDE, (float)(3 * b->object.texel * BODIES_PLACE.height_m), &sum);
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
            struct sv_vec3 n = bodies_texel_normal(r, i);
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
    struct sv_camera camera = bodies_orbit_camera(&b->object, 0.35, 0, SIDE);
    double mean[3];
    for (int k = 0; k < 3; k++) { /* no shade, half, all */
        const double heights[3] = {-INFINITY, BODIES_PLACE.place.z + 0.5 * BODIES_PLACE.height_m, INFINITY};
        struct sv_relief_look_options options = {.lit = true, .shade_height_m = heights[k]};
        const struct sv_warp_source *sources;
        struct sv_warp_stats stats = {0};
        unsigned count, faces = sv_relief_object_faces(&b->object, &BODIES_PLACE, &camera);
        uint8_t(*rgba)[4] = must(calloc((size_t)SIDE * SIDE, 4));
        assert_int_equal(sv_relief_look_light(b->look, &BODIES_PLACE, &light, &options, faces, NULL), SV_OK);
        assert_int_equal(sv_relief_look_warp(b->look, &BODIES_PLACE, &camera, 0, 0, faces, &buffer, &sources,
                                             &count, &stats, NULL),
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_orbits),
        cmocka_unit_test(test_shadows),
        cmocka_unit_test(test_shade_height),
    };
    return cmocka_run_group_tests(tests, bodies_set_up, bodies_tear_down);
}
