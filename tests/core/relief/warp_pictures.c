/* warp_pictures.c - see warp_pictures.h. */
#include "tests/core/relief/warp_pictures.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/relief/prewarp.h"
#include "core/relief/warp.h"
#include "core/relief/warp_kernel.h"

static void check(enum sv_status status, const struct sv_error *error)
{
    if (status == SV_OK)
        return;
    fprintf(stderr, "%s: %s\n", error->field, error->message);
    abort();
}

static void picture_init(int width, int height, struct warp_picture *p)
{
    size_t n = (size_t)width * (size_t)height;
    *p = (struct warp_picture){.width = width, .height = height};
    p->rgba = calloc(n, sizeof *p->rgba);
    p->hole = calloc(n, 1);
    if (!p->rgba || !p->hole)
        abort();
}

void warp_picture_finish(struct warp_picture *picture)
{
    free(picture->rgba);
    free(picture->unfiltered);
    free(picture->hole);
    free(picture->edge);
    *picture = (struct warp_picture){0};
}

static void truth_init(int width, int height, struct warp_picture *p)
{
    picture_init(width, height, p);
    p->unfiltered = calloc((size_t)width * (size_t)height, sizeof *p->unfiltered);
    p->edge = calloc((size_t)width * (size_t)height, 1);
    if (!p->unfiltered || !p->edge)
        abort();
}

/* Outlines are looked for where they matter: a tie is one pixel of ten here, one of ten thousand elsewhere.
 */
static bool small_enough(const struct warp_picture *p)
{
    return p->width * p->height < 4096;
}

static void march_pixel(const struct ray_field *field, const struct ray_view *view, double px, double py,
                        size_t p, struct warp_picture *picture)
{
    struct ray_seen seen, near;
    ray_march_view(field, view, px, py, &seen);
    for (int k = 0; k < 4 && small_enough(picture); k++) {
        double e = WARP_PICTURE_TIE_PX;
        ray_march_view(field, view, px + (k & 1 ? e : -e), py + (k & 2 ? e : -e), &near);
        picture->edge[p] |= (near.kind == RAY_NOTHING) != (seen.kind == RAY_NOTHING);
    }
    if (seen.kind == RAY_NOTHING)
        return;
    for (int e = 0; e < 3; e++) {
        picture->rgba[p][e] = (uint8_t)lrint(seen.rgb[e]);
        picture->unfiltered[p][e] = (uint8_t)lrint(seen.kind == RAY_HOLE ? seen.far_rgb[e] : seen.rgb[e]);
    }
    picture->rgba[p][3] = 255;
    picture->shown++;
    picture->hole[p] = seen.kind == RAY_HOLE;
    picture->holes += seen.kind == RAY_HOLE;
    picture->holes_left = picture->holes;
}

void warp_picture_truth(const struct ray_field *field, const struct sv_camera *camera,
                        struct warp_picture *picture)
{
    struct ray_view view;
    ray_view_init(field, camera, &view);
    truth_init(camera->width, camera->height, picture);
    for (int j = 0; j < camera->height; j++)
        for (int i = 0; i < camera->width; i++)
            march_pixel(field, &view, i + 0.5, j + 0.5, (size_t)j * (size_t)camera->width + (size_t)i,
                        picture);
}

static uint32_t count_shown(const uint8_t (*rgba)[4], int width, int height)
{
    uint32_t shown = 0;
    for (size_t p = 0; p < (size_t)width * (size_t)height; p++)
        shown += rgba[p][3] != 0;
    return shown;
}

void warp_picture_direct(const struct sv_relief *relief, const struct sv_camera *camera, enum sv_simd level,
                         struct warp_picture *picture)
{
    struct sv_warp_buffer buffer;
    struct sv_warp_stats stats = {0};
    struct sv_error error;
    struct sv_warp_source source = {.width = relief->width,
                                    .height = relief->height,
                                    .t = relief->displ,
                                    .color = (const uint8_t(*)[4])relief->color,
                                    .cut = relief->cut};
    picture_init(camera->width, camera->height, picture);
    check(sv_warp_buffer_create(camera->width, camera->height, &buffer, &error), &error);
    sv_warp_map_from_camera(&relief->frame, camera, 0, 0, &source.map);
    sv_warp_clear(&buffer);
    sv_warp_splat_at(level, &source, 0, &buffer, &stats);
    sv_warp_fill(&source, 1, &buffer, &stats);
    sv_warp_resolve_at(level, &source, 1, &buffer, picture->rgba);
    for (size_t p = 0; p < (size_t)camera->width * (size_t)camera->height; p++) {
        picture->rgba[p][3] = buffer.texel[p] == SV_WARP_EMPTY ? 0 : 255;
        picture->hole[p] = buffer.texel[p] != SV_WARP_EMPTY && (buffer.texel[p] & SV_WARP_FILLED);
    }
    picture->shown = count_shown((const uint8_t(*)[4])picture->rgba, picture->width, picture->height);
    picture->holes = stats.holes;
    picture->holes_left = stats.holes_left;
    sv_warp_buffer_finish(&buffer);
}

/* What relief_plane.frag finds at (u, v): where at least half of the bilinear weight is on samples that hold
 * something, the nearest of them says which surface is seen, and those within `cut` of it are mixed. */
static bool sample(const struct sv_warped *w, float cut, double u, double v, uint8_t rgba[4])
{
    double x = (u - w->u0) / (w->u1 - w->u0) * w->width - 0.5,
           y = (v - w->v0) / (w->v1 - w->v0) * w->height - 0.5;
    double i = floor(x), j = floor(y), weight[4], there = 0, sum[4] = {0};
    size_t at[4];
    int own = 0;
    if (!(u >= w->u0 && v >= w->v0 && u < w->u1 && v < w->v1)) /* the window is all that is drawn */
        return false;
    for (int k = 0; k < 4; k++) {
        int a = (int)sv_clamp(i + (k & 1), 0, w->width - 1),
            b = (int)sv_clamp(j + (k >> 1), 0, w->height - 1);
        at[k] = (size_t)b * (size_t)w->width + (size_t)a;
        weight[k] = w->color[at[k]][3] ? (k & 1 ? x - i : 1 - x + i) * (k >> 1 ? y - j : 1 - y + j) : 0;
        own = weight[k] > weight[own] ? k : own;
        there += weight[k];
    }
    if (there < 0.5)
        return false;
    for (int k = 0; k < 4; k++)
        for (int e = 0; e < 4 && fabsf(w->displ[at[k]] - w->displ[at[own]]) <= cut; e++)
            sum[e] += weight[k] * (e < 3 ? w->color[at[k]][e] : 1);
    for (int e = 0; e < 3; e++)
        rgba[e] = (uint8_t)lrint(sum[e] / sum[3]);
    rgba[3] = 255;
    return true;
}

static void two_pass(const struct sv_relief *relief, const struct sv_camera *camera, double scale,
                     struct sv_warped *warped)
{
    struct sv_prewarp prewarp;
    struct sv_error error;
    struct sv_prewarp_options options = {.fill = true};
    const struct sv_relief_frame *f = &relief->frame;
    bool parallel = camera->projection == SV_PROJECTION_ORTHOGRAPHIC;
    check(parallel ? sv_prewarp_parallel(f, camera->forward, &prewarp, &error)
                   : sv_prewarp_perspective(f, camera->eye, &prewarp, &error),
          &error);
    check(sv_prewarp_two_pass(relief, &prewarp, &options, warped, &error), &error);
    if (scale != 1) {
        options.width = (int)lrint(scale * warped->width);
        options.height = (int)lrint(scale * warped->height);
        sv_warped_finish(warped);
        check(sv_prewarp_two_pass(relief, &prewarp, &options, warped, &error), &error);
    }
}

void warp_picture_prewarp(const struct sv_relief *relief, const struct sv_camera *camera, double scale,
                          struct warp_picture *picture)
{
    struct sv_warped warped;
    const struct sv_relief_frame *f = &relief->frame;
    bool parallel = camera->projection == SV_PROJECTION_ORTHOGRAPHIC;
    picture_init(camera->width, camera->height, picture);
    two_pass(relief, camera, scale, &warped);
    for (int j = 0; j < camera->height; j++)
        for (int i = 0; i < camera->width; i++) {
            struct sv_vec3 origin, direction;
            double u, v, displ;
            sv_camera_ray(camera, i + 0.5, j + 0.5, &origin, &direction);
            struct sv_vec3 start = sv_sub(sv_add(origin, camera->eye), f->origin);
            double t = -sv_dot(start, f->f) / sv_dot(direction, f->f);
            if (!parallel && !(t > 0))
                continue;
            sv_relief_locate(f, sv_madd(sv_add(start, f->origin), direction, t), &u, &v, &displ);
            (void)sample(&warped, relief->cut, u, v,
                         picture->rgba[(size_t)j * (size_t)camera->width + (size_t)i]);
        }
    picture->shown = count_shown((const uint8_t(*)[4])warped.color, warped.width, warped.height);
    picture->holes = warped.holes;
    picture->holes_left = warped.holes_left;
    sv_warped_finish(&warped);
}

void warp_picture_on_plane(const struct sv_relief *relief, const struct ray_field *field,
                           const struct sv_camera *camera, struct warp_picture *truth,
                           struct warp_picture *warped)
{
    struct sv_warped w;
    struct ray_view view;
    ray_view_init(field, camera, &view);
    two_pass(relief, camera, 1, &w);
    truth_init(w.width, w.height, truth);
    picture_init(w.width, w.height, warped);
    for (int j = 0; j < w.height; j++)
        for (int i = 0; i < w.width; i++) {
            size_t p = (size_t)j * (size_t)w.width + (size_t)i;
            double u = w.u0 + (i + 0.5) * (w.u1 - w.u0) / w.width,
                   v = w.v0 + (j + 0.5) * (w.v1 - w.v0) / w.height;
            struct sv_vec3 d = sv_sub(sv_relief_point(&relief->frame, u, v, 0), camera->eye);
            bool parallel = camera->projection == SV_PROJECTION_ORTHOGRAPHIC;
            double focal = sv_camera_focal_px(camera) / (parallel ? 1 : sv_dot(d, camera->forward));
            march_pixel(field, &view, 0.5 * camera->width + focal * sv_dot(d, camera->right),
                        0.5 * camera->height - focal * sv_dot(d, camera->up), p, truth);
            memcpy(warped->rgba[p], w.color[p], 4);
        }
    warped->shown = count_shown((const uint8_t(*)[4])w.color, w.width, w.height);
    warped->holes = w.holes;
    warped->holes_left = w.holes_left;
    sv_warped_finish(&w);
}

static int levels_off(const uint8_t a[4], const uint8_t b[4])
{
    int off = 0;
    for (int e = 0; e < 3; e++)
        off = abs(a[e] - b[e]) > off ? abs(a[e] - b[e]) : off;
    return off;
}

struct warp_difference warp_picture_compare(const struct warp_picture *truth,
                                            const struct warp_picture *other, int levels)
{
    struct warp_difference d = {0};
    for (size_t p = 0; p < (size_t)truth->width * (size_t)truth->height; p++) {
        const uint8_t *a = truth->rgba[p], *b = other->rgba[p];
        if (!a[3] && !b[3])
            continue;
        bool off = a[3] != b[3] ? !(truth->edge && truth->edge[p]) : levels_off(a, b) > levels;
        if (off && a[3] && b[3] && truth->hole[p] && truth->unfiltered)
            off = levels_off(truth->unfiltered[p], b) > levels;
        d.pixels++;
        d.holes += truth->hole[p];
        d.differ += off;
        d.in_hole += off && truth->hole[p];
    }
    return d;
}
