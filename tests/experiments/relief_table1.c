/* relief_table1.c - paper 1's table 1 and figure 6 again: one object of six 128 x 128 relief textures at 512
 * x 512, (a) plain, (b) lit, (c) shadowed, the light moving every frame and nothing kept from frame to frame.
 *
 *   relief_table1 [-o OUT.png] [--frames N] [--body NAME]
 *
 * Two ways: the direct warp (core/relief/object.h, whole frame to RGBA), and the paper's own: two-pass
 * pre-warp of the faces that look towards the eye, then a quad each by OSMesa, with shadows by line sweep and
 * by shadow textures. The six cases take turns frame by frame, so that what else the machine does falls on
 * all alike; medians and minima. A frame of the direct warp always comes after one of the paper's way, which
 * leaves little of it in the caches, and the direct cases change places from frame to frame, so that each
 * comes after each of the paper's equally often: none finds its data warmer than the others. OUT.png: three
 * pictures side by side (a, b, c), the direct way above, the paper's below. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "core/base/color.h"
#include "core/base/frames.h"
#include "core/base/simd.h"
#include "core/gl/context.h"
#include "core/gl/frame.h"
#include "core/gl/target.h"
#include "core/image/encode.h"
#include "core/relief/draw_prewarp.h"
#include "core/relief/object.h"
#include "core/relief/object_shadow.h"
#include "tests/experiments/object_kit.h"

enum { SIDE = 512, RESOLUTION = 128, FRAMES = 200, FRAMES_MAX = 100000, CASES = 6, PICTURES = 3 };
static const struct sv_relief_place PLACE = {{0, 0, 0}, 2, 0};
static const char *const CASE_NAMES[PICTURES] = {"(a) plain", "(b) lit", "(c) shadowed"};
/* Frames/s of the paper, Pentium III 800 MHz. */
static const double PAPER[PICTURES] = {11.4, 10.1, 8.70};

struct experiment {
    struct sv_tree_mesh mesh;
    struct sv_relief_object object;
    struct sv_relief_look *look;
    struct sv_relief_shade *shade;
    struct sv_camera camera;
    struct sv_warp_buffer buffer;
    struct sv_prewarp_draw *draw;
    struct sv_gl_target *target;
    uint8_t (*lit_color)[4], *lit[SV_RELIEF_SHEETS]; /* of the paper's way */
    uint8_t (*picture[CASES])[4];
    struct sv_warp_stats stats; /* of the direct way, last frame */
};

static void must(enum sv_status status, const struct sv_error *error)
{
    if (status == SV_OK)
        return;
    fprintf(stderr, "relief_table1: %s: %s\n", error->field, error->message);
    exit(1);
}

static void *must_alloc(size_t bytes)
{
    void *memory = calloc(1, bytes);
    if (!memory) {
        fprintf(stderr, "relief_table1: no memory\n");
        exit(1);
    }
    return memory;
}

static double now_ms(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

/* Once round the object in 256 frames, at 40 degrees. */
static void light_of(int frame, struct sv_light *light)
{
    const struct sv_sun sun = {2 * SV_PI * (frame % 256) / 256 + 1.2, sv_radians(40)};
    sv_light_from_sun(&sun, light);
}

static const struct sv_relief_look_options HOW[PICTURES] = {
    {.lit = false, .shade_height_m = -INFINITY},
    {.lit = true, .specular = 0.15f, .shininess = 24, .has_viewer = true, .shade_height_m = -INFINITY},
    {.lit = true,
     .shadow = SV_RELIEF_SHADOW_ROW_FRONT,
     .specular = 0.15f,
     .shininess = 24,
     .has_viewer = true,
     .shade_height_m = -INFINITY}};

static void frame_direct(struct experiment *x, int form, int frame, uint8_t (*rgba)[4])
{
    struct sv_error error;
    struct sv_light light;
    struct sv_relief_look_options how = HOW[form];
    const struct sv_warp_source *sources;
    unsigned count;
    how.eye = x->camera.eye;
    how.in_warp = true; /* nothing is kept for another view */
    light_of(frame, &light);
    const struct sv_warp_buffer *last = &x->buffer; /* as of the last frame: nothing else was written */
    for (int j = last->y0; j < last->y1 && last->x0 < last->x1; j++)
        memset(rgba[j * SIDE + last->x0], 0, (size_t)(last->x1 - last->x0) * 4);
    unsigned faces = sv_relief_object_faces(&x->object, &PLACE, &x->camera);
    must(sv_relief_look_light(x->look, &PLACE, &light, &how, faces, &error), &error);
    x->stats = (struct sv_warp_stats){0};
    must(sv_relief_look_warp(x->look, &PLACE, &x->camera, 0, 0, faces, &x->buffer, &sources, &count,
                             &x->stats, &error),
         &error);
    sv_warp_resolve(sources, count, &x->buffer, rgba);
}

/* Faces that look towards the eye: what the paper warps. */
static unsigned facing(const struct experiment *x)
{
    unsigned faces = 0;
    for (int k = 0; k < SV_RELIEF_FACES; k++) {
        struct sv_relief_frame f = sv_relief_object_frame(&x->object, k, &PLACE);
        faces |= sv_dot(sv_sub(x->camera.eye, f.origin), f.f) > 0 ? 1u << k : 0;
    }
    return faces;
}

/* The face as it stands in the world, of the object's height. */
static struct sv_relief world_relief(const struct experiment *x, int k, float *displ)
{
    struct sv_relief r = x->object.face[k];
    size_t texels = (size_t)r.width * (size_t)r.height;
    r.frame = sv_relief_object_frame(&x->object, k, &PLACE);
    for (size_t i = 0; i < texels; i++)
        displ[i] = r.displ[i] * (float)PLACE.height_m;
    r.displ = displ;
    r.displ_min *= (float)PLACE.height_m;
    r.displ_max *= (float)PLACE.height_m;
    r.cut *= (float)PLACE.height_m;
    return r;
}

static void frame_paper(struct experiment *x, int form, int frame, uint8_t (*rgba)[4])
{
    static float displ[RESOLUTION * RESOLUTION];
    struct sv_error error;
    struct sv_gl_frame gl_frame = {.camera = x->camera};
    unsigned faces = facing(x);
    struct sv_relief sheet[SV_RELIEF_SHEETS];
    light_of(frame, &gl_frame.light);
    for (int k = 0; k < SV_RELIEF_SHEETS; k++)
        sheet[k] = *sv_relief_sheet(&x->object, k);
    for (int k = SV_RELIEF_FACES; k < SV_RELIEF_SHEETS; k++)
        sheet[k].solid_count = 0; /* the paper has six textures */
    if (form == 2)
        must(sv_relief_shade_light(x->shade, sheet, gl_frame.light.to_sun, SV_RELIEF_SHADOW_LINE_SWEEP, faces,
                                   NULL, x->lit, &error),
             &error);
    must(sv_gl_frame_begin(&gl_frame, &error), &error);
    sv_gl_target_begin(x->target);
    for (int k = 0; k < SV_RELIEF_FACES; k++) {
        if (!(faces >> k & 1))
            continue;
        struct sv_relief r = world_relief(x, k, displ);
        struct sv_relief_light how = {.light = &gl_frame.light,
                                      .frame = r.frame,
                                      .lit = form == 2 ? x->lit[k] : NULL,
                                      .has_viewer = true,
                                      .eye = x->camera.eye,
                                      .specular = HOW[form].specular,
                                      .shininess = HOW[form].shininess};
        if (form > 0)
            sv_relief_light(&r, &how, x->lit_color);
        struct sv_prewarp prewarp;
        struct sv_warped warped;
        struct sv_prewarp_options options = {.color = form > 0 ? (const uint8_t(*)[4])x->lit_color : NULL,
                                             .fill = true};
        must(sv_prewarp_perspective(&r.frame, x->camera.eye, &prewarp, &error), &error);
        must(sv_prewarp_two_pass(&r, &prewarp, &options, &warped, &error), &error);
        must(sv_prewarp_draw_upload(x->draw, &warped, NULL, &error), &error);
        struct sv_prewarp_plane plane = {.frame = &r.frame, .cut = r.cut};
        must(sv_prewarp_draw_plane(x->draw, &gl_frame, &plane, &error), &error);
        sv_warped_finish(&warped);
    }
    struct sv_image image = {SIDE, SIDE, 4, SV_PIXEL_U8, rgba};
    must(sv_gl_target_read(x->target, SV_LAYER_COLOR, &image, &error), &error);
}

static void run_case(struct experiment *x, int c, int frame)
{
    if (c < PICTURES)
        frame_direct(x, c, frame, x->picture[c]);
    else
        frame_paper(x, c - PICTURES, frame, x->picture[c]);
}

static void set_up(struct experiment *x, enum object_kit_body body)
{
    struct sv_error error;
    x->mesh = object_kit_make(body);
    must(sv_relief_object_bake(&x->mesh, RESOLUTION, &x->object, &error), &error);
    must(sv_relief_look_create(&x->object, &x->look, &error), &error);
    must(sv_relief_shade_create(&x->object, &x->shade, &error), &error);
    must(sv_warp_buffer_create(SIDE, SIDE, &x->buffer, &error), &error);
    must(sv_prewarp_draw_create(&x->draw, &error), &error);
    must(sv_gl_target_create(SIDE, SIDE, 1u << SV_LAYER_COLOR, &x->target, &error), &error);
    x->lit_color = must_alloc((size_t)RESOLUTION * RESOLUTION * 4);
    for (int k = 0; k < SV_RELIEF_SHEETS; k++)
        x->lit[k] = must_alloc((size_t)RESOLUTION * RESOLUTION);
    for (int c = 0; c < CASES; c++)
        x->picture[c] = must_alloc((size_t)SIDE * SIDE * 4);
    double azimuth = sv_radians(38), elevation = sv_radians(24), distance = 7.4;
    x->camera = (struct sv_camera){.vfov_rad = sv_radians(24), .width = SIDE, .height = SIDE, .near_m = 0.1};
    x->camera.eye = sv_madd(sv_vec3(0, 0, 0.94), sv_direction(azimuth, elevation), distance);
    sv_camera_aim(&x->camera, azimuth + SV_PI, -elevation, 0);
}

static void tear_down(struct experiment *x)
{
    for (int k = 0; k < SV_RELIEF_SHEETS; k++)
        free(x->lit[k]);
    for (int c = 0; c < CASES; c++)
        free(x->picture[c]);
    free(x->lit_color);
    sv_gl_target_destroy(x->target);
    sv_prewarp_draw_destroy(x->draw);
    sv_warp_buffer_finish(&x->buffer);
    sv_relief_shade_destroy(x->shade);
    sv_relief_look_destroy(x->look);
    sv_relief_object_finish(&x->object);
    sv_tree_mesh_finish(&x->mesh);
}

static int by_value(const void *a, const void *b)
{
    double p = *(const double *)a, q = *(const double *)b;
    return (p > q) - (p < q);
}

/* What a frame took: by the clock on the wall, and of the processor. */
enum { WALL, PROCESSOR, CLOCKS };
static const char *const CLOCK_NAMES[CLOCKS] = {"wall", "processor"};

static void print_way(const char *way, int first, double (*ms)[CASES], int frames)
{
    double median[PICTURES], least[PICTURES];
    double *sorted = must_alloc((size_t)frames * sizeof *sorted);
    for (int c = 0; c < PICTURES; c++) {
        for (int i = 0; i < frames; i++)
            sorted[i] = ms[i][first + c];
        qsort(sorted, (size_t)frames, sizeof *sorted, by_value);
        median[c] = sorted[frames / 2];
        least[c] = sorted[0];
    }
    free(sorted);
    for (int c = 0; c < PICTURES; c++)
        printf("%-12s %-13s %9.3f ms %8.1f frames/s %7.2fx   %9.3f ms %8.1f frames/s %7.2fx   %7.2f %7.2fx\n",
               way, CASE_NAMES[c], median[c], 1e3 / median[c], median[c] / median[0], least[c],
               1e3 / least[c], least[c] / least[0], PAPER[c], PAPER[0] / PAPER[c]);
}

/* Three by two pictures over a grey ground. */
static void write_figure(const struct experiment *x, const char *path)
{
    const size_t width = (size_t)PICTURES * SIDE;
    struct sv_image image = {(int)width, 2 * SIDE, 3, SV_PIXEL_U8, must_alloc(width * 2 * SIDE * 3)};
    uint8_t *to = image.data;
    for (size_t j = 0; j < 2 * SIDE; j++)
        for (size_t i = 0; i < width; i++, to += 3) {
            const uint8_t *from = x->picture[j / SIDE * PICTURES + i / SIDE][j % SIDE * SIDE + i % SIDE];
            for (int c = 0; c < 3; c++)
                to[c] = from[3] ? from[c] : (uint8_t)(96 + 64 * (j % SIDE) / SIDE);
        }
    struct sv_encode_layer layer = {&image, NULL};
    const struct sv_encode_options options = {.format = SV_FORMAT_PNG, .quality = 90};
    struct sv_error error;
    void *bytes;
    size_t size;
    must(sv_image_encode(&layer, 1, &options, &bytes, &size, &error), &error);
    FILE *f = fopen(path, "wb");
    if (!f || fwrite(bytes, 1, size, f) != size || fclose(f) != 0) {
        fprintf(stderr, "relief_table1: cannot write %s\n", path);
        exit(1);
    }
    free(bytes);
    free(image.data);
    printf("%s: (a), (b), (c); the direct warp above, the paper's way below\n", path);
}

/* Which case has turn 0 .. CASES - 1 of a frame: direct and paper's by turns. */
static int case_of(int frame, int turn)
{
    return turn & 1 ? PICTURES + turn / 2 : (frame + turn / 2) % PICTURES;
}

/* Each case once, checked: something is drawn, and shadows make it no brighter. */
static void check(struct experiment *x)
{
    double mean[CASES];
    for (int c = 0; c < CASES; c++) {
        double sum = 0;
        long held = 0;
        run_case(x, c, 0);
        for (size_t i = 0; i < (size_t)SIDE * SIDE; i++)
            if (x->picture[c][i][3])
                sum += x->picture[c][i][1], held++;
        mean[c] = sum / (double)(held ? held : 1);
        if (held < SIDE * SIDE / 8 || (c % PICTURES == 2 && !(mean[c] <= mean[c - 1]))) {
            fprintf(stderr, "relief_table1: case %d is not drawn as it should be: %ld px, mean level %.1f\n",
                    c, held, mean[c]);
            exit(1);
        }
    }
}

static enum object_kit_body body_of(const char *name)
{
    for (int k = 0; k < OBJECT_KIT_COUNT; k++)
        if (strcmp(name, object_kit_names[k]) == 0)
            return (enum object_kit_body)k;
    fprintf(stderr, "relief_table1: --body %s: sphere, box, torus, courtyard, knot or urn\n", name);
    exit(2);
}

int main(int argc, char **argv)
{
    static struct experiment x;
    const char *out = NULL;
    long frames = FRAMES;
    enum object_kit_body body = OBJECT_KIT_URN;
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "-o") == 0 && i + 1 < argc) {
            out = argv[++i];
        } else if (strcmp(argv[i], "--frames") == 0 && i + 1 < argc) {
            frames = strtol(argv[++i], NULL, 10);
        } else if (strcmp(argv[i], "--body") == 0 && i + 1 < argc) {
            body = body_of(argv[++i]);
        } else {
            fprintf(stderr, "usage: %s [-o OUT.png] [--frames N] [--body NAME]\n", argv[0]);
            return 2;
        }
    }
    if (frames < 1 || frames > FRAMES_MAX) {
        fprintf(stderr, "relief_table1: --frames %ld: 1 to %d are legal\n", frames, FRAMES_MAX);
        return 2;
    }
    struct sv_gl_context *context;
    struct sv_error error;
    sv_color_init();
    sv_image_init();
    must(sv_gl_context_create(&context, &error), &error);
    set_up(&x, body);
    check(&x);
    double(*ms[CLOCKS])[CASES];
    static const clockid_t CLOCK[CLOCKS] = {[WALL] = CLOCK_MONOTONIC, [PROCESSOR] = CLOCK_THREAD_CPUTIME_ID};
    for (int k = 0; k < CLOCKS; k++)
        ms[k] = must_alloc((size_t)frames * sizeof *ms[k]);
    for (int i = 0; i < (int)frames; i++)
        for (int turn = 0; turn < CASES; turn++) {
            int c = case_of(i, turn);
            double start[CLOCKS];
            for (int k = 0; k < CLOCKS; k++)
                start[k] = now_ms(CLOCK[k]);
            run_case(&x, c, i);
            for (int k = 0; k < CLOCKS; k++)
                ms[k][i][c] = now_ms(CLOCK[k]) - start[k];
        }
    printf(
        "%s: six %d x %d relief textures at %d x %d, %ld frames each in turn, light moving, SIMD level %d; "
        "the last direct "
        "frame: %llu texels, %u px\n",
        object_kit_names[body], RESOLUTION, RESOLUTION, SIDE, SIDE, frames, (int)sv_simd_level(),
        (unsigned long long)x.stats.texels, x.stats.pixels);
    for (int k = 0; k < CLOCKS; k++) {
        printf("%-26s %-38s %-38s %s\n", CLOCK_NAMES[k], "median", "least", "paper 1");
        print_way("direct warp", 0, ms[k], (int)frames);
        print_way("paper's way", PICTURES, ms[k], (int)frames);
        free(ms[k]);
    }
    if (out) {
        for (int c = 0; c < CASES; c++)
            run_case(&x, c, 0);
        write_figure(&x, out);
    }
    tear_down(&x);
    sv_gl_context_destroy(context);
    return 0;
}
