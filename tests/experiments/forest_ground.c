/* forest_ground.c - what a cold view costs before its trees are drawn, stage by stage, in processor time:
 * windows of shadow with every caster in them, ground, sky, read-back of colour and depth. The forest of
 * forest_kit.h.
 *
 *   forest_ground [--counts 5000,45000] [--poses N] [--size PX] [-o FOLDER]
 *
 * What belongs to the sun is made before (its own row); every pose stands in a new place. FOLDER: pictures of
 * the ground in the shade of its trees, which are not drawn. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

#include "core/gl/context.h"
#include "core/gl/frame.h"
#include "core/gl/functions.h"
#include "core/gl/target.h"
#include "core/terrain/draw.h"
#include "core/terrain/ground.h"
#include "core/tree/draw.h"
#include "core/tree/shade.h"
#include "tests/experiments/forest_kit.h"

enum { POSES_MAX = 64 };
enum stage { DEPTH, READ_DEPTH, PAGES, SHADE, WRITE, READ_COLOR, STAGES };
static const char *const STAGE_NAMES[STAGES] = {"depth", "read depth", "shadows",
                                                "shade", "write",      "read colour"};
static const char *const KIND_NAMES[2] = {"overview", "walk"};

struct bench {
    struct forest forest;
    struct sv_terrain_draw *terrain;
    struct sv_tree_shade *shade;
    struct sv_shadow_pages *pages;
    struct sv_ground *ground;
    struct sv_shadow_height height;
    struct sv_gl_target *target;
    struct sv_image color, depth;
    double ms[STAGES][POSES_MAX];
    double triangles, pages_filled;
};

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

static struct sv_shadow_scene scene_of(const struct bench *b)
{
    return (struct sv_shadow_scene){.field = &b->forest.scene->terrain.field,
                                    .terrain = &b->height,
                                    .casters = {{sv_tree_shade_cast, b->shade}},
                                    .key = 1};
}

static void open_bench(struct bench *b, uint32_t trees, int size)
{
    struct sv_error error = {0};
    memset(b, 0, sizeof *b);
    forest_open(trees, false, &b->forest);
    const struct sv_scene *scene = b->forest.scene;
    struct sv_light light;
    sv_light_from_sun(&scene->sun, &light);
    must(sv_terrain_draw_create(&scene->terrain, b->forest.store, &b->terrain, &error), "terrain", &error);
    must(sv_shadow_pages_create(&b->pages, &error), "shadows", &error);
    must(sv_ground_create(&scene->terrain, &b->ground, &error), "ground", &error);
    must(sv_tree_draw_shade_create(sv_renderer_trees(b->forest.renderer), &b->shade, &error), "shade",
         &error);
    double since = processor_ms();
    must(sv_shadow_height_make(&b->height, &scene->terrain.field, light.to_sun, &error), "sun", &error);
    must(sv_tree_shade_update(b->shade, light.to_sun, sv_shadow_height_at, &b->height, &error), "sun",
         &error);
    printf("%6u trees: a sun's terrain and trees %.1f ms\n", trees, processor_ms() - since);
    struct sv_shadow_scene casting = scene_of(b);
    sv_shadow_pages_use(b->pages, &casting);
    since = processor_ms();
    int level = sv_shadow_pages_fill_whole(b->pages, trees, SV_SHADOW_PAGES_WHOLE_S);
    printf("%6u trees: shadows on all of the ground, texels of %g m: %.1f ms\n", trees,
           ldexp(SV_SHADOW_PAGE_TEXEL_M, level), processor_ms() - since);
    must(sv_gl_target_create(size, size, 1u << SV_LAYER_COLOR, &b->target, &error), "target", &error);
    must(sv_image_alloc(size, size, 4, SV_PIXEL_U8, &b->color, &error), "image", &error);
    must(sv_image_alloc(size, size, 1, SV_PIXEL_F32, &b->depth, &error), "image", &error);
}

static void close_bench(struct bench *b)
{
    sv_image_free(&b->color);
    sv_image_free(&b->depth);
    sv_gl_target_destroy(b->target);
    sv_shadow_height_finish(&b->height);
    sv_tree_shade_destroy(b->shade);
    sv_shadow_pages_destroy(b->pages);
    sv_ground_destroy(b->ground);
    sv_terrain_draw_destroy(b->terrain);
    forest_close(&b->forest);
}

static void lap(struct bench *b, int pose, enum stage which, double *since)
{
    gl.Finish();
    double now = processor_ms();
    b->ms[which][pose] = now - *since;
    *since = now;
}

static void draw(struct bench *b, const struct sv_view_request *request, int pose)
{
    struct sv_error error = {0};
    struct sv_resolved_view view;
    must(sv_view_resolve(b->forest.scene, request, &view, NULL, &error), "resolve", &error);
    struct sv_gl_frame frame;
    struct sv_terrain_draw_stats stats;
    memset(&frame, 0, sizeof frame);
    frame.camera = view.camera;
    sv_light_from_sun(&view.sun, &frame.light);
    frame.light.air = view.air;
    struct sv_shadow_scene casting = scene_of(b);
    sv_shadow_pages_use(b->pages, &casting);
    uint64_t filled = sv_shadow_pages_filled(b->pages);
    double since = processor_ms();
    sv_gl_target_begin(b->target);
    must(sv_gl_frame_begin(&frame, &error), "frame", &error);
    must(sv_terrain_draw(b->terrain, &frame, view.plan.terrain_error_px, true, &stats, &error), "ground",
         &error);
    lap(b, pose, DEPTH, &since);
    must(sv_gl_target_read(b->target, SV_LAYER_DEPTH, &b->depth, &error), "read", &error);
    lap(b, pose, READ_DEPTH, &since);
    struct sv_ground_view ground = {.camera = &view.camera,
                                    .light = &frame.light,
                                    .shadows = b->pages,
                                    .sky = true,
                                    .depth = b->depth.data};
    sv_ground_shade(b->ground, &ground, b->color.data);
    lap(b, pose, PAGES, &since);
    sv_ground_shade(b->ground, &ground, b->color.data); /* again: its pages are there now */
    lap(b, pose, SHADE, &since);
    b->ms[PAGES][pose] -= b->ms[SHADE][pose];
    must(sv_gl_target_write(b->target, &b->color, &error), "write", &error);
    lap(b, pose, WRITE, &since);
    must(sv_gl_target_read(b->target, SV_LAYER_COLOR, &b->color, &error), "read", &error);
    lap(b, pose, READ_COLOR, &since);
    b->triangles += stats.triangles;
    b->pages_filled += (double)(sv_shadow_pages_filled(b->pages) - filled);
}

static void run(uint32_t trees, int poses, int size, const char *folder)
{
    static struct bench b;
    open_bench(&b, trees, size);
    for (int kind = 0; kind < 2; kind++) {
        b.triangles = b.pages_filled = 0;
        for (int k = -1; k < poses;
             k++) { /* the first one makes shaders, and windows that belong to the sun */
            struct sv_view_request r = forest_request(&b.forest, (enum forest_eye)kind, k < 0 ? poses : k);
            char path[512];
            r.width = r.height = size;
            double since = processor_ms();
            draw(&b, &r, k < 0 ? 0 : k);
            if (k < 0) {
                printf("%6u trees, first view %.1f ms (shadows %.1f)\n", trees, processor_ms() - since,
                       b.ms[PAGES][0]);
                b.triangles = b.pages_filled = 0;
                continue;
            }
            snprintf(path, sizeof path, "%s/ground-%u-%s-%d.png", folder ? folder : "", trees,
                     KIND_NAMES[kind], k);
            if (folder && k < 4)
                forest_save(&b.color, path);
        }
        printf("%6u %-8s", trees, KIND_NAMES[kind]);
        for (int s = 0; s < STAGES; s++)
            printf("  %s %.2f", STAGE_NAMES[s], forest_median(b.ms[s], poses));
        printf("  ms; %.0f triangles, %.1f pages filled\n", b.triangles / poses, b.pages_filled / poses);
    }
    close_bench(&b);
}

int main(int argc, char **argv)
{
    const char *counts = "5000,45000", *folder = NULL;
    int poses = 8, size = 512;
    for (int k = 1; k + 1 < argc; k += 2) {
        if (strcmp(argv[k], "--counts") == 0)
            counts = argv[k + 1];
        else if (strcmp(argv[k], "--poses") == 0)
            poses = atoi(argv[k + 1]);
        else if (strcmp(argv[k], "--size") == 0)
            size = atoi(argv[k + 1]);
        else if (strcmp(argv[k], "-o") == 0)
            folder = argv[k + 1];
        else
            poses = 0;
    }
    if (argc % 2 == 0 || poses < 1 || poses > POSES_MAX || size < 16 || size > 4096) {
        fprintf(stderr,
                "usage: forest_ground [--counts N,N,...] [--poses 1..%d] [--size 16..4096] [-o FOLDER]\n",
                POSES_MAX);
        return 2;
    }
    if (folder)
        mkdir(folder, 0777);
    for (char *end; *counts; counts = *end ? end + 1 : end) {
        run((uint32_t)strtoul(counts, &end, 10), poses, size, folder);
        if (*end && *end != ',')
            break;
    }
    return 0;
}
