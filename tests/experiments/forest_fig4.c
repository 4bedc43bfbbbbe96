/* forest_fig4.c - paper 2's figure 4 with figures: one tree in every form against its polygons ray cast with
 * 64 samples a pixel, at five distances.
 *
 * forest_fig4 [-o DIR] [--trees NAME,...] [--views N] [--samples N] [--store DIR] [--models DIR] [--forms
 * NAME,...] Prints, for each tree, form and distance (the tree's height in the picture): mean absolute
 * difference, SSIM, and the ratio of gradient energies (core/view/compare.h), means over the views; time to
 * draw; bytes and time to build. Forms are drawn with one sample a pixel, at its centre, where none of the
 * truth's 64 lies. DIR gets TREE.png, a sheet a tree: a row a distance, the truth first. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/color.h"
#include "core/gl/context.h"
#include "core/image/encode.h"
#include "tests/experiments/tree_forms.h"
#include "tests/experiments/tree_options.h"

enum {
    DISTANCES = TREE_OPTIONS_DISTANCES,
    VIEWS_MAX = TREE_OPTIONS_VIEWS_MAX,
    FORMS_MAX = TREE_OPTIONS_FORMS_MAX,
    SHEET_TILE = 480,
    RUNS = 3
};
static const double HEIGHT_PX[DISTANCES] = {400, 200, 100, 50, 25};
static const double SUN[2] = {135, 40};
/* Azimuth and elevation that views are seen from: a walker's, and from over the forest. */
static const double VIEWS[VIEWS_MAX][2] = {{20, 0},  {200, 25}, {110, 8},  {290, 15}, {65, 2}, {245, 30},
                                           {155, 5}, {335, 20}, {0, 12},   {180, 40}, {90, 3}, {270, 10},
                                           {45, 18}, {225, 6},  {135, 35}, {315, 1}};

struct score {
    double mean_abs, ssim, gradient, ms;
};

static void add_score(struct score *sum, const struct sv_image *picture, const struct sv_image *truth,
                      double ms, int views)
{
    struct sv_compare_result r;
    struct sv_compare_options options = SV_COMPARE_OPTIONS_DEFAULT;
    struct sv_error error;
    tree_kit_must(sv_compare(picture, truth, &options, &r, &error), &error);
    sum->mean_abs += r.mean_abs / views;
    sum->ssim += r.ssim / views;
    sum->gradient += r.gradient_ratio / views;
    sum->ms += ms / views;
}

static void run_view(const struct tree_options *setup, const struct tree_kit *kit, struct tree_forms *forms,
                     int d, int v, struct tree_kit_sheet *sheet, struct score scores[FORMS_MAX])
{
    struct sv_camera camera = tree_kit_camera(kit, HEIGHT_PX[d], VIEWS[v][0], VIEWS[v][1]);
    struct sv_light light = tree_kit_light(SUN[0], SUN[1]);
    struct sv_image cast = tree_kit_truth(kit, &camera, &light, setup->samples, setup->store);
    struct sv_image truth = tree_kit_compose(&cast, false);
    sv_image_free(&cast);
    if (sheet && v == 0)
        tree_kit_sheet_put(sheet, 0, d, &truth);
    for (int f = 0, column = 1; f < tree_forms_count(); f++) {
        double ms = 0;
        if (!setup->forms[f])
            continue;
        struct sv_image drawn = tree_forms_draw(forms, f, &camera, &light, RUNS, &ms);
        struct sv_image picture = tree_kit_compose(&drawn, true);
        add_score(&scores[f], &picture, &truth, ms, setup->views);
        if (sheet && v == 0)
            tree_kit_sheet_put(sheet, column, d, &picture);
        column++;
        sv_image_free(&drawn);
        sv_image_free(&picture);
    }
    sv_image_free(&truth);
}

/* "Error" of the acceptance: mean absolute and SSIM together. */
static const char *judge(const struct score *a, const struct score *b, double share)
{
    bool mean = a->mean_abs <= share * b->mean_abs, ssim = 1 - a->ssim <= share * (1 - b->ssim);
    return mean && ssim ? "yes" : mean ? "SSIM no" : ssim ? "mean no" : "no";
}

static void print_verdict(const struct tree_options *setup, struct score scores[DISTANCES][FORMS_MAX])
{
    int density = tree_forms_find("density"), paper = tree_forms_find("density_paper"),
        billboard = tree_forms_find("billboard");
    if (density < 0 || paper < 0 || billboard < 0 || !setup->forms[density] || !setup->forms[paper] ||
        !setup->forms[billboard])
        return;
    for (int d = 0; d < setup->distances; d++)
        printf("  %4.0f px: density beats density_paper: %s; within 10 %% of billboard: %s; gradient %.2f\n",
               HEIGHT_PX[d], judge(&scores[d][density], &scores[d][paper], 1),
               judge(&scores[d][density], &scores[d][billboard], 1.1), scores[d][density].gradient);
}

static void run_tree(const struct tree_options *setup, int tree)
{
    struct tree_kit kit;
    struct score scores[DISTANCES][FORMS_MAX];
    memset(scores, 0, sizeof scores);
    if (!tree_kit_open(&kit, tree, setup->models, setup->store))
        return;
    struct tree_forms *forms = tree_forms_create(&kit, setup->store);
    int columns = 1 + tree_options_forms(setup);
    struct tree_kit_sheet sheet = {0};
    if (setup->out)
        sheet = tree_kit_sheet(columns, setup->distances, SHEET_TILE);
    for (int d = 0; d < setup->distances; d++)
        for (int v = 0; v < setup->views; v++)
            run_view(setup, &kit, forms, d, v, setup->out ? &sheet : NULL, scores[d]);
    printf("%s: %u leaves, %u triangles; %d views, %d samples\n", kit.name, kit.mesh.leaf_count,
           kit.mesh.index_count / 3, setup->views, setup->samples);
    printf("  %-14s %9s %8s", "form", "bytes", "build ms");
    for (int d = 0; d < setup->distances; d++)
        printf(" | %3.0f px: abs  SSIM  grad     ms", HEIGHT_PX[d]);
    printf("\n");
    for (int f = 0; f < tree_forms_count(); f++) {
        if (!setup->forms[f])
            continue;
        printf("  %-14s %9zu %8.0f", tree_forms_name(f), tree_forms_bytes(forms, f),
               tree_forms_build_ms(forms, f));
        for (int d = 0; d < setup->distances; d++)
            printf(" |    %6.2f %6.3f %5.2f %6.2f", scores[d][f].mean_abs, scores[d][f].ssim,
                   scores[d][f].gradient, scores[d][f].ms);
        printf("\n");
    }
    print_verdict(setup, scores);
    if (setup->out) {
        char path[4096];
        snprintf(path, sizeof path, "%s/fig4_%s.png", setup->out, kit.name);
        tree_kit_sheet_write(&sheet, path);
        sv_image_free(&sheet.image);
    }
    fflush(stdout);
    tree_forms_destroy(forms);
    tree_kit_close(&kit);
}

int main(int argc, char **argv)
{
    struct tree_options options;
    struct sv_gl_context *context;
    struct sv_error error;
    if (!tree_options_parse(argc, argv, &options))
        return 2;
    sv_color_init();
    sv_image_init();
    tree_kit_must(sv_gl_context_create(&context, &error), &error);
    for (int k = 0; k < TREE_KIT_TREES; k++)
        if (options.trees[k])
            run_tree(&options, k);
    sv_gl_context_destroy(context);
    sv_store_close(options.store);
    return 0;
}
