/* test_self_shadow.c - the line sweep (paper 1, 3.3.1) and the row front against a ray march over the
 * bilinear surface, each line against all pairs of its own texels, and what the header defines at the
 * singular lights. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/base/rng.h"
#include "core/relief/row_front.h"
#include "core/relief/self_shadow.h"
#include "shadow_fields.h"

/* A twentieth of a sample, for the truth and the sweeps alike: a bilinear surface stands off the curve that
 * it stands for by curvature / 8, and casts shadows of that size on itself wherever light grazes it. */
static const double bias_samples = 0.05;

static struct sv_relief relief_of(const struct shadow_field *f, float *heights)
{
    struct sv_relief r;
    assert_int_equal(sv_relief_alloc(f->width, f->height, &r, NULL), SV_OK);
    size_t n = (size_t)f->width * (size_t)f->height;
    r.frame =
        (struct sv_relief_frame){.a = sv_vec3(f->dx, 0, 0), .b = sv_vec3(0, f->dy, 0), .f = sv_vec3(0, 0, 1)};
    for (size_t k = 0; k < n; k++) {
        r.displ[k] = heights[k];
        r.color[k][3] = isnan(heights[k]) ? 0 : 255;
    }
    sv_relief_measure(&r);
    return r;
}

struct score {
    double worst, mean;
    int light;
};

static void score_add(struct score *s, const uint8_t *truth, const uint8_t *got, size_t n, int light)
{
    size_t differ = 0;
    for (size_t k = 0; k < n; k++)
        differ += truth[k] != got[k];
    double percent = 100.0 * (double)differ / (double)n;
    s->mean += percent / SHADOW_LIGHTS;
    if (percent >= s->worst) {
        s->worst = percent;
        s->light = light;
    }
}

static void compare_field(const struct shadow_field *f, struct score score[3])
{
    size_t n = (size_t)f->width * (size_t)f->height;
    float *heights = shadow_field_heights(f);
    struct sv_relief relief = relief_of(f, heights);
    uint8_t *truth = malloc(n), *got = malloc(n);
    assert_true(heights && truth && got);
    for (int k = 0; k < SHADOW_LIGHTS; k++) {
        struct sv_vec3 l = shadow_light(k);
        float bias = (float)(bias_samples * f->dx);
        shadow_truth(f, heights, l, (double)bias, truth);
        struct sv_row_front front = {f->width, f->height, f->dx, f->dy, l, heights, NULL, bias};
        assert_int_equal(sv_row_front(&front, NULL, NULL, got, NULL), SV_OK);
        score_add(&score[0], truth, got, n, k);
        struct sv_self_shadow_options options = {.travel = l, .bias_m = bias};
        assert_int_equal(sv_self_shadow(&relief, &options, got, NULL), SV_OK);
        score_add(&score[1], truth, got, n, k);
        options.texels_alone = true;
        assert_int_equal(sv_self_shadow(&relief, &options, got, NULL), SV_OK);
        score_add(&score[2], truth, got, n, k);
    }
    sv_relief_finish(&relief);
    free(heights);
    free(truth);
    free(got);
}

static void sweeps_agree_with_the_ray_march(void **state)
{
    (void)state;
    static const char *const kinds[] = {"smooth", "stepped", "objects", "noise"};
    int missed = 0;
    printf("share of texels that differ from the march, %%, over %d lights (bias %.2f samples)\n",
           SHADOW_LIGHTS, bias_samples);
    printf("%-12s %-8s %9s | %6s %6s %5s | %6s %6s %5s | %6s %6s\n", "field", "kind", "size", "front", "mean",
           "light", "sweep", "mean", "light", "alone", "mean");
    for (int k = 0; k < SHADOW_FIELDS; k++) {
        const struct shadow_field *f = &shadow_fields[k];
        struct score s[3] = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
        compare_field(f, s);
        printf("%-12s %-8s %4d x%4d | %6.2f %6.3f %5d | %6.2f %6.3f %5d | %6.2f %6.3f\n", f->name,
               kinds[f->kind], f->width, f->height, s[0].worst, s[0].mean, s[0].light, s[1].worst, s[1].mean,
               s[1].light, s[2].worst, s[2].mean);
        if (f->kind == FIELD_SMOOTH || f->kind == FIELD_STEPPED)
            missed += s[0].worst > 2.0 || s[1].worst > 6.0;
    }
    printf("noise: every sample is an edge, so that the half texel by which a line or a ray passes beside it "
           "decides\n"
           "objects: sides of one sample's width, 3 to 18 samples high, along the light: the same half "
           "sample\n");
    assert_int_equal(missed, 0);
}

/* ---- each line against all pairs of its texels ---- */

struct line_check {
    uint64_t texels, wrong;
};

/* Texels of the line of (i0, step 0), in the light's order: own arithmetic from the header's words. */
static void check_line(const struct sv_relief *r, struct sv_vec3 l, const uint8_t *lit, int line, bool rows,
                       bool alone, struct line_check *check)
{
    double a = sv_length(r->frame.a), b = sv_length(r->frame.b), flat = hypot(l.x, l.y);
    int steps = rows ? r->height : r->width, count = rows ? r->width : r->height, n = 0;
    double slope = rows ? (l.x / a) / fabs(l.y / b) : (l.y / b) / fabs(l.x / a);
    bool forward = (rows ? l.y : l.x) > 0;
    static double s[1024], d[1024];
    static int at[1024];
    for (int k = 0; k < steps; k++) {
        double x = line + slope * k;
        int i = line + (int)floor(slope * k + 0.5), row = forward ? k : steps - 1 - k;
        if (i < 0 || i >= count)
            continue;
        int t = rows ? row * r->width + i : i * r->width + row, next = x < i ? i - 1 : i + 1;
        double displ = (double)r->displ[t];
        double where = alone ? i : x;
        if (!alone && next >= 0 && next < count)
            displ += ((double)r->displ[rows ? row * r->width + next : next * r->width + row] - displ) *
                     fabs(x - i);
        double major = (forward ? 1 : -1) * k * (rows ? b : a), minor = where * (rows ? a : b);
        s[n] = (rows ? minor * l.x + major * l.y : major * l.x + minor * l.y) / flat;
        d[n] = displ;
        at[n++] = t;
    }
    for (int k = 0; k < n; k++) {
        double deepest = -INFINITY; /* how far the shadow line of any texel before stands above this one */
        for (int j = 0; j < k; j++)
            deepest = fmax(deepest, d[j] * flat - (s[k] - s[j]) * -l.z - d[k] * flat);
        check->texels++;
        if (fabs(deepest) > 1e-9) /* ties may fall either way */
            check->wrong += (deepest > 0) != (lit[at[k]] == 0);
    }
}

static void each_line_is_exact(void **state)
{
    (void)state;
    struct line_check check = {0, 0};
    uint64_t covered = 0;
    static const int which[] = {2, 3, 8, 14, 16};
    for (int f = 0; f < 5; f++) {
        const struct shadow_field *field = &shadow_fields[which[f]];
        float *heights = shadow_field_heights(field);
        struct sv_relief r = relief_of(field, heights);
        uint8_t *lit = malloc((size_t)r.width * (size_t)r.height);
        for (int k = 0; k < 45; k += 3)
            for (int alone = 0; alone < 2; alone++) {
                struct sv_vec3 l = shadow_light(k);
                struct sv_self_shadow_options o = {.travel = l, .texels_alone = alone};
                assert_int_equal(sv_self_shadow(&r, &o, lit, NULL), SV_OK);
                bool rows = fabs(l.y / field->dy) >= fabs(l.x / field->dx);
                uint64_t before = check.texels;
                for (int line = -512; line < 512; line++)
                    check_line(&r, l, lit, line, rows, alone, &check);
                covered += check.texels - before == (uint64_t)r.width * (uint64_t)r.height;
            }
        free(lit);
        free(heights);
        sv_relief_finish(&r);
    }
    printf("%llu texels on lines against all pairs: %llu differ\n", (unsigned long long)check.texels,
           (unsigned long long)check.wrong);
    assert_int_equal(check.wrong, 0);
    assert_int_equal(covered, 5 * 15 * 2); /* every texel on exactly one line */
}

/* ---- what is printed in the paper ---- */

/* Rule (iii) as printed, along u: S reaches to u_s itself, not to where it is warped. */
static double dark_share_as_printed(const float *h, int n, double cot, bool literal)
{
    int dark = 0;
    double end = -INFINITY; /* S = (-inf, end] */
    for (int u = 0; u < n; u++) {
        double ui = u + (double)h[u] * cot;
        if (ui <= end)
            dark++;
        else
            end = literal ? fmax(end, u) : ui;
    }
    return (double)dark / n;
}

static void rule_three_as_printed_darkens_nearly_all(void **state)
{
    (void)state;
    /* displ of a face of a box: behind its plane, as relief objects have it */
    float h[512];
    for (int u = 0; u < 512; u++)
        h[u] = (float)(-20 + 6 * sin(u * 0.1) + 3 * sin(u * 0.037));
    double cot = 1 / tan(sv_radians(12)), printed = dark_share_as_printed(h, 512, cot, true),
           ours = dark_share_as_printed(h, 512, cot, false);
    struct sv_relief r;
    assert_int_equal(sv_relief_alloc(512, 1, &r, NULL), SV_OK);
    r.frame = (struct sv_relief_frame){.a = sv_vec3(1, 0, 0), .b = sv_vec3(0, 1, 0), .f = sv_vec3(0, 0, 1)};
    for (int u = 0; u < 512; u++) {
        r.displ[u] = h[u];
        r.color[u][3] = 255;
    }
    sv_relief_measure(&r);
    uint8_t lit[512];
    struct sv_self_shadow_options o = {.travel = sv_vec3(cos(sv_radians(12)), 0, -sin(sv_radians(12)))};
    assert_int_equal(sv_self_shadow(&r, &o, lit, NULL), SV_OK);
    int dark = 0;
    for (int u = 0; u < 512; u++)
        dark += lit[u] == 0;
    /* exact: is there a higher point on the way to the light */
    int truth = 0;
    for (int u = 0; u < 512; u++) {
        bool hidden = false;
        for (int k = 0; k < u; k++)
            hidden = hidden || (double)h[k] - (u - k) * tan(sv_radians(12)) > (double)h[u];
        truth += hidden;
    }
    printf("rule (iii) as printed: %.1f %% dark; to (u_i, v_i): %.1f %%; sv_self_shadow %.1f %%; exact %.1f "
           "%%\n",
           100 * printed, 100 * ours, 100.0 * dark / 512, 100.0 * truth / 512);
    assert_true(printed > 0.95);
    assert_true(abs(dark - truth) <= 1 && fabs(ours * 512 - truth) <= 1);
    sv_relief_finish(&r);
}

static void figure_three_swaps_d_and_e(void **state)
{
    (void)state;
    /* light to the right, 45 degrees. a: a tower at 0; d: on its ground, within its shadow; e: past it. d' =
     * u + displ = 2 is in S = (.., 5], e' = 7 is not: so d is dark and e lit, where the text says the
     * contrary of both. */
    float h[8] = {5, 0, 0, 0, 0, 0, 0, 0};
    struct sv_relief r;
    assert_int_equal(sv_relief_alloc(8, 1, &r, NULL), SV_OK);
    r.frame = (struct sv_relief_frame){.a = sv_vec3(1, 0, 0), .b = sv_vec3(0, 1, 0), .f = sv_vec3(0, 0, 1)};
    for (int u = 0; u < 8; u++) {
        r.displ[u] = h[u];
        r.color[u][3] = 255;
    }
    sv_relief_measure(&r);
    uint8_t lit[8];
    struct sv_self_shadow_options o = {.travel = sv_normalize(sv_vec3(1, 0, -1))};
    assert_int_equal(sv_self_shadow(&r, &o, lit, NULL), SV_OK);
    assert_int_equal(lit[2], 0);
    assert_int_equal(lit[7], 255);
    sv_relief_finish(&r);
}

/* ---- singular lights, masks, empty texels ---- */

static void singular_lights_are_as_defined(void **state)
{
    (void)state;
    const struct shadow_field *f = &shadow_fields[13];
    float *h = shadow_field_heights(f);
    h[777] = NAN;
    struct sv_relief r = relief_of(f, h);
    size_t n = (size_t)r.width * (size_t)r.height;
    uint8_t *lit = malloc(n), *other = malloc(n), *mask = malloc(n);
    struct sv_self_shadow_options o = {.travel = sv_vec3(0, 0, -1)};
    for (int special = 0; special < 2; special++) {
        o.special_cases = special;
        assert_int_equal(sv_self_shadow(&r, &o, lit, NULL), SV_OK);
        for (size_t k = 0; k < n; k++)
            assert_int_equal(lit[k], 255);
    }
    o.special_cases = false;
    o.travel = sv_normalize(sv_vec3(0.3, 0.2, 0.01)); /* from behind */
    assert_int_equal(sv_self_shadow(&r, &o, lit, NULL), SV_OK);
    for (size_t k = 0; k < n; k++)
        assert_int_equal(lit[k], k == 777 ? 255 : 0);
    for (int k = 0; k < 16; k++) { /* in the plane: the special case and the general one are one */
        o.travel = sv_vec3(cos(k * SV_PI / 8), sin(k * SV_PI / 8), 0);
        o.special_cases = false;
        assert_int_equal(sv_self_shadow(&r, &o, lit, NULL), SV_OK);
        o.special_cases = true;
        assert_int_equal(sv_self_shadow(&r, &o, other, NULL), SV_OK);
        assert_memory_equal(lit, other, n);
    }
    /* a mask darkens what it covers, and what it covers shades as before */
    o = (struct sv_self_shadow_options){.travel = shadow_light(18)};
    assert_int_equal(sv_self_shadow(&r, &o, lit, NULL), SV_OK);
    memset(mask, 255, n);
    memset(mask, 0, n / 3);
    o.initial = mask;
    assert_int_equal(sv_self_shadow(&r, &o, other, NULL), SV_OK);
    for (size_t k = 0; k < n; k++)
        assert_int_equal(other[k], k < n / 3 && k != 777 ? 0 : lit[k]);
    /* light from nearly square to nearly parallel: dark share grows without a jump */
    double last = 0;
    for (double e = 90; e >= 0; e -= e > 2 ? 1 : 0.125) {
        size_t dark = 0;
        o = (struct sv_self_shadow_options){.travel = sv_vec3(cos(sv_radians(e)), 0, -sin(sv_radians(e)))};
        o.travel = sv_normalize(o.travel);
        assert_int_equal(sv_self_shadow(&r, &o, lit, NULL), SV_OK);
        for (size_t k = 0; k < n; k++)
            dark += lit[k] == 0;
        double share = (double)dark / (double)n;
        assert_true(share >= last - 1e-12 && share < last + 0.06);
        last = share;
    }
    free(lit);
    free(other);
    free(mask);
    free(h);
    sv_relief_finish(&r);
}

static void wrong_arguments_are_named(void **state)
{
    (void)state;
    const struct shadow_field *f = &shadow_fields[0];
    float *h = shadow_field_heights(f);
    struct sv_relief r = relief_of(f, h);
    uint8_t *lit = malloc((size_t)r.width * (size_t)r.height);
    struct sv_error e;
    struct sv_self_shadow_options o = {.travel = sv_vec3(0, 0, -1.1)};
    assert_int_equal(sv_self_shadow(&r, &o, lit, &e), SV_EINVAL);
    assert_string_equal(e.field, "travel");
    o.travel = sv_vec3(NAN, 0, -1);
    assert_int_equal(sv_self_shadow(&r, &o, lit, &e), SV_EINVAL);
    o = (struct sv_self_shadow_options){.travel = sv_vec3(0, 0, -1), .bias_m = -1};
    assert_int_equal(sv_self_shadow(&r, &o, lit, &e), SV_EINVAL);
    assert_string_equal(e.field, "bias_m");
    o.bias_m = NAN;
    assert_int_equal(sv_self_shadow(&r, &o, lit, &e), SV_EINVAL);
    free(lit);
    free(h);
    sv_relief_finish(&r);
}

/* Sizes from 1 x 1, displ up to 1e9, lights of every kind: ends, and every byte is 0 or 255. */
static void extremes_are_answered(void **state)
{
    (void)state;
    static const float odd[] = {0, -0.0f, 1e9f, -1e9f, 1e-40f, NAN, INFINITY, -INFINITY, 1, -1, 3.4e38f};
    struct sv_rng rng = sv_rng_seeded(31, 1);
    int done = 0;
    for (int k = 0; k < 50000; k++) {
        int w = 1 + (int)(sv_rng_next(&rng) % 9), h = 1 + (int)(sv_rng_next(&rng) % 9);
        float displ[81];
        uint8_t color[81][4], lit[81];
        for (int t = 0; t < w * h; t++) {
            displ[t] = odd[sv_rng_next(&rng) % 11];
            color[t][3] = sv_rng_next(&rng) % 4 ? 255 : 0;
            lit[t] = 7;
        }
        double long_a = pow(10, sv_rng_range(&rng, -6, 6)), long_b = pow(10, sv_rng_range(&rng, -6, 6));
        struct sv_relief r = {
            .frame = {.a = sv_vec3(long_a, 0, 0), .b = sv_vec3(0, long_b, 0), .f = sv_vec3(0, 0, 1)},
            .width = w,
            .height = h,
            .displ = displ,
            .color = color,
            .cut = k % 3 ? INFINITY : 1};
        struct sv_vec3 l =
            sv_vec3(sv_rng_range(&rng, -1, 1), sv_rng_range(&rng, -1, 1), sv_rng_range(&rng, -1, 1));
        if (k % 5 == 0)
            l.x = 0;
        if (k % 7 == 0)
            l.y *= 1e-300;
        if (k % 11 == 0)
            l.z = 0;
        struct sv_self_shadow_options o = {
            .travel = sv_normalize(l), .texels_alone = k & 1, .special_cases = k & 2};
        if (sv_length(l) < 1e-200)
            continue;
        assert_int_equal(sv_self_shadow(&r, &o, lit, NULL), SV_OK);
        for (int t = 0; t < w * h; t++)
            assert_true(lit[t] == 0 || (lit[t] == 255));
        done++;
    }
    printf("%d random extreme reliefs answered\n", done);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sweeps_agree_with_the_ray_march),
        cmocka_unit_test(each_line_is_exact),
        cmocka_unit_test(rule_three_as_printed_darkens_nearly_all),
        cmocka_unit_test(figure_three_swaps_d_and_e),
        cmocka_unit_test(singular_lights_are_as_defined),
        cmocka_unit_test(wrong_arguments_are_named),
        cmocka_unit_test(extremes_are_answered),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
