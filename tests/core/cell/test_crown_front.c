/* What of a panel is in front of light that was gathered before it, against brute force and itself. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/cell/crown_warp_kernel.h"
#include "tests/core/cell/crown_kit.h"

enum { SEED = 43, WIDTH = 70, HEIGHT = 61, PIXELS = WIDTH * HEIGHT };

/* A panel before a camera, and what has been gathered before it. */
struct scene {
    struct crown_panel panel;
    struct sv_crown_source source;
    float light[PIXELS][4], front[PIXELS];
};

/* Stripes of what has been gathered, at some depth, some of it half transparent, some of it nothing. */
static void put_gathered(struct sv_rng *rng, struct scene *s)
{
    for (int n = 0; n < PIXELS; n++) {
        int stripe = (n % WIDTH + n / WIDTH) / 9 % 4;
        float pass = stripe == 0 ? 1 : stripe == 1 ? 0.4f : 0;
        for (int c = 0; c < 3; c++)
            s->light[n][c] = (1 - pass) * 0.25f * (float)(c + 1);
        s->light[n][3] = pass;
        s->front[n] = stripe == 0 ? INFINITY : (float)sv_rng_range(rng, 0.003, 0.02);
    }
}

static void scene_make(struct sv_rng *rng, int k, bool opens, struct scene *s)
{
    struct sv_vec3 v = sv_vec3(412345.5, 4123456.25, 310);
    struct sv_vec3 offset =
        sv_vec3(sv_rng_range(rng, -0.1, 0.1), sv_rng_range(rng, -0.1, 0.1), sv_rng_range(rng, -0.1, 0.1));
    const double turn[3] = {sv_rng_range(rng, -0.3, 0.3), sv_rng_range(rng, -0.2, 0.2),
                            sv_rng_range(rng, -1, 1)};
    struct sv_camera camera =
        crown_camera(SV_CELL_NORTH, v, 20, offset, turn, sv_rng_range(rng, 0.6, 1.5), WIDTH, HEIGHT);
    crown_panel_make(40 + k % 3 * 30, &s->panel);
    crown_panel_blobs(&s->panel, rng, 0.6, 0.3, 1.6);
    s->source.layer = &s->panel.panel.crowns;
    s->source.opens = k % 3 == 2 && opens;
    s->source.steep = k & 1 ? SV_CROWN_STEEP : 1;
    sv_crown_map(v, 20, SV_CELL_NORTH, &camera, 0, 0, s->source.m);
    put_gathered(rng, s);
}

/* Rows first .. of the scene into light[first * WIDTH ..]. */
static void draw(const struct sv_crown_kernel *kernel, struct scene *s, int first, int rows, bool close,
                 float (*light)[4])
{
    struct sv_crown_buffer *buffer;
    size_t at = (size_t)first * WIDTH;
    memcpy(light + at, s->light + at, (size_t)rows * WIDTH * sizeof *light);
    assert_int_equal(sv_crown_buffer_create(WIDTH, first, rows, &buffer, NULL), SV_OK);
    sv_crown_buffer_begin(buffer);
    if (close)
        sv_crown_buffer_close(buffer, (const float(*)[4])(light + at), s->front + at);
    sv_crown_buffer_clear(buffer);
    sv_crown_splat_at(kernel, &s->source, 1, buffer, NULL);
    sv_crown_resolve_front_at(kernel, &s->source, 1, buffer, s->front + at, light + at);
    sv_crown_resolve_at(kernel, &s->source, 1, buffer, NULL, 0, light + at);
    sv_crown_buffer_destroy(buffer);
}

/* What the pixel shows when the nearer of the two goes over the other. */
static void expect(const struct crown_truth *t, bool over, const float gathered[4], double out[4])
{
    double pass = 1 - t->color[3], behind = (double)gathered[3];
    for (int c = 0; c < 3; c++)
        out[c] = over ? t->color[c] + pass * (double)gathered[c] : (double)gathered[c] + behind * t->color[c];
    out[3] = pass * behind;
}

/* The nearer surface wins, whichever was drawn first; nothing is shown twice. */
static void test_nearer_wins(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(SEED, 1);
    long over = 0, under = 0, unsure = 0;
    for (int k = 0; k < 4; k++) {
        static struct scene s;
        static float light[PIXELS][4];
        scene_make(&rng, k, false, &s);
        draw(k & 2 ? &sv_crown_scalar : sv_crown_kernel_of(sv_simd_level()), &s, 0, HEIGHT, true, light);
        for (int n = 0; n < PIXELS; n++) {
            struct crown_truth t;
            crown_truth_of(&s.source, 1, n % WIDTH, n / WIDTH, &t);
            bool goes_over = t.any && t.d >= (double)s.front[n];
            double front = (double)s.front[n], worst = 0, expected[4];
            if (t.unsure || (t.any && fabs(t.d - front) < 1e-5 * front)) {
                unsure++;
                continue;
            }
            const struct crown_truth nothing = {0};
            expect(t.any ? &t : &nothing, goes_over, s.light[n], expected);
            for (int c = 0; c < 4; c++)
                worst = fmax(worst, fabs(expected[c] - (double)light[n][c]));
            over += goes_over;
            under += t.any && !goes_over && s.light[n][3] > 0;
            if (worst <= 1.0 / 256 + 0.02)
                continue;
            fail_msg("seed %d case %d pixel (%d, %d), %s: off by %.4f", SEED, k, n % WIDTH, n / WIDTH,
                     goes_over ? "over" : "under", worst);
        }
        crown_panel_free(&s.panel);
    }
    printf("%ld pixels over, %ld under what was gathered, %ld unsure\n", over, under, unsure);
    assert_true(over > 5000 && under > 2000 && unsure < PIXELS);
}

/* Levels, bands, and leaving out what is hidden: the same bytes. */
static void test_agree(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(SEED, 2);
    for (int k = 0; k < 40; k++) {
        static struct scene s;
        static float whole[PIXELS][4], other[PIXELS][4];
        scene_make(&rng, k, true, &s);
        draw(&sv_crown_scalar, &s, 0, HEIGHT, true, whole);
        draw(&sv_crown_scalar, &s, 0, HEIGHT, false, other);
        assert_memory_equal(whole, other, sizeof whole);
        draw(sv_crown_kernel_of(sv_simd_level()), &s, 0, HEIGHT, true, other);
        assert_memory_equal(whole, other, sizeof whole);
        int first = k % 30, rows = 10 + k % 20;
        draw(sv_crown_kernel_of(sv_simd_level()), &s, first, rows, true, other);
        assert_memory_equal(whole[first * WIDTH], other[first * WIDTH], (size_t)rows * WIDTH * sizeof *whole);
        crown_panel_free(&s.panel);
    }
}

/* A wall behind what is closed is not splatted; the same wall before it is. */
static void test_left_out(void **state)
{
    (void)state;
    static struct scene s;
    struct sv_rng rng = sv_rng_seeded(SEED, 3);
    struct sv_crown_buffer *buffer;
    uint64_t drawn[2];
    scene_make(&rng, 0, false, &s);
    crown_panel_flat(&s.panel, (const uint8_t[4]){90, 90, 90, 255}, 0.8);
    s.source.layer = &s.panel.panel.crowns;
    assert_int_equal(sv_crown_buffer_create(WIDTH, 0, HEIGHT, &buffer, NULL), SV_OK);
    for (int before = 0; before < 2; before++) {
        struct sv_crown_stats stats = {0};
        for (int n = 0; n < PIXELS; n++) {
            s.light[n][3] = 0;
            s.front[n] = before ? 1e-6f : 1;
        }
        sv_crown_buffer_begin(buffer);
        sv_crown_buffer_close(buffer, (const float(*)[4])s.light, s.front);
        sv_crown_splat(&s.source, 1, buffer, &stats);
        drawn[before] = stats.drawn;
    }
    assert_true(drawn[0] == 0 && drawn[1] > 0);
    sv_crown_buffer_destroy(buffer);
    crown_panel_free(&s.panel);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_nearer_wins), cmocka_unit_test(test_agree),
                                       cmocka_unit_test(test_left_out)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
