/* walkthrough.c - the forest of table 2 walked through, flown over and jumped about in, drawn from relief
 * cells, beside paper 1's own way, direct drawing and the one-sample ray cast of the same poses.
 *
 *   walkthrough [--counts N,N,...] [--path flight|walk|jump|turn|survey] [--frames N] [--forms
 * on,auto,paper,off,raycast,four]
 *               [--size WxH] [--truth STRIDE] [--workers 1|2] [--refine SAMPLES[xSCALE]] [--panel TEXELS]
 *               [--warm] [--still] [--parts] [--shadows] [-o FOLDER]
 *
 * Paths: walk_path.h. Where the eye turns, how much a worker's frame differs from its next one taken back is
 * told (walk_turn.h). --warm: the path is gone along once before it is measured, by the process that workers
 * are forked from, and each worker draws some frames: what is measured maps panels that others have built,
 * but makes nothing that a process makes once, its heap included. --still: the first pose again and again.
 * --refine: all panels of a pose and the shadows on its ground are drawn again from the ray-cast truth before
 * it is measured; with --shadows the shadows alone. four: the ray cast of four samples. Every STRIDE-th frame
 * is compared with 64 samples of the ray-cast truth. --parts: the same by parts of the picture
 * (walk_parts.h).
 *
 * Workers are forked as the service forks them and share one cache of panels, each draws every workers-th
 * frame, in all forms one after the other, from the first or, in turn, from the last; frames a second are
 * workers * 1000 / median ms, encoding left out. FOLDER: walkthrough.csv (a row a frame and form), pictures
 * of the compared frames, plots of ms over frames and of frames a second over the number of trees, a contact
 * sheet of the path (rows of cells, and of direct drawing under each), and where the eye turns the pair that
 * differs most: frame, next one taken back, four times their difference (a row a form). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/view/cells.h"
#include "core/view/warm.h"
#include "tests/experiments/forest_kit.h"
#include "tests/experiments/motion_sheet.h"
#include "tests/experiments/plot.h"
#include "tests/experiments/walk_parts.h"
#include "tests/experiments/walk_path.h"
#include "tests/experiments/walk_turn.h"

enum form { ON, AUTO, PAPER, OFF, RAYCAST, RAYCAST4, FORMS };
static const char *const NAMES[] = {"on", "auto", "paper", "off", "raycast", "four"};
enum { FRAMES_MAX = 4096, COUNTS_MAX = 16, WORKERS_MAX = 2, WARM_FRAMES = 3, SHEET_COLUMNS = 6 };

struct setup {
    uint32_t trees; /* of the count at hand */
    uint32_t counts[COUNTS_MAX];
    int count_count;
    enum walk_path path;
    int frames, width, height, truth_stride, workers;
    int refine_samples, refine_scale; /* 0: panels stay as built */
    int panel;                        /* texels a side; 0: the scene's */
    bool forms[FORMS], warm, still, parts, shadows_alone;
    const char *folder;
};

static struct sv_view_request pose(const struct forest *forest, const struct setup *setup, int k)
{
    return walk_path_pose(forest, setup->path, k, setup->still, setup->width, setup->height);
}

static void dress(struct sv_view_request *request, enum form form)
{
    static const enum sv_relief_mode reliefs[FORMS] = {
        [ON] = SV_RELIEF_ON,   [AUTO] = SV_RELIEF_AUTO,   [PAPER] = SV_RELIEF_PAPER,
        [OFF] = SV_RELIEF_OFF, [RAYCAST] = SV_RELIEF_OFF, [RAYCAST4] = SV_RELIEF_OFF};
    request->relief = reliefs[form];
    request->trees = form >= RAYCAST ? SV_TREES_RAYCAST : SV_TREES_AUTO;
    request->samples = form == RAYCAST4 ? 4 : 1;
}

static void refine(const struct forest *forest, const struct setup *setup, struct sv_view_request *request)
{
    request->relief_resolution = setup->panel;
    if (!setup->refine_samples)
        return;
    struct sv_picture picture;
    double ms;
    forest_draw(forest, request, &picture, NULL, NULL, NULL);
    sv_picture_finish(&picture);
    uint32_t count =
        forest_refine(forest, request, setup->refine_samples, setup->refine_scale, setup->shadows_alone, &ms);
    printf("refined %u panels and pages of shadow in %.1f s\n", count, ms * 1e-3);
}

/* One frame in one form; workers write them into memory that all share. */
struct record {
    double ms, cpu_ms, stage_ms[SV_STAGE_COUNT];
    long faults, preempted; /* times that a page was mapped, that another process was let run instead */
    double mean_abs, ssim, gradient; /* 0 unless compared */
    double holes, holes_left;        /* shares of the picture, of the ground's warp */
    struct sv_cell_use cell;
    struct walk_turn turn;
    bool compared, cells; /* cells: drawn from them */
};
static struct record (*records)[FRAMES_MAX];
static struct walk_sums (*sums)[FORMS][WALK_PARTS]; /* by worker; shared as well */

static void keep(const struct setup *setup, const struct sv_image *image, int frame, const char *name)
{
    char path[512];
    if (!setup->folder)
        return;
    snprintf(path, sizeof path, "%s/%u-%s-%04d-%s.png", setup->folder, setup->trees,
             WALK_PATH_NAMES[setup->path], frame, name);
    forest_save(image, path);
}

/* What a frame is compared with. */
struct truth {
    struct sv_image color;
    struct sv_image parts; /* empty: not wanted */
    struct walk_sums (*sums)[WALK_PARTS];
};

static struct sv_camera camera_of(const struct forest *forest, const struct sv_view_request *request)
{
    struct sv_resolved_view view;
    struct sv_error error = {0};
    if (sv_view_resolve(forest->scene, request, &view, NULL, &error)) {
        fprintf(stderr, "%s: %s\n", error.field, error.message);
        exit(1);
    }
    return view.camera;
}

/* A picture of this worker, and whose it is. */
struct shown {
    struct sv_image color;
    struct sv_camera camera;
};
static struct shown last_shown[FORMS];

/* Takes the picture's colour. */
static void compare_turned(const struct forest *forest, const struct sv_view_request *request, int k,
                           enum form form, struct sv_picture *picture)
{
    struct shown *last = &last_shown[form],
                 shown = {picture->layer[SV_LAYER_COLOR], camera_of(forest, request)};
    picture->layer[SV_LAYER_COLOR] = (struct sv_image){0};
    if (last->color.data) {
        struct sv_image back = walk_turn_back(&shown.color, &shown.camera, &last->camera);
        walk_turn_add(&last->color, &back, k, &records[form][k].turn);
        sv_image_free(&back);
    }
    sv_image_free(&last->color);
    *last = shown;
}

static void draw_frame(const struct forest *forest, const struct setup *setup, int k, enum form form,
                       const struct truth *truth)
{
    struct record *to = &records[form][k];
    struct sv_view_request request = pose(forest, setup, k);
    struct sv_picture picture;
    struct sv_draw_stats stats = {0};
    struct rusage before, after;
    dress(&request, form);
    if (form == ON)
        refine(forest, setup, &request);
    getrusage(RUSAGE_SELF, &before);
    forest_draw(forest, &request, &picture, &stats, &to->ms, &to->cpu_ms);
    getrusage(RUSAGE_SELF, &after);
    to->faults = after.ru_minflt - before.ru_minflt;
    to->preempted = after.ru_nivcsw - before.ru_nivcsw;
    for (int stage = 0; stage < SV_STAGE_COUNT; stage++)
        to->stage_ms[stage] = forest_stage_ms((enum sv_stage)stage);
    to->cell = stats.cell;
    to->cells = stats.cell.kind == SV_CELL_USE_BUILT || stats.cell.kind == SV_CELL_USE_HIT;
    if (to->cells) {
        const struct sv_cells_report *report = sv_renderer_cells_report(forest->renderer);
        double pixels = (double)request.width * request.height;
        to->holes = (double)report->hole_pixels / pixels;
        to->holes_left = (double)report->holes_left / pixels;
    }
    if (truth) {
        struct sv_compare_result r = forest_compare(&picture.layer[SV_LAYER_COLOR], &truth->color);
        to->compared = true;
        to->mean_abs = r.mean_abs;
        to->ssim = r.ssim;
        to->gradient = r.gradient_ratio;
        if (truth->parts.data)
            walk_parts_add(&truth->parts, &picture.layer[SV_LAYER_COLOR], &truth->color, truth->sums[form]);
        keep(setup, &picture.layer[SV_LAYER_COLOR], k, NAMES[form]);
    }
    if (walk_path_turns(setup->path))
        compare_turned(forest, &request, k, form, &picture);
    sv_picture_finish(&picture);
}

static void draw_once(const struct forest *forest, const struct setup *setup, int k)
{
    struct sv_view_request request = pose(forest, setup, k);
    struct sv_picture picture;
    dress(&request, ON);
    forest_draw(forest, &request, &picture, NULL, NULL, NULL);
    sv_picture_finish(&picture);
}

static void work(const struct forest *forest, const struct setup *setup, int worker)
{
    for (int k = 0; k < WARM_FRAMES && setup->warm && setup->forms[ON]; k++)
        draw_once(forest, setup, worker);
    for (int k = worker; k < setup->frames; k += setup->workers) {
        struct sv_view_request request = pose(forest, setup, k);
        bool compare = setup->truth_stride > 0 && k % setup->truth_stride == 0;
        struct truth truth = {.sums = sums[worker]};
        if (compare)
            forest_truth(forest, &request, &truth.color);
        if (compare && setup->parts)
            truth.parts = walk_parts_of(forest, &request);
        for (int n = 0; n < FORMS;
             n++) { /* who comes first pays for caches that the pose has not yet filled */
            int form = k / setup->workers % 2 ? FORMS - 1 - n : n;
            if (setup->forms[form])
                draw_frame(forest, setup, k, (enum form)form, compare ? &truth : NULL);
        }
        if (compare)
            keep(setup, &truth.color, k, "truth");
        sv_image_free(&truth.color);
        sv_image_free(&truth.parts);
    }
}

/* False when a worker failed. */
static bool run(const struct forest *forest, const struct setup *setup)
{
    pid_t child[WORKERS_MAX];
    bool well = true;
    memset(records, 0, sizeof(struct record[FORMS][FRAMES_MAX]));
    memset(sums, 0, sizeof(struct walk_sums[WORKERS_MAX][FORMS][WALK_PARTS]));
    fflush(NULL);
    for (int w = 0; w < setup->workers; w++) {
        child[w] = fork();
        if (child[w] == 0) {
            sv_renderer_use_cells_slot(forest->renderer, w);
            work(forest, setup, w);
            fflush(NULL);
            _exit(0);
        }
    }
    for (int w = 0; w < setup->workers; w++) {
        int status = 1;
        well = child[w] > 0 && waitpid(child[w], &status, 0) == child[w] && status == 0 && well;
    }
    return well;
}

/* ---- what came out ---- */

static double percentile(enum form form, int count, bool cpu, double share)
{
    double sorted[FRAMES_MAX];
    for (int k = 0; k < count; k++)
        sorted[k] = cpu ? records[form][k].cpu_ms : records[form][k].ms;
    forest_median(sorted, count);
    return share == 0.5 ? forest_median(sorted, count) : sorted[(int)fmin(share * count, count - 1)];
}

static double frames_per_s(const struct setup *setup, enum form form)
{
    return setup->workers * 1000 / percentile(form, setup->frames, false, 0.5);
}

static void tell_cells(const struct setup *setup, enum form form)
{
    double holes = 0, worst = 0, left = 0;
    uint32_t drawn = 0, built = 0, frames_built = 0;
    for (int k = 0; k < setup->frames; k++) {
        const struct record *r = &records[form][k];
        drawn += r->cells;
        built += r->cell.built;
        frames_built += r->cell.built > 0;
        holes += r->holes;
        worst = fmax(worst, r->holes);
        left = fmax(left, r->holes_left);
    }
    if (drawn > 0)
        printf("       %u of %d frames from cells; %u panels built in %u frames; holes before filling %.4f "
               "%% of the "
               "picture (worst %.4f %%), after %.4f %%\n",
               drawn, setup->frames, built, frames_built, 100 * holes / drawn, 100 * worst, 100 * left);
}

static struct walk_turn worst_turn(const struct setup *setup, enum form form)
{
    struct walk_turn worst = {0};
    for (int k = 0; k < setup->frames; k++)
        walk_turn_join(&worst, &records[form][k].turn);
    return worst;
}

static void tell_turn(const struct setup *setup, enum form form)
{
    struct walk_turn worst = worst_turn(setup, form);
    if (worst.tiles > 0)
        printf("       turned by %g degrees, tiles of %d px: tone off by %.2f in the mean, %.2f at most "
               "(frame %d, x %d y "
               "%d); change at most %.2f\n",
               WALK_TURN_DEG * setup->workers, WALK_TURN_TILE, worst.tones / worst.tiles, worst.tone,
               worst.frame, worst.x, worst.y, worst.change);
}

static void tell(const struct setup *setup, enum form form)
{
    double sum[3] = {0};
    int compared = 0;
    for (int k = 0; k < setup->frames; k++) {
        const struct record *r = &records[form][k];
        compared += r->compared;
        sum[0] += r->mean_abs;
        sum[1] += r->ssim;
        sum[2] += r->gradient;
    }
    printf("%6u %-6s %-7s ms: median %8.2f  99 %% %8.2f (%.1f frames/s)   processor ms: median %8.2f  99 %% "
           "%8.2f",
           setup->trees, WALK_PATH_NAMES[setup->path], NAMES[form],
           percentile(form, setup->frames, false, 0.5), percentile(form, setup->frames, false, 0.99),
           frames_per_s(setup, form), percentile(form, setup->frames, true, 0.5),
           percentile(form, setup->frames, true, 0.99));
    if (compared > 0)
        printf("   mean abs %.3f  SSIM %.4f  gradient %.3f", sum[0] / compared, sum[1] / compared,
               sum[2] / compared);
    printf("\n");
    tell_cells(setup, form);
    tell_turn(setup, form);
    for (int w = 1; w < setup->workers; w++)
        walk_parts_join(sums[0][form], sums[w][form]);
    walk_parts_tell(NAMES[form], sums[0][form]);
}

static void write_rows(const struct setup *setup, FILE *csv)
{
    for (int k = 0; k < setup->frames; k++)
        for (int form = 0; form < FORMS; form++) {
            const struct record *r = &records[form][k];
            if (!setup->forms[form])
                continue;
            fprintf(csv, "%u,%s,%d,%s,%.3f,%.3f,%ld,%ld,%.3f,%.3f,%.3f,%.3f,%u,%u,%.6f,%.6f,%.4f,%.5f,%.4f\n",
                    setup->trees, WALK_PATH_NAMES[setup->path], k, NAMES[form], r->ms, r->cpu_ms, r->faults,
                    r->preempted, r->stage_ms[SV_STAGE_CELL], r->stage_ms[SV_STAGE_WARP], r->stage_ms[SV_STAGE_NEAR],
                    r->stage_ms[SV_STAGE_COMPOSITE], r->cell.hits, r->cell.built, r->holes, r->holes_left,
                    r->mean_abs, r->ssim, r->gradient);
        }
}

/* Milliseconds over frames, of the count at hand. */
static void plot_frames(const struct setup *setup)
{
    static double x[FRAMES_MAX], y[FORMS][FRAMES_MAX];
    struct plot_line lines[FORMS];
    char path[512], title[128];
    int n = 0;
    for (int k = 0; k < setup->frames; k++)
        x[k] = k;
    for (int form = 0; form < FORMS; form++) {
        for (int k = 0; k < setup->frames; k++)
            y[form][k] = records[form][k].ms;
        if (setup->forms[form])
            lines[n++] = (struct plot_line){NAMES[form], x, y[form], setup->frames, false};
    }
    snprintf(title, sizeof title, "%s, %u trees, %d x %d, %d workers", WALK_PATH_NAMES[setup->path],
             setup->trees, setup->width, setup->height, setup->workers);
    snprintf(path, sizeof path, "%s/%u-%s.svg", setup->folder, setup->trees, WALK_PATH_NAMES[setup->path]);
    if (!plot_write(path, &(struct plot_axes){title, "frame", "ms", false, true}, lines, n))
        perror(path);
}

static void plot_counts(const struct setup *setup, double rate[FORMS][COUNTS_MAX])
{
    struct plot_line lines[FORMS];
    double x[COUNTS_MAX];
    char path[512];
    int n = 0;
    for (int k = 0; k < setup->count_count; k++)
        x[k] = setup->counts[k];
    for (int form = 0; form < FORMS; form++)
        if (setup->forms[form])
            lines[n++] = (struct plot_line){NAMES[form], x, rate[form], setup->count_count, false};
    snprintf(path, sizeof path, "%s/%s.svg", setup->folder, WALK_PATH_NAMES[setup->path]);
    if (!plot_write(
            path, &(struct plot_axes){"Frames a second by number of trees", "trees", "frames/s", true, true},
            lines, n))
        perror(path);
}

/* Two times SHEET_COLUMNS frames of the path, evenly: a row from cells, a row drawn directly, and again. */
static void write_sheet(const struct forest *forest, const struct setup *setup)
{
    struct motion_sheet sheet;
    char path[512];
    motion_sheet_init(&sheet, SHEET_COLUMNS, 4, setup->width / 2, setup->height / 2);
    for (int row = 0; row < 4; row++)
        for (int column = 0; column < SHEET_COLUMNS; column++) {
            int step = row / 2 * SHEET_COLUMNS + column;
            struct sv_view_request request = pose(forest, setup, step * setup->frames / (2 * SHEET_COLUMNS));
            struct sv_picture picture;
            dress(&request, row % 2 ? OFF : ON);
            forest_draw(forest, &request, &picture, NULL, NULL, NULL);
            motion_sheet_add(&sheet, &picture.layer[SV_LAYER_COLOR]);
            sv_picture_finish(&picture);
        }
    snprintf(path, sizeof path, "%s/%u-%s-sheet.png", setup->folder, setup->trees,
             WALK_PATH_NAMES[setup->path]);
    forest_save(&sheet.image, path);
    motion_sheet_finish(&sheet);
}

static struct sv_image draw_again(const struct forest *forest, const struct setup *setup, int k,
                                  enum form form, struct sv_camera *camera)
{
    struct sv_view_request request = pose(forest, setup, k);
    struct sv_picture picture;
    dress(&request, form);
    if (form == ON)
        refine(forest, setup, &request);
    forest_draw(forest, &request, &picture, NULL, NULL, NULL);
    *camera = camera_of(forest, &request);
    return picture.layer[SV_LAYER_COLOR];
}

/* A row of a form's worst pair. */
static void add_turn(const struct forest *forest, const struct setup *setup, enum form form,
                     struct motion_sheet *sheet)
{
    enum { ENLARGED = 3, GAIN = 4 };
    struct walk_turn worst = worst_turn(setup, form);
    struct sv_camera camera, later_camera;
    if (worst.tiles == 0)
        return;
    struct sv_image picture = draw_again(forest, setup, worst.frame - setup->workers, form, &camera);
    struct sv_image later = draw_again(forest, setup, worst.frame, form, &later_camera);
    struct sv_image back = walk_turn_back(&later, &later_camera, &camera);
    motion_sheet_add_part(sheet, &picture, worst.x, worst.y, ENLARGED);
    motion_sheet_add_part(sheet, &back, worst.x, worst.y, ENLARGED);
    motion_sheet_add_change(sheet, &picture, &back, worst.x, worst.y, ENLARGED, GAIN);
    sv_image_free(&picture);
    sv_image_free(&later);
    sv_image_free(&back);
}

static void write_turns(const struct forest *forest, const struct setup *setup)
{
    struct motion_sheet sheet;
    char path[512];
    int rows = 0;
    for (int form = 0; form < FORMS; form++)
        rows += setup->forms[form];
    motion_sheet_init(&sheet, 3, rows, setup->width, setup->height);
    for (int form = 0; form < FORMS; form++)
        if (setup->forms[form])
            add_turn(forest, setup, (enum form)form, &sheet);
    snprintf(path, sizeof path, "%s/%u-%s-worst.png", setup->folder, setup->trees,
             WALK_PATH_NAMES[setup->path]);
    forest_save(&sheet.image, path);
    motion_sheet_finish(&sheet);
}

static void go_along(const struct forest *forest, const struct setup *setup)
{
    for (int k = 0; k < setup->frames; k++)
        draw_once(forest, setup, k);
}

static bool run_count(const struct setup *setup, FILE *csv, double rate[FORMS])
{
    struct forest forest;
    struct sv_error error = {0};
    forest_open(setup->trees,
                setup->forms[RAYCAST] || setup->forms[RAYCAST4] || setup->refine_samples ||
                    setup->truth_stride > 0,
                &forest);
    if (sv_view_warm(forest.renderer, forest.scene, 1u << SV_LAYER_COLOR, &error)) {
        fprintf(stderr, "warm: %s\n", error.message);
        return false;
    }
    if (setup->warm && setup->forms[ON])
        go_along(&forest, setup);
    bool well = run(&forest, setup);
    for (int form = 0; form < FORMS && well; form++)
        if (setup->forms[form]) {
            tell(setup, (enum form)form);
            rate[form] = frames_per_s(setup, (enum form)form);
        }
    write_rows(setup, csv);
    if (setup->folder && well) {
        plot_frames(setup);
        write_sheet(&forest, setup);
        if (walk_path_turns(setup->path))
            write_turns(&forest, setup);
    }
    forest_close(&forest);
    fflush(stdout);
    return well;
}

static bool read_counts(const char *text, struct setup *setup)
{
    setup->count_count = 0;
    for (char *end; *text; text = *end ? end + 1 : end) {
        unsigned long v = strtoul(text, &end, 10);
        if (end == text || (*end && *end != ',') || v > SV_FOREST_TREES_MAX ||
            setup->count_count == COUNTS_MAX)
            return false;
        setup->counts[setup->count_count++] = (uint32_t)v;
    }
    return setup->count_count > 0;
}

static bool read_forms(const char *text, struct setup *setup)
{
    for (int k = 0; k < FORMS; k++)
        setup->forms[k] = false;
    while (*text) {
        size_t n = strcspn(text, ",");
        int form = 0;
        while (form < FORMS && (strlen(NAMES[form]) != n || strncmp(text, NAMES[form], n) != 0))
            form++;
        if (form == FORMS)
            return false;
        setup->forms[form] = true;
        text += n + (text[n] == ',');
    }
    return true;
}

static bool option(struct setup *setup, const char *name, const char *value)
{
    if (strcmp(name, "--counts") == 0)
        return read_counts(value, setup);
    else if (strcmp(name, "--frames") == 0)
        return (setup->frames = atoi(value)) > 0 && setup->frames <= FRAMES_MAX;
    else if (strcmp(name, "--size") == 0)
        return sscanf(value, "%dx%d", &setup->width, &setup->height) == 2 &&
               setup->width >= SV_VIEW_SIDE_MIN && setup->height >= SV_VIEW_SIDE_MIN &&
               setup->width <= SV_VIEW_SIDE_MAX && setup->height <= SV_VIEW_SIDE_MAX;
    else if (strcmp(name, "--workers") == 0)
        return (setup->workers = atoi(value)) >= 1 && setup->workers <= WORKERS_MAX;
    else if (strcmp(name, "--truth") == 0)
        setup->truth_stride = atoi(value);
    else if (strcmp(name, "--panel") == 0)
        return (setup->panel = atoi(value)) >= 16;
    else if (strcmp(name, "--refine") == 0)
        return sscanf(value, "%dx%d", &setup->refine_samples, &setup->refine_scale) >= 1 &&
               setup->refine_samples >= 1 && setup->refine_scale >= 1;
    else if (strcmp(name, "-o") == 0)
        setup->folder = value;
    else if (strcmp(name, "--path") == 0)
        return (setup->path = walk_path_named(value)) < WALK_PATHS;
    else if (strcmp(name, "--forms") == 0)
        return read_forms(value, setup);
    else
        return false;
    return true;
}

int main(int argc, char **argv)
{
    struct setup setup = {.counts = {45000},
                          .count_count = 1,
                          .frames = 60,
                          .width = 512,
                          .height = 512,
                          .workers = 1,
                          .refine_scale = 1,
                          .forms = {[ON] = true, [OFF] = true}};
    bool well = true;
    for (int k = 1; k < argc && well; k++) {
        if (strcmp(argv[k], "--warm") == 0)
            setup.warm = true;
        else if (strcmp(argv[k], "--still") == 0)
            setup.still = true;
        else if (strcmp(argv[k], "--parts") == 0)
            setup.parts = true;
        else if (strcmp(argv[k], "--shadows") == 0)
            setup.shadows_alone = true;
        else if ((well = k + 1 < argc && option(&setup, argv[k], argv[k + 1])))
            k++;
    }
    if (!well) {
        fprintf(stderr,
                "usage: walkthrough [--counts N,N,...] [--path flight|walk|jump|turn|survey] [--frames N] "
                "[--forms on,auto,paper,off,raycast,four] [--size WxH] [--truth STRIDE] [--workers 1|2] "
                "[--refine SAMPLES[xSCALE]] [--panel TEXELS] [--warm] [--still] [--parts] [--shadows] "
                "[-o FOLDER]\n");
        return 2;
    }
    char path[512] = "/dev/null";
    if (setup.folder) {
        mkdir(setup.folder, 0777);
        snprintf(path, sizeof path, "%s/walkthrough.csv", setup.folder);
    }
    FILE *csv = fopen(path, "w");
    records = mmap(NULL, sizeof(struct record[FORMS][FRAMES_MAX]), PROT_READ | PROT_WRITE,
                   MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    sums = mmap(NULL, sizeof(struct walk_sums[WORKERS_MAX][FORMS][WALK_PARTS]), PROT_READ | PROT_WRITE,
                MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (!csv || records == MAP_FAILED || sums == MAP_FAILED) {
        perror(path);
        return 1;
    }
    fprintf(csv,
            "trees,path,frame,form,ms,processor_ms,faults,preempted,cell_ms,warp_ms,near_ms,composite_ms,panels,"
            "built,holes,holes_left,mean_abs,ssim,gradient\n");
    static double rate[FORMS][COUNTS_MAX];
    forest_use_cells((size_t)4 << 30);
    for (int k = 0; k < setup.count_count && well; k++) {
        double of[FORMS] = {0};
        setup.trees = setup.counts[k];
        well = run_count(&setup, csv, of);
        for (int form = 0; form < FORMS; form++)
            rate[form][k] = of[form];
    }
    if (setup.folder && setup.count_count > 1 && well)
        plot_counts(&setup, rate);
    fclose(csv);
    return well ? 0 : 1;
}
