/* forest_table2.c - paper 2's table 2 again: frames a second over forests of 5,000 to 45,000 trees of five
 * species, 512 x 512, form by form, beside the paper's row and the one-sample ray cast of the same poses.
 *
 *   forest_table2 [--counts 5000,10000,...] [--poses N] [--forms auto,raycast,...] [-o FOLDER] [--plain]
 *
 * Two workers, forked as the service forks them, draw at the same time, each every second pose, cold (nothing
 * is kept from view to view but what belongs to the sun); at each pose the forms take turns, so that what else
 * the machine does falls on all alike. Frames/s are those of both workers together: 2000 / the median of ms a
 * frame, encoding left out. Errors are against 64 samples a pixel of the ray-cast truth, independent of the
 * one sample of `raycast`. --plain: without shadows. FOLDER: table2.csv, table2.svg, pictures of the first
 * pose. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/view/warm.h"
#include "tests/experiments/forest_kit.h"
#include "tests/experiments/plot.h"

enum { COUNTS_MAX = 16, POSES_MAX = 64, WORKERS = 2, KINDS = 2, PAPER_COUNTS = 6 };
static const uint32_t PAPER_TREES[PAPER_COUNTS] = {5000, 10000, 20000, 30000, 40000, 45000};
/* Frames/s of paper 2, table 2, on a GeForce 8800GT; and what design.md asks of `auto`, overview. */
static const double PAPER[PAPER_COUNTS] = {66.7, 21.3, 7.1, 4.3, 3.0, 2.4};
static const double WANTED[PAPER_COUNTS] = {40, 25, 15, 12, 10, 10};
static const char *const KIND_NAMES[KINDS] = {"overview", "walk"};
/* A form that would take minutes a frame is left out: polygons by llvmpipe, 39,000 leaves a tree. */
enum { POLYGON_TREES_MAX = 500 };

struct measure { /* of one pose and form */
    double ms, cpu_ms, mean_abs, ssim, gradient;
};

struct setup {
    uint32_t counts[COUNTS_MAX];
    int count_count, poses, form_count;
    enum sv_trees forms[SV_TREES_COUNT];
    bool shadows;
    const char *folder;
};

struct table { /* medians */
    struct measure of[COUNTS_MAX][KINDS][SV_TREES_COUNT];
};

static bool form_here(uint32_t trees, enum sv_trees form)
{
    return form != SV_TREES_POLYGON || trees <= POLYGON_TREES_MAX;
}

static void keep(const struct setup *setup, const struct sv_image *image, uint32_t trees, int kind, const char *form)
{
    char path[512];
    if (!setup->folder)
        return;
    snprintf(path, sizeof path, "%s/%u-%s-%s.png", setup->folder, trees, KIND_NAMES[kind], form);
    forest_save(image, path);
}

/* A worker's first picture pays for memory that it has for life: one of each form and kind, at an eye that is not
 * measured. */
static void warm_worker(const struct forest *forest, const struct setup *setup, uint32_t trees, int worker)
{
    for (int kind = 0; kind < KINDS; kind++)
        for (int f = 0; f < setup->form_count; f++) {
            struct sv_view_request request = forest_request(forest, (enum forest_eye)kind, POSES_MAX + worker);
            struct sv_picture picture;
            request.shadows = setup->shadows;
            request.trees = setup->forms[f];
            if (!form_here(trees, setup->forms[f]) || setup->forms[f] == SV_TREES_RAYCAST)
                continue;
            forest_draw(forest, &request, &picture, NULL, NULL, NULL);
            sv_picture_finish(&picture);
        }
}

/* One worker's share: results[kind][pose][form]. */
static void work(const struct forest *forest, const struct setup *setup, uint32_t trees, int worker,
                 struct measure (*results)[POSES_MAX][SV_TREES_COUNT])
{
    warm_worker(forest, setup, trees, worker);
    for (int kind = 0; kind < KINDS; kind++)
        for (int pose = worker; pose < setup->poses; pose += WORKERS) {
            struct sv_view_request request = forest_request(forest, (enum forest_eye)kind, pose);
            struct sv_picture picture[SV_TREES_COUNT];
            request.shadows = setup->shadows;
            for (int f = 0; f < setup->form_count; f++) {
                request.trees = setup->forms[f];
                if (form_here(trees, setup->forms[f]))
                    forest_draw(forest, &request, &picture[f], NULL, &results[kind][pose][f].ms,
                                &results[kind][pose][f].cpu_ms);
            }
            struct sv_image truth;
            request.trees = SV_TREES_AUTO;
            forest_truth(forest, &request, &truth);
            if (pose == 0)
                keep(setup, &truth, trees, kind, "truth");
            for (int f = 0; f < setup->form_count; f++) {
                if (!form_here(trees, setup->forms[f]))
                    continue;
                struct measure *m = &results[kind][pose][f];
                struct sv_compare_result r = forest_compare(&picture[f].layer[SV_LAYER_COLOR], &truth);
                m->mean_abs = r.mean_abs;
                m->ssim = r.ssim;
                m->gradient = r.gradient_ratio;
                if (pose == 0)
                    keep(setup, &picture[f].layer[SV_LAYER_COLOR], trees, kind, sv_trees_name(setup->forms[f]));
                sv_picture_finish(&picture[f]);
            }
            sv_image_free(&truth);
        }
}

static double median_of(const struct measure (*results)[SV_TREES_COUNT], int poses, int form, size_t offset)
{
    double values[POSES_MAX];
    for (int k = 0; k < poses; k++)
        memcpy(&values[k], (const char *)&results[k][form] + offset, sizeof values[k]);
    return forest_median(values, poses);
}

/* All poses of one count, by forked workers; false when one of them failed. */
static bool run_count(const struct setup *setup, uint32_t trees, struct measure of[KINDS][SV_TREES_COUNT])
{
    struct forest forest;
    struct sv_error error = {0};
    forest_open(trees, true, &forest);
    if (sv_view_warm(forest.renderer, forest.scene, 1u << SV_LAYER_COLOR, &error)) {
        fprintf(stderr, "warm: %s\n", error.message);
        return false;
    }
    size_t bytes = sizeof(struct measure[KINDS][POSES_MAX][SV_TREES_COUNT]);
    void *shared = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    struct measure(*results)[POSES_MAX][SV_TREES_COUNT] = shared;
    pid_t child[WORKERS];
    bool well = true;
    fflush(NULL);
    for (int w = 0; w < WORKERS; w++) {
        child[w] = fork();
        if (child[w] == 0) {
            work(&forest, setup, trees, w, results);
            fflush(NULL);
            _exit(0);
        }
    }
    for (int w = 0; w < WORKERS; w++) {
        int status = 1;
        well = child[w] > 0 && waitpid(child[w], &status, 0) == child[w] && status == 0 && well;
    }
    for (int kind = 0; kind < KINDS; kind++)
        for (int f = 0; f < setup->form_count; f++)
            of[kind][f] = (struct measure){
                median_of(results[kind], setup->poses, f, offsetof(struct measure, ms)),
                median_of(results[kind], setup->poses, f, offsetof(struct measure, cpu_ms)),
                median_of(results[kind], setup->poses, f, offsetof(struct measure, mean_abs)),
                median_of(results[kind], setup->poses, f, offsetof(struct measure, ssim)),
                median_of(results[kind], setup->poses, f, offsetof(struct measure, gradient))};
    munmap(shared, bytes);
    forest_close(&forest);
    return well;
}

static double paper_value(const double *row, uint32_t trees)
{
    for (int k = 0; k < PAPER_COUNTS; k++)
        if (PAPER_TREES[k] == trees)
            return row[k];
    return NAN;
}

static void print_count(const struct setup *setup, uint32_t trees, const struct measure of[KINDS][SV_TREES_COUNT],
                        FILE *csv)
{
    for (int kind = 0; kind < KINDS; kind++)
        for (int f = 0; f < setup->form_count; f++) {
            const struct measure *m = &of[kind][f];
            if (!form_here(trees, setup->forms[f]))
                continue;
            double rate = WORKERS * 1000 / m->ms;
            const char *form = sv_trees_name(setup->forms[f]);
            printf("%6u %-8s %-13s %8.1f ms (processor %7.1f) %7.2f frames/s  mean abs %6.3f  SSIM %.4f  gradient %.3f", trees,
                   KIND_NAMES[kind], form, m->ms, m->cpu_ms, rate, m->mean_abs, m->ssim, m->gradient);
            if (kind == FOREST_OVERVIEW && setup->forms[f] == SV_TREES_AUTO)
                printf("  (paper %.1f, wanted %.0f)", paper_value(PAPER, trees), paper_value(WANTED, trees));
            printf("\n");
            if (csv)
                fprintf(csv, "%u,%s,%s,%.3f,%.3f,%.3f,%.4f,%.5f,%.4f,%.1f\n", trees, KIND_NAMES[kind], form, m->ms, m->cpu_ms, rate,
                        m->mean_abs, m->ssim, m->gradient, paper_value(PAPER, trees));
        }
    fflush(stdout);
}

static void plot(const struct setup *setup, const struct table *table)
{
    char path[512];
    snprintf(path, sizeof path, "%s/table2.svg", setup->folder);
    struct plot_line lines[2 * SV_TREES_COUNT + 1] = {{0}};
    double x[COUNTS_MAX], paper_x[PAPER_COUNTS], y[2 * SV_TREES_COUNT][COUNTS_MAX];
    char names[2 * SV_TREES_COUNT][64];
    int n = 0;
    for (int k = 0; k < setup->count_count; k++)
        x[k] = setup->counts[k];
    for (int k = 0; k < PAPER_COUNTS; k++)
        paper_x[k] = PAPER_TREES[k];
    for (int kind = 0; kind < KINDS; kind++)
        for (int f = 0; f < setup->form_count; f++, n++) {
            for (int k = 0; k < setup->count_count; k++)
                y[n][k] = form_here(setup->counts[k], setup->forms[f])
                              ? WORKERS * 1000 / table->of[k][kind][f].ms
                              : NAN;
            snprintf(names[n], sizeof names[n], "%s, %s", sv_trees_name(setup->forms[f]), KIND_NAMES[kind]);
            lines[n] = (struct plot_line){names[n], x, y[n], setup->count_count, kind == FOREST_WALK};
        }
    lines[n++] = (struct plot_line){"paper 2 (GeForce 8800GT)", paper_x, PAPER, PAPER_COUNTS, true};
    struct plot_axes axes = {"Frames a second by number of trees, 512 x 512, two cores", "trees", "frames/s", false, true};
    if (!plot_write(path, &axes, lines, n))
        perror(path);
}

static bool read_counts(const char *text, struct setup *setup)
{
    setup->count_count = 0;
    for (char *end; *text; text = *end ? end + 1 : end) {
        unsigned long v = strtoul(text, &end, 10);
        if (end == text || (*end && *end != ',') || v > SV_FOREST_TREES_MAX || setup->count_count == COUNTS_MAX)
            return false;
        setup->counts[setup->count_count++] = (uint32_t)v;
    }
    return setup->count_count > 0;
}

static bool read_forms(const char *text, struct setup *setup)
{
    setup->form_count = 0;
    while (*text) {
        size_t n = strcspn(text, ",");
        int form = 0;
        while (form < SV_TREES_COUNT && (strlen(sv_trees_name((enum sv_trees)form)) != n ||
                                         strncmp(sv_trees_name((enum sv_trees)form), text, n) != 0))
            form++;
        if (form == SV_TREES_COUNT || setup->form_count == SV_TREES_COUNT)
            return false;
        setup->forms[setup->form_count++] = (enum sv_trees)form;
        text += n + (text[n] == ',');
    }
    return setup->form_count > 0;
}

int main(int argc, char **argv)
{
    static struct table table;
    struct setup setup = {.poses = 4, .shadows = true};
    bool well = read_counts("5000,10000,20000,30000,40000,45000", &setup) && read_forms("auto,raycast", &setup);
    for (int k = 1; k < argc && well; k++) {
        const char *value = k + 1 < argc ? argv[k + 1] : "";
        if (strcmp(argv[k], "--plain") == 0) {
            setup.shadows = false;
            continue;
        }
        if (strcmp(argv[k], "--counts") == 0)
            well = read_counts(value, &setup);
        else if (strcmp(argv[k], "--forms") == 0)
            well = read_forms(value, &setup);
        else if (strcmp(argv[k], "--poses") == 0)
            well = (setup.poses = atoi(value)) >= 1 && setup.poses <= POSES_MAX;
        else if (strcmp(argv[k], "-o") == 0)
            setup.folder = value;
        else
            well = false;
        k++;
    }
    if (!well) {
        fprintf(stderr, "usage: forest_table2 [--counts N,N,...] [--poses 1..%d] [--forms auto,raycast,...] [--plain] "
                        "[-o FOLDER]\n", POSES_MAX);
        return 2;
    }
    FILE *csv = NULL;
    if (setup.folder) {
        char path[512];
        mkdir(setup.folder, 0777);
        snprintf(path, sizeof path, "%s/table2.csv", setup.folder);
        csv = fopen(path, "w");
        if (csv)
            fprintf(csv, "trees,eyes,form,ms,processor_ms,frames_per_s,mean_abs,ssim,gradient,paper_frames_per_s\n");
    }
    for (int k = 0; k < setup.count_count && well; k++) {
        well = run_count(&setup, setup.counts[k], table.of[k]);
        print_count(&setup, setup.counts[k], (const struct measure(*)[SV_TREES_COUNT])table.of[k], csv);
    }
    if (csv)
        fclose(csv);
    if (setup.folder && well)
        plot(&setup, &table);
    return well ? 0 : 1;
}
