/* test_object_kernels.c - kernels of relief objects draw the same bits at every SIMD level. */
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
#include "core/base/rng.h"
#include "core/base/simd.h"
#include "core/relief/object_lookup.h"
#include "core/relief/object_splat_kernel.h"
#include "tests/core/relief/object_bodies.h"

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
        cmocka_unit_test(test_lookup_avx2),
        cmocka_unit_test(test_levels),
    };
    return cmocka_run_group_tests(tests, bodies_set_up, bodies_tear_down);
}
