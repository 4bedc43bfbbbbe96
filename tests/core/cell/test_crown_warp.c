/* The warp of crowns against brute force in double, closed forms and itself (bands, levels, orders). */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/cell/crown_warp_kernel.h"
#include "tests/core/cell/crown_kit.h"

enum { SEED = 41 };

struct picture {
    int width, height;
    float (*light)[4];
};

static struct picture picture_make(int width, int height)
{
    struct picture p = {width, height, malloc((size_t)(width * height) * sizeof *p.light)};
    for (int k = 0; k < width * height; k++)
        memcpy(p.light[k], (const float[4]){0, 0, 0, 1}, sizeof p.light[k]);
    return p;
}

static void draw_band(const struct sv_crown_kernel *kernel, const struct sv_crown_source *sources,
                      unsigned count, int first, int rows, const float *depth, struct picture *p)
{
    struct sv_crown_buffer *buffer;
    size_t at = (size_t)first * (size_t)p->width;
    assert_int_equal(sv_crown_buffer_create(p->width, first, rows, &buffer, NULL), SV_OK);
    sv_crown_splat_at(kernel, sources, count, buffer, NULL);
    sv_crown_resolve_at(kernel, sources, count, buffer, depth ? depth + at : NULL, 0.01f, p->light + at);
    sv_crown_buffer_destroy(buffer);
}

/* ---- against brute force ---- */

struct judged {
    long pixels, shown, unsure, filled;
    double worst;
};

/* Allowed: the weight along a row is cut to 1/256 (contrast at most 1, so 1/256); a place is right to 0.01
 * texels in each direction (2 x 0.01). */
static const double COLOR_ALLOWED = 1.0 / 256 + 0.02;

static void judge(const struct sv_crown_source *sources, unsigned count, const struct picture *p,
                  struct judged *sum)
{
    for (int row = 0; row < p->height; row++)
        for (int i = 0; i < p->width; i++) {
            struct crown_truth t;
            const float *got = p->light[row * p->width + i];
            crown_truth_of(sources, count, i, row, &t);
            sum->pixels++;
            sum->unsure += t.unsure;
            if (t.unsure)
                continue;
            sum->shown += t.any;
            for (int c = 0; c < 4; c++) {
                double expected = t.any ? t.color[c] : 0, have = c < 3 ? got[c] : 1 - got[3];
                sum->worst = fmax(sum->worst, fabs(expected - have));
                if (!(fabs(expected - have) <= COLOR_ALLOWED))
                    fail_msg("pixel (%d, %d) channel %d: %.5f, expected %.5f (allowed %.5f), texel %d at "
                             "(%.3f, %.3f)",
                             i, row, c, have, expected, COLOR_ALLOWED, t.texel, t.u, t.v);
            }
        }
}

static void test_brute_force(void **state)
{
    (void)state;
    struct sv_rng rng = sv_rng_seeded(SEED, 1);
    struct judged sum = {0, 0, 0, 0, 0};
    for (int k = 0; k < 24; k++) {
        struct crown_panel panel[2];
        struct sv_crown_source sources[2];
        enum sv_cell_face face = (enum sv_cell_face)(k % SV_CELL_FACES);
        enum sv_cell_face other = face == SV_CELL_EAST   ? SV_CELL_NORTH
                                  : face == SV_CELL_DOWN ? SV_CELL_NORTH
                                                         : SV_CELL_EAST;
        struct sv_vec3 v = sv_vec3(412345.5, 4123456.25, 310);
        struct sv_vec3 offset = sv_vec3(sv_rng_range(&rng, -0.2, 0.2), sv_rng_range(&rng, -0.2, 0.2),
                                        sv_rng_range(&rng, -0.2, 0.2));
        const double turn[3] = {sv_rng_range(&rng, -0.8, 0.8), sv_rng_range(&rng, -0.3, 0.3),
                                sv_rng_range(&rng, -0.5, 0.5)};
        struct sv_camera camera =
            crown_camera(face, v, 20, offset, turn, sv_rng_range(&rng, 0.6, 1.5), 24 + k % 5, 20 + k % 7);
        for (int n = 0; n < 2; n++) {
            crown_panel_make(17 + (k * 5 + n) % 24, &panel[n]);
            crown_panel_blobs(&panel[n], &rng, 0.4, 0.2, 1.2);
            sources[n].layer = &panel[n].panel.crowns;
            sv_crown_map(v, 20, n ? other : face, &camera, 0.1, -0.2, sources[n].m);
        }
        struct picture p = picture_make(camera.width, camera.height);
        draw_band(&sv_crown_scalar, sources, 2, 0, camera.height, NULL, &p);
        judge(sources, 2, &p, &sum);
        free(p.light);
        crown_panel_free(&panel[0]);
        crown_panel_free(&panel[1]);
    }
    printf("%ld pixels, %ld shown, %ld unsure, worst %.5f\n", sum.pixels, sum.shown, sum.unsure, sum.worst);
    assert_true(sum.shown > sum.pixels / 4 && sum.unsure < sum.pixels / 10);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_brute_force),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
