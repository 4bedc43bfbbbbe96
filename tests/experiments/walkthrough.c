/* walkthrough.c - the forest of table 2 walked through, flown over and jumped about in, drawn from relief
 * cells, beside paper 1's own way, direct drawing and the one-sample ray cast of the same poses.
 *
 *   walkthrough [--count N] [--path flight|walk|jump] [--frames N] [--forms on,paper,off,raycast] [--size N]
 * [--truth STRIDE]
 *               [--warm] [--still] [-o FOLDER]
 *
 * flight: 15 m/s at 40 m over the ground; walk: 1.4 m/s at 1.7 m; 30 frames a second. jump: poses of both
 * kinds at random. --warm: the path is gone along once before it is measured; --still: the first pose again
 * and again. Every STRIDE-th frame is compared with 64 samples of the ray-cast truth. One process: ms a frame
 * on one core, encoding left out. FOLDER: walkthrough.csv and pictures. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "tests/experiments/forest_kit.h"

enum path { FLIGHT, WALK, JUMP };
enum form { ON, PAPER, OFF, RAYCAST, FORMS };
static const char *const PATHS[] = {"flight", "walk", "jump"};
static const char *const NAMES[] = {"on", "paper", "off", "raycast"};
#define FRAMES_PER_S 30.0
enum { FRAMES_MAX = 4096 };

struct setup {
    uint32_t trees;
    enum path path;
    int frames, size, truth_stride;
    bool forms[FORMS], warm, still;
    const char *folder;
};

static struct sv_view_request pose(const struct forest *forest, const struct setup *setup, int k)
{
    if (setup->path == JUMP) {
        struct sv_view_request r = forest_request(forest, k & 1 ? FOREST_WALK : FOREST_OVERVIEW, k / 2);
        r.width = r.height = setup->size;
        return r;
    }
    bool walk = setup->path == WALK;
    struct sv_view_request r = forest_request(forest, walk ? FOREST_WALK : FOREST_OVERVIEW, 0);
    double step = setup->still ? 0 : (walk ? 1.4 : 15) / FRAMES_PER_S * k;
    r.eye.x += step * sin(r.heading_rad);
    r.eye.y += step * cos(r.heading_rad);
    r.eye.agl = walk ? 1.7 : 40;
    r.pitch_rad = sv_radians(walk ? 3 : -12);
    r.width = r.height = setup->size;
    return r;
}

static void dress(struct sv_view_request *request, enum form form)
{
    static const enum sv_relief_mode reliefs[FORMS] = {SV_RELIEF_ON, SV_RELIEF_PAPER, SV_RELIEF_OFF,
                                                       SV_RELIEF_OFF};
    request->relief = reliefs[form];
    request->trees = form == RAYCAST ? SV_TREES_RAYCAST : SV_TREES_AUTO;
    request->samples = 1;
}

static double values[FORMS][FRAMES_MAX];

static double percentile(const double *of, int count, double share)
{
    double sorted[FRAMES_MAX];
    memcpy(sorted, of, (size_t)count * sizeof *of);
    forest_median(sorted, count);
    return sorted[(int)fmin(share * count, count - 1)];
}

static void run(const struct forest *forest, const struct setup *setup, FILE *csv)
{
    double sum[FORMS][3] = {{0}};
    int compared = 0;
    for (int k = 0; k < setup->frames; k++) {
        struct sv_view_request request = pose(forest, setup, k);
        bool compare = setup->truth_stride > 0 && k % setup->truth_stride == 0;
        struct sv_image truth = {0};
        if (compare)
            forest_truth(forest, &request, &truth);
        compared += compare;
        for (int form = 0; form < FORMS; form++) {
            struct sv_picture picture;
            struct sv_compare_result r = {0};
            struct sv_view_request of = request;
            double ms, cpu_ms;
            if (!setup->forms[form])
                continue;
            dress(&of, (enum form)form);
            forest_draw(forest, &of, &picture, NULL, &ms, &cpu_ms);
            values[form][k] = cpu_ms;
            if (compare) {
                r = forest_compare(&picture.layer[SV_LAYER_COLOR], &truth);
                sum[form][0] += r.mean_abs;
                sum[form][1] += r.ssim;
                sum[form][2] += r.gradient_ratio;
            }
            fprintf(csv, "%u,%s,%d,%s,%.3f,%.3f,%.3f,%.3f,%.3f,%.3f,%.4f,%.5f,%.4f\n", setup->trees,
                    PATHS[setup->path], k, NAMES[form], ms, cpu_ms, forest_stage_ms(SV_STAGE_CELL),
                    forest_stage_ms(SV_STAGE_WARP), forest_stage_ms(SV_STAGE_NEAR),
                    forest_stage_ms(SV_STAGE_COMPOSITE), r.mean_abs, r.ssim, r.gradient_ratio);
            if (compare && setup->folder) {
                char path[512];
                snprintf(path, sizeof path, "%s/%s-%04d-%s.png", setup->folder, PATHS[setup->path], k,
                         NAMES[form]);
                forest_save(&picture.layer[SV_LAYER_COLOR], path);
            }
            sv_picture_finish(&picture);
        }
        if (compare && setup->folder) {
            char path[512];
            snprintf(path, sizeof path, "%s/%s-%04d-truth.png", setup->folder, PATHS[setup->path], k);
            forest_save(&truth, path);
        }
        sv_image_free(&truth);
    }
    for (int form = 0; form < FORMS; form++)
        if (setup->forms[form])
            printf("%6u %-6s %-7s processor ms: median %8.2f  99 %% %8.2f   mean abs %.3f  SSIM %.4f  "
                   "gradient %.3f\n",
                   setup->trees, PATHS[setup->path], NAMES[form],
                   percentile(values[form], setup->frames, 0.5),
                   percentile(values[form], setup->frames, 0.99), sum[form][0] / compared,
                   sum[form][1] / compared, sum[form][2] / compared);
}

static bool option(struct setup *setup, const char *name, const char *value)
{
    if (strcmp(name, "--count") == 0)
        setup->trees = (uint32_t)strtoul(value, NULL, 10);
    else if (strcmp(name, "--frames") == 0)
        return (setup->frames = atoi(value)) > 0 && setup->frames <= FRAMES_MAX;
    else if (strcmp(name, "--size") == 0)
        return (setup->size = atoi(value)) >= 16;
    else if (strcmp(name, "--truth") == 0)
        setup->truth_stride = atoi(value);
    else if (strcmp(name, "-o") == 0)
        setup->folder = value;
    else if (strcmp(name, "--path") == 0) {
        for (int k = FLIGHT; k <= JUMP; k++)
            if (strcmp(value, PATHS[k]) == 0) {
                setup->path = (enum path)k;
                return true;
            }
        return false;
    } else if (strcmp(name, "--forms") == 0) {
        for (int k = 0; k < FORMS; k++)
            setup->forms[k] = strstr(value, NAMES[k]) != NULL;
    } else
        return false;
    return true;
}

int main(int argc, char **argv)
{
    struct setup setup = {.trees = 45000, .frames = 60, .size = 512, .forms = {[ON] = true, [OFF] = true}};
    struct forest forest;
    bool well = true;
    for (int k = 1; k < argc && well; k++) {
        if (strcmp(argv[k], "--warm") == 0)
            setup.warm = true;
        else if (strcmp(argv[k], "--still") == 0)
            setup.still = true;
        else if ((well = k + 1 < argc && option(&setup, argv[k], argv[k + 1])))
            k++;
    }
    if (!well) {
        fprintf(
            stderr,
            "usage: walkthrough [--count N] [--path flight|walk|jump] [--frames N] "
            "[--forms on,paper,off,raycast] [--size N] [--truth STRIDE] [--warm] [--still] [-o FOLDER]\n");
        return 2;
    }
    char path[512] = "/dev/null";
    if (setup.folder) {
        mkdir(setup.folder, 0777);
        snprintf(path, sizeof path, "%s/walkthrough.csv", setup.folder);
    }
    FILE *csv = fopen(path, "w");
    if (!csv) {
        perror(path);
        return 1;
    }
    fprintf(csv, "trees,path,frame,form,ms,processor_ms,cell_ms,warp_ms,near_ms,composite_ms,mean_abs,ssim,"
                 "gradient\n");
    forest_use_cells((size_t)4 << 30);
    forest_open(setup.trees, setup.forms[RAYCAST] || setup.truth_stride > 0, &forest);
    for (int k = 0; k < 2 * setup.frames && setup.warm; k++) {
        enum form form = k < setup.frames ? ON : PAPER;
        struct sv_view_request request = pose(&forest, &setup, k % setup.frames);
        struct sv_picture picture;
        if (!setup.forms[form])
            continue;
        dress(&request, form);
        forest_draw(&forest, &request, &picture, NULL, NULL, NULL);
        sv_picture_finish(&picture);
    }
    run(&forest, &setup, csv);
    fclose(csv);
    forest_close(&forest);
    return 0;
}
