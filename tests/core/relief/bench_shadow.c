/* bench_shadow.c - what shadows cost: row front (both classes of azimuth, scalar and AVX2 beside each other),
 * line sweep, silhouette and cast. Prints medians; asserts nothing about time. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "core/relief/cast.h"
#include "core/relief/row_front.h"
#include "core/relief/self_shadow.h"
#include "shadow_fields.h"

enum { RUNS = 15 };

static double now_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t); /* others on the machine do not count */
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static int compare(const void *a, const void *b)
{
    double p = *(const double *)a, q = *(const double *)b;
    return (p > q) - (p < q);
}

struct work {
    struct sv_row_front front;
    enum sv_simd level;
    float *height;
    uint8_t *lit;
    struct sv_relief *relief, *receiver;
    struct sv_self_shadow_options sweep;
    struct sv_silhouette silhouette;
    double texel;
};

static void run_front(struct work *w)
{
    if (sv_row_front_at(w->level, &w->front, w->height, NULL, w->lit, NULL) != SV_OK)
        exit(1);
}
static void run_copy(struct work *w)
{
    memcpy(w->height, w->front.height_m, sizeof(float) * (size_t)w->front.width * (size_t)w->front.height);
    if (w->height[1] > 1e9f)
        exit(1);
}
static void run_sweep(struct work *w)
{
    if (sv_self_shadow(w->relief, &w->sweep, w->lit, NULL) != SV_OK)
        exit(1);
}
static void run_silhouette(struct work *w)
{
    sv_cast_silhouette_finish(&w->silhouette);
    if (sv_cast_silhouette(w->relief, w->sweep.travel, w->texel, &w->silhouette, NULL) != SV_OK)
        exit(1);
}
static void run_cast(struct work *w)
{
    if (sv_cast_shadow(&w->silhouette, w->receiver, SV_CAST_HEIGHT, w->lit, NULL) != SV_OK)
        exit(1);
}

static double measure(const char *name, void (*run)(struct work *), struct work *w)
{
    double ms[RUNS];
    run(w);
    for (int k = 0; k < RUNS; k++) {
        double start = now_ms();
        run(w);
        ms[k] = now_ms() - start;
    }
    qsort(ms, RUNS, sizeof ms[0], compare);
    printf("%-44s median %8.3f ms  least %8.3f ms\n", name, ms[RUNS / 2], ms[0]);
    return ms[RUNS / 2];
}

static struct sv_relief relief_of(const struct shadow_field *f)
{
    struct sv_relief r;
    if (sv_relief_alloc(f->width, f->height, &r, NULL) != SV_OK)
        exit(1);
    float *h = shadow_field_heights(f);
    memcpy(r.displ, h, sizeof(float) * (size_t)f->width * (size_t)f->height);
    for (int k = 0; k < f->width * f->height; k++)
        r.color[k][3] = 255;
    free(h);
    r.frame =
        (struct sv_relief_frame){.a = sv_vec3(f->dx, 0, 0), .b = sv_vec3(0, f->dy, 0), .f = sv_vec3(0, 0, 1)};
    sv_relief_measure(&r);
    return r;
}

static void bench_front(void)
{
    struct shadow_field big = shadow_fields[6];
    big.width = big.height = 2048;
    size_t n = (size_t)big.width * (size_t)big.height;
    float *h = shadow_field_heights(&big);
    struct work w = {.height = malloc(n * 4), .lit = malloc(n)};
    w.front = (struct sv_row_front){2048, 2048, 30, 30, {0, 0, 0}, h, NULL, 1.5f};
    measure("2048^2 memcpy of the heights", run_copy, &w);
    static const double azimuth[2] = {70, 20};
    static const char *const names[2][2] = {
        {"2048^2 rows, scalar: P and lit", "2048^2 rows, best: P and lit"},
        {"2048^2 columns, scalar: P and lit", "2048^2 columns, best: P and lit"}};
    for (int class = 0; class < 2; class ++) {
        double a = sv_radians(azimuth[class]), e = sv_radians(20), ms[2];
        w.front.travel = sv_vec3(cos(a) * cos(e), sin(a) * cos(e), -sin(e));
        for (int k = 0; k < 2; k++) {
            w.level = k ? sv_simd_level() : SV_SIMD_SCALAR;
            ms[k] = measure(names[class][k], run_front, &w);
        }
        uint8_t *lit = w.lit;
        w.lit = NULL;
        measure("    best: P alone", run_front, &w);
        w.lit = lit;
        printf("    scalar / best %.2f, %.2f ns a sample\n", ms[0] / ms[1], ms[1] * 1e6 / (double)n);
    }
    free(h);
    free(w.height);
    free(w.lit);
}

static void bench_faces(void)
{
    struct sv_relief caster = relief_of(&shadow_fields[13]), plate = relief_of(&shadow_fields[0]);
    caster.frame.origin = sv_vec3(20, 10, 60);
    struct work w = {
        .relief = &caster, .receiver = &plate, .lit = malloc(128 * 128), .height = NULL, .texel = 1};
    for (int along = 0; along < 2; along++) {
        w.sweep = (struct sv_self_shadow_options){
            .travel = sv_normalize(along ? sv_vec3(1, 0.3, -0.6) : sv_vec3(0.3, 1, -0.6)), .bias_m = 0.05f};
        measure(along ? "128^2 line sweep, light along u" : "128^2 line sweep, light along v", run_sweep, &w);
    }
    measure("128^2 silhouette, texel 1", run_silhouette, &w);
    measure("128^2 cast, height form", run_cast, &w);
    sv_cast_silhouette_finish(&w.silhouette);
    w.front = (struct sv_row_front){128, 128, 1, 1, w.sweep.travel, caster.displ, NULL, 0.05f};
    w.level = sv_simd_level();
    measure("128^2 row front, best: lit", run_front, &w);
    free(w.lit);
    sv_relief_finish(&caster);
    sv_relief_finish(&plate);
}

int main(void)
{
    bench_front();
    bench_faces();
    return 0;
}
