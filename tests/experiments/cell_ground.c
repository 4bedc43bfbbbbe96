/* cell_ground.c - the ground of a cell: how long its panels take, whether their depth is what OSMesa draws,
 * and how a warp of them looks beside the drawn picture, at the reference point and off it.
 *
 *   cell_ground [--scene FILE] [--size TEXELS] [--picture PX] [--eyes N] [--cut TEXELS] [--overlap TEXELS]
 *
 * [--truth 1|16] [-o FOLDER]
 *
 * For each eye: V there, D the largest of 100 m / 2^k whose cube the ground leaves free. cut: in units of 2 /
 * TEXELS. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

#include "core/base/simd.h"
#include "core/cell/panel_ground.h"
#include "core/cell/region.h"
#include "core/cell/sweep_kernel.h"
#include "core/gl/frame.h"
#include "core/gl/target.h"
#include "core/terrain/draw.h"
#include "tests/experiments/forest_kit.h"

enum { EYES_MAX = 64, ROUNDS = 5 };

struct panel {
    struct sv_sweep sweep;
    float *q;
    uint8_t (*color)[4];
    struct sv_cell_jumps jumps;
};

struct bench {
    struct forest forest;
    struct sv_light light;
    struct sv_ground *ground;
    struct sv_shadow_height height;
    struct sv_shadow_pages *pages;
    struct sv_sweep_blocks *blocks;
    struct sv_terrain_draw *terrain;
    struct sv_gl_target *target;
    struct panel panels[SV_CELL_FACES];
    struct sv_warp_buffer buffer;
    int size, picture, truth;
    float cut;
    double overlap; /* texels */
    const char *folder;
};

/* A move of the eye off V, in units of D along the picture's right, the world's up and the picture's heading.
 */
static const struct move {
    const char *name;
    double right, up, forward;
} MOVES[] = {{"at V", 0, 0, 0},          {"right 0.05", 0.05, 0, 0}, {"right 0.1", 0.1, 0, 0},
             {"right 0.2", 0.2, 0, 0},   {"down 0.1", 0, -0.1, 0},   {"down 0.2", 0, -0.2, 0},
             {"up 0.05", 0, 0.05, 0},    {"up 0.1", 0, 0.1, 0},      {"up 0.2", 0, 0.2, 0},
             {"forward 0.1", 0, 0, 0.1}, {"forward 0.2", 0, 0, 0.2}, {"back 0.1", 0, 0, -0.1},
             {"back 0.2", 0, 0, -0.2}};
enum { MOVE_COUNT = sizeof MOVES / sizeof MOVES[0] };

static double processor_ms(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static void must(enum sv_status status, const char *what, const struct sv_error *error)
{
    if (!status)
        return;
    fprintf(stderr, "%s: %s: %s\n", what, error->field, error->message);
    exit(1);
}

static void open_bench(struct bench *b, const char *scene)
{
    struct sv_error error = {0};
    forest_open_file(scene, b->truth > 1, &b->forest);
    const struct sv_terrain *terrain = &b->forest.scene->terrain;
    size_t n = (size_t)b->size * (size_t)b->size;
    sv_light_from_sun(&b->forest.scene->sun, &b->light);
    must(sv_ground_create(terrain, &b->ground, &error), "ground", &error);
    must(sv_shadow_pages_create(&b->pages, &error), "shadows", &error);
    must(sv_shadow_height_make(&b->height, &terrain->field, b->light.to_sun, &error), "sun", &error);
    struct sv_shadow_scene scene_of = {.field = &terrain->field, .terrain = &b->height, .key = 1};
    sv_shadow_pages_use(b->pages, &scene_of);
    double since = processor_ms();
    must(sv_sweep_blocks_create(&terrain->field, &b->blocks, &error), "blocks", &error);
    printf("blocks of %d x %d samples: %.2f ms\n", terrain->field.width, terrain->field.height,
           processor_ms() - since);
    must(sv_terrain_draw_create(terrain, b->forest.store, &b->terrain, &error), "terrain", &error);
    must(sv_gl_target_create(b->size, b->size, 1u << SV_LAYER_DEPTH, &b->target, &error), "target", &error);
    must(sv_warp_buffer_create(b->picture, b->picture, &b->buffer, &error), "warp", &error);
    for (int k = 0; k < SV_CELL_FACES; k++) {
        b->panels[k].q = malloc(n * sizeof(float));
        b->panels[k].color = malloc(n * 4);
    }
}

static void close_bench(struct bench *b)
{
    for (int k = 0; k < SV_CELL_FACES; k++) {
        free(b->panels[k].q);
        free(b->panels[k].color);
    }
    sv_warp_buffer_finish(&b->buffer);
    sv_gl_target_destroy(b->target);
    sv_terrain_draw_destroy(b->terrain);
    sv_sweep_blocks_destroy(b->blocks);
    sv_shadow_pages_destroy(b->pages);
    sv_shadow_height_finish(&b->height);
    sv_ground_destroy(b->ground);
    forest_close(&b->forest);
}

/* Whether no sample of the field within the square is higher than the cube's floor. */
static bool is_free(const struct sv_heightfield *f, struct sv_vec3 v, double d)
{
    for (double y = -1; y <= 1; y += 1.0 / 32)
        for (double x = -1; x <= 1; x += 1.0 / 32) {
            double z;
            if (sv_heightfield_height(f, v.x + x * d, v.y + y * d, &z) && z > v.z - d)
                return false;
        }
    return true;
}

static double distance_of(const struct sv_heightfield *f, struct sv_vec3 v)
{
    double d = 100;
    while (d > 0.5 && !is_free(f, v, d))
        d /= 2;
    return d;
}

/* ---- panels ---- */

static double sweep_ms(const struct sv_sweep *sweep, sv_sweep_columns *columns, float *q)
{
    double ms[ROUNDS];
    for (int k = 0; k < ROUNDS; k++) {
        double since = processor_ms();
        if (columns)
            sv_sweep_by(sweep, columns, q);
        else
            sv_sweep(sweep, q);
        ms[k] = processor_ms() - since;
    }
    return forest_median(ms, ROUNDS);
}

/* Shares of texels whose q is off by more than 1e-3 of itself from what OSMesa draws at full detail: where
 * both have ground, and where one has. */
static void check_depth(struct bench *b, const struct panel *p, double *off, double *other)
{
    struct sv_error error = {0};
    struct sv_gl_frame frame;
    struct sv_image depth = {0};
    memset(&frame, 0, sizeof frame);
    frame.camera = sv_panel_ground_camera(&p->sweep);
    frame.light = b->light;
    must(sv_image_alloc(b->size, b->size, 1, SV_PIXEL_F32, &depth, &error), "image", &error);
    sv_gl_target_begin(b->target);
    must(sv_gl_frame_begin(&frame, &error), "frame", &error);
    must(sv_terrain_draw(b->terrain, &frame, 0, true, NULL, &error), "terrain", &error);
    must(sv_gl_target_read(b->target, SV_LAYER_DEPTH, &depth, &error), "read", &error);
    size_t n = (size_t)b->size * (size_t)b->size, bad = 0, one = 0;
    const float *drawn = depth.data;
    for (size_t k = 0; k < n; k++) {
        bool both = p->q[k] > 0 && drawn[k] > 0;
        bad += both && fabsf(p->q[k] - drawn[k]) > 1e-3f * drawn[k];
        one += (p->q[k] > 0) != (drawn[k] > 0);
    }
    *off = (double)bad / (double)n;
    *other = (double)one / (double)n;
    sv_image_free(&depth);
}

static void make_panels(struct bench *b, struct sv_vec3 v, double d)
{
    static const char *const NAMES[SV_CELL_FACES] = {"east", "north", "west", "south", "down", "up"};
    size_t n = (size_t)b->size * (size_t)b->size;
    for (int k = 0; k < SV_CELL_FACES; k++) {
        struct panel *p = &b->panels[k];
        p->sweep = (struct sv_sweep){.field = &b->forest.scene->terrain.field,
                                     .blocks = b->blocks,
                                     .v = v,
                                     .distance_m = d,
                                     .face = (enum sv_cell_face)k,
                                     .size = b->size,
                                     .reach = 1 + 2 * b->overlap / b->size};
        struct sv_sweep plain = p->sweep;
        plain.blocks = NULL;
        double ms = sweep_ms(&p->sweep, NULL, p->q), scalar = NAN, whole = NAN, off, other;
        if (k < SV_CELL_DOWN) {
            scalar = sweep_ms(&p->sweep, sv_sweep_columns_scalar, p->q);
            whole = sweep_ms(&plain, NULL, p->q);
        }
        check_depth(b, p, &off, &other);
        struct sv_panel_ground_options o = {
            .sweep = p->sweep, .ground = b->ground, .light = &b->light, .shadows = b->pages};
        sv_panel_ground_make(&o, p->q, p->color);
        double since = processor_ms();
        sv_panel_ground_make(&o, p->q, p->color); /* its shadows are there now */
        double made = processor_ms() - since;
        since = processor_ms();
        sv_cell_jumps_measure(p->q, b->size, b->cut, &p->jumps);
        printf("  %-5s sweep %.2f ms (no blocks %.2f, scalar %.2f), panel %.2f, jumps %.2f; ground %.1f %%; "
               "off from OSMesa %.3f %%, "
               "one has ground %.3f %%\n",
               NAMES[k], ms, whole, scalar, made, processor_ms() - since,
               100 * (double)p->jumps.texels / (double)n, 100 * off, 100 * other);
    }
}

/* ---- pictures ---- */

struct result {
    struct sv_compare_result error;
    double holes, left, lost, gained, cracks, predicted, ms;
};

static void warp(struct bench *b, const struct sv_camera *camera, uint8_t *rgba, struct result *r)
{
    struct sv_warp_source sources[SV_CELL_FACES];
    struct sv_warp_stats stats = {0};
    size_t n = (size_t)b->picture * (size_t)b->picture;
    double since = processor_ms();
    sv_warp_clear(&b->buffer);
    for (int k = 0; k < SV_CELL_FACES; k++) {
        sources[k] = (struct sv_warp_source){.width = b->size,
                                             .height = b->size,
                                             .t = b->panels[k].q,
                                             .color = (const uint8_t(*)[4])b->panels[k].color,
                                             .cut = b->cut};
        sv_panel_ground_map(&b->panels[k].sweep, camera, 0, 0, &sources[k].map);
        if (b->panels[k].jumps.texels > 0)
            sv_warp_splat(&sources[k], (unsigned)k, &b->buffer, &stats);
    }
    sv_warp_fill(sources, SV_CELL_FACES, &b->buffer, &stats);
    sv_warp_resolve(sources, SV_CELL_FACES, &b->buffer, (uint8_t(*)[4])rgba);
    r->ms = processor_ms() - since;
    uint8_t *hidden = malloc(n);
    float *nothing = calloc(n, sizeof *nothing);
    for (size_t k = 0; k < n; k++)
        hidden[k] = b->buffer.texel[k] != SV_WARP_EMPTY;
    struct sv_ground_view sky = {
        .camera = camera, .light = &b->light, .sky = true, .depth = nothing, .hidden = hidden};
    sv_ground_shade(b->ground, &sky, rgba);
    free(hidden);
    free(nothing);
    r->holes = (double)stats.holes / (double)n;
    r->left = (double)stats.holes_left / (double)n;
}

/* Pixels of ground that the warp shows as sky, and the other way, by the drawn depth; cracks: of the first,
 * those that are not at the skyline (ground three pixels up). */
static void count_sky(struct bench *b, const struct sv_image *depth, struct result *r)
{
    int n = b->picture, lost = 0, gained = 0, cracks = 0;
    const float *z = depth->data;
    for (int k = 0; k < n * n; k++) {
        bool ground = isfinite(z[k]) && z[k] > 0, has = b->buffer.texel[k] != SV_WARP_EMPTY;
        bool below = k >= 3 * n && isfinite(z[k - 3 * n]) && z[k - 3 * n] > 0;
        lost += ground && !has;
        gained += has && !ground;
        cracks += ground && !has && below;
    }
    r->lost = (double)lost / ((double)n * n);
    r->gained = (double)gained / ((double)n * n);
    r->cracks = cracks;
}

/* Differences times 8, and which pixels were filled (red) or are sky where the drawing has ground (blue). */
static void save_difference(const struct bench *b, const struct sv_image *a, const struct sv_image *t,
                            const char *path)
{
    struct sv_image d = {0};
    struct sv_error error = {0};
    must(sv_image_alloc(a->width, a->height, 3, SV_PIXEL_U8, &d, &error), "image", &error);
    const uint8_t *x = a->data, *y = t->data;
    for (int k = 0; k < a->width * a->height; k++)
        for (int c = 0; c < 3; c++) {
            int v = 8 * abs(x[k * 4 + c] - y[k * t->channels + c]);
            uint32_t texel = b->buffer.texel[k];
            if (c == 0 && texel != SV_WARP_EMPTY && texel & SV_WARP_FILLED)
                v = 255;
            ((uint8_t *)d.data)[k * 3 + c] = (uint8_t)(v < 255 ? v : 255);
        }
    forest_save(&d, path);
    sv_image_free(&d);
}

/* Share of what the panels cover that is to open for an eye at that offset. */
static double predicted(const struct bench *b, struct sv_vec3 offset)
{
    const struct sv_region_view view = {.focal_px = b->picture, .width = b->picture, .height = b->picture};
    double sum = 0, texels = 0;
    for (int k = 0; k < SV_CELL_FACES; k++) {
        struct sv_region_panel panel = {
            .face = (enum sv_cell_face)k, .size = b->size, .q_most = 1, .jumps = b->panels[k].jumps};
        sum += sv_region_predict(&panel, offset, &view).hole_share * panel.jumps.texels;
        texels += panel.jumps.texels;
    }
    return texels > 0 ? sum / texels : 0;
}

static struct result show(struct bench *b, const struct sv_view_request *base, const struct sv_camera *camera,
                          double d, int eye, const struct move *move)
{
    struct sv_view_request r = *base;
    struct sv_error error = {0};
    struct sv_picture drawn;
    struct sv_image warped = {0}, truth = {0};
    struct result result = {.predicted = 0};
    struct sv_vec3 flat = sv_normalize(sv_vec3(camera->forward.x, camera->forward.y, 0));
    struct sv_vec3 off = sv_add(sv_scale(camera->right, move->right * d), sv_scale(flat, move->forward * d));
    off.z += move->up * d;
    struct sv_camera at = *camera;
    at.eye = sv_add(at.eye, off);
    r.eye =
        (struct sv_place){.form = SV_PLACE_XY, .x = at.eye.x, .y = at.eye.y, .has_z = true, .z = at.eye.z};
    r.layers = 1u << SV_LAYER_COLOR | 1u << SV_LAYER_DEPTH;
    forest_draw(&b->forest, &r, &drawn, NULL, NULL, NULL);
    must(sv_image_alloc(b->picture, b->picture, 4, SV_PIXEL_U8, &warped, &error), "image", &error);
    warp(b, &at, warped.data, &result);
    count_sky(b, &drawn.layer[SV_LAYER_DEPTH], &result);
    if (b->truth > 1)
        forest_truth_of(&b->forest, &r, b->truth, &truth);
    const struct sv_image *against = b->truth > 1 ? &truth : &drawn.layer[SV_LAYER_COLOR];
    result.error = forest_compare(&warped, against);
    result.predicted = predicted(b, sv_scale(off, 1 / d));
    if (b->folder) {
        char path[512];
        snprintf(path, sizeof path, "%s/%d-%s-warped.png", b->folder, eye, move->name);
        forest_save(&warped, path);
        snprintf(path, sizeof path, "%s/%d-%s-drawn.png", b->folder, eye, move->name);
        forest_save(&drawn.layer[SV_LAYER_COLOR], path);
        snprintf(path, sizeof path, "%s/%d-%s-off.png", b->folder, eye, move->name);
        save_difference(b, &warped, against, path);
    }
    if (b->truth > 1) {
        struct sv_compare_result own = forest_compare(&drawn.layer[SV_LAYER_COLOR], &truth);
        printf("    drawn against truth: mean %.3f SSIM %.4f\n", own.mean_abs, own.ssim);
    }
    sv_image_free(&truth);
    sv_image_free(&warped);
    sv_picture_finish(&drawn);
    return result;
}

static void run_eye(struct bench *b, int k, struct result results[MOVE_COUNT])
{
    struct sv_error error = {0};
    struct sv_view_request r = forest_request(&b->forest, k & 1 ? FOREST_WALK : FOREST_OVERVIEW, k);
    struct sv_resolved_view view;
    r.width = r.height = b->picture;
    if (k & 1)
        r.eye.agl = 3;
    r.pitch_rad = sv_radians(k & 1 ? -3 : -12);
    must(sv_view_resolve(b->forest.scene, &r, &view, NULL, &error), "resolve", &error);
    double d = distance_of(&b->forest.scene->terrain.field, view.camera.eye);
    printf("eye %d, %.1f m above the ground, heading %.0f, D %.4g m\n", k, view.camera.eye.z - view.ground_z,
           view.heading_rad * 180 / SV_PI, d);
    make_panels(b, view.camera.eye, d);
    for (int m = 0; m < MOVE_COUNT; m++) {
        struct result one = show(b, &r, &view.camera, d, k, &MOVES[m]);
        printf("    %-12s mean %.3f SSIM %.4f  holes %.3f %% (left %.3f; predicted %.3f)  lost %.3f %% "
               "gained %.3f %% cracks %.1f px  %.1f ms\n",
               MOVES[m].name, one.error.mean_abs, one.error.ssim, 100 * one.holes, 100 * one.left,
               100 * one.predicted, 100 * one.lost, 100 * one.gained, one.cracks, one.ms);
        results[m].error.mean_abs += one.error.mean_abs;
        results[m].error.ssim += one.error.ssim;
        results[m].holes += one.holes;
        results[m].predicted += one.predicted;
        results[m].lost += one.lost;
        results[m].cracks += one.cracks;
        results[m].gained += one.gained;
        results[m].ms += one.ms;
    }
}

static int usage(void)
{
    fprintf(stderr,
            "usage: cell_ground [--scene FILE] [--size 64..4096] [--picture 64..2048] [--eyes 1..%d] [--cut "
            "TEXELS] "
            "[--truth 1|4|16|64] [-o FOLDER]\n",
            EYES_MAX);
    return 2;
}

int main(int argc, char **argv)
{
    static struct bench b = {.size = 1024, .picture = 512, .truth = 1, .overlap = 1};
    const char *scene = "tests/experiments/cell_ground.json";
    double cut = (double)SV_PANEL_GROUND_CUT;
    int eyes = 4;
    for (int k = 1; k + 1 < argc; k += 2) {
        const char *value = argv[k + 1];
        if (strcmp(argv[k], "--scene") == 0)
            scene = value;
        else if (strcmp(argv[k], "--size") == 0)
            b.size = atoi(value);
        else if (strcmp(argv[k], "--picture") == 0)
            b.picture = atoi(value);
        else if (strcmp(argv[k], "--eyes") == 0)
            eyes = atoi(value);
        else if (strcmp(argv[k], "--cut") == 0)
            cut = atof(value);
        else if (strcmp(argv[k], "--overlap") == 0)
            b.overlap = atof(value);
        else if (strcmp(argv[k], "--truth") == 0)
            b.truth = atoi(value);
        else if (strcmp(argv[k], "-o") == 0)
            b.folder = value;
        else
            return usage();
    }
    if (argc % 2 == 0 || eyes < 1 || eyes > EYES_MAX || b.size < 64 || b.size > SV_SWEEP_SIZE_MAX ||
        b.picture < 64 || b.picture > 2048 || !(cut > 0))
        return usage();
    b.cut = (float)(cut * 2 / b.size);
    if (b.folder)
        mkdir(b.folder, 0777);
    open_bench(&b, scene);
    struct result results[MOVE_COUNT] = {0};
    for (int k = 0; k < eyes; k++)
        run_eye(&b, k, results);
    printf("means of %d eyes, panels of %d, cut %g texels (%.5f)\n", eyes, b.size, cut, (double)b.cut);
    for (int m = 0; m < MOVE_COUNT; m++)
        printf("  %-12s mean %.3f SSIM %.4f  holes %.3f %% (predicted %.3f)  lost %.3f %% gained %.3f %%  "
               "cracks %.1f px  "
               "%.1f ms\n",
               MOVES[m].name, results[m].error.mean_abs / eyes, results[m].error.ssim / eyes,
               100 * results[m].holes / eyes, 100 * results[m].predicted / eyes, 100 * results[m].lost / eyes,
               100 * results[m].gained / eyes, results[m].cracks / eyes, results[m].ms / eyes);
    close_bench(&b);
    return 0;
}
