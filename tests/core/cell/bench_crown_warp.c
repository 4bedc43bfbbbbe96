/* bench_crown_warp.c - what the warp of crowns costs: one line a case, medians of scalar and AVX2 in one run,
 * by the thread's processor time. Asserts no time. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "core/base/color.h"
#include "core/cell/crown_warp_kernel.h"
#include "tests/core/cell/crown_kit.h"

enum { ROUNDS = 15, LEVELS = 2, FACES = 3, RINGS = 5, SIZE = 1024, VIEW = 512 };

static double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *v, int n)
{
    qsort(v, (size_t)n, sizeof *v, by_value);
    return v[n / 2];
}

struct bench {
    struct crown_panel panels[RINGS][FACES];
    struct sv_crown_buffer *buffer;
    float (*light)[4];
    float *depth;
};

struct times {
    double splat[ROUNDS], resolve[ROUNDS];
};

/* A frame of rings, nearest first; the camera looks between the first two faces (heading 0: onto the first).
 */
static void frame(struct bench *b, const struct sv_crown_kernel *kernel, int rings, double heading,
                  bool begin_each, double *splat_ms, double *resolve_ms, struct sv_crown_stats *stats)
{
    static const enum sv_cell_face faces[FACES] = {SV_CELL_NORTH, SV_CELL_EAST, SV_CELL_WEST};
    const double turn[3] = {heading, -0.05, 0};
    memset(stats, 0, sizeof *stats);
    *splat_ms = *resolve_ms = 0;
    for (size_t k = 0; k < VIEW * VIEW; k++)
        memcpy(b->light[k], (const float[4]){0, 0, 0, 1}, sizeof b->light[k]);
    sv_crown_buffer_begin(b->buffer);
    for (int ring = 0; ring < rings; ring++) {
        struct sv_crown_source sources[FACES];
        double distance = 6 << ring, start = now_ms();
        struct sv_vec3 v = sv_vec3(0, 0, 0), offset = sv_vec3(0.02, -0.03, 0.01);
        struct sv_camera camera =
            crown_camera(SV_CELL_NORTH, v, distance, offset, turn, sv_radians(60), VIEW, VIEW);
        for (int k = 0; k < FACES; k++) {
            sources[k].layer = &b->panels[ring][k].panel.crowns;
            sources[k].steep = SV_CROWN_STEEP;
            sources[k].opens = false;
            sv_crown_map(v, distance, faces[k], &camera, 0, 0, sources[k].m);
        }
        if (begin_each)
            sv_crown_buffer_begin(b->buffer);
        else
            sv_crown_buffer_clear(b->buffer);
        sv_crown_splat_at(kernel, sources, FACES, b->buffer, stats);
        double middle = now_ms();
        sv_crown_resolve_at(kernel, sources, FACES, b->buffer, b->depth, 0.01f, b->light);
        *splat_ms += middle - start;
        *resolve_ms += now_ms() - middle;
    }
}

static void run(struct bench *b, const char *name, int rings, double heading, bool begin_each)
{
    static struct times times[LEVELS];
    static const char *const names[LEVELS] = {"scalar", "avx2"};
    const struct sv_crown_kernel *kernels[LEVELS] = {&sv_crown_scalar, &sv_crown_avx2};
    int levels = sv_simd_level() == SV_SIMD_AVX2 ? LEVELS : 1;
    struct sv_crown_stats stats;
    for (int round = -2; round < ROUNDS; round++)
        for (int level = 0; level < levels; level++) {
            double splat, resolve;
            frame(b, kernels[level], rings, heading, begin_each, &splat, &resolve, &stats);
            if (round >= 0) {
                times[level].splat[round] = splat;
                times[level].resolve[round] = resolve;
            }
        }
    printf("%s: %llu tiles, %llu drawn, %llu texels\n", name, (unsigned long long)stats.tiles,
           (unsigned long long)stats.drawn, (unsigned long long)stats.texels);
    for (int level = 0; level < levels; level++) {
        double splat = median(times[level].splat, ROUNDS), resolve = median(times[level].resolve, ROUNDS);
        double each = 1e6 / (stats.texels ? (double)stats.texels : 1);
        printf("  %-6s splat %.3f ms (%.2f ns a texel), resolve %.3f ms (%.2f ns a pixel), sum %.3f ms, %.2f "
               "ns a texel\n",
               names[level], splat, splat * each, resolve, resolve * 1e6 / (VIEW * VIEW), splat + resolve,
               (splat + resolve) * each);
    }
}

static void fill(struct bench *b, double cover)
{
    for (int ring = 0; ring < RINGS; ring++)
        for (int k = 0; k < FACES; k++) {
            struct sv_rng rng = sv_rng_seeded(5, (uint64_t)(ring * FACES + k));
            if (b->panels[ring][k].block)
                crown_panel_free(&b->panels[ring][k]);
            crown_panel_make(SIZE, &b->panels[ring][k]);
            crown_panel_blobs(&b->panels[ring][k], &rng, cover, 0.5, 1.1);
        }
}

/* A drawn canvas: the panel's own colours as sRGB, its q as depth, each scale x scale times. */
static void run_conversion(struct bench *b, size_t scale)
{
    static double ms[ROUNDS];
    struct crown_panel *p = &b->panels[0][0], to;
    size_t side = SIZE * scale, n = side * side;
    uint8_t(*color)[4] = malloc(n * sizeof *color);
    float *depth = malloc(n * sizeof *depth);
    for (size_t k = 0; k < n; k++) {
        size_t texel = k / side / scale * SIZE + k % side / scale;
        const uint8_t *from = p->room.color[texel];
        for (int c = 0; c < 3; c++)
            color[k][c] = sv_srgb8_from_linear((float)(from[c] * from[c]) / 65025.0f);
        color[k][3] = from[3];
        depth[k] = from[3] ? p->room.q[texel] / (float)SV_PANEL_Q_ONE : 0;
    }
    crown_panel_make(SIZE, &to);
    struct sv_panel_drawing drawing = {&color[0][0], depth, NULL, 1, (int)scale};
    for (int round = 0; round < ROUNDS; round++) {
        double start = now_ms();
        if (sv_panel_crowns(&drawing, &to.room, NULL))
            exit(1);
        ms[round] = now_ms() - start;
    }
    printf("conversion to %d x %d from %zu x: %.2f ms\n", SIZE, SIZE, scale, median(ms, ROUNDS));
    crown_panel_free(&to);
    free(color);
    free(depth);
}

int main(void)
{
    static struct bench b;
    sv_color_init();
    b.light = malloc(VIEW * VIEW * sizeof *b.light);
    b.depth = calloc(VIEW * VIEW, sizeof *b.depth);
    if (!b.light || !b.depth || sv_crown_buffer_create(VIEW, 0, VIEW, &b.buffer, NULL))
        return 1;
    fill(&b, 0.6);
    run(&b, "dense ring", 1, 0, true);
    run(&b, "dense ring, between faces", 1, 0.785, true);
    run(&b, "five dense rings, nothing left out behind others", RINGS, 0.4, true);
    run(&b, "five dense rings", RINGS, 0.4, false);
    run_conversion(&b, 1);
    run_conversion(&b, 2);
    fill(&b, 0.05);
    run(&b, "five sparse rings", RINGS, 0.4, false);
    run(&b, "five sparse rings, looking away", RINGS, 3.1, false);
    for (int ring = 0; ring < RINGS; ring++)
        for (int k = 0; k < FACES; k++)
            crown_panel_free(&b.panels[ring][k]);
    sv_crown_buffer_destroy(b.buffer);
    free(b.light);
    free(b.depth);
    return 0;
}
