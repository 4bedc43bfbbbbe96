/* bench_warp.c - what the direct warp costs: one line a case, medians of the three SIMD levels in one run.
 * Asserts no time. `bench_warp PREFIX` writes the pictures as PREFIX-*.ppm. */
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "core/relief/warp_kernel.h"
#include "tests/core/relief/warp_scenes.h"

enum { ROUNDS = 15, LEVELS = 3 };

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

static void write_ppm(const char *prefix, const char *name, const uint8_t (*rgba)[4], int width, int height)
{
    char path[512];
    snprintf(path, sizeof path, "%s-%s.ppm", prefix, name);
    FILE *f = fopen(path, "wb");
    if (!f)
        return;
    fprintf(f, "P6 %d %d 255\n", width, height);
    for (int p = 0; p < width * height; p++)
        fwrite(rgba[p], 1, 3, f);
    fclose(f);
}

enum stage { CLEAR, SPLAT, FILL, RESOLVE, STAGES };

struct bench {
    const char *name;
    struct sv_warp_source *sources;
    unsigned count;
    int width, height;
};

static void one_round(const struct bench *bench, enum sv_simd level, struct sv_warp_buffer *buffer,
                      uint8_t (*rgba)[4], struct sv_warp_stats *stats, double ms[STAGES])
{
    memset(stats, 0, sizeof *stats);
    double t0 = now_ms();
    sv_warp_clear(buffer);
    double t1 = now_ms();
    for (unsigned k = 0; k < bench->count; k++)
        sv_warp_splat_at(level, &bench->sources[k], k, buffer, stats);
    double t2 = now_ms();
    sv_warp_fill(bench->sources, bench->count, buffer, stats);
    double t3 = now_ms();
    sv_warp_resolve_at(level, bench->sources, bench->count, buffer, rgba);
    double t4 = now_ms();
    ms[CLEAR] = t1 - t0;
    ms[SPLAT] = t2 - t1;
    ms[FILL] = t3 - t2;
    ms[RESOLVE] = t4 - t3;
}

static void run(const struct bench *bench, const char *prefix)
{
    static const char *level_names[LEVELS] = {"scalar", "sse2", "avx2"};
    static double all[LEVELS][STAGES][ROUNDS];
    double splat[LEVELS];
    struct sv_warp_buffer buffer;
    struct sv_warp_stats stats;
    size_t n = (size_t)bench->width * (size_t)bench->height;
    uint8_t(*rgba)[4] = calloc(n, sizeof *rgba);
    if (!rgba || sv_warp_buffer_create(bench->width, bench->height, &buffer, NULL) != SV_OK)
        exit(1);
    int levels = sv_simd_level() == SV_SIMD_AVX2 ? LEVELS : LEVELS - 1;
    for (int round = -2; round < ROUNDS; round++)
        for (int level = 0; level < levels; level++) {
            double ms[STAGES];
            one_round(bench, (enum sv_simd)level, &buffer, rgba, &stats, ms);
            for (int s = 0; s < STAGES && round >= 0; s++)
                all[level][s][round] = ms[s];
        }
    printf("%s: %llu texels, %u pixels, %u holes, %zu tears\n", bench->name, (unsigned long long)stats.texels,
           stats.pixels, stats.holes, buffer.tears->count);
    for (int level = 0; level < levels; level++) {
        double m[STAGES];
        for (int s = 0; s < STAGES; s++)
            m[s] = median(all[level][s], ROUNDS);
        splat[level] = m[SPLAT];
        printf("  %-6s clear %.3f splat %.3f fill %.3f resolve %.3f sum %.3f ms; splat %.2fx scalar\n",
               level_names[level], m[CLEAR], m[SPLAT], m[FILL], m[RESOLVE],
               m[CLEAR] + m[SPLAT] + m[FILL] + m[RESOLVE], splat[0] / splat[level]);
    }
    if (prefix)
        write_ppm(prefix, bench->name, (const void *)rgba, bench->width, bench->height);
    free(rgba);
    sv_warp_buffer_finish(&buffer);
}

static void bench_panel(const char *name, enum scene_shape shape, int side, int picture, double angle,
                        double turn, double texel_px, const char *prefix)
{
    struct sv_vec3 middle = sv_vec3(412345.5, 4123456.25, 310);
    struct sv_warp_source source = scene_source(shape, side, side, 1);
    struct sv_relief_frame frame = scene_frame(side, side, middle, sv_vec3(0.3, -1, 0.2));
    struct sv_camera camera =
        scene_camera(&frame, middle, 1.2 * side, angle, turn, turn * 0.1, picture, picture, texel_px);
    sv_warp_map_from_camera(&frame, &camera, 0, 0, &source.map);
    struct bench bench = {name, &source, 1, picture, picture};
    run(&bench, prefix);
    scene_finish(&source);
}

/* Three faces of a box of 128 texels, as an object shows them. */
static void bench_object(const char *name, double texel_px, const char *prefix)
{
    static const double fronts[3][3] = {{1, 0, 0}, {0, -1, 0}, {0, 0, 1}};
    struct sv_warp_source sources[3];
    struct sv_vec3 middle = sv_vec3(412345.5, 4123456.25, 310);
    struct sv_relief_frame view = scene_frame(128, 128, middle, sv_vec3(0.7, -1, 0.6));
    struct sv_camera camera = scene_camera(&view, middle, 500, 0, 0, 0, 512, 512, texel_px);
    for (int k = 0; k < 3; k++) {
        struct sv_vec3 front = sv_vec3(fronts[k][0], fronts[k][1], fronts[k][2]);
        struct sv_relief_frame frame = scene_frame(128, 128, sv_madd(middle, front, 64), front);
        sources[k] = scene_source(SCENE_STEPPED, 128, 128, 1);
        sv_warp_map_from_camera(&frame, &camera, 0, 0, &sources[k].map);
    }
    struct bench bench = {name, sources, 3, 512, 512};
    run(&bench, prefix);
    for (int k = 0; k < 3; k++)
        scene_finish(&sources[k]);
}

int main(int argc, char **argv)
{
    const char *prefix = argc > 1 ? argv[1] : NULL;
    bench_panel("panel-1024-to-1024", SCENE_STEPPED, 1024, 1024, 0.2, 0.5, 1.0, prefix);
    bench_panel("panel-1024-to-1024-45", SCENE_STEPPED, 1024, 1024, 0.785, 0.785, 1.0, prefix);
    bench_panel("panel-1024-to-512", SCENE_STEPPED, 1024, 512, 0.2, 0.5, 0.5, prefix);
    bench_panel("panel-1024-smooth", SCENE_SMOOTH, 1024, 1024, 0.2, 0.5, 1.0, prefix);
    bench_panel("panel-1024-noise", SCENE_NOISE, 1024, 1024, 0.2, 0.5, 1.0, prefix);
    bench_panel("magnified-8", SCENE_STEPPED, 128, 1024, 0.5, 0.5, 8.0, prefix);
    bench_object("object-1.5", 1.5, prefix);
    bench_object("object-2.5", 2.5, prefix);
    return 0;
}
