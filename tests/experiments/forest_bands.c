/* forest_bands.c - what a picture costs when two draw it: the processor time of its upper and its lower half
 * against that of the whole, of poses over (15 m/s at 40 m) and in (1.4 m/s at 1.7 m) the forest of table 2,
 * warm.
 *
 *   forest_bands [--trees N] [--frames N] [--size WxH] [--scene FILE] [--forms on,off,raycast]
 *
 * Each pose is drawn whole, as its upper half and as its lower half, in turns of order, after all of them
 * were drawn once; halves are compared with the whole byte for byte. Medians of processor milliseconds.
 * longer: of the two halves, what a client waits for; sum: both over the whole. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "core/view/resolve.h"
#include "tests/experiments/forest_kit.h"

enum form { ON, OFF, RAYCAST, FORMS };
static const char *const NAMES[] = {"on", "off", "raycast"};
enum part { WHOLE, UPPER, LOWER, PARTS };
enum { FRAMES_MAX = 256 };

struct setup {
    uint32_t trees;
    int frames, width, height;
    bool forms[FORMS];
    const char *scene;
};

static struct sv_view_request pose(const struct forest *forest, const struct setup *setup, bool walk, int k)
{
    struct sv_view_request r = forest_request(forest, walk ? FOREST_WALK : FOREST_OVERVIEW, 0);
    double step = (walk ? 1.4 : 15) / 30 * k;
    r.eye.x += step * sin(r.heading_rad);
    r.eye.y += step * cos(r.heading_rad);
    r.eye.agl = walk ? 1.7 : 40;
    r.pitch_rad = sv_radians(walk ? 3 : -12);
    r.width = setup->width;
    r.height = setup->height;
    return r;
}

static double cpu_ms(void)
{
    return 1e3 * (double)clock() / CLOCKS_PER_SEC;
}

/* Processor ms of the part; it is compared with the whole, or becomes it. */
static double draw(const struct forest *forest, const struct sv_view_request *request, enum part part,
                   struct sv_image *whole)
{
    struct sv_resolved_view view;
    struct sv_picture picture;
    struct sv_draw_took took;
    struct sv_error error = {0};
    int half = request->height / 2;
    struct sv_renderer_band band = {.row_first = part == LOWER ? half : 0,
                                    .row_count = part == WHOLE   ? request->height
                                                 : part == UPPER ? half
                                                                 : request->height - half};
    if (sv_view_resolve(forest->scene, request, &view, NULL, &error)) {
        fprintf(stderr, "%s: %s\n", error.field, error.message);
        exit(1);
    }
    double since = cpu_ms();
    if (sv_renderer_draw_band(forest->renderer, request, &view, &band, &picture, NULL, NULL, &took, &error)) {
        fprintf(stderr, "%s: %s\n", error.field, error.message);
        exit(1);
    }
    double ms = cpu_ms() - since;
    size_t skip = (size_t)band.row_first * (size_t)request->width * 4;
    struct sv_image *color = &picture.layer[SV_LAYER_COLOR];
    if (part == WHOLE)
        memcpy(whole->data, color->data, sv_image_bytes(whole));
    else if (whole->data && memcmp(color->data, (uint8_t *)whole->data + skip, sv_image_bytes(color)) != 0)
        printf("half %d is not a part of the whole\n", part);
    sv_picture_finish(&picture);
    return ms;
}

static void measure(const struct forest *forest, const struct setup *setup, bool walk, enum form form)
{
    static double ms[PARTS][FRAMES_MAX], longer[FRAMES_MAX], sum[FRAMES_MAX];
    struct sv_image whole;
    if (sv_image_alloc(setup->width, setup->height, 4, SV_PIXEL_U8, &whole, NULL))
        exit(1);
    for (int round = 0; round < 2; round++)
        for (int k = 0; k < setup->frames; k++) {
            struct sv_view_request request = pose(forest, setup, walk, k);
            request.relief = form == ON ? SV_RELIEF_ON : SV_RELIEF_OFF;
            request.trees = form == RAYCAST ? SV_TREES_RAYCAST : SV_TREES_AUTO;
            draw(forest, &request, WHOLE, &whole); /* the pose's own caches */
            for (int n = 0; n < PARTS; n++) {
                enum part part = (enum part)((k + n) % PARTS);
                ms[part][k] = draw(forest, &request, part, &whole);
            }
            longer[k] = fmax(ms[UPPER][k], ms[LOWER][k]);
            sum[k] = (ms[UPPER][k] + ms[LOWER][k]) / ms[WHOLE][k];
        }
    double m[PARTS];
    for (int part = 0; part < PARTS; part++)
        m[part] = forest_median(ms[part], setup->frames);
    printf("%-6s %-7s processor ms, medians: whole %7.2f  upper %7.2f  lower %7.2f  longer %7.2f  sum of "
           "halves %.2fx\n",
           walk ? "walk" : "flight", NAMES[form], m[WHOLE], m[UPPER], m[LOWER],
           forest_median(longer, setup->frames), forest_median(sum, setup->frames));
    fflush(stdout);
    sv_image_free(&whole);
}

static struct setup parse(int argc, char **argv)
{
    struct setup s = {
        .trees = 45000, .frames = 30, .width = 512, .height = 512, .forms = {true, true, false}};
    for (int k = 1; k + 1 < argc; k += 2) {
        if (strcmp(argv[k], "--trees") == 0)
            s.trees = (uint32_t)atol(argv[k + 1]);
        else if (strcmp(argv[k], "--frames") == 0)
            s.frames = atoi(argv[k + 1]);
        else if (strcmp(argv[k], "--size") == 0)
            sscanf(argv[k + 1], "%dx%d", &s.width, &s.height);
        else if (strcmp(argv[k], "--scene") == 0)
            s.scene = argv[k + 1];
        else if (strcmp(argv[k], "--forms") == 0)
            for (int f = 0; f < FORMS; f++)
                s.forms[f] = strstr(argv[k + 1], NAMES[f]) != NULL;
    }
    s.frames = s.frames < 1 ? 1 : s.frames > FRAMES_MAX ? FRAMES_MAX : s.frames;
    return s;
}

int main(int argc, char **argv)
{
    struct setup setup = parse(argc, argv);
    struct forest forest;
    forest_use_cells((size_t)1 << 30);
    if (setup.scene)
        forest_open_file(setup.scene, setup.forms[RAYCAST], &forest);
    else
        forest_open(setup.trees, setup.forms[RAYCAST], &forest);
    printf("%d x %d, %d poses of a kind\n", setup.width, setup.height, setup.frames);
    for (int walk = 0; walk < 2; walk++)
        for (int form = 0; form < FORMS; form++)
            if (setup.forms[form])
                measure(&forest, &setup, walk, (enum form)form);
    forest_close(&forest);
    return 0;
}
